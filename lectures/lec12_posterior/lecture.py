# %% [markdown]
# # The posterior
#
# **How well do we know what we found?**
#
# A fit answers with one pose, and it does so even if the data say next to nothing about the pose. In this
# lecture we ask for everything that the data leave possible. One camera looks at a forearm. We find its angle,
# give the angle an error bar in the usual way, and find that the bar is wrong. Then we learn what to do instead,
# which is to draw from the posterior. Angles are in radians, lengths in metres, and image coordinates in pixels.

# %%
import casadi as cs
import numpy as np

import workbench as wb
from workbench.course import Picture, source
from workbench.experiments import find
from workbench.lectures.material.replays import recorded_bodies
from workbench.plots import house_style, sheet
from workbench.sampling import laplace, sample
from workbench.sampling.mixing import integrated_time

# %% [markdown]
# ## A bone in one image
#
# A forearm of the length $l = 0.25$ m hangs on an elbow whose place is known, $D = 5$ m in front of a camera with a
# focal length of $F = 1000$ px. It is turned out of the image plane by $\varphi$, away from the camera for
# $\varphi > 0$. The wrist is then seen
#
# $$ u(\varphi) = \frac{F\, l \cos \varphi}{D + l \sin \varphi} $$
#
# to the right of the elbow: the wrist is $l \cos \varphi$ to the right of the elbow and $l \sin \varphi$ further
# away than the elbow. A detector finds it with an error of $\sigma = 3$ px. Before we see the image, we know that
# $\varphi$ is 0 on average, with a standard deviation of $\sigma_0 = 0.6$ rad.

# %% slide [markdown]
# ## A forearm in one image
#
# $$ u(\varphi) = \frac{F\, l \cos \varphi}{D + l \sin \varphi} $$
#
# - One camera, 5 m away; the forearm is turned out of the image by $\varphi$.
# - Seen to 3 px; before that, $\varphi$ is 0 with a deviation of 0.6 rad.

# %%
F, D, LENGTH = 1000.0, 5.0, 0.25  # px, m, m
SIGMA, PRIOR = 3.0, 0.6  # px, rad


def pixel(phi):
    """Where the wrist is seen, px from the elbow."""
    return F * LENGTH * np.cos(phi) / (D + LENGTH * np.sin(phi))


def cost(phi, seen):
    """Half the sum of squares of the whitened residuals: detection, and what we knew beforehand."""
    return 0.5 * ((pixel(phi) - seen) / SIGMA) ** 2 + 0.5 * (phi / PRIOR) ** 2


rng = np.random.default_rng(12)
truth = 0.5
seen = pixel(truth) + SIGMA * rng.standard_normal()
grid = np.linspace(-3, 3, 1001)
best = grid[np.argmin(cost(grid, seen))]
print(f"seen at {seen:.1f} px; least squares: {best:.2f} rad; the truth: {truth} rad")

# %% slide [markdown]
# ## Least squares answers with one angle
#
# - Seen at {{ seen:.1f}} px: {{ best:.2f}} rad. The truth: {{ truth}} rad
# - Is it off by much, or as little as one may hope?

# %% [markdown]
# ## What a cost means
#
# Suppose that the error of the detector is Gaussian, and that what we knew before is Gaussian too. Bayes' rule
# says that an angle is the more probable, the better it explains what was seen, and the more probable it was
# before. Let $\hat u$ be where the detector found the wrist; it differs from $u(\varphi)$, where the wrist is, by the
# detector's error. The probability density of the angle after the image was seen is called the **posterior**. Up to a
# constant factor it is the product of the two:
#
# $$ p(\varphi \mid \hat u) \propto e^{-(u(\varphi) - \hat u)^2 / (2 \sigma^2)}\; e^{-\varphi^2 / (2 \sigma_0^2)} = e^{-\text{cost}} . $$
#
# The product of two exponentials is the exponential of the sum of their exponents. This sum is minus half of the sum of
# squares of the residuals $(u(\varphi) - \hat u) / \sigma$ and $\varphi / \sigma_0$. That is why the workbench divides
# each residual by its sigma: the cost *is* minus the logarithm of the posterior, up to a constant. The least cost is
# the highest point of the posterior.

# %% slide [markdown]
# ## What a cost means
#
# $$ p(\varphi \mid \hat u) \propto e^{-(u(\varphi) - \hat u)^2 / (2 \sigma^2)}\; e^{-\varphi^2 / (2 \sigma_0^2)} = e^{-\text{cost}} $$
#
# - **Posterior**: how probable each angle is, now that the image was seen
# - That is why each residual is divided by its sigma.

# %% [markdown]
# ## An error bar, the usual way
#
# Let $\hat \varphi$ be the angle with the least cost. Near it, the vector of whitened residuals is nearly linear,
# $r + J\, (\varphi - \hat \varphi)$, where $r$ and $J$ are taken at $\hat \varphi$. The cost is half of its square,
#
# $$ \text{cost} \approx \tfrac12 r^\top r + r^\top J\, (\varphi - \hat \varphi)
#    + \tfrac12 (\varphi - \hat \varphi)^\top J^\top J\, (\varphi - \hat \varphi) . $$
#
# The first term is a constant. In the second one stands the gradient $J^\top r$ (lecture 6), which is zero at the
# minimum. So the third one alone is left:
#
# $$ \text{cost} \approx \text{const} + \tfrac12 (\varphi - \hat \varphi)^\top J^\top J\, (\varphi - \hat \varphi) . $$
#
# Minus this is the logarithm of a Gaussian with the mean $\hat \varphi$ and the covariance
#
# $$ C = (J^\top J)^{-1} . $$
#
# To use this Gaussian in place of the posterior is called **Laplace's approximation**. It costs nothing, because
# the solver has computed $J$ already. For our forearm:


# %% slide [markdown]
# ## An error bar, the usual way: Laplace
#
# $$ \text{cost} \approx \text{const} + \tfrac12 (\varphi - \hat \varphi)^\top J^\top J\, (\varphi - \hat \varphi), \qquad C = (J^\top J)^{-1} $$
#
# - A Gaussian in place of the posterior; the solver has $J$ already.


# %%
def slope(phi):
    """The derivative of `pixel`, px/rad."""
    depth = D + LENGTH * np.sin(phi)
    return -F * LENGTH * (np.sin(phi) * depth + LENGTH * np.cos(phi) ** 2) / depth**2


def bar(phi):
    """Laplace's standard deviation at the angle that was found, rad."""
    J = np.array([slope(phi) / SIGMA, 1 / PRIOR])
    return 1 / np.sqrt(J @ J)


print(f"{best:.2f} +- {bar(best):.2f} rad")

# %% slide [markdown]
# ## The bar for our forearm
#
# - {{ best:.2f}} ± {{ bar(best):.2f}} rad
# - Try it: a thousand angles, images, fits. A 90 % interval should hold the truth 900 times.

# %% [markdown]
# Is this error bar right? A 90 % interval should hold the truth nine times out of ten. We can try this. We draw an
# angle from what was known beforehand, make an image of it with the detector's error, fit, and see whether the
# interval holds the angle. We do so a thousand times. (A Gaussian number is within 1.645 standard deviations of its
# mean with a probability of 90 %, so the interval reaches so far to both sides.)

# %%
angles = PRIOR * rng.standard_normal(1000)
images = pixel(angles) + SIGMA * rng.standard_normal(1000)
costs = cost(grid[:, None], images)  # (1001, 1000)
fits = grid[np.argmin(costs, axis=0)]
bars = np.array([bar(phi) for phi in fits])
inside = np.abs(fits - angles) <= 1.645 * bars
print(f"90 % intervals by Laplace hold the truth {100 * inside.mean():.0f} times out of 100")
wrong = np.sign(fits) != np.sign(angles)
print(
    f"the fit has the forearm on the wrong side of the image plane {100 * wrong.mean():.0f} times out of 100"
)

with house_style():
    figure, axes = sheet(11, 3.6, columns=3)
    for ax, at in zip(axes, (0.1, 0.6, 1.1), strict=True):
        values = np.exp(-cost(grid, pixel(at)))
        density = values / (values.sum() * (grid[1] - grid[0]))
        found = grid[np.argmax(density)]
        gauss = np.exp(-0.5 * ((grid - found) / bar(found)) ** 2) / np.sqrt(2 * np.pi) / bar(found)
        ax.plot(grid, density, label="posterior")
        ax.plot(grid, gauss, "--", label="Laplace")
        ax.axvline(at, color="k", lw=0.8, ls=":", label="truth")
        ax.set(xlabel="angle φ (rad)", ylabel="density (1/rad)", xlim=(-2, 2), ylim=(0, 4.5))
    axes[0].legend(loc="upper left", fontsize=8)
Picture(
    figure,
    "The posterior of the angle, and Laplace's approximation, for three true angles (data without "
    "noise). Left, near the image plane: one broad answer, and Laplace too wide. Middle and right, "
    "further out: two answers, and Laplace knows the higher one only.",
)

# %% slide [markdown]
# ## 90 % intervals hold the truth {{ 100 * inside.mean():.0f}} times in 100
#
# - Further out there are two answers, and Laplace knows one.
# - The wrong side of the image plane: {{ 100 * wrong.mean():.0f}} in 100

# %% [markdown]
# So 90 % intervals held the truth {{ 100 * inside.mean():.0f}} times out of 100{{ inside.mean() < 0.8 }}. One camera
# hardly tells whether a bone points towards it or away from it: the images differ by perspective alone, less than the
# detector's error{{ abs(pixel(0.5) - pixel(-0.5)) < SIGMA }}. So the posterior has two peaks, which are called **modes**{{ [((p[1:-1] > p[:-2]) & (p[1:-1] > p[2:])).sum() for p in (-cost(grid, pixel(at)) for at in (0.1, 0.6, 1.1))] == [1, 2, 2] }}.
# Least squares
# finds one of them, and Laplace's bar is the width of that one. Nothing in the Jacobian warns of the other one,
# because the Jacobian is computed at a single point.

# %% slide [markdown]
# ## Nothing in the Jacobian warns
#
# - Towards the camera or away: the images differ by less than the detector's
#   error.{{ abs(pixel(0.5) - pixel(-0.5)) < SIGMA }}
# - Two peaks, called **modes**. The Jacobian is computed at a single point.

# %% [markdown]
# ## The truth, for two unknowns
#
# For one angle we could compute the posterior on a grid. For two angles this is still possible, so that we still
# know the truth. Take an arm, whose upper arm of 0.30 m and forearm of 0.25 m are each turned out of the image
# plane. Elbow and wrist are seen by one camera from the front, and later also by one from the side, which sees
# depth. In the code, `one.costs(x, given, None)` is a function that answers the costs at many points at once, one in
# each row. A row replaces entries of the point `x`, and with None it replaces all of them, so that it does not matter
# what `x` is. The second argument holds the numbers that are not free, and here there are none.

# %% slide [markdown]
# ## Two angles, so that the truth is still known
#
# - Upper arm and forearm, each turned out of the image
# - A grid of 121 by 121 points says what the posterior is.

# %%
arm = wb.Block("angles", (2,), "rad", ("upper arm", "forearm"))
a, b = arm.symbol[0], arm.symbol[1]
elbow = 0.30 * cs.vertcat(cs.cos(a), cs.sin(a))  # to the right, and away from the camera
wrist = elbow + 0.25 * cs.vertcat(cs.cos(b), cs.sin(b))
views = {
    "front": cs.vertcat(F * elbow[0] / (D + elbow[1]), F * wrist[0] / (D + wrist[1])),
    "side": cs.vertcat(F * elbow[1] / (D - elbow[0]), F * wrist[1] / (D - wrist[0])),
}
prior = wb.residuals.gaussian(arm.symbol, covariance=PRIOR**2, unit="rad", name="prior")
true_angles = np.array([0.5, -0.7])


def arm_problem(*names):
    """What these cameras see of the arm, with errors, and the prior."""
    rng = np.random.default_rng(12)
    residuals = []
    for name, view in views.items():
        exact = np.asarray(cs.Function("view", [arm.symbol], [view])(true_angles)).ravel()
        noisy = exact + SIGMA * rng.standard_normal(2)
        residuals.append(wb.Residual(name, view - cs.DM(noisy), sigma=SIGMA, unit="px"))
    kept = [one for one in residuals if one.name in names]
    return wb.Problem([*kept, prior], ["angles"], blocks=[arm])


one = arm_problem("front")
found = wb.solve(one, {"angles": np.array([0.3, 0.3])})
approximation = laplace(one, found.values)
axis = np.linspace(-1.8, 1.8, 121)
places = np.stack(np.meshgrid(axis, axis, indexing="ij"), axis=-1).reshape(-1, 2)
density = np.exp(-one.costs(np.zeros(2), np.zeros(0), None)(places)).reshape(121, 121)
density /= density.sum()
exact_mean = np.array([density.sum(axis=1) @ axis, density.sum(axis=0) @ axis])
exact_sd = np.sqrt([density.sum(axis=1) @ axis**2, density.sum(axis=0) @ axis**2] - exact_mean**2)
print("the truth            ", true_angles, "rad")
print("least squares        ", found.values["angles"].round(2), "rad, cost", round(found.cost, 2))
other = wb.solve(one, {"angles": true_angles})
print("another minimum      ", other.values["angles"].round(2), "rad, cost", round(other.cost, 2))
print("Laplace's deviations ", approximation.sd.round(2), "rad")
print("those of the grid    ", exact_sd.round(2), "rad")

# %% slide [markdown]
# ## The lowest cost belongs to the wrong answer
#
# - Found: {{ found.values['angles'][0]:.2f}}, {{ found.values['angles'][1]:.2f}} rad at {{ found.cost:.2f}};
#   near the truth: {{ other.values['angles'][0]:.2f}}, {{ other.values['angles'][1]:.2f}} at
#   {{ other.cost:.2f}}
# - Laplace's deviations are too small by {{ (exact_sd / approximation.sd)[0]:.1f}} and
#   {{ (exact_sd / approximation.sd)[1]:.1f}} times.
# - No better solver would have helped.

# %% [markdown]
# Least squares has found a forearm that points away from the camera, although it points towards it, *at a lower cost
# than the right one* ({{ found.cost:.2f}} and
# {{ other.cost:.2f}}{{ found.values['angles'][1] > 0 > true_angles[1] and found.cost < other.cost and other.values['angles'][1] < 0 }}):
# no better solver would have helped. And Laplace's standard deviation is too small by a factor of
# {{ (exact_sd / approximation.sd)[0]:.1f}} for the upper arm, and of {{ (exact_sd / approximation.sd)[1]:.1f}} for
# the forearm.
#
# ## Draws
#
# With 121 points to an axis, a grid for the 82 numbers of a body's pose and shape has $121^{82}$ points. No
# computer can do that. What can be done is to *draw* from the posterior: to make a list of poses, in which each
# pose appears the more often, the more probable it is. Every question then becomes a count. (How probable is it
# that the arm points away? Count the poses in which it does.)

# %% slide [markdown]
# ## Draws: every question becomes a count
#
# - A body has 82 numbers: a grid has $121^{82}$ points.
# - A list in which a pose appears the more often, the more probable it is
# - Does the arm point away? Count.

# %% [markdown]
# The oldest method to make such a list is that of Metropolis and others ([*Equation of State Calculations by Fast
# Computing Machines*](https://doi.org/10.1063/1.1699114), 1953). It needs the density only up to a constant factor. At
# each point of the list, it proposes a random step. If the density is higher there, the step is taken. If it is lower,
# the step is taken with the probability $p(\text{new}) / p(\text{old})$. If the step is not taken, *the old point is
# counted again*. Such a list is called a **chain**.


# %%
def metropolis(log_p, x, steps, size, rng):
    """A chain of draws (steps, n)."""
    chain, here = [], log_p(x)
    for _ in range(steps):
        y = x + size * rng.standard_normal(len(x))
        there = log_p(y)
        if np.log(rng.uniform()) < there - here:
            x, here = y, there
        chain.append(x)
    return np.array(chain)


def log_p(x):
    """The log density of the angle of one forearm in one image."""
    return -cost(x[0], pixel(0.9))


chains = {}
for size in (0.05, 1.5):
    chain = metropolis(log_p, np.array([0.9]), 4000, size, np.random.default_rng(0))[:, 0]
    chains[size] = chain
    values = np.exp(-cost(grid, pixel(0.9)))
    right = values[grid > 0].sum() / values.sum()
    print(
        f"steps of {size:4} rad: {100 * (chain > 0).mean():3.0f} % of draws point away from the camera; "
        f"by the grid {100 * right:.0f} %"
    )

# %% slide [markdown]
# ## Metropolis, 1953
#
# - Propose a random step. Higher density: take it.
# - Lower: take it with the probability $p(\text{new}) / p(\text{old})$, else count the old point *again*.
#
# ```python
# y = x + size * rng.standard_normal(len(x))
# there = log_p(y)
# if np.log(rng.uniform()) < there - here:
#     x, here = y, there
# chain.append(x)
# ```

# %% [markdown]
# With short steps the chain has not left the mode in which it began: {{ (chains[0.05] < 0).sum() or 'none'}} of its
# 4000 draws is in the other one.

# %%
with house_style():
    figure, axes = sheet(10, 3.2, columns=2)
    for ax, (size, chain) in zip(axes, chains.items(), strict=True):
        ax.plot(chain[:1000], lw=0.6)
        ax.axhline(0, color="0.6", ls=":")
        ax.set(
            title=f"steps of {size} rad", xlabel="step", ylabel="angle φ (rad)", ylim=(-1.6, 1.6)
        )
Picture(
    figure,
    "The first thousand steps of both chains. Above the dotted line the forearm points away from the camera, and "
    "below it towards the camera. The chain with short steps never crosses the line, and nothing in it shows that "
    "there is anything to find below. The other one crosses it many times.",
)

# %% slide [markdown]
# ## Short steps never see the other mode
#
# - 0.05 rad: {{ 100 * (chains[0.05] > 0).mean():.0f}} % point away; by the grid {{ 100 * right:.0f}} %. 1.5
#   rad: {{ 100 * (chains[1.5] > 0).mean():.0f}} %
# - Nothing in the left chain says so.

# %% [markdown]
# With long ones {{ 100 * (chains[1.5] > 0).mean():.0f}} % of the draws are above the line, and by the grid
# {{ 100 * right:.0f}} %{{ (np.diff(np.sign(chains[1.5][:1000])) != 0).sum() > 20 }}. How large should a step be, and
# in which direction, in 82 dimensions? Nobody wants to find this out by hand.
#
# ## Walkers that learn from each other
#
# The library emcee (Foreman-Mackey and others, [*emcee: The MCMC Hammer*](https://doi.org/10.1086/670067), 2013) lets
# many **walkers** go at once, and takes the size and the direction of steps from the distances between them. In the
# **stretch move** (Goodman and Weare, [*Ensemble Samplers with Affine
# Invariance*](https://doi.org/10.2140/camcos.2010.5.65), 2010) a walker $x$ picks another one,
# $x_j$, and proposes a point on the line through both,
#
# $$ y = x_j + z\,(x - x_j), \qquad \text{taken with } \min\left(1,\; z^{k-1}\, \frac{p(y)}{p(x)}\right) $$
#
# in $k$ dimensions. The number $z$ is drawn between $\tfrac12$ and $2$, and not uniformly but with the density
#
# $$ g(z) \propto \frac{1}{\sqrt z} . $$

# %% slide [markdown]
# ## Walkers that learn from each other
#
# $$ y = x_j + z\,(x - x_j), \quad \text{taken with } \min\left(1,\; z^{k-1}\, \frac{p(y)}{p(x)}\right) $$
#
# - The **stretch move**: along the line through another walker, with $g(z) \propto 1 / \sqrt z$
# - Size and direction come from the walkers; units do not matter.

# %% [markdown]
# Why this density, and why the factor $z^{k-1}$? The draws follow $p$ if, in the long run, walkers go from $x$ to
# $y$ as often as they go from $y$ to $x$. We measure where a walker is by its direction from $x_j$, which does not
# change, and its distance $r$ from $x_j$. In $k$ dimensions the walkers with distances from $r$ to $r + dr$ fill a
# volume in proportion to $r^{k-1} dr$. So those that want to go from there to $z$ times the distance are in
# proportion to
#
# $$ p(x)\; r^{k-1}\; g(z)\; dr\, dz . $$
#
# On the way back a walker begins at the distance $r' = z\, r$, and has to draw $z' = 1/z$. The same expression for
# the way back is $p(y)\, r'^{k-1} g(z')\, dr'\, dz'$. Now $dz'$ is $dz / z^2$ and $dr'$ is $z\, dr$, so that it is
#
# $$ p(y)\; z^{k-1} r^{k-1}\; g(1/z)\; \frac{1}{z}\; dr\, dz . $$
#
# Let $A$ be the ratio of the second to the first. If $A$ is below 1, there are too many that want to go to $y$: we
# take the share $A$ of them, and all of those that want to go back. If it is above 1, we take all of the first, and the
# share $1 / A$ of those that want to go back. In both cases both ways become equally frequent. On the way back the
# ratio is $1 / A$, so one rule says both: a proposal is taken with the probability $\min(1, A)$. (The rule of
# Metropolis is the same one, with $A = p(\text{new}) / p(\text{old})$.)
#
# Here the ratio is
# $A = z^{k-2}\, \frac{g(1/z)}{g(z)}\, \frac{p(y)}{p(x)}$. For the density above $g(1/z) = z\, g(z)$, and the factor
# becomes $z^{k-1}$. If $z$ is drawn uniformly instead, $g(1/z) = g(z)$, and the right factor is $z^{k-2}$. What
# happens to somebody who draws $z$ uniformly but keeps $z^{k-1}$?

# %% slide [markdown]
# ## Why $z^{k-1}$?
#
# $$ A = z^{k-2}\, \frac{g(1/z)}{g(z)}\, \frac{p(y)}{p(x)} $$
#
# - As many from $x$ to $y$ as back; at the distance $r$ there is a volume of $r^{k-1} dr$.
# - $g(1/z) = z\, g(z)$ gives $z^{k-1}$; a uniform $z$ would need $z^{k-2}$.

# %% [markdown]
# We try both on a Gaussian in two dimensions whose
# standard deviation is 1. (A $z$ with the density $g$ is made of a number $q$ that is uniform from 0 to 1: it is the
# $z$ below which a share $q$ of the draws lies. The share below $z$ is $\sqrt{2 z} - 1$, so that $z = (1 + q)^2 / 2$.)


# %%
def stretched(drawn, k=2, walkers=100, steps=1000):
    """Draws (n, k) by the stretch move with the factor z^(k-1); `drawn` makes z of numbers from 0 to 1."""
    rng = np.random.default_rng(0)
    half = walkers // 2
    x = rng.standard_normal((2, half, k))
    kept = []
    for _ in range(steps):
        for moving in (0, 1):
            here, other = x[moving], x[1 - moving][rng.integers(half, size=half)]
            z = drawn(rng.uniform(size=half))
            y = other + z[:, None] * (here - other)
            log_ratio = (k - 1) * np.log(z) + 0.5 * np.sum(here**2 - y**2, axis=1)
            taken = np.log(rng.uniform(size=half)) < log_ratio
            x[moving][taken] = y[taken]
        kept.append(x.copy())
    return np.reshape(kept, (-1, k))


right_z = stretched(lambda share: (1 + share) ** 2 / 2)
wrong_z = stretched(lambda share: 0.5 + 1.5 * share)
print(f"z with a density of 1 / sqrt z: standard deviation {right_z.std():.2f}")
print(f"z uniform, the same factor:     standard deviation {wrong_z.std():.2f}")

# %%
with house_style():
    figure, (ax,) = sheet(7.5, 3.4)
    edges, bell = np.linspace(-4.5, 4.5, 61), np.linspace(-4.5, 4.5, 200)
    for some, name in ((right_z, "z with the density 1 / √z"), (wrong_z, "z uniform")):
        ax.hist(some[:, 0], edges, density=True, histtype="step", lw=1.5, label=name)
    ax.plot(bell, np.exp(-0.5 * bell**2) / np.sqrt(2 * np.pi), "k:", lw=1, label="the Gaussian")
    ax.set(xlabel="first entry of a draw", ylabel="density")
    ax.legend()
Picture(
    figure,
    "Draws from a Gaussian (dotted) by the stretch move. With the right density of z the draws follow it; with a "
    "uniform z and the same factor they are too wide.",
)

# %% slide [markdown]
# ## Draw $z$ uniformly and keep the factor
#
# - Standard deviation {{ wrong_z.std():.2f}} in place of 1 (right: {{ right_z.std():.2f}}), and nothing warns.

# %% [markdown]
# With the wrong density the draws are too wide, {{ wrong_z.std():.2f}} in place of 1, and nothing
# warns{{ abs(right_z.std() - 1) < 0.03 and wrong_z.std() > 1.1 }}. With the right one the move has a valuable
# property: it does not depend on units, for if the space is scaled or sheared, so are the walkers and their steps.
#
# The workbench has the stretch move, but its default is another one with the same property, called differential
# evolution. The step of a walker is the difference of two other walkers, times a factor. If the two are in different
# modes, this step jumps from mode to mode. At each step half of the walkers move, while the other half, from which they
# take their steps, stands still. Such a set of walkers is called an **ensemble**. `sample` makes four ensembles unless
# it is told otherwise, and they know nothing of each other.

# %% slide [markdown]
# ## The workbench's default: differential evolution
#
# - A step is the difference of two other walkers, times a factor: it jumps from mode to mode.
# - Half of the walkers move, the others stand still.
# - Four ensembles that know nothing of each other

# %% [markdown]
# We let four ensembles of 32 walkers go for our two angles,
# 3000 steps each, and compare with the grid. (With two angles that may both be turned towards the camera or away from
# it, there are four modes.) The first printed line is the verdict on the draws; the next section says what its numbers
# mean. It also counts the modes to which a few searches from elsewhere have led: least squares from points in ever
# wider shells around the mode that is known, up to 1,000 of Laplace's standard deviations away. They are a test and no
# census: they may miss a mode in which the draws are. In the figure below the draws of one camera lie on a ring, and
# its four thick places are the modes.

# %%
draws = sample(one, found.values, walkers=32, steps=3000, seed=1)
print(draws.verdict)
print("mean      ", draws.mean.round(2), "by the grid", exact_mean.round(2), "rad")
print(
    "deviations",
    draws.sd.round(2),
    "by the grid",
    exact_sd.round(2),
    "by Laplace",
    approximation.sd.round(2),
    "rad",
)
both = arm_problem("front", "side")
clear = wb.solve(both, {"angles": np.zeros(2)})
better = laplace(both, clear.values)
density = np.exp(-both.costs(np.zeros(2), np.zeros(0), None)(places)).reshape(121, 121)
density /= density.sum()
exact = np.sqrt(
    [
        density.sum(axis=1) @ axis**2 - (density.sum(axis=1) @ axis) ** 2,
        density.sum(axis=0) @ axis**2 - (density.sum(axis=0) @ axis) ** 2,
    ]
)
print(
    "with a second camera: least squares",
    clear.values["angles"].round(2),
    "deviations by Laplace",
    better.sd.round(3),
    "by the grid",
    exact.round(3),
    "rad",
)

with house_style():
    figure, (left, right) = sheet(10.5, 4.6, columns=2)
    for ax, some, name in ((left, draws, "front"), (right, better, "front and side")):
        ax.plot(
            *some.flat[:: max(1, len(some.flat) // 4000)].T, ".", ms=2, alpha=0.3, label="draws"
        )
        ax.plot(*true_angles, "k*", ms=12, label="truth")
        ax.set(
            title=f"cameras: {name}",
            xlabel="upper arm out of the image (rad)",
            ylabel="forearm (rad)",
            xlim=(-1.6, 1.6),
            ylim=(-1.6, 1.6),
            aspect="equal",
        )
    left.plot(*found.values["angles"], "C1o", ms=6, label="least squares")
    for scale in (1, 2):
        turn = np.linspace(0, 2 * np.pi, 100)
        half = np.linalg.cholesky(approximation.covariance)
        ring = found.values["angles"] + scale * (half @ [np.cos(turn), np.sin(turn)]).T
        left.plot(*ring.T, "C1--", lw=1, label="Laplace" if scale == 1 else None)
    left.legend(loc="upper left", fontsize=8)
Picture(
    figure,
    "Left, one camera: each bone may point towards it or away; least squares and Laplace's "
    "approximation (one and two standard deviations) show one of these modes. Right, with a second"
    " camera from the side: there is one mode, and Laplace's approximation suffices. The points on the right are "
    "draws from its Gaussian.",
)

# %% slide [markdown]
# ## One camera, four modes; two cameras, one
#
# - One: deviations {{ draws.sd[0]:.2f}} and {{ draws.sd[1]:.2f}} rad, by the grid {{ exact_sd[0]:.2f}} and
#   {{ exact_sd[1]:.2f}}, by Laplace {{ approximation.sd[0]:.2f}} and {{ approximation.sd[1]:.2f}}
# - Two: Laplace suffices.{{ np.allclose(better.sd, exact, rtol=0.05) }}

# %% [markdown]
# A few searches from elsewhere have found {{ printed('modes in all')[-1] - 1:.0f}} more modes, so that
# {{ printed('modes in all')[-1]:.0f}} of the four are
# known{{ draws.usable and np.allclose(draws.mean, exact_mean, atol=0.05) and np.allclose(draws.sd, exact_sd, rtol=0.05) and min(((draws.flat > 0) == signs).all(axis=1).mean() for signs in ((0, 0), (0, 1), (1, 0), (1, 1))) > 0.05 }}.
# With the second camera Laplace's deviations are those of the
# grid{{ np.allclose(better.sd, exact, rtol=0.05) and np.allclose(clear.values['angles'], true_angles, atol=0.1) }}.
#
# ## What draws are worth
#
# The draws of a chain are not independent, because each one resembles the ones before it. How many independent draws
# are they worth? Let $\rho_t$ be the correlation between draws that are $t$ steps apart, and let each draw have the
# variance $s^2$. The variance of the mean of $N$ draws is the mean of the covariances of all pairs of them. A draw has
# a covariance of $s^2$ with itself, and of $s^2 \rho_t$ with the two draws that are $t$ steps before and after it. So
# the variance of the mean is
#
# $$ \frac{s^2}{N} \left( 1 + 2 \rho_1 + 2 \rho_2 + \dots \right) = \frac{s^2}{N}\, \tau,
#    \qquad \tau = 1 + 2 \sum_{t = 1}^{\infty} \rho_t , $$
#
# if the chain is much longer than its memory. For $N$ independent draws it would be $s^2 / N$. So $N$ draws are worth
# $N / \tau$ independent ones. The number $\tau$, which is counted in steps, is called the **autocorrelation time**.

# %% slide [markdown]
# ## What are draws worth?
#
# $$ \frac{s^2}{N} \left( 1 + 2 \rho_1 + 2 \rho_2 + \dots \right) = \frac{s^2}{N}\, \tau $$
#
# - $\tau$: the **autocorrelation time**. $N$ draws are worth $N / \tau$ independent ones.
# - Here {{ draws.draws[..., 0].size:,}} draws, $\tau$ = {{ draws.mixing.times.max():.0f}} steps

# %% [markdown]
# Now $\tau$ itself has to be estimated from the chain. The sum cannot go on to the end of the chain, because the
# correlations of draws that are far apart are nothing but noise, and there are many of them. Sokal's rule ends it at
# the first $t$ that is at least five times the sum up to there (`WINDOW` below). The lines compute `times`, the sum for
# every possible end, and take the first end that obeys the rule; `autocovariance` is the library's function for the
# products of draws that are $t$ steps apart, summed over all walkers.
#
# And a chain that is too short makes its own
# memory look short. The estimate can be believed if the chain is at least 50 $\tau$ long (Sokal, [*Monte Carlo Methods
# in Statistical Mechanics*](https://doi.org/10.1007/978-1-4899-0319-8_6), 1997), or, with several ensembles of walkers,
# 20 $\tau$ if the estimate no longer grows. Besides, the ensembles must agree: R-hat, the spread of all draws together
# over that within the ensembles, must be close to one (Gelman and Rubin, [*Inference from Iterative Simulation Using
# Multiple Sequences*](https://doi.org/10.1214/ss/1177011136), 1992). Until both hold, no number should be read from the
# draws. So the workbench puts its verdict before the numbers, and refuses an interval if the verdict is bad.

# %% slide [markdown]
# ## When to believe them
#
# - The chain is 50 $\tau$ long (20, with ensembles, if $\tau$ no longer grows).
# - **R-hat**: spread of all over spread within ensembles, close to one
# - Until then no number should be read. So the verdict comes first.

# %% [markdown]
# We ask a chain of 100 steps for an interval, and then the 3000 steps from above. (The
# first steps, which still depend on the start, do not count: they are a tenth of all steps, or $5 \tau$ if that is
# more, but never more than half. Of the 3000 steps {{ draws.mixing.steps}} are left. Four ensembles of 32 walkers
# have $N = 4 \cdot 32 \cdot {{ draws.mixing.steps}} = {{ draws.draws[..., 0].size}}$ draws in them, and the printed
# number of effective draws is $N / \tau$, with the $\tau$ of {{ draws.mixing.times.max():.0f}} steps of the slower
# angle. Of the 100 steps only half is left. The advice that is printed for them is
# generous: it asks for $1.3 \cdot 50\, \tau$ steps, because a short chain makes $\tau$ look short, and for as many
# again, because half of this chain was left out.)

# %%
source(integrated_time)

# %%
short = sample(one, found.values, walkers=16, steps=100, seed=1)
for steps, ensembles in ((100, short), (3000, draws)):
    try:
        low, high = ensembles.interval(0.9).T.round(2)
        print(f"{steps} steps: 90 % of the draws lie from {low} to {high} rad")
    except wb.WorkbenchError as error:
        print(f"{steps} steps: {error}")

# %% slide [markdown]
# ## A hundred steps are refused
#
# - 100 steps: no interval{{ not short.usable }}
# - 3000 steps: 90 % of the draws lie from {{ low[0]:.1f}} to {{ high[0]:.1f}} rad (upper arm).
# - Even so: it spans the middle, where there is little. Look at the draws.

# %% [markdown]
# Even when it is granted, an interval is a poor summary of two modes: it spans the middle, where there is
# little{{ not short.usable and (np.abs(draws.flat[:, 0]) < 0.2).mean() < 0.05 }}. It
# is better to look at the draws themselves, as in the last figure.
#
# ## On a body
#
# Nothing changes when the bone belongs to a body. A synthetic person stands in front of one camera, or among four. Free
# are the first two shape coefficients, the place and the left elbow: eight numbers of $\theta$, $\beta$ and the
# translation. All others are held at the truth, which nobody knows of a real person. With four cameras, Laplace's
# approximation is enough, and the page with bodies draws from its Gaussian. In the code, `setup.start` holds a value
# for everything, cameras as well, and `setup.made_of` the true pose, shape and place; the bar between them puts the
# second in the place of the first.

# %% slide [markdown]
# ## On a body: eight numbers
#
# - Two shape coefficients, the place, the left elbow; all others held at the truth
# - One camera in front, or four around

# %%
free = ("betas[0:2]", "trans", "pose[left_elbow]")
people = {}
for cameras in ("one-camera", "four-cameras"):
    setup = find(f"body-{cameras}", {"body": "small"}).setup()
    problem = setup.problem.freeing(*free)
    answer = setup.start | setup.made_of
    answer |= wb.solve(problem, answer).values
    people[cameras] = problem, answer, laplace(problem, answer)
problem, answer, straight = people["one-camera"]
drawn = sample(problem, answer, steps=800, seed=0)
print(drawn.verdict)
for i in range(problem.free.size):
    unit = ("standard deviations", "m", "rad")[(i > 1) + (i > 4)]
    print(
        f"{problem.free.label(i):22} one camera: draws {drawn.sd[i]:.4f}, Laplace {straight.sd[i]:.4f}; "
        f"four, Laplace {people['four-cameras'][2].sd[i]:.4f} {unit}"
    )

with house_style():
    figure, (ax,) = sheet(7.5, 4.4)
    some = drawn.flat[:: max(1, len(drawn.flat) // 4000)]
    ax.plot(some[:, 4], some[:, 0], ".", ms=2, alpha=0.3, label="one camera: draws")
    place, shape = people["four-cameras"][1]["trans"][2], people["four-cameras"][1]["betas"][0]
    ax.plot(place, shape, "k*", ms=12, label="four cameras: least squares")
    ax.set(
        xlabel="place towards the first camera (m)",
        ylabel="betas[0] (standard deviations)",
    )
    ax.legend()
Picture(
    figure,
    "Draws of the place in depth and of the first shape coefficient: the larger it is, the taller the person. To one "
    "camera a tall person far away looks like a short one nearby, so the draws lie along a line. Four cameras know "
    "both.",
    lambda: recorded_bodies(
        setup.body,
        {
            f"draws, {name}": {f"draw {k + 1}": one for k, one in enumerate(posterior.values(40))}
            for name, posterior in (
                ("one camera", drawn),
                ("four cameras", people["four-cameras"][2]),
            )
        },
        "People drawn from the posterior: first what one camera leaves possible, then what four do. "
        "Look from the side to see how far they are apart in depth, and through the first camera to see that "
        "it can hardly tell them apart.",
        views=setup.views,
        cameras=setup.start,
    ),
)

# %% slide still [markdown]
# ## Tall and far, or short and near
#
# - One camera leaves the distance open by {{ 100 * drawn.sd[4]:.0f}} cm, four by
#   {{ 1e3 * people['four-cameras'][2].sd[4]:.0f}} mm.

# %% slide [markdown]
# ## People that one camera leaves possible
#
# - From the side: how far apart they are in depth
# - Through the first camera: it can hardly tell them apart.

# %% [markdown]
# One camera leaves the distance open by a standard deviation of {{ 100 * drawn.sd[4]:.0f}} cm, and with it the
# height; four know it to {{ 1e3 * people['four-cameras'][2].sd[4]:.0f}}
# mm{{ np.corrcoef(drawn.flat[:, [0, 4]].T)[0, 1] < -0.95 }}. Here the posterior has one mode and the model is nearly
# straight over its width, so Laplace's numbers agree with the
# draws{{ drawn.usable and np.allclose(drawn.sd, straight.sd, rtol=0.1) }}. But only the draws could tell us that they
# do. The example
# `examples/15_how_well_a_person_is_known.py` asks the same of a real person, with all of the pose free.
#
# ## What to remember
#
# - If each residual is divided by its sigma, the cost is minus the logarithm of the posterior.
# - Laplace's approximation is the Gaussian with the covariance $(J^\top J)^{-1}$. It costs nothing, and it is right if
#   the posterior has one mode and the model bends little over its width. It cannot say that it is wrong.
# - One camera does not tell whether a bone points towards it or away. The lowest cost may belong to the
#   wrong answer.
# - Draws answer every question, once they have mixed. So first ask what they are worth: their number divided by the
#   autocorrelation time.

# %% slide [markdown]
# ## Only the draws could say that Laplace was right
#
# - One mode, nearly straight: deviations agree within a
#   tenth.{{ np.allclose(drawn.sd, straight.sd, rtol=0.1) }}
# - Laplace cannot say that it is wrong.

# %% slide [markdown]
# ## What to remember
#
# - Residuals over sigma: the cost is minus the log of the posterior.
# - $C = (J^\top J)^{-1}$ is free, and right for one mode that is nearly straight.
# - Draws answer every question, once they have mixed: ask for $N / \tau$ first.
