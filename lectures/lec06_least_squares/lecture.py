# %% [markdown]
# # Least squares
#
# **How does an optimizer know where to go, and how far?**
#
# An arm of two bones moves in the plane. Somebody has seen its elbow and its wrist. Which angles do the
# joints have? We write down how wrong a guess is, go downhill in the obvious way, watch this fail, and
# find the step on which the rest of the course is built. Angles are in radians, lengths in metres.

# %%
import casadi as cs
import numpy as np
import scipy.optimize

import workbench as wb
from workbench.course import Picture, source
from workbench.plots import house_style, sheet

# %% [markdown]
# ## How wrong is a guess?
#
# The unknowns are $x = (a, b)$, the angle of the shoulder and that of the elbow. The upper bone is
# $u = 0.30$ m long, the forearm $l = 0.25$ m. The model $m(x)$ says where the elbow and the wrist are,
# and $y$ is where they were seen. The **residual** is the difference of the two:
#
# $$
# m(x) = \begin{pmatrix} u \cos a \\ u \sin a \\ u \cos a + l \cos(a + b) \\ u \sin a + l \sin(a + b)
# \end{pmatrix}, \qquad e(x) = m(x) - y .
# $$
#
# These are four numbers, and all of them should be small at once. So we minimise the sum of their
# squares, $F(x) = e^\top e = \sum_i e_i^2$.

# %% slide [markdown]
# ## How wrong is a guess?
#
# $$ m(x) = \begin{pmatrix} u \cos a \\ u \sin a \\ u \cos a + l \cos(a + b) \\ u \sin a + l \sin(a + b) \end{pmatrix}, \qquad e(x) = m(x) - y $$
#
# - An arm of two bones; elbow and wrist were seen at $y$.
# - **Residual** $e$: four numbers. Minimise $F(x) = e^\top e$.

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
# The derivatives of the residual are its **Jacobian** $J$, with a row for each entry of the residual and
# a column for each unknown: here $4 \times 2$. A small change $p$ of $x$ changes $e$ by $J p$. What does it do
# to $F = \sum_i e_i^2$? By the chain rule, the derivative of $e_i^2$ by the unknown $x_j$ is
# $2 e_i\, \partial e_i / \partial x_j = 2 e_i J_{ij}$, and so
#
# $$ \frac{\partial F}{\partial x_j} = 2 \sum_i J_{ij}\, e_i , \qquad \text{or} \qquad
#    \nabla F = \nabla (e^\top e) = 2 J^\top e . $$
#
# The factor of two is easily lost: *Body Models II* (Pons-Moll and Swoboda, 2018) has $J^\top e$. Does
# it matter? A derivative can always be checked against a difference quotient:


# %% slide [markdown]
# ## Downhill
#
# $$ J = \frac{\partial e}{\partial x}, \qquad \nabla F = \nabla (e^\top e) = 2 J^\top e $$
#
# - **Jacobian**: a row for each residual, a column for each unknown, here $4 \times 2$
# - *Body Models II* has $J^\top e$. Does the factor matter?


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
    """The gradient of a function with one value, by central differences."""
    return np.array([(f(x + h * one) - f(x - h * one)) / (2 * h) for one in np.eye(len(x))])


slope = quotient(F, start)
right, printed_there = 2 * jacobian(start).T @ residual(start), jacobian(start).T @ residual(start)
print("difference quotient      ", slope)
print("2 J'e, divided by it     ", right / slope)
print("J'e, divided by it       ", printed_there / slope)

# %% slide [markdown]
# ## A difference quotient decides
#
# - $2 J^\top e$ over the quotient: {{ (right / slope).mean():.3f}}; $J^\top e$:
#   {{ (printed_there / slope).mean():.3f}}
# - Half of a gradient still points downhill. So where is the harm?

# %% [markdown]
# Minus half of the gradient still points
# downhill{{ np.allclose(right, slope, atol=1e-6) and np.allclose(printed_there, slope / 2, atol=1e-6) }}, so a method
# that only needs a direction works all the
# same. The mistake shows as soon as a second term is added whose derivative is right. Suppose we also
# believe that the elbow is bent by about 0.2 rad, and add $w\,(b - 0.2)^2$ with $w = 0.02$ m²/rad². At
# the minimum the sum of both gradients is zero,
#
# $$ 2 J^\top e + 2 w \begin{pmatrix} 0 \\ b - 0.2 \end{pmatrix} = 0 . $$
#
# If only the first of the two is halved, their sum is zero at another point:

# %% slide [markdown]
# ## The harm: a second term whose derivative is right
#
# $$ 2 J^\top e + 2 w \begin{pmatrix} 0 \\ b - 0.2 \end{pmatrix} = 0 $$
#
# - We also believe that the elbow is bent by about 0.2 rad.
# - If only one of the two is halved, the sum is zero somewhere else.

# %%
w = 0.02  # m^2/rad^2


def both(x):
    """The sum of squares, plus the term for what we believe about the elbow, m^2."""
    return F(x) + w * (x[1] - 0.2) ** 2


zeros = {}
for factor in (2, 1):

    def whole(x, factor=factor):
        return factor * jacobian(x).T @ residual(x) + 2 * w * np.array([0, x[1] - 0.2])

    x = zeros[factor] = scipy.optimize.root(whole, truth).x
    print(f"{factor} J'e: elbow at {x[1]:.3f} rad, both terms together {both(x):.6f} m^2")

elbows = np.linspace(0.2, 0.8, 61)  # rad
lowest = [
    scipy.optimize.minimize_scalar(lambda a, b=b: both((a, b)), bounds=(0, 2), method="bounded").fun
    for b in elbows
]
with house_style():
    figure, (ax,) = sheet(7.0, 3.4)
    ax.plot(elbows, 1e3 * np.array(lowest), label="both terms, at the best shoulder")
    for (factor, x), mark in zip(zeros.items(), ("o", "s"), strict=True):
        ax.plot(x[1], 1e3 * both(x), mark, ms=7, label=f"where {factor} J'e + 2 w (b - 0.2) = 0")
    ax.set(xlabel="angle of the elbow b (rad)", ylabel="both terms (10⁻³ m²)")
    ax.legend()
Picture(
    figure,
    "What both terms together amount to for each angle of the elbow, with the shoulder where it is best for it. "
    "With the factor, the zero of the gradient (circle) is the minimum; without it, the zero (square) is on the slope.",
)

# %% slide [markdown]
# ## The lost factor doubles the belief
#
# - The elbow is off by {{ zeros[2][1] - zeros[1][1]:.2f}} rad, without any error message.
# - The square is the zero of *another* function's gradient.

# %% [markdown]
# The lost factor has silently doubled the weight of the belief, and the answer is off by
# {{ zeros[2][1] - zeros[1][1]:.2f}} rad{{ both(zeros[2]) < min(lowest) + 1e-6 < both(zeros[1]) }}: what is
# zero there is half the gradient of $F + 2 w\,(b - 0.2)^2$, another function.
#
# The workbench has no factor that could be lost: its **cost** is $\tfrac12 \sum r^2$, where $r$ is its
# residual, and the gradient of this cost is $J^\top r$.

# %%
source(wb.Linearization.gradient)

# %% slide [markdown]
# ## The workbench's cost has no factor to lose
#
# $$ \text{cost} = \tfrac12 \sum r^2, \qquad \nabla\, \text{cost} = J^\top r $$
#
# - One half in the cost, none in the gradient

# %% [markdown]
# Now we go downhill, $x \leftarrow x - s\, \nabla F$, again and again. How large should $s$ be?


# %%
def descent(s, n=60):
    """F along n steps of steepest descent, which are s times the gradient."""
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
    "The sum of squares along steepest descent. With a factor s that is too small (0.2) it creeps; "
    "with one that is a little too large (2.8) it never settles, and with a still larger one (4.5) it "
    "leaps about. Nothing in the gradient says which factor is right.",
)

# %% slide [markdown]
# ## How far downhill? The gradient does not say
#
# - $x \leftarrow x - s\, \nabla F$, sixty steps
# - 0.2: {{ fallen[0.2][-1]:.0e}} m², it creeps. 2.0: {{ fallen[2.0][-1]:.0e}}. 2.8: {{ fallen[2.8][-1]:.0e}},
#   it never settles.

# %% [markdown]
# Near the minimum $\nabla F$ is the matrix $H$ of second derivatives of $F$ times the error of $x$. So along an
# eigenvector of $H$ with the eigenvalue $\lambda$, each step multiplies the error by $1 - s \lambda$. The descent
# settles{{ fallen[0.2][-1] > 1e3 * fallen[2.0][-1] and fallen[2.8][-1] > 1e-3 }} if these factors are between $-1$ and
# 1, which is so if $s$ is below 2 over the largest eigenvalue. At the truth, where the residual is zero, this matrix is $2 J^\top J$ (we shall see why):

# %%
largest = np.linalg.eigvalsh(2 * jacobian(truth).T @ jacobian(truth)).max()
print(f"the largest factor that settles at the truth: s = {2 / largest:.2f} rad^2/m^2")

# %% [markdown]
# But to compute this, one must already have found the minimum{{ lengths[1] < 2 / largest < lengths[2] }}.
#
# A gradient is a direction and not a step. The units show this: $\nabla F$ is in m²/rad, and we subtract
# a multiple of it from angles in rad, so $s$ has to be in rad²/m². If we had measured the elbow in
# degrees, the same method would take another path. The *problem* has to say how long a step should be.

# %% slide [markdown]
# ## The factor that settles is known too late
#
# - It must be below 2 over the largest eigenvalue of the Hessian: here {{ 2 / largest:.2f}} rad²/m², *at the
#   truth*.
# - Units: $\nabla F$ is in m²/rad, so $s$ has to be in rad²/m². A gradient is no step.

# %% [markdown]
# ## The idea: the residual is nearly linear
#
# We know more than the gradient of $F$: we know how each entry of the residual changes. Near $x$
#
# $$ e(x + p) \approx e + J p , $$
#
# and the best $p$ for the right-hand side solves a linear least-squares problem. Multiplied out, what is to be
# minimised is
#
# $$ \|e + J p\|^2 = (e + J p)^\top (e + J p) = e^\top e + 2 p^\top J^\top e + p^\top J^\top J\, p . $$
#
# Its gradient by $p$ is $2 J^\top e + 2 J^\top J\, p$. Where this is zero, we have the **normal equations** of Gauss
# and Newton,
#
# $$ J^\top J\, p = - J^\top e . $$
#
# The matrix $J^\top J$ is in m²/rad² and the right-hand side in m²/rad, so that $p$ is in rad, whatever the units
# of $e$ are. We did not have to choose a length.


# %% slide [markdown]
# ## The idea: the residual is nearly linear
#
# $$ e(x + p) \approx e + J p \quad\Rightarrow\quad J^\top J\, p = - J^\top e $$
#
# - **Normal equations** of Gauss and Newton
# - $J^\top J$ is in m²/rad², $J^\top e$ in m²/rad: $p$ is in rad, and nobody chose a length.


# %%
def gauss_newton(residual, jacobian, x, n=8):
    """The start, and the points to which n full steps lead."""
    way = [x]
    for _ in range(n):
        e, J = residual(x), jacobian(x)
        x = x + np.linalg.solve(J.T @ J, -J.T @ e)
        way.append(x)
    return np.array(way)


way = gauss_newton(residual, jacobian, start)
for k, x in enumerate(way):
    print(f"step {k}: x = {x}, off by {np.abs(x - truth).max():.0e}")

# %% slide [markdown]
# ## The step in one line
#
# ```python
# for _ in range(n):
#     e, J = residual(x), jacobian(x)
#     x = x + np.linalg.solve(J.T @ J, -J.T @ e)
#     way.append(x)
# ```
#
# - After five steps $F$ is {{ F(way[5]):.0e}} m²; steepest descent had
#   {{ min(costs[-1] for costs in fallen.values()):.0e}} after sixty.

# %% slide [markdown]
# ## Each step doubles the number of right digits
#
# - Off by {{ np.abs(way[3] - truth).max():.0e}}, {{ np.abs(way[4] - truth).max():.0e}},
#   {{ np.abs(way[5] - truth).max():.0e}} rad after steps 3, 4 and
#   5{{ all(1.8 < np.log(off[k]) / np.log(off[k - 1]) < 2.6 for off in [np.abs(way - truth).max(axis=1)] for k in (4, 5)) }}

# %% [markdown]
# Five of these steps make $F$ smaller than sixty of the others
# did{{ F(way[5]) < 1e-3 * min(costs[-1] for costs in fallen.values()) }}, and each of the last steps doubles the
# number of correct
# digits{{ all(1.8 < np.log(off[k]) / np.log(off[k - 1]) < 2.6 for off in [np.abs(way - truth).max(axis=1)] for k in (4, 5)) }}.
# In the workbench this step is a method of a `Linearization`,
# which holds the residual and the Jacobian at a point; `damping` and `scaling` belong to the next lecture. What the
# method calls in its last line, `automatic`, computes the step in one of two ways. One of them solves the normal equations. It first scales the
# unknowns, so that they have no units: with $d_j = \|J_j\|$, the length of column $j$, it solves for $d_j\, p_j$. It is
# used if the condition number of the scaled $J$ is below 10,000, so that enough digits are left.

# %%
source(wb.Linearization.step)

# %%
d = np.linalg.norm(jacobian(start), axis=0)  # m/rad
scaled = jacobian(start) / d
by_scaling = np.linalg.solve(scaled.T @ scaled, -scaled.T @ residual(start)) / d
here = wb.Linearization(residual(start), jacobian(start))
by_hand = np.linalg.solve(jacobian(start).T @ jacobian(start), -jacobian(start).T @ residual(start))
print("by hand    ", by_hand)
print("scaled     ", by_scaling)
print("the library", here.step())

# %% slide [markdown]
# ## Scaling makes unknowns comparable
#
# - Solve for $d_j\, p_j$ with $d_j = \|J_j\|$, the length of column $j$: no units are left.
# - By hand, scaled, by the library: the same
#   step{{ np.allclose(by_scaling, by_hand) and np.allclose(by_hand, here.step()) }}

# %% [markdown]
# The three agree{{ np.allclose(by_scaling, by_hand) and np.allclose(by_hand, here.step()) }}. What does "enough
# digits" mean? The condition number of a matrix is its largest singular value over its
# smallest, and says by what factor solving with it can enlarge rounding errors. The singular values of
# $J^\top J$ are the squares of those of $J$, and so its condition number is the *square* of that of $J$. It is large if
# two columns are nearly alike, such as those of two joints that have nearly the same effect. The least-squares
# problem can also be solved without forming $J^\top J$, by an orthogonal factorisation $J = Q R$. Because
# $J^\top J = R^\top Q^\top Q R = R^\top R$, the normal equations become $R^\top R\, p = - R^\top Q^\top e$, and the common
# factor $R^\top$ can be left out:
#
# $$ R\, p = - Q^\top e , $$
#
# in which only $R$ stands, with the condition number of $J$. This is the library's other way. How many digits are
# really lost varies from case to case, so we take columns that are alike to between one and six digits, solve each
# time for twenty answers that we know, and print the largest error of the last case:

# %% slide [markdown]
# ## Two ways to solve it
#
# $$ J^\top J\, p = -J^\top e \qquad\text{or}\qquad J = Q R, \quad R\, p = - Q^\top e $$
#
# - The condition number of $J^\top J$ is the **square** of that of $J$.
# - Two joints with nearly the same effect make it large.

# %%
both_columns = np.random.default_rng(0).standard_normal((6, 2))
answers = np.random.default_rng(1).standard_normal((20, 2))
WAYS = {
    "normal equations": lambda J, y: np.linalg.solve(J.T @ J, J.T @ y),
    "np.linalg.lstsq": lambda J, y: np.linalg.lstsq(J, y, rcond=None)[0],
    "the library": lambda J, y: wb.Linearization(-y, J).step(),
}
conditions, lost = [], {name: [] for name in WAYS}
for unlike in (1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6):
    J = both_columns.copy()
    J[:, 1] = J[:, 0] + unlike * J[:, 1]  # two columns that are nearly alike
    conditions.append(np.linalg.cond(J))
    for name, solved in WAYS.items():
        lost[name].append(max(np.abs(solved(J, J @ p) - p).max() for p in answers))
print(f"condition of J: {np.linalg.cond(J):.0e}, of J'J: {np.linalg.cond(J.T @ J):.0e}")
for name, off in lost.items():
    print(f"{name:17} off by up to {off[-1]:.0e}")

with house_style():
    figure, (ax,) = sheet(7.0, 3.4)
    for (name, off), mark in zip(lost.items(), ("o-", "s--", "^:"), strict=True):
        ax.loglog(conditions, np.maximum(off, 1e-17), mark, ms=5, label=name)
    ax.set(xlabel="condition number of J", ylabel="largest error of p")
    ax.legend()
Picture(
    figure,
    "The largest error of twenty answers, for columns that are more and more alike. By the normal equations it grows "
    "with the square of the condition number, by an orthogonal factorisation with the number itself. The library goes "
    "over from the one to the other between a condition number of 3,000 and one of 30,000.",
)

# %% slide [markdown]
# ## Squaring costs digits
#
# - Condition {{ np.linalg.cond(J):.0e}}: normal equations off by {{ lost['normal equations'][-1]:.0e}},
#   factorisation by {{ lost['np.linalg.lstsq'][-1]:.0e}}
# - The library changes over in time.

# %% [markdown]
# ## What Gauss-Newton leaves out
#
# In the last case the normal equations are off by {{ lost['normal equations'][-1]:.0e}} and the factorisation by
# {{ lost['np.linalg.lstsq'][-1]:.0e}}{{ lost['normal equations'][-1] > 1e-6 > 1e-8 > lost['the library'][-1] and lost['the library'][2] > 30 * lost['the library'][3] }}.
# Newton's own method would use the second derivatives of $F$. Differentiate $\partial F / \partial x_j = 2 \sum_i e_i
# J_{ij}$ once more, by $x_k$. The product rule gives two terms for each $i$: one in which $e_i$ is differentiated, and
# one in which $J_{ij}$ is. The first ones add up to $2 \sum_i J_{ik} J_{ij}$, so that
#
# $$ \tfrac12 \nabla^2 F = J^\top J + \sum_i e_i \nabla^2 e_i , $$
#
# and the Gauss-Newton method leaves out the sum on the right. At the truth all $e_i$ are zero, so that nothing is
# missing; this is why the digits double. What if no $x$ fits the data exactly? Take the upper bone
# alone, with its length $u = 0.30$ m, and one point that was seen at a distance $\rho$ from the
# shoulder. If $\rho \neq u$, no angle makes the residual zero; at the best angle the bone points towards
# the point that was seen. CasADi, the library in which the workbench writes its formulas, has exact
# second derivatives (for a function of several variables they form a matrix, the **Hessian**), so we can
# look at both parts:

# %% slide [markdown]
# ## What Gauss-Newton leaves out
#
# $$ \tfrac12 \nabla^2 F = J^\top J + \sum_i e_i \nabla^2 e_i $$
#
# - The sum is left out. At the truth all $e_i = 0$: nothing is missing, and digits double.
# - What if no $x$ fits the data exactly?

# %%
a = wb.Block("a", (), "rad")
target = wb.Block("target", (2,), "m")
bone = cs.vertcat(cs.cos(a.symbol), cs.sin(a.symbol)) * UPPER
one_bone = wb.Problem(
    [wb.Residual("tip", bone - target.symbol, sigma=1.0, unit="m")], ["a"], blocks=[a, target]
)
left_out = {}  # m^2
for share in (0.5, 1.0, 1.5, 2.5):
    at = {"a": 0.0, "target": [share * UPPER, 0.0]}  # the best angle is 0
    normal = one_bone.linearize(at).normal
    H = one_bone.hessian_at(*one_bone.split(at))
    left_out[share] = (H - normal).item()
    print(f"rho = {share} u: J'J = {normal.item():.3f}, left out {left_out[share]:+.3f} m^2")

# %% slide [markdown]
# ## One bone, and a point out of its reach
#
# | seen at | $J^\top J$ | left out |
# | --- | --- | --- |
# | $0.5\, u$ | {{ normal.item():.3f}} m² | {{ left_out[0.5]:+.3f}} m² |
# | $1.0\, u$ | {{ normal.item():.3f}} m² | {{ abs(left_out[1.0]):.3f}} m² |
# | $1.5\, u$ | {{ normal.item():.3f}} m² | {{ left_out[1.5]:+.3f}} m² |
# | $2.5\, u$ | {{ normal.item():.3f}} m² | {{ left_out[2.5]:+.3f}} m² |

# %% [markdown]
# Can we say how the error shrinks? Let $\delta$ be the error of the angle. The point was seen at $(\rho, 0)$, and the
# bone ends at $(u \cos \delta, u \sin \delta)$. So
#
# $$ e = \begin{pmatrix} u \cos \delta - \rho \\ u \sin \delta \end{pmatrix}, \qquad
#    J = \begin{pmatrix} - u \sin \delta \\ u \cos \delta \end{pmatrix}, \qquad
#    J^\top J = u^2, \qquad J^\top e = u \rho \sin \delta , $$
#
# because in $J^\top e$ the terms with $u^2 \sin \delta \cos \delta$ cancel. The Gauss-Newton step is
# $p = - J^\top e / J^\top J = -(\rho / u) \sin \delta$, and the error after the step is
#
# $$ \delta' = \delta - \frac{\rho}{u} \sin \delta \approx \left(1 - \frac{\rho}{u}\right) \delta . $$
#
# Each step multiplies the error by $|1 - \rho/u|$. This is the size of the part that was left out (which is negative
# if the point is nearer to the shoulder than the bone is long{{ left_out[0.5] < 0 < left_out[1.5] }}) over the part
# that was kept.
# At $\rho = u$ the factor is zero. What remains is $\delta - \sin \delta \approx \delta^3 / 6$, because the sine begins
# with $\delta - \delta^3 / 6$, and this **triples** the number of correct digits. For $\rho > 2 u$ the factor is larger than one.


# %% slide [markdown]
# ## How fast the error shrinks
#
# $$ \delta' = \delta - \frac{\rho}{u} \sin \delta \approx \left(1 - \frac{\rho}{u}\right) \delta $$
#
# - $|1 - \rho/u|$ is what was left out over what was kept.
# - $\rho = u$: $\delta^3 / 6$ remains, digits **triple**. $\rho > 2u$: full steps diverge.


# %%
def errors(share, n=12, angle=0.5):
    """The error of the angle after each of n full steps, for one bone."""

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
        f" (the last error: {off[-1]:.0e} rad)"
    )

with house_style():
    figure, (ax,) = sheet(7.5, 3.8)
    for (share, off), mark in zip(found.items(), "osD^v", strict=True):
        ax.semilogy(np.maximum(off, 1e-17), f"{mark}-", ms=4, label=f"ρ = {share} u")
    ax.set(xlabel="step", ylabel="error of the angle (rad)", ylim=(1e-18, 10))
    ax.legend(loc="center right", bbox_to_anchor=(1, 0.25))
Picture(
    figure,
    "Gauss-Newton on one bone. If the bone can reach the point (ρ = u), each step triples the number "
    "of correct digits. If it cannot, each step multiplies the error by about |1 - ρ/u|. Beyond 2 u "
    "the steps lead away, however near to the best angle they begin (that line starts at 0.01 rad, the "
    "others at 0.5 rad). Errors below 1e-17 are drawn at 1e-17.",
)

# %% slide [markdown]
# ## Fast, slow, and away
#
# - Measured at 1.2 u: {{ found[1.2][-1] / found[1.2][-2]:.3f}} (law: 0.2); at 0.5 u:
#   {{ found[0.5][-1] / found[0.5][-2]:.3f}} (law: 0.5)
# - Beyond 2 u steps lead away, however near they begin.

# %% [markdown]
# (At 1.9 u the printed factor, {{ found[1.9][-1] / found[1.9][-2]:.3f}}, does not yet agree with the law, which holds
# for small errors: after 12 steps the error is {{ found[1.9][-1]:.2f}}
# rad{{ all(abs(found[rho][-1] / found[rho][-2] - abs(1 - rho)) < 1e-3 for rho in (1.2, 0.5)) and (np.diff(found[2.2][:9]) > 0).all() and np.log(found[1.0][2]) / np.log(found[1.0][1]) > 2.5 }}.)
#
# So full steps can lead away, even from a point that is as near to the
# minimum as you like. Their direction is still downhill; only their length is wrong, and this time we
# can tell. If the residual were linear, the step would lower $F$ from $\|e\|^2$ to $\|e + J p\|^2$. The difference
# of the two is the decrease that the linear model predicts; the actual decrease is $\|e\|^2 - \|e(x + p)\|^2$. The
# library's `GaussNewton` halves the step until the actual decrease is at least a ten-thousandth of what the slope of
# $F$ along the step predicts for its length; lecture 7 has a better answer. Here is the bone with $\rho = 2.2\, u$, from $a = 0.5$ rad; the best
# angle is 0.

# %%
far = {"a": np.array(0.5), "target": np.array([2.2 * UPPER, 0.0])}
for name in ("gauss-newton-full", "gauss-newton"):
    solution = wb.solve(one_bone, far, wb.SOLVERS[name])
    print(
        f"{name:17}: {solution.status.name:14} after {solution.iterations:3} iterations, "
        f"the last at a = {float(solution.trace[-1].values['a'].round(3)) + 0.0:+.3f} rad; "
        f"returned a = {float(solution.values['a'].round(3)) + 0.0:+.3f} rad"
    )

# %% slide [markdown]
# ## Halving mends it here
#
# - Promise: $\|e\|^2 - \|e + J p\|^2$; fact: $\|e\|^2 - \|e(x + p)\|^2$
# - Full steps: back and forth, none better than the start. Halved until the fact is at
#   least a ten-thousandth of the promise: {{ solution.iterations}} iterations
# - Lecture 7 has a better answer.

# %% [markdown]
# Full steps go back and forth, and none of them leads to a better point than the
# start{{ printed('gauss-newton-full:')[-1] == 0.5 and solution.status.name == 'CONVERGED' and abs(printed('gauss-newton     :')[-1]) < 1e-3 }}.
# A solver of the
# workbench returns the best point that it visited, which here is the start itself; the status says that
# the solver did not converge.

# %% [markdown]
# ## The same on a body
#
# All of this holds for a whole body as well. Here {{ 72 }} numbers for the pose and 3 for the position are fitted to
# {{ 369 }} vertices, which we compute from a known pose, so that the answer is known. `Problem`
# builds the residual $r$, which is $e$ divided by its standard deviation of 2 mm, and its Jacobian; the steps are the
# same as above. The next cell prints cost and error, step by step; `cholesky` means that the step was computed by the
# normal equations (Cholesky's factorisation solves them).

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
costs = [iterate.cost for iterate in solution.trace]
pose_off = [np.abs(iterate.values["pose"] - bent["pose"]).max() for iterate in solution.trace]
for iterate, off in zip(solution.trace, pose_off, strict=True):
    print(
        f"cost {iterate.cost:10.3e}, pose off by up to {off:.1e} rad, "
        + (f"step by {iterate.linear_algebra}" if iterate.linear_algebra else "the start")
    )
J = problem.linearize(given).jacobian
print("the Jacobian is", J.shape)

# %% slide [markdown]
# ## The same on a body
#
# - {{ 72 + 3 }} unknowns, {{ 3 * body.n_vertices:,}} residuals; {{ len(costs) - 1}} steps to the
#   truth{{ pose_off[-1] < 1e-9 }}
# - The first step makes the cost {{ costs[0] / costs[1]:.0f}} times smaller, and one number of the pose
#   *worse*.
# - An optimizer sees the residual, not the truth.

# %% [markdown]
# In the second printed line the cost is {{ costs[0] / costs[1]:.0f}} times smaller, and yet one number of the pose is
# further off than at the start{{ pose_off[1] > 1.05 * pose_off[0] and len(pose_off) < 10 and pose_off[-1] < 1e-9 }}:
# an optimizer sees the residual and not the truth.
#
# ## What to remember
#
# - Write residuals and not only a cost: the derivatives of all residuals are the Jacobian, which says
#   more than the gradient of the cost.
# - $\nabla(e^\top e) = 2 J^\top e$. For the cost $\tfrac12 e^\top e$ there is no factor.
# - A gradient does not say how long a step should be. The solution of $J^\top J\, p = -J^\top e$ has the
#   unit of the unknowns and needs no choice of a length.
# - Gauss-Newton is fast if the model can fit the data closely. If it cannot, each step multiplies the
#   error by the ratio of the part of the Hessian that was left out to the part that was kept; if this
#   ratio is above one, full steps diverge.

# %% slide [markdown]
# ## What to remember
#
# - Write residuals, not only a cost; $\nabla(e^\top e) = 2 J^\top e$.
# - A gradient has no length. $J^\top J\, p = -J^\top e$ has the unit of the unknowns.
# - Gauss-Newton is fast if the model can fit closely; else each step multiplies the error by left out over
#   kept.
