# %% [markdown]
# # Levenberg-Marquardt, dogleg and the trust region
#
# **What if the linear model promises too much?**
#
# Gauss and Newton's step of lecture 6 replaces the residual $e$ by its *linear model* $e + J p$, asks where
# the model is least, and goes there, however far that is. In this lecture we send an arm after a point that
# it cannot reach, and watch those steps grow without end. Then we teach the method to believe its model only
# as far as the model has kept its promises. Angles are in radians and lengths in metres. The cost is
# $\tfrac12 e^\top e$, so its gradient is $J^\top e$ with no factor.

# %%
import casadi as cs
import numpy as np
from scipy.optimize import brentq

import workbench as wb
from workbench.course import Picture, source
from workbench.lectures.material.arm import arm_page
from workbench.plots import house_style, sheet
from workbench.problem.steps import Step
from workbench.solvers.dogleg import cauchy_point, dogleg_step
from workbench.solvers.levenberg_marquardt import eased
from workbench.solvers.trust_region import next_radius, step_within

# %% [markdown]
# ## An arm and its wrist
#
# We take the arm of lecture 6. It has an upper arm of 0.30 m and a forearm of 0.25 m, and its unknowns are
# the angles $a$ of the shoulder and $b$ of the elbow. This time only the wrist is seen, which gives two
# numbers for two unknowns. The Jacobian has the determinant $u\,l \sin b$, with $u$ and $l$ the lengths of
# the bones. So where the arm is straight ($b = 0$) the Jacobian is singular: however the angles begin to
# change, the wrist does not begin to move outwards.

# %% slide [markdown]
# ## An arm and its wrist
#
# $$ \det J = u\, l \sin b $$
#
# - Two angles, two numbers seen: Gauss-Newton can always make its model zero.
# - A straight arm, $b = 0$, is singular: no small change moves the wrist outwards.

# %%
UPPER, LOWER = 0.30, 0.25  # m


def wrist(x):
    """Where the wrist is, (2,) m."""
    a, b = x
    return np.array(
        [UPPER * np.cos(a) + LOWER * np.cos(a + b), UPPER * np.sin(a) + LOWER * np.sin(a + b)]
    )


def jacobian(x):
    """Its derivatives, (2, 2) m/rad."""
    a, b = x
    by_b = LOWER * np.array([-np.sin(a + b), np.cos(a + b)])
    return np.column_stack([UPPER * np.array([-np.sin(a), np.cos(a)]) + by_b, by_b])


def cost(x, seen):
    """Half the sum of squares, m^2."""
    return 0.5 * np.sum((wrist(x) - seen) ** 2)


in_reach = wrist([0.9, 1.1])
beyond = 1.3 * (UPPER + LOWER) * in_reach / np.linalg.norm(in_reach)  # the same way, too far
start = np.array([0.2, 0.3])
print(f"in reach: {np.linalg.norm(in_reach):.2f} m away; beyond: {np.linalg.norm(beyond):.2f} m")

# %% slide [markdown]
# ## Two stars: in reach, and beyond
#
# - In reach: {{ np.linalg.norm(in_reach):.2f}} m away. Beyond: {{ np.linalg.norm(beyond):.2f}} m, for an arm
#   of {{ UPPER + LOWER:.2f}} m
# - The answer is plain: stretch, and point.

# %% [markdown]
# For the workbench this is a problem of one block and one residual. We try Gauss-Newton from thirty
# starts, once with full steps, and once with steps that are halved until the cost falls enough, which
# is where lecture 6 ended. For each we count how many of the starts lead to a minimum:

# %%
angles, target = wb.Block("angles", (2,), "rad"), wb.Block("target", (2,), "m")
a, b = angles.symbol[0], angles.symbol[1]
tip = UPPER * cs.vertcat(cs.cos(a), cs.sin(a)) + LOWER * cs.vertcat(cs.cos(a + b), cs.sin(a + b))
problem = wb.Problem(
    [wb.Residual("wrist", tip - target.symbol, sigma=1.0, unit="m")],
    ["angles"],
    blocks=[angles, target],
)
starts = np.random.default_rng(7).uniform([-2, -2.5], [2, 2.5], (30, 2))  # rad


well = {}  # by solver: how many starts end well, in reach and beyond


def tried(name):
    """How many of thirty starts end well, in and beyond reach, and the median iterations."""
    told, well[name] = [], []
    for seen in (in_reach, beyond):
        every = [wb.solve(problem, {"angles": x, "target": seen}, wb.SOLVERS[name]) for x in starts]
        ended = [one.iterations for one in every if one.converged]
        well[name].append(len(ended))
        told.append(
            f"{len(ended):2} of 30" + (f" in {np.median(ended):.0f} iterations" if ended else "")
        )
    print(f"{name:20} in reach {told[0]:28} beyond {told[1]}")


for name in ("gauss-newton-full", "gauss-newton"):
    tried(name)

# %% slide [markdown]
# ## Thirty starts with Gauss-Newton
#
# | | in reach | beyond |
# | --- | --- | --- |
# | full steps | {{ well['gauss-newton-full'][0]}} of 30 | {{ well['gauss-newton-full'][1]}} |
# | halved steps | {{ well['gauss-newton'][0]}} of 30 | {{ well['gauss-newton'][1]}} |
#
# - Halving mends what full steps break; beyond reach nothing helps.

# %% [markdown]
# Within reach, halving mends what full steps break{{ well['gauss-newton-full'][0] < well['gauss-newton'][0] == 30 }}.
# Beyond reach nothing helps: {{ max(well['gauss-newton'][1], well['gauss-newton-full'][1]) or 'not one' }} of thirty
# starts ends at a minimum. Yet the answer is plain, for the arm only has to stretch and point. To see what goes
# wrong, we follow one of the runs and compare what the linear model promised at each step with what happened.
# With two equations for two unknowns the model can always be made zero, so it always promises to leave
# nothing of the cost.


# %%
def gauss_newton_steps(x, seen, n=12):
    """The points, the steps, promises and falls of Gauss-Newton with halving."""
    rows = []
    for _ in range(n):
        e, J = wrist(x) - seen, jacobian(x)
        p = np.linalg.solve(J, -e)
        length = 1.0
        while cost(x + length * p, seen) > cost(x, seen) + 1e-4 * length * (J.T @ e) @ p:
            length /= 2
        rows.append((x, p, length))
        x = x + length * p
    return rows


rows = gauss_newton_steps(start, beyond)
for k, (x, p, length) in enumerate(rows):
    left = cost(x + p, beyond) / cost(x, beyond)
    print(
        f"step {k:2}: |p| = {np.linalg.norm(p):10.3g} rad, promised to leave 0, would leave "
        f"{left:.3g} of the cost, taken {length:.1e} of it"
    )

best = 0.5 * (np.linalg.norm(beyond) - UPPER - LOWER) ** 2
x, p, _ = rows[0]
shares = np.linspace(0, 1.2, 600)
with house_style():
    figure, (left, right) = sheet(10, 3.8, columns=2)
    left.plot(shares, 1e2 * cost(x, beyond) * (1 - shares) ** 2, "--", label="the linear model")
    left.plot(shares, [1e2 * cost(x + s * p, beyond) for s in shares], label="the cost")
    left.set(xlabel="share of the first step", ylabel="cost (10⁻² m²)")
    left.legend()
    right.semilogy([np.linalg.norm(p) for _, p, _ in rows], "o-", label="asked for")
    right.semilogy([s * np.linalg.norm(p) for _, p, s in rows], "s--", label="taken")
    right.set(xlabel="step", ylabel="length of the step (rad)")
    right.legend()
Picture(
    figure,
    "A point out of reach. Left: along the first Gauss-Newton step the model falls to zero, but "
    "the cost follows the model for a short way only. Right: the straighter the arm, the longer "
    "the steps that are asked for, and the less of them can be taken.",
)

# %% slide [markdown]
# ## The model promises too much
#
# - The straighter the arm, the longer the step that is asked for: {{ np.linalg.norm(rows[-1][1]):,.0f}} rad
#   in the end
# - Halving shortens *all* of the step, the useful part too.

# %% [markdown]
# The straighter the arm is, the smaller is the smallest singular value of
# $J${{ (np.diff([[abs(np.sin(x[1])), -np.linalg.norm(p), length] for x, p, length in rows[-6:]], axis=0) < 0).all() }}.
# Gauss-Newton divides by it a
# residual that will never go away, because the point is out of reach. So the step becomes very long
# ({{ np.linalg.norm(rows[-1][1]):,.0f}} rad in the end) in the one direction that does almost nothing. Halving makes *all*
# of the step short, also the part that was useful.
# What we need is a shorter step that also goes in a better direction.
#
# ## The idea: pay for length
#
# Levenberg ([*A Method for the Solution of Certain Non-Linear Problems in Least
# Squares*](https://doi.org/10.1090/qam/10666), 1944) adds a price for length to the model. The price $\lambda$ is
# called the **damping**:
#
# $$ \min_p\; \|e + J p\|^2 + \lambda \|p\|^2
#    \qquad\Longleftrightarrow\qquad (J^\top J + \lambda I)\, p = -J^\top e . $$

# %% slide [markdown]
# ## The idea: pay for length
#
# $$ \min_p\; \|e + J p\|^2 + \lambda \|p\|^2 \quad\Longleftrightarrow\quad (J^\top J + \lambda I)\, p = -J^\top e $$
#
# - Levenberg, 1944; $\lambda$ is called the **damping**.
# - A shorter step that also goes in a better direction

# %% [markdown]
# The equation on the right says that the derivative of the expression on the left is zero: it is
# $2 J^\top (e + J p) + 2 \lambda p$. (In *Body Models II* by Pons-Moll and Swoboda (2018) the $e$ on the right
# is not printed in bold, although it is the vector of the residuals. The shapes tell what is meant, because
# $-J^\top e$ has one entry for each unknown, as a step must.)
#
# What does $\lambda$ do? Write the Jacobian by its singular value decomposition, $J = U S V^\top$, and the step
# by its coordinates $q_i$ along the columns $v_i$ of $V$, so that $p = \sum_i q_i v_i$. Then
# $J^\top J\, v_i = s_i^2 v_i$, and $J^\top e = \sum_i s_i (u_i^\top e)\, v_i$. The equation falls apart into one
# for each direction, $(s_i^2 + \lambda)\, q_i = -s_i\, (u_i^\top e)$, so that
#
# $$ p = -\sum_i \frac{s_i}{s_i^2 + \lambda}\, (u_i^\top e)\, v_i . $$
#
# Where $s_i^2 \gg \lambda$, the factor is nearly $1 / s_i$, as it is in Gauss-Newton's step. Where
# $s_i^2 \ll \lambda$, it is nearly $s_i / \lambda$, which is small. Every direction is shortened by its own
# share, and those that do little are shortened most. As $\lambda \to 0$, the step becomes Gauss-Newton's. As
# $\lambda \to \infty$, it becomes $-J^\top e / \lambda$, which is short and goes straight downhill. At an arm
# that is nearly straight:

# %% slide [markdown]
# ## Every direction gets its own share
#
# $$ p = -\sum_i \frac{s_i}{s_i^2 + \lambda}\, (u_i^\top e)\, v_i $$
#
# - $s_i^2 \gg \lambda$: Gauss-Newton's step. $s_i^2 \ll \lambda$: hardly any step
# - $\lambda \to 0$: Gauss-Newton. $\lambda \to \infty$: short, and straight downhill

# %%
straight = np.array([0.2, 0.05])
here = wb.Linearization(wrist(straight) - beyond, jacobian(straight))
print("singular values of J:", here.svd[1].round(4), "m/rad")
lengths = []  # rad
for damping in (0, 1e-5, 1e-3, 1e-1, 10):
    p = here.step(damping)
    lengths.append(np.linalg.norm(p))
    print(f"lambda = {damping:5g}: p = {p.round(3)}, |p| = {lengths[-1]:8.3f} rad")

# %% [markdown]
# Without damping the step is {{ lengths[0]:.0f}} rad long, with $\lambda = 10^{-3}$ it is {{ lengths[2]:.1f}}
# rad{{ sorted(lengths, reverse=True) == lengths }}.

# %% slide [markdown]
# ## At an arm that is nearly straight
#
# - Singular values {{ here.svd[1][0]:.2f}} and {{ here.svd[1][1]:.4f}} m/rad
# - $\lambda = 0$: {{ lengths[0]:.0f}} rad. $\lambda = 10^{-3}$: {{ lengths[2]:.1f}} rad. $\lambda = 10$:
#   {{ lengths[4]:.2f}} rad

# %% [markdown]
# ## Who sets lambda? The gain
#
# Which $\lambda$ is right? After a step we know what it was worth. Before it, the model promised that the cost
# would fall by
#
# $$ \text{promise} = \tfrac12 \|e\|^2 - \tfrac12 \|e + J p\|^2 = -(J^\top e)^\top p - \tfrac12 \|J p\|^2 . $$
#
# (The second form is the first one multiplied out.) The **gain ratio**, or gain for short, is the actual fall
# of the cost over the promised one. In the library the promise is `predicted_decrease`:

# %% slide [markdown]
# ## Who sets lambda? The gain
#
# $$ \text{gain} = \frac{\text{actual fall of the cost}}{\tfrac12 \|e\|^2 - \tfrac12 \|e + J p\|^2} $$
#
# - Near 1: the model was right; trust it further, make $\lambda$ smaller.
# - Below 0: uphill. Refuse the step, and try a larger $\lambda$.

# %%
gains = {}
for damping in (1e-5, 1e-3, 1e-2, 1e-1):
    p = here.step(damping)
    fell = cost(straight, beyond) - cost(straight + p, beyond)
    gains[damping] = fell / here.predicted_decrease(p)
    print(
        f"lambda = {damping:5g}: |p| = {np.linalg.norm(p):7.3f} rad, promised "
        f"{here.predicted_decrease(p):.4f} m^2, gain {gains[damping]:+.2f}"
    )

# %% slide [markdown]
# ## Gains at the nearly straight arm
#
# | $\lambda$ | gain | |
# | --- | --- | --- |
# | $10^{-5}$ | {{ gains[1e-5]:.2f}} | refused |
# | $10^{-3}$ | {{ gains[1e-3]:.2f}} | {{ "refused" if gains[1e-3] < 0 else "taken" }} |
# | $10^{-2}$ | {{ gains[1e-2]:.2f}} | taken |
# | $10^{-1}$ | {{ gains[1e-1]:.2f}} | taken |

# %% [markdown]
# If the gain is near 1 (above with $\lambda = 0.01$: {{ gains[1e-2]:.2f}}), the model was right, can be trusted
# further, and $\lambda$ may become smaller. If the gain is below 0 (with $10^{-5}$: {{ gains[1e-5]:.2f}}), the step
# went uphill: we do not take it, and try again with a larger $\lambda$. That is the
# whole of the **Levenberg-Marquardt** method. The details differ between programs. The workbench takes those
# of Nielsen ([*Damping Parameter in Marquardt's Method*](https://www2.imm.dtu.dk/documents/ftp/tr99/tr05_99.pdf),
# 1999): after a step that is taken, $\lambda$ is multiplied by a factor that depends smoothly on the gain,

# %%
source(eased)

# %% [markdown]
# and after steps that are refused one after the other, it is multiplied by 2, 4, 8 and so on. The method fits
# on one screen:


# %% slide [markdown]
# ## Levenberg-Marquardt: lower it smoothly, raise it fast
#
# - Taken: $\lambda$ times a factor that depends on the gain (Nielsen, 1999)
# - Refused one after the other: times 2, 4, 8, ...


# %%
def levenberg_marquardt(x, seen):
    """The points (n, 2) rad on the way to a minimum, and the damping with which each was left."""
    here = wb.Linearization(wrist(x) - seen, jacobian(x))
    damping, growth = 1e-3 * np.max(here.column_norms**2), 2
    rows = [(x, damping)]
    while np.linalg.norm(here.gradient) > 1e-8:
        p = here.step(damping)
        gain = (here.cost - cost(x + p, seen)) / here.predicted_decrease(p)
        if gain > 0:
            x = x + p
            here = wb.Linearization(wrist(x) - seen, jacobian(x))
            damping *= eased(gain)
            growth = 2
            rows.append((x, damping))
        else:
            damping *= growth
            growth *= 2
    return rows


way = levenberg_marquardt(start, beyond)
for k, (x, damping) in enumerate(way):
    if k < 4 or k % 4 == 0:
        print(
            f"{k:2}: elbow {x[1]:+.4f} rad, cost above the least "
            f"{cost(x, beyond) - best:.1e} m^2, lambda {damping:.1e}"
        )
solution = wb.solve(problem, {"angles": start, "target": beyond}, wb.LevenbergMarquardt())
apart = np.abs(solution.values["angles"] - way[-1][0]).max()
print(
    f"the library: {solution.status.name} after {solution.iterations} iterations, "
    f"{apart:.0e} rad away from where ours ended after {len(way) - 1}"
)


# %% slide [markdown]
# ## The whole method
#
# ```python
# p = here.step(damping)
# gain = (here.cost - cost(x + p, seen)) / here.predicted_decrease(p)
# if gain > 0:
#     x = x + p
#     here = wb.Linearization(wrist(x) - seen, jacobian(x))
#     damping *= eased(gain)
#     growth = 2
#     ...
# else:
#     damping *= growth
#     growth *= 2
# ```


# %%
def beside(x):
    """The angle between the directions of the wrist and of the point, rad."""
    at = wrist(x)
    return np.arccos(at @ beyond / np.linalg.norm(at) / np.linalg.norm(beyond))


stuck = np.array([x for x, _, _ in rows])
for k in (7, 11):
    print(
        f"after {k:2} steps Gauss-Newton points {beside(stuck[k]):.4f} rad beside the star, "
        f"and Levenberg-Marquardt {beside(way[k][0]):.4f} rad"
    )

with house_style():
    figure, (left, right) = sheet(10, 4.2, columns=2)
    for ax, points, title in (
        (left, stuck, "Gauss-Newton with halving"),
        (right, np.array([x for x, _ in way]), "Levenberg-Marquardt"),
    ):
        for k, (a_k, b_k) in enumerate(points[:12]):
            shade = str(0.8 - 0.8 * k / 11)
            at = UPPER * np.array([np.cos(a_k), np.sin(a_k)])
            ax.plot(*np.transpose([[0, 0], at, wrist((a_k, b_k))]), "o-", color=shade, ms=3, lw=1)
        ax.plot(*beyond, "C1*", ms=12)
        ax.set(title=title, xlabel="x (m)", ylabel="y (m)", aspect="equal")
        ax.set(xlim=(-0.1, 0.6), ylim=(-0.05, 0.75))
Picture(
    figure,
    "The arm on its way to a point that it cannot reach (the star), during the first 11 steps; later ones are "
    "darker. Left: the arm is straight before it points exactly at the star, and from then on it hardly moves "
    "any more. Right: it comes to point at the star.",
)

# %% slide [markdown]
# ## Stretch, then point: one method does both
#
# - After 11 steps Gauss-Newton points {{ beside(stuck[11]):.3f}} rad beside the star and stays there;
#   Levenberg-Marquardt {{ beside(way[11][0]):.4f}} rad.

# %% [markdown]
# ## The same by a radius
#
# In its last steps Gauss-Newton pointed {{ beside(stuck[11]):.3f}} rad beside the star, and Levenberg-Marquardt
# {{ beside(way[11][0]):.4f}}
# rad{{ beside(stuck[7]) - beside(stuck[11]) < 1e-3 and beside(stuck[11]) > 10 * beside(way[11][0]) and solution.converged and apart < 1e-5 and abs(way[-1][0][1]) < 1e-6 }}.
# Let $p(\lambda)$ be the step with the damping $\lambda$, and $r = \|p(\lambda)\|$ its length. Then no step $p$
# of at most that length is better *for the model*. For if $\|e + J p\|^2$ were smaller, and $\|p\|^2$ not
# larger, then $\|e + J p\|^2 + \lambda \|p\|^2$ would be smaller too, but $p(\lambda)$ has the smallest value of
# that sum. So to choose $\lambda$ is to choose a radius $r$. The ball with this radius is the **trust region**,
# in which the model is believed. A radius is easier to think about than $\lambda$, because it is in radians and
# says how far we trust the model.

# %% slide [markdown]
# ## The same by a radius
#
# - No step of the length of $p(\lambda)$ is better *for the model*: to choose $\lambda$ is to choose a radius.
# - **Trust region**: the ball in which the model is believed
# - A radius is in radians; $\lambda$ is in m²/rad².

# %% [markdown]
# There is a price. For a given radius we have to search for the $\lambda$ whose step is as long as the radius,
# and each trial needs another factorization of a matrix. Powell (*A Hybrid Method for Nonlinear Equations*,
# 1970) replaces the curve of all $p(\lambda)$ by two straight legs that need a single factorization. The first
# leg goes down the gradient $g = J^\top e$ to the point at which the model is least along it. With $p = -t g$ the
# model is $\tfrac12 \|e - t J g\|^2$, and its derivative by $t$, which is $-\|g\|^2 + t\, \|J g\|^2$, is zero at the
# **Cauchy point**
#
# $$ p_C = -\frac{\|g\|^2}{\|J g\|^2}\, g . $$
#
# The second leg leads from there to the Gauss-Newton point. The two together are called the **dogleg**, and
# the step ends where the dogleg leaves the ball.

# %% slide [markdown]
# ## The dogleg: two legs, one factorisation
#
# $$ p_C = -\frac{\|g\|^2}{\|J g\|^2}\, g, \qquad g = J^\top e $$
#
# - First down the gradient to the **Cauchy point**, then towards Gauss-Newton's
# - The step ends where the dogleg leaves the ball (Powell, 1970).

# %%
source(cauchy_point)

# %%
source(dogleg_step)

# %%
bent = np.array([1.5, 0.6])  # an arm that is bent, and can reach
here = wb.Linearization(wrist(bent) - in_reach, jacobian(bent))
D = np.ones(2)
newton, cauchy = here.step(), cauchy_point(here, D)
lambdas = np.concatenate([[0], np.logspace(-6, 2, 400)])
curve = np.array([here.step(damping) for damping in lambdas])
radii = np.array([0.15, 0.3, 0.6, 0.9]) * np.linalg.norm(newton)
doglegs = [dogleg_step(newton, cauchy, D, radius) for radius in radii]
kept = []  # the share of the best promise
for radius, p in zip(radii, doglegs, strict=True):
    exact = here.step(
        brentq(lambda damping, r=radius: np.linalg.norm(here.step(damping)) - r, 0, 1e3)
    )
    kept.append(here.predicted_decrease(p) / here.predicted_decrease(exact))
    print(
        f"radius {radius:.3f} rad: the dogleg keeps {kept[-1]:.3f} "
        "of the best promise there is in that ball"
    )

grid = np.stack(np.meshgrid(np.linspace(-1.3, 0.5, 60), np.linspace(-0.5, 1.4, 60)), axis=-1)
true = np.array([[cost(bent + p, in_reach) for p in row] for row in grid])
model = np.array([[here.predicted_cost(p) for p in row] for row in grid])
levels = np.array([0.03, 0.1, 0.3, 0.6, 1.0, 1.5]) * here.cost
turn = np.linspace(0, 2 * np.pi, 200)
with house_style():
    figure, (ax,) = sheet(6.5, 6)
    ax.contour(*np.moveaxis(grid, -1, 0), true, levels, colors="0.7", linewidths=0.8)
    ax.contour(
        *np.moveaxis(grid, -1, 0), model, levels, colors="C0", linewidths=0.8, linestyles=":"
    )
    ax.plot(*curve.T, "C1", label="p(λ)")
    ax.plot(*np.transpose([[0, 0], cauchy, newton]), "C2--", label="dogleg")
    ax.plot(*np.transpose(doglegs), "C2o", ms=5)
    for radius in radii:
        ax.plot(radius * np.cos(turn), radius * np.sin(turn), color="0.85", lw=0.8)
    ax.plot(*newton, "k*", ms=10, label="Gauss-Newton")
    ax.set(
        xlabel="change of the shoulder (rad)",
        ylabel="change of the elbow (rad)",
        aspect="equal",
        xlim=(-1.3, 0.5),
        ylim=(-0.5, 1.4),
    )
    ax.legend(loc="lower left", fontsize=8)
Picture(
    figure,
    "Steps from a bent arm. Grey: the cost, and four radii; dotted: the linear model's cost at the "
    "same levels. Levenberg's steps leave downhill and bend over to Gauss-Newton's; the dogleg does "
    "the same in two straight legs.",
    lambda: arm_page(UPPER, LOWER, bent, in_reach, beyond, damping=0.01),
)

# %% slide still [markdown]
# ## The dogleg loses next to nothing
#
# - It keeps at least {{ min(kept):.0%}} of the best promise in each of the four balls.

# %% slide [markdown]
# ## Drag the arm, or let it step
#
# - Put the star beyond reach, and watch the gain.
# - Change the damping: the step turns downhill as it shortens.

# %% [markdown]
# ## What the workbench does unless told otherwise
#
# If we name no solver{{ min(kept) > 0.98 }}, `wb.solve` takes Levenberg's step *and* a radius. It does search for the
# $\lambda$ that
# belongs to the radius, because another factorization costs little beside the Jacobian of a body. It is also
# enough if the length is right to a tenth, as Hebden and Moré found (Moré, [*The Levenberg-Marquardt Algorithm:
# Implementation and Theory*](https://doi.org/10.1007/BFb0067700), 1978). How does one search for a number whose order
# of magnitude is unknown? In *logarithms*, the length falls with $\lambda$ along a curve that is nearly straight over
# long pieces. So the search draws a straight line through the last two trials and tries where that line meets the
# radius:

# %% slide [markdown]
# ## The workbench: Levenberg's step *and* a radius
#
# - It searches for the $\lambda$ of the radius: a factorisation costs little beside a body's Jacobian.
# - A tenth is accurate enough (Hebden, Moré).
# - In logarithms the length falls along a nearly straight curve: draw a line through two trials.

# %%
here = wb.Linearization(wrist(straight) - beyond, jacobian(straight))
trials = []


def damped(damping):
    """The step with a damping; each trial is noted."""
    p = here.step(damping)
    trials.append((damping, np.linalg.norm(p)))
    return Step(p, "dense")


RADIUS = 3.0  # rad
step_within(RADIUS, damped, np.linalg.norm(here.gradient), 1e-7)
for damping, length in trials:
    print(f"lambda = {damping:.1e}: |p| = {length:6.2f} rad; wanted: {RADIUS} rad")

# %%
with house_style():
    figure, (ax,) = sheet(7.5, 3.8)
    many = np.logspace(-8, 1, 200)
    ax.loglog(many, [np.linalg.norm(here.step(d)) for d in many], label="length of p(λ)")
    ax.axhspan(0.9 * RADIUS, 1.1 * RADIUS, color="0.85", label="the radius, to a tenth")
    ax.loglog(*np.transpose(trials), "C1o", ms=6, label="trials")
    for k, (damping, length) in enumerate(trials, 1):
        ax.annotate(str(k), (damping, length), xytext=(5, 5), textcoords="offset points")
    ax.set(xlabel="damping λ (m²/rad²)", ylabel="length of the step (rad)")
    ax.legend()
Picture(
    figure,
    "The search for the damping that belongs to a radius, at the arm that is nearly straight. The numbers "
    "are the order of the trials; the search ends as soon as a step is within the grey band.",
)

# %% slide [markdown]
# ## The search in logarithms
#
# - {{ len(trials)}} trials to a step of 3 rad, to a tenth

# %% [markdown]
# It took {{ len(trials) }}
# trials{{ [0.9 <= length / RADIUS <= 1.1 for _, length in trials] == [False] * (len(trials) - 1) + [True] }}. Now the
# gain ratio sets the radius, by a rule that is as simple as the one for $\lambda$. After a poor step
# the radius is halved. After a good one, or a Gauss-Newton step that was not poor, it is twice the length of
# the step:

# %%
source(next_radius)

# %% slide [markdown]
# ## The gain sets the radius
#
# - Poor step: halve it. Good step: twice the step's length
# - A radius keeps its meaning from point to point; the same $\lambda$ shortens far more, or less, elsewhere.

# %% [markdown]
# Why is this better than setting $\lambda$ directly? A radius keeps its meaning from one point to the next.
# Where the singular values of $J$ change much, as on the way out of a flat region, the same $\lambda$ shortens
# steps far more or far less than before, whereas a radius is still the same length in radians.
#
# One more thing helps in narrow valleys that curve. There a straight step can only be as long as the valley is
# straight, so the cost falls by a little each time. Once a step lowers the cost by less than a tenth, the
# workbench therefore looks a tenth of the next step ahead and measures how the residual $e$ curves along $p$.
# From that it computes a correction $a$, which bends the step. Transtrum and Sethna ([*Improvements to the
# Levenberg-Marquardt Algorithm for Nonlinear Least-Squares Minimization*](https://arxiv.org/abs/1201.5885), 2012)
# derive it from a geodesic, which is the straightest way on the surface of all residuals that the model can produce:
#
# $$ (J^\top J + \lambda I)\, a = -\tfrac12 J^\top e_{pp}, \qquad
#    e_{pp} = \frac{d^2}{dt^2}\, e(x + t p) \Big|_{t=0} . $$
#
# This is the equation of a damped step once more, with half of the curvature in the place of $e$.
#
# The first radius is the distance of the start from zero, or 1 if that is more, and a first step of that length may
# lead past the nearest minimum, into the basin of a worse one. No rule of a single run can exclude that. Who needs to
# know starts from several places: `wb.Starts` keeps every minimum that it found, and says how many starts led there.

# %% slide [markdown]
# ## Narrow valleys curve: bend the step
#
# $$ (J^\top J + \lambda I)\, a = -\tfrac12 J^\top e_{pp} $$
#
# - Half of the residual's curvature along $p$ in the place of $e$ (Transtrum and Sethna, 2012)
# - Used once a step lowers the cost by less than a tenth

# %%
solution = wb.solve(problem, {"angles": start, "target": beyond})
for k, iterate in enumerate(solution.trace):
    if k < 8 or k % 4 == 0:
        print(
            f"{k:2}: elbow {iterate.values['angles'][1]:+.4f} rad, cost above the least "
            f"{iterate.cost - best:.1e} m^2, step {iterate.step_norm:.3f} rad"
        )
print(solution.status.name, "after", solution.iterations, "iterations")

# %% [markdown]
# Does it matter which method we take? We try the same thirty starts with all three:

# %%


for name in ("levenberg-marquardt", "dogleg", "trust-region"):
    tried(name)

# %% slide [markdown]
# ## Thirty starts, once more
#
# | | in reach | beyond |
# | --- | --- | --- |
# | Levenberg-Marquardt | {{ well['levenberg-marquardt'][0]}} of 30 | {{ well['levenberg-marquardt'][1]}} of 30 |
# | dogleg | {{ well['dogleg'][0]}} of 30 | {{ well['dogleg'][1]}} of 30 |
# | trust region | {{ well['trust-region'][0]}} of 30 | {{ well['trust-region'][1]}} of 30 |

# %% [markdown]
# With each of these ways to a shorter step, all runs end at a
# minimum{{ all(well[name] == [30, 30] for name in ('levenberg-marquardt', 'dogleg', 'trust-region')) }}. Which solver
# is quicker is the subject of
# lecture 11.
#
# ## What is long?
#
# The length $\|p\|$ adds radians to radians here. Had we counted the elbow in degrees, its steps would look
# {{ 180 / np.pi:.0f}} times longer and be damped as if they were. Marquardt ([*An Algorithm for Least-Squares
# Estimation of Nonlinear Parameters*](https://doi.org/10.1137/0111030), 1963) measures length with the Jacobian itself.
# He takes $\lambda \|D p\|^2$ as the price, where
# $D$ is diagonal and holds the lengths $\|J_i\|$ of the columns of $J$. A column is a change of the residual
# *per unit* of its unknown, so in the product $\|J_i\|\, p_i$ the unit cancels:

# %% slide [markdown]
# ## What is long?
#
# $$ \lambda \|D p\|^2, \qquad D = \operatorname{diag} \|J_i\| $$
#
# - $\|p\|$ adds radians to radians. In degrees, an elbow's steps look {{ 180 / np.pi:.0f}} times longer.
# - Marquardt (1963): measure with the columns of $J$, and units cancel.

# %%
unit = np.array([1.0, 180 / np.pi])  # the elbow in degrees
in_degrees = wb.Linearization(here.residual, here.jacobian / unit)
both = {}  # rad: the step in radians, and the one by degrees
for name, scaling in (("Levenberg, D = I", np.ones(2)), ("Marquardt, D = |J_i|", None)):
    D, E = (here.column_norms, in_degrees.column_norms) if scaling is None else (scaling, scaling)
    damping = 0.1 * np.max((here.column_norms / D) ** 2)
    both[name] = here.step(damping, D), in_degrees.step(damping, E) / unit
    print(f"{name:21} in radians {both[name][0].round(4)}, by degrees {both[name][1].round(4)}")

# %% slide [markdown]
# ## For a body, $D = I$ is better
#
# - Marquardt's step is the same in both units; Levenberg's is
#   not.{{ np.allclose(*both['Marquardt, D = |J_i|']) and not np.allclose(*both['Levenberg, D = I'], atol=0.01) }}
# - But an unknown that hardly matters has a short column, and becomes *cheap* to change.
# - All joints are in radians already.

# %% [markdown]
# With Marquardt's $D$ the step is the same in both
# units{{ np.allclose(*both['Marquardt, D = |J_i|']) and not np.allclose(*both['Levenberg, D = I'], atol=0.01) }}.
# That is what we want for the coefficients of a
# regression, which have all kinds of units. For a body it is not. An unknown that hardly changes the residuals
# has a short column, so Marquardt's $D$ makes it cheap to change this unknown very much. All joints of a body
# are in radians already. So the workbench's default is $D = I$, and `levenberg-marquardt-columns` is the other.
#
# ## What to remember
#
# - A linear model is good nearby. The **gain** tells how near: it is the actual fall of the cost over the
#   promised one.
# - Halving a bad step leaves its direction bad. Damping leaves each direction its own share of Gauss-Newton's
#   step, $s_i^2 / (s_i^2 + \lambda)$.
# - To choose a damping $\lambda$ is to choose a radius. The dogleg needs one factorization for it, and the
#   workbench's default a few.
# - A length needs a unit: $D$ says what a unit of each entry costs.

# %% slide [markdown]
# ## What to remember
#
# - The **gain**, actual fall over promised fall, says how far a linear model holds.
# - Halving leaves a bad direction bad; damping gives each direction its share $s_i^2 / (s_i^2 + \lambda)$.
# - A damping is a radius; a length needs a unit.
