# %% [markdown]
# # Levenberg-Marquardt, dogleg and the trust region
#
# **What if the linear model promises too much?**
#
# Gauss and Newton's step of lecture 6 asks where the *linear model* of the residual would be least,
# and goes there, however far that is. We send an arm after a point that it cannot reach, watch those
# steps grow without end, and then teach the method to believe its model only as far as it keeps its
# promises. Angles are in radians, lengths in metres; the cost is $\tfrac12 e^\top e$, so its gradient
# is $J^\top e$ with no factor.

# %%
import casadi as cs
import numpy as np
from scipy.optimize import brentq

import workbench as wb
from workbench.course import Picture, source
from workbench.plots import house_style, sheet
from workbench.solvers.damped_length import step_within
from workbench.solvers.dogleg import cauchy_point, dogleg_step
from workbench.solvers.trust_region import bend

# %% [markdown]
# ## An arm and its wrist
#
# The arm of lecture 6 has an upper arm of 0.30 m, a forearm of 0.25 m, and the angles $a$ and $b$ of
# shoulder and elbow. Now only the wrist is seen: two numbers for two unknowns. The
# Jacobian has the determinant $u\,l \sin b$, with $u$ and $l$ the lengths of the bones. So where the arm
# is straight ($b = 0$) it is singular: whatever the angles do, the wrist cannot move outwards.

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

# %% [markdown]
# For the workbench this is a problem of one block and one residual. We try Gauss-Newton from thirty
# starts, once with full steps, and once with steps that are halved until the cost falls enough, which
# is where lecture 6 ended:

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


def tried(name):
    """How many of thirty starts end well, in and beyond reach, and the median iterations."""
    told = []
    for seen in (in_reach, beyond):
        every = [wb.solve(problem, {"angles": x, "target": seen}, wb.SOLVERS[name]) for x in starts]
        well = [one for one in every if one.converged]
        middle = f" in {np.median([one.iterations for one in well]):.0f} iterations" if well else ""
        told.append(f"{len(well):2} of 30{middle}")
    print(f"{name:20} in reach {told[0]:28} beyond {told[1]}")


for name in ("gauss-newton-full", "gauss-newton"):
    tried(name)

# %% [markdown]
# Within reach, halving mends what full steps break. Beyond reach nothing helps: not one of thirty
# starts ends. Yet the answer is plain: stretch the arm and point. For one of the starts, let us compare
# what the linear model promised with what happened.


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

# %% [markdown]
# The straighter the arm, the smaller the smallest singular value of $J$, and a residual that will not
# go away is divided by it. The step grows in the one direction that does nearly nothing, and halving
# makes *all* of it short, also the part that was useful. A shorter step should also go in another
# direction.
#
# ## The idea: pay for length
#
# Levenberg (1944) adds a price for length to the model:
#
# $$ \min_p\; \|e + J p\|^2 + \lambda \|p\|^2
#    \qquad\Longleftrightarrow\qquad (J^\top J + \lambda I)\, p = -J^\top e . $$
#
# (In *Body Models II* the $e$ on the right is not bold, although it is a vector, that of the residuals.
# The shapes tell what is meant: $-J^\top$ alone would be a matrix, and $-J^\top e$ has one entry for
# each unknown, as a step must.) With $J = U \Sigma V^\top$ the step is
#
# $$ p = -\sum_i \frac{s_i}{s_i^2 + \lambda}\, (u_i^\top e)\, v_i , $$
#
# and one sees what $\lambda$ does. Where $s_i^2 \gg \lambda$ it changes nothing; where
# $s_i^2 \ll \lambda$ the factor is $s_i / \lambda$ in the place of $1 / s_i$. Every direction is
# shortened by its own share, the doubtful ones most. At $\lambda \to 0$ this is Gauss-Newton's step, at
# $\lambda \to \infty$ it is $-J^\top e / \lambda$: short, and straight downhill.

# %%
straight = np.array([0.2, 0.05])
here = wb.Linearization(wrist(straight) - beyond, jacobian(straight))
print("singular values of J:", here.svd[1].round(4), "m/rad")
for damping in (0, 1e-5, 1e-3, 1e-1, 10):
    p = here.step(damping)
    print(f"lambda = {damping:5g}: p = {p.round(3)}, |p| = {np.linalg.norm(p):8.3f} rad")

# %% [markdown]
# ## Who sets lambda? The gain
#
# After a step we know what it was worth. The model promised a fall of
#
# $$ \text{promise} = \tfrac12 \|e\|^2 - \tfrac12 \|e + J p\|^2 = -(J^\top e)^\top p - \tfrac12 \|J p\|^2 , $$
#
# and the cost fell by something. The **gain ratio**, or gain for short, is the actual fall over the
# promised one:

# %%
source(wb.Linearization.predicted_decrease)

# %%
for damping in (1e-5, 1e-3, 1e-2, 1e-1):
    p = here.step(damping)
    fell = cost(straight, beyond) - cost(straight + p, beyond)
    print(
        f"lambda = {damping:5g}: |p| = {np.linalg.norm(p):7.3f} rad, promised "
        f"{here.predicted_decrease(p):.4f} m^2, gain {fell / here.predicted_decrease(p):+.2f}"
    )

# %% [markdown]
# A gain near 1: the model can be trusted further, lower $\lambda$. A gain below 0: the step goes uphill;
# do not take it, and raise $\lambda$. That is the whole of Levenberg-Marquardt. Between the two the
# workbench follows Nielsen (1999): $\lambda$ is multiplied by $1 - (2\,\text{gain} - 1)^3$, but not by less
# than a bound, and after each failure by 2, 4, 8, ... Look for these in the loop:

# %%
source(wb.LevenbergMarquardt.solve)

# %%
solution = wb.solve(problem, {"angles": start, "target": beyond}, wb.LevenbergMarquardt())
for k, iterate in enumerate(solution.trace):
    if k < 4 or k % 4 == 0:
        print(
            f"{k:2}: elbow {iterate.values['angles'][1]:+.4f} rad, cost above the least "
            f"{iterate.cost - best:.1e} m^2, lambda {iterate.damping:.1e}"
        )
print(solution.status.name, "after", solution.iterations, "iterations")

# %% [markdown]
# ## The same by a radius
#
# Let $p(\lambda)$ be that step, and $r = \|p(\lambda)\|$ its length. Then no step of at most that
# length is better *for the model*: a better one would also lower the sum that $p(\lambda)$ minimises.
# So to choose $\lambda$ is to choose a radius: the **trust region**, the ball in which the model is
# believed. This is easier to think about, because a radius is in radians and says how far the model is
# believed.
#
# But the $p(\lambda)$ of a given radius has to be searched for, with one factorization for each
# $\lambda$. Powell (1970) replaces the curve by two straight legs that need a single factorization:
# first down the gradient to where the model is least along it, the **Cauchy point**
#
# $$ p_C = -\frac{\|g\|^2}{\|J g\|^2}\, g, \qquad g = J^\top e , $$
#
# then over to the Gauss-Newton point; and where this **dogleg** leaves the ball, there is the step.

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
for radius, p in zip(radii, doglegs, strict=True):
    exact = here.step(
        brentq(lambda damping, r=radius: np.linalg.norm(here.step(damping)) - r, 0, 1e3)
    )
    print(
        f"radius {radius:.3f} rad: the dogleg keeps {here.predicted_decrease(p) / here.predicted_decrease(exact):.3f} "
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
)

# %% [markdown]
# ## What the workbench does unless told otherwise
#
# `wb.solve` without a named solver takes Levenberg's step *and* a radius. It searches for the $\lambda$
# of that radius after all: beside the Jacobian of a body another factorization costs little, and it is
# enough if the length is right to a tenth, as Hebden (1973) and Moré (1978) found. Because $\lambda$ may
# have any order of magnitude, the search draws a straight line through two trials in *logarithms*:

# %%
source(step_within)

# %% [markdown]
# The gain ratio now sets the radius. After a poor step it is halved; after a good one, or a Gauss-Newton
# step that was not poor, it is twice the length of the step. Why is this better than setting $\lambda$
# directly? A radius keeps its meaning from one point to the next. Where the singular values of $J$
# change much, as on the way out of a flat region, the same $\lambda$ shortens steps far more or far less
# than before, whereas a radius is still the same length in radians.

# %%
source(wb.TrustRegion.solve)

# %% [markdown]
# One thing in the loop is new: `bend`. A narrow valley that curves allows straight steps only as long as
# the valley is straight, and the cost falls by a little each time. Once a step lowers the cost by less
# than a tenth, the loop therefore looks a tenth of the next step ahead, measures by how much the
# residual $e$ bends along $p$, and adds the correction $a$ that the linear model has for that. Transtrum
# and Sethna (2012) derive it from a geodesic, the straightest way on the surface of all residuals:
#
# $$ (J^\top J + \lambda I)\, a = -\tfrac12 J^\top e_{pp}, \qquad
#    e_{pp} = \frac{d^2}{dt^2}\, e(x + t p) \Big|_{t=0} . $$

# %%
source(bend)

# %%
solution = wb.solve(problem, {"angles": start, "target": beyond})
for k, iterate in enumerate(solution.trace):
    print(
        f"{k:2}: elbow {iterate.values['angles'][1]:+.4f} rad, cost above the least "
        f"{iterate.cost - best:.1e} m^2, step {iterate.step_norm:.3f} rad, lambda {iterate.damping:.1e}"
    )
print(solution.status.name, "after", solution.iterations, "iterations")

# %% [markdown]
# Does it matter which? The same thirty starts, by all three:

# %%
for name in ("levenberg-marquardt", "dogleg", "trust-region"):
    tried(name)

# %% [markdown]
# With each of these ways to a shorter step, all runs end. Lecture 11 is about which solver is quicker.
#
# ## What is long?
#
# $\|p\|$ adds radians to radians here. Had we counted the elbow in degrees, its steps would look 57 times
# longer and be damped as if they were. Marquardt (1963) measures with the Jacobian itself,
# $\lambda \|D p\|^2$ with $D = \mathrm{diag}\,\|J_i\|$, the lengths of the columns: then units cancel.

# %%
unit = np.array([1.0, 180 / np.pi])  # the elbow in degrees
in_degrees = wb.Linearization(here.residual, here.jacobian / unit)
for name, scaling in (("Levenberg, D = I", np.ones(2)), ("Marquardt, D = |J_i|", None)):
    D, E = (here.column_norms, in_degrees.column_norms) if scaling is None else (scaling, scaling)
    damping = 0.1 * np.max((here.column_norms / D) ** 2)
    print(
        f"{name:21} in radians {here.step(damping, D).round(4)}, "
        f"by degrees {(in_degrees.step(damping, E) / unit).round(4)}"
    )

# %% [markdown]
# For the coefficients of a regression, which have all kinds of units, this is what one wants. For a
# body it is not: the columns of unknowns that hardly change the residuals are short, Marquardt's $D$
# makes motion along them cheap, and the fit wanders. All joints of a body are in radians; the
# workbench's default is $D = I$, and `levenberg-marquardt-columns` is the other.
#
# ## What to remember
#
# - A linear model is good nearby. How near, the **gain** tells: the actual fall over the promised one.
# - Halving a bad step leaves its direction bad. Damping shortens each direction by its own share,
#   $s_i^2 / (s_i^2 + \lambda)$ of Gauss-Newton's.
# - $\lambda$ and a radius are two names of one thing; the dogleg goes there with one factorization, the
#   workbench's default with two or three.
# - A length needs a unit: $D$ says what a unit of each entry costs.
