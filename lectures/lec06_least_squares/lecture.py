# %% [markdown]
# # Least squares
#
# **How does an optimizer know where to go, and how far?**
#
# An arm of two bones moves in the plane. Somebody has seen its elbow and its wrist. Which angles do
# the joints have? We write down how wrong a guess is, go downhill the obvious way, watch that fail,
# and find the step that all of this course rests on. Angles are in radians, lengths in metres.

# %%
import casadi as cs
import numpy as np
import scipy.optimize

import workbench as wb
from workbench.course import Picture, source
from workbench.plots import house_style, sheet
from workbench.problem.steps import cholesky

# %% [markdown]
# ## How wrong is a guess?
#
# The unknowns are $x = (a, b)$, the angle of the shoulder and that of the elbow. The upper bone is
# $u = 0.30$ m long, the forearm $l = 0.25$ m. The model $m(x)$ says where elbow and wrist are, $y$ is
# where they were seen; the **residual** is the difference of the two:
#
# $$
# m(x) = \begin{pmatrix} u \cos a \\ u \sin a \\ u \cos a + l \cos(a + b) \\ u \sin a + l \sin(a + b)
# \end{pmatrix}, \qquad e(x) = m(x) - y .
# $$
#
# These are four numbers, which we want to make small all at once: we minimise the sum of their squares,
# $F(x) = e^\top e = \sum_i e_i^2$.

# %%
UPPER, LOWER = 0.30, 0.25  # m


def points(x):
    """Elbow and wrist, (4,) m."""
    a, b = x
    elbow = UPPER * np.array([np.cos(a), np.sin(a)])
    return np.concatenate([elbow, elbow + LOWER * np.array([np.cos(a + b), np.sin(a + b)])])


truth = np.array([0.9, 0.7])
seen = points(truth)
start = np.array([-0.2, 0.2])


def residual(x):
    """What the model says minus what was seen, (4,) m."""
    return points(x) - seen


print(f"F at the start: {residual(start) @ residual(start):.4f} m^2")

# %% [markdown]
# ## Downhill
#
# The derivatives of the residual are its **Jacobian** $J$, a row for each residual and a column for
# each unknown: here $4 \times 2$. A small change $p$ of $x$ changes $e$ by $J p$. With it the
# gradient of $F$ is, by the product rule,
#
# $$ \nabla F = \nabla (e^\top e) = 2 J^\top e . $$
#
# The factor of two is easily lost: *Body Models II* (Pons-Moll and Swoboda, 2018) has $J^\top e$. Does
# it matter? A derivative can always be checked against a difference quotient:


# %%
def jacobian(x):
    """The derivatives of the residual, (4, 2) m/rad."""
    a, b = x
    by_b = LOWER * np.array([-np.sin(a + b), np.cos(a + b)])
    by_a = UPPER * np.array([-np.sin(a), np.cos(a)])
    return np.column_stack([np.concatenate([by_a, by_a + by_b]), np.concatenate([[0, 0], by_b])])


def F(x):
    """The sum of squares, m^2."""
    return residual(x) @ residual(x)


def quotient(f, x, h=1e-6):
    """Central differences of a function that answers one number."""
    return np.array([(f(x + h * one) - f(x - h * one)) / (2 * h) for one in np.eye(len(x))])


slope = quotient(F, start)
right, printed = 2 * jacobian(start).T @ residual(start), jacobian(start).T @ residual(start)
print("difference quotient    ", slope)
print("2 J'e, over it         ", right / slope)
print("J'e as printed, over it", printed / slope)

# %% [markdown]
# Half of the gradient still points downhill, so a method that only asks for a direction notices
# nothing. The mistake shows as soon as a second term is added whose derivative is right. Say that we
# also believe that the elbow is bent by about 0.2 rad, and add $w\,(b - 0.2)^2$ with $w = 0.02$
# m²/rad². At the minimum the whole gradient is zero; with only one of its two terms halved, something
# else is zero:

# %%
w = 0.02  # m^2/rad^2


def both(x):
    """The sum of squares, and what we believe of the elbow, m^2."""
    return F(x) + w * (x[1] - 0.2) ** 2


for factor in (2, 1):

    def whole(x, factor=factor):
        return factor * jacobian(x).T @ residual(x) + 2 * w * np.array([0, x[1] - 0.2])

    x = scipy.optimize.root(whole, truth).x
    print(f"{factor} J'e: elbow at {x[1]:.3f} rad, F and belief together {both(x):.6f} m^2")

# %% [markdown]
# The lost factor has doubled the weight of the belief, without a word, and the answer is off by
# 0.09 rad.
#
# The workbench avoids the question: its **cost** is $\tfrac12 \sum r^2$, and the gradient of that is
# $J^\top r$ with no factor at all.

# %%
source(wb.Linearization.gradient)

# %% [markdown]
# Now we go downhill, $x \leftarrow x - s\, \nabla F$, again and again. How large should $s$ be?


# %%
def descent(s, n=60):
    """Costs along n steps of steepest descent with the fixed length s."""
    x, costs = start, [F(start)]
    for _ in range(n):
        x = x - s * 2 * jacobian(x).T @ residual(x)
        costs.append(F(x))
    return np.array(costs)


lengths = (0.2, 2.0, 2.8, 4.5)
fallen = {s: descent(s) for s in lengths}
for s, costs in fallen.items():
    print(f"s = {s:3} rad^2/m^2: F after 60 steps {costs[-1]:.1e}")

with house_style():
    figure, (ax,) = sheet(7.5, 3.8)
    for (s, costs), dash in zip(fallen.items(), ("-", "--", "-.", ":"), strict=True):
        ax.semilogy(np.maximum(costs, 1e-32), dash, label=f"s = {s} rad²/m²")
    ax.set(xlabel="step", ylabel="F (m²)")
    ax.legend()
Picture(
    figure,
    "The sum of squares along steepest descent. Too short a step (0.2) creeps; one that is a little too "
    "long (2.8) never settles, a longer one (4.5) leaps about; and nothing in the gradient says "
    "which is which.",
)

# %% [markdown]
# The border is at 2 over the largest eigenvalue of the second derivatives of $F$. At the truth, where
# the residual is zero, they are $2 J^\top J$ (we shall see why):

# %%
largest = np.linalg.eigvalsh(2 * jacobian(truth).T @ jacobian(truth)).max()
print(f"the longest step that settles at the truth: s = {2 / largest:.2f} rad^2/m^2")

# %% [markdown]
# But to know that, one must have found the minimum already.
#
# A gradient is a direction and not a step. Its unit gives it away: $\nabla F$ is in m²/rad, and we
# add it to angles in rad, so $s$ has to be in rad²/m². Had we counted the elbow in degrees, the same
# method would walk another way. It is the *problem* that has to say how long a step is.
#
# ## The idea: the residual is nearly linear
#
# We know more than the slope of $F$: we know how each residual changes. Near $x$
#
# $$ e(x + p) \approx e + J p , $$
#
# and for that the best $p$ need not be searched for: it solves a linear least-squares problem. Setting
# the gradient of $\|e + J p\|^2$ to zero gives the **normal equations** of Gauss and Newton,
#
# $$ J^\top J\, p = - J^\top e . $$
#
# The unit of $p$ is rad, whatever the units of $e$, and we did not have to choose a length.


# %%
def gauss_newton(residual, jacobian, x, n=8):
    """The points that n full steps lead to, the start among them."""
    way = [x]
    for _ in range(n):
        e, J = residual(x), jacobian(x)
        x = x + np.linalg.solve(J.T @ J, -J.T @ e)
        way.append(x)
    return np.array(way)


way = gauss_newton(residual, jacobian, start)
for k, x in enumerate(way):
    print(f"step {k}: x = {x}, off by {np.abs(x - truth).max():.0e}")

# %% [markdown]
# Five of these steps do what sixty of the others did not do, and each of the last ones doubles the
# number of right digits. In the workbench this step is a method of a `Linearization`, a residual and a
# Jacobian at a point; `damping` belongs to the next lecture. `steps.automatic` solves for it in one of
# two ways. The function `cholesky` solves the normal equations, whose unknowns are first scaled so that
# they have no units. It is used where the condition of the scaled $J$ is below `CHOLESKY_UP_TO`, so
# that enough digits are left.

# %%
source(wb.Linearization.step)

# %%
source(cholesky)

# %%
here = wb.Linearization(residual(start), jacobian(start))
by_hand = np.linalg.solve(jacobian(start).T @ jacobian(start), -jacobian(start).T @ residual(start))
print("by hand    ", by_hand)
print("the library", here.step())

# %% [markdown]
# What does "enough digits" mean? The condition of a matrix says how many digits solving with it can
# cost, and that of $J^\top J$ is the *square* of that of $J$. Two columns that are nearly alike, such as
# those of two joints that nearly do the same, make it a large number. The least-squares problem can be
# solved without forming $J^\top J$, by an orthogonal factorisation, and the library changes over to that.
# How many digits are really lost is a matter of luck, so we solve for twenty answers that we know and
# print the worst:

# %%
J = np.random.default_rng(0).standard_normal((6, 2))
J[:, 1] = J[:, 0] + 1e-6 * J[:, 1]  # two columns that are nearly alike
answers = np.random.default_rng(1).standard_normal((20, 2))
print(f"condition of J: {np.linalg.cond(J):.0e}, of J'J: {np.linalg.cond(J.T @ J):.0e}")
for name, solved in (
    ("normal equations", lambda y: np.linalg.solve(J.T @ J, J.T @ y)),
    ("np.linalg.lstsq", lambda y: np.linalg.lstsq(J, y, rcond=None)[0]),
    ("the library", lambda y: wb.Linearization(-y, J).step()),
):
    print(f"{name:17} off by up to {max(np.abs(solved(J @ p) - p).max() for p in answers):.0e}")

# %% [markdown]
# ## What was left out
#
# Newton's own method would use the second derivatives of $F$. They are
#
# $$ \tfrac12 \nabla^2 F = J^\top J + \sum_i e_i \nabla^2 e_i , $$
#
# and Gauss and Newton left out the sum. At the truth all $e_i$ are zero and nothing is missing:
# hence the doubling of digits. What if the data do not fit? Take the upper bone alone, its
# length $u = 0.30$ m, and one point that was seen at a distance $\rho$ from the shoulder. If
# $\rho \neq u$, no angle makes the residual zero; the best one points at what was seen. CasADi, the
# library that the workbench writes its formulas in, has exact second derivatives (of a function of
# several variables they are a matrix, its **Hessian**), so we can look at both parts:

# %%
a = wb.Block("a", (), "rad")
target = wb.Block("target", (2,), "m")
bone = cs.vertcat(cs.cos(a.symbol), cs.sin(a.symbol)) * UPPER
one_bone = wb.Problem(
    [wb.Residual("tip", bone - target.symbol, sigma=1.0, unit="m")], ["a"], blocks=[a, target]
)
for share in (0.5, 1.0, 1.5, 2.5):
    at = {"a": 0.0, "target": [share * UPPER, 0.0]}  # the best angle is 0
    normal = one_bone.linearize(at).normal
    H = one_bone.hessian_at(*one_bone.split(at))
    print(f"rho = {share} u: J'J = {normal.item():.3f}, left out {(H - normal).item():+.3f} m^2")

# %% [markdown]
# With $\delta$ the error of the angle, the Gauss-Newton step of this bone is
# $p = -(\rho / u) \sin \delta$, so the error after it is
#
# $$ \delta' = \delta - \frac{\rho}{u} \sin \delta \approx \left(1 - \frac{\rho}{u}\right) \delta . $$
#
# Each step multiplies the error by $|1 - \rho/u|$: the part that was left out (negative where the
# point is nearer than the bone is long) over the part that was kept. At $\rho = u$ that is zero, and
# what remains, $\delta - \sin \delta \approx \delta^3 / 6$, **triples** the digits. And at
# $\rho > 2 u$ it is more than one.


# %%
def errors(share, n=12, angle=0.5):
    """The error of the angle along n full steps on one bone."""

    def e(x):
        return UPPER * np.array([np.cos(x[0]) - share, np.sin(x[0])])

    def J(x):
        return UPPER * np.array([[-np.sin(x[0])], [np.cos(x[0])]])

    return np.abs(gauss_newton(e, J, np.array([angle]), n)[:, 0])


shares = (1.0, 1.2, 0.5, 1.9, 2.2)
found = {share: errors(share) for share in shares} | {2.2: errors(2.2, angle=0.01)}
for share in shares[1:4]:
    off = found[share]
    print(
        f"rho = {share} u: factor {off[-1] / off[-2]:.3f}, the law says {abs(1 - share):.3f}"
        f" (the error by then: {off[-1]:.0e} rad)"
    )

with house_style():
    figure, (ax,) = sheet(7.5, 3.8)
    for (share, off), mark in zip(found.items(), "osD^v", strict=True):
        ax.semilogy(np.maximum(off, 1e-17), f"{mark}-", ms=4, label=f"ρ = {share} u")
    ax.set(xlabel="step", ylabel="error of the angle (rad)", ylim=(1e-18, 10))
    ax.legend(loc="center right", bbox_to_anchor=(1, 0.25))
Picture(
    figure,
    "Gauss-Newton on one bone. Where the point can be met (ρ = u) each step triples the right digits; "
    "where it cannot, it multiplies the error by |1 - ρ/u|; beyond 2 u the steps lead away, however "
    "near they began (that line starts at 0.01 rad, the others at 0.5 rad). Below 1e-17 is drawn at "
    "1e-17.",
)

# %% [markdown]
# (At 1.9 u the law is not yet met: it is one of small errors, and after 12 steps the error is not
# small.) So full steps can lead away, and from a point as near as you like. The direction is still
# downhill; only the length is wrong, and this time we can tell. If the residual were linear, the step
# would lower $F$ from $\|e\|^2$ to $\|e + J p\|^2$: this is what the linear model promises, and
# $\|e\|^2 - \|e(x + p)\|^2$ is what was kept of the promise. The library's `GaussNewton` halves the
# step until a fair share is kept; lecture 7 has a better answer. Here is the bone with
# $\rho = 2.2\, u$, from $a = 0.5$ rad; the best angle is 0.

# %%
far = {"a": np.array(0.5), "target": np.array([2.2 * UPPER, 0.0])}
for name in ("gauss-newton-full", "gauss-newton"):
    solution = wb.solve(one_bone, far, wb.SOLVERS[name])
    print(
        f"{name:17}: {solution.status.name:14} after {solution.iterations:3} iterations, "
        f"the last at a = {float(solution.trace[-1].values['a']):+.3f} rad, "
        f"handed back a = {float(solution.values['a']):+.3f} rad"
    )

# %% [markdown]
# Full steps go to and fro, and none of them was better than the start. A solver of the workbench
# hands back the best point that it saw, so here that is the start itself; the status says that it did
# not converge.

# %% [markdown]
# ## The same on a body
#
# Nothing above was about arms alone. Here is a whole body: 72 numbers of the pose and 3 of its place,
# fitted to 369 vertices that we made up, so that the answer is known. `Problem` builds $e$ and $J$; the
# steps are those of above. In the second line the cost has fallen twentyfold, and yet one number of the
# pose is further off than at the start: an optimizer sees the residual and not the truth.

# %%
body = wb.load_body("small")
pose, betas, trans = (block.symbol for block in body.blocks())
observed = wb.Block("observed", (body.n_vertices, 3), "m")
problem = wb.Problem(
    [wb.residuals.vertices(body.points(pose, betas, trans), observed.symbol, sigma=0.002)],
    ["pose", "trans"],
    blocks=[observed],
)
bent = body.start() | {"pose": 0.25 * np.random.default_rng(1).standard_normal((24, 3))}
given = body.start() | {"observed": body.vertices(**bent)}
solution = wb.solve(problem, given, wb.GaussNewton())
for iterate in solution.trace:
    off = np.abs(iterate.values["pose"] - bent["pose"]).max()
    print(
        f"cost {iterate.cost:10.3e}, pose off by up to {off:.1e} rad, "
        + (f"step by {iterate.linear_algebra}" if iterate.linear_algebra else "the start")
    )
J = problem.linearize(given).jacobian
print("the Jacobian is", J.shape)

# %% [markdown]
# ## What to remember
#
# - Write residuals, not costs: each knows how it changes, and that is the Jacobian.
# - $\nabla(e^\top e) = 2 J^\top e$. With the cost $\tfrac12 e^\top e$ the factor is gone.
# - A gradient does not say how long a step should be. $J^\top J\, p = -J^\top e$ does, in the unit of
#   the unknowns.
# - Gauss-Newton is quick where the data can be met. Where they cannot, each step multiplies the error
#   by the ratio of what was left out of the Hessian to what was kept; above one, full steps diverge.
