# %% [markdown]
# # Priors and robust losses
#
# **What if the data are few, or wrong?**
#
# If the data are few, they leave directions of the pose open, and something else has to say what people do. If some
# of the data are wrong (a marker is taken for another, or a detector is confused), they must not be believed. In both
# cases the question is what a residual ought to cost. Lengths are in metres and angles in radians. People and data
# are synthetic; the priors of poses were learned from motion capture.

# %%
import numpy as np
from scipy.special import logsumexp
from scipy.stats import chi2

import workbench as wb
from workbench.course import Picture, source
from workbench.plots import house_style, sheet
from workbench.priors.poses import shipped_gaussian, shipped_mixture

# %%
body = wb.load_body("small")
names = body.joint_names
pose, betas, trans = (block.symbol for block in body.blocks())

# %% [markdown]
# ## Few data
#
# We see wrists, ankles, the head and the pelvis, to 1 cm: {{ 6 * 3 }} numbers for a pose of {{ 24 * 3 }}. Lecture 9 added
# a naive prior: each angle is zero on average, with a standard deviation of 0.25 rad, whatever the others are. We
# compare it with a prior that was learned from recorded poses, and consists of their mean and their covariance. We
# look for the poses of five people with a bent knee, which are drawn from a model of such recordings. (Below we shall
# see which model.)

# %% slide [markdown]
# ## Few data: six joints, {{ 6 * 3 }} numbers for {{ 24 * 3 }}
#
# - Seen to 1 cm: wrists, ankles, head, pelvis
# - Naive prior: each angle alone, 0.25 rad
# - Learned prior: mean and covariance of recorded poses

# %%
seen_names = ("pelvis", "head", "left_wrist", "right_wrist", "left_ankle", "right_ankle")
which = [names.index(name) for name in seen_names]
rng = np.random.default_rng(0)
learned = shipped_gaussian()
mean, C = learned.mean, learned.covariance  # (69,) rad and (69, 69) rad^2, no pelvis
mixture = shipped_mixture()
drawn = mixture.draw(4000, rng)
knee, hip = names.index("left_knee"), names.index("left_hip")
people = drawn[np.argsort(-drawn[:, knee, 0])[10:400:80]]  # five with a bent knee

seen = wb.Block("seen", (len(which), 3), "m")
all_joints = body.joint_points(pose, betas, trans)
missed = (all_joints.symbol[:, which] - seen.symbol).reshape((-1, 1))  # (18, 1) m
data = wb.Residual("six joints", missed, 0.01, "m", points=(all_joints,))
shape = wb.residuals.gaussian(betas)

below = pose[:, 1:].reshape((-1, 1))  # the 69 numbers of the joints below the pelvis
priors = {
    "each angle alone": wb.residuals.gaussian(below, covariance=0.25**2, unit="rad", name="poses"),
    "a learned Gaussian": wb.residuals.gaussian(below, mean=mean, covariance=C, name="poses"),
}
off = {name: [] for name in priors}
for name, prior in priors.items():
    problem = wb.Problem([data, shape, prior], ["pose", "betas", "trans"], blocks=[seen])
    for person in people:
        joints = body.joints(person)
        given = body.start() | {"seen": joints[which] + 0.01 * rng.standard_normal((6, 3))}
        found = wb.solve(problem, given).values
        off[name].append(1e3 * np.linalg.norm(body.joints(**found) - joints, axis=1))
seen_off = {name: np.array(each)[:, which].mean() for name, each in off.items()}  # mm
unseen_off = {name: np.delete(each, which, axis=1).mean() for name, each in off.items()}  # mm
for name in off:
    print(
        f"{name:19}: joints that were seen off by {seen_off[name]:.0f} mm, "
        f"others by {unseen_off[name]:.0f} mm"
    )

# %% slide [markdown]
# ## What was not seen gains most
#
# | prior | seen joints off by | others |
# | --- | --- | --- |
# | each angle alone | {{ seen_off['each angle alone']:.0f}} mm | {{ unseen_off['each angle alone']:.0f}} mm |
# | a learned Gaussian | {{ seen_off['a learned Gaussian']:.0f}} mm | {{ unseen_off['a learned Gaussian']:.0f}} mm |
#
# - 1 cm in each coordinate is {{ 1e3 * 0.01 * np.sqrt(8 / np.pi):.0f}} mm of distance.

# %% [markdown]
# With the learned prior the fit meets what was seen to its noise (1 cm in each coordinate is
# {{ 1e3 * 0.01 * np.sqrt(8 / np.pi):.0f}} mm of distance), with
# the naive one nearly so{{ seen_off['a learned Gaussian'] < 17 < seen_off['each angle alone'] < 24 }}. The great
# difference is in what was not seen, which is off by {{ unseen_off['a learned Gaussian']:.0f}} mm in the place of
# {{ unseen_off['each angle alone']:.0f}} mm.
#
# ## One keypoint is hidden
#
# What a prior does is seen best at a single keypoint. Now all 24 joints are seen to 1 cm; then the left ankle
# and foot are hidden behind a table. With each of these, and with and without the learned prior, we fit
# the same five people from the same start, and ask how far the ankle is off, and how far off it says that it
# may be: with $A$ the Jacobian of the ankle's place, the covariance of the place is $A (J^\top J)^{-1} A^\top$
# (lecture 8), and its standard deviation is the root of the trace. If some direction of the pose changes no residual
# and moves the ankle, it is infinite.

# %% slide [markdown]
# ## One keypoint is hidden
#
# - All joints are seen to 1 cm; then the left ankle and foot are behind a table.
# - How far is the ankle off, and how far does the fit *say*: $A\, (J^\top J)^{-1} A^\top$

# %%
ankle = names.index("left_ankle")
hidden = [ankle, names.index("left_foot")]
marks = wb.Block("marks", (len(names), 3), "m")
place = wb.Residual("ankle", all_joints.symbol[:, ankle], 1.0, "m", points=(all_joints,))
probe = wb.Problem([place], ["pose", "betas", "trans"])


def ankle_of(person, unseen, extra):
    """How far the ankle is off and its standard deviation, mm, and the joints of the fit."""
    kept = [k for k in range(len(names)) if k not in unseen]
    apart = (all_joints.symbol[:, kept] - marks.symbol[:, kept]).reshape((-1, 1))
    joints_seen = wb.Residual("joints", apart, float(data.sigma), "m", points=(all_joints,))
    problem = wb.Problem([joints_seen, shape, *extra], ["pose", "betas", "trans"], blocks=[marks])
    joints = body.joints(person)
    noise = data.sigma * np.random.default_rng(5).standard_normal(joints.shape)
    given = body.start() | {"marks": joints + noise}
    found = wb.solve(problem, given).values
    at = problem.linearize(given | found)
    A = probe.linearize(found).dense
    _, s, Vt = np.linalg.svd(at.dense)
    open_moves = np.linalg.norm(A @ Vt[at.rank :].T) > 1e-6
    deviation = np.inf if open_moves else np.linalg.norm(A @ Vt[: at.rank].T / s[: at.rank])
    fit = body.joints(**found)
    return 1e3 * np.linalg.norm(fit[ankle] - joints[ankle]), 1e3 * deviation, fit


takes_over = [priors["a learned Gaussian"]]
ankles, ankle_off, deviation = {}, {}, {}
for seen_as, unseen in (("seen", []), ("hidden", hidden)):
    for with_prior, extra in (("without prior", []), ("with prior", takes_over)):
        ankles[seen_as, with_prior] = [ankle_of(person, unseen, extra) for person in people]
        far, sd = (np.array([one[k] for one in ankles[seen_as, with_prior]]) for k in (0, 1))
        ankle_off[seen_as, with_prior], deviation[seen_as, with_prior] = far, sd
        print(
            f"ankle {seen_as:6} {with_prior:13}: off by",
            ", ".join(f"{one:.0f}" for one in far),
            f"mm; standard deviation {sd.mean():.0f} mm",
        )
in_sds = ankle_off["hidden", "with prior"] / deviation["hidden", "with prior"]

with house_style():
    figure, (left, right) = sheet(10, 4.4, columns=2)
    shown = {
        "truth": (body.joints(people[1]), "k", "-"),
        "hidden, with prior": (ankles["hidden", "with prior"][1][2], "C0", "--"),
        "hidden, without prior": (ankles["hidden", "without prior"][1][2], "C1", ":"),
    }
    for label, (joints, colour, dash) in shown.items():
        for k, parent in enumerate(body.parents):
            if parent >= 0:
                z, y = joints[[parent, k]][:, [2, 1]].T
                left.plot(z, y, dash, color=colour, label=label if k == 1 else None)
        left.plot(*joints[ankle][[2, 1]], "o", color=colour, ms=6)
    left.set(xlabel="z, to the front (m)", ylabel="y, up (m)", aspect="equal")
    left.legend(fontsize=8, loc="upper right")
    for (seen_as, with_prior), mark in zip(ankles, ("v", "^", "s", "o"), strict=True):
        right.semilogy(
            range(1, 6),
            [one[0] for one in ankles[seen_as, with_prior]],
            mark,
            label=f"{seen_as}, {with_prior}",
        )
    right.axhline(ankles["hidden", "with prior"][0][1], color="0.5", lw=0.8)
    right.set(xlabel="person", ylabel="ankle off by (mm)", xticks=range(1, 6), ylim=(3, 6000))
    right.legend(fontsize=8, ncols=2, loc="upper center")
Picture(
    figure,
    "Left: the second person from the side, with the left ankle as a dot. Right: how far the ankle is off. "
    "The grey line is the standard deviation that the first person's fit with prior gives for the hidden ankle.",
)

# %% slide [markdown]
# ## The prior takes over where nothing is seen
#
# - Hidden without prior: off by {{ ankle_off['hidden', 'without prior'].min():.0f}} mm or more, deviation
#   infinite
# - With prior: deviation {{ deviation['hidden', 'with prior'].mean():.0f}} mm

# %% [markdown]
# While the ankle is seen, the prior hardly matters: the standard deviation is
# {{ deviation['seen', 'without prior'].mean():.0f}} mm without it and {{ deviation['seen', 'with prior'].mean():.0f}}
# mm with it. Hidden and without prior, the ankle is off by {{ ankle_off['hidden', 'without prior'].min():.0f}} mm or
# more for all five, and the standard deviation is infinite{{ np.isinf(deviation['hidden', 'without prior']).all() }}:
# nothing says how the knee is bent. With the prior it is {{ deviation['hidden', 'with prior'].mean():.0f}} mm. For
# four people the error is within two of these. For the last one it is {{ in_sds[4]:.1f}} times as
# large{{ (in_sds[:4] < 2).all() and in_sds[4] > 3 }}: these people were not drawn from
# this prior, and a prior that does not suit its people is surer than it should be.

# %% slide [markdown]
# ## A prior that does not suit its people is too sure
#
# - Ankle seen: {{ deviation['seen', 'without prior'].mean():.0f}} mm without the prior,
#   {{ deviation['seen', 'with prior'].mean():.0f}} with it; it hardly matters.
# - Hidden: four people within two deviations, the last one {{ in_sds[4]:.1f}} times{{ (in_sds[:4] < 2).all() }}

# %% [markdown]
# ## What a prior is

# %% slide [markdown]
# ## What a prior is
#
# $$ (x - \mu)^\top C^{-1} (x - \mu) = \| L^{-1} (x - \mu) \|^2, \qquad C = L L^\top $$
#
# - Half of this squared **Mahalanobis distance** is its cost.
# - **Whitening**: 69 correlated numbers become 69 that are not, each of deviation one.

# %% [markdown]
# The prior belief that $x$ is near $\mu$, with covariance $C$, costs half of the squared **Mahalanobis
# distance**,
#
# $$ (x - \mu)^\top C^{-1} (x - \mu) . $$
#
# (The lecture *Training a Body Model and Fitting SMPL to Scans* of the course *Virtual Humans* writes
# vectors as rows; there the transposed vector stands on the right.) Solvers want a residual whose
# sum of squares this is. We write $C = L L^\top$ with a triangular matrix $L$ (Cholesky's factorization). Then
# $C^{-1} = (L^{-1})^\top L^{-1}$, so the expression is $\| L^{-1} (x - \mu) \|^2$, and the residual is
# $L^{-1} (x - \mu)$. This is *whitening* once more: its covariance is $L^{-1} C\, (L^{-1})^\top = I$, so 69 numbers
# that are correlated become 69 that are not, each with a standard deviation of one. The library's `gaussian` makes
# this residual.
#
# Does the prior suit its poses? If it does, each squared distance is the sum of the squares of 69 independent numbers
# with a standard deviation of one. Such sums follow a $\chi^2$ law with 69 degrees of freedom, whose mean is 69. We
# look at poses that are drawn from the prior, and at poses from the model of eight Gaussians that made our five
# people:

# %% slide [markdown]
# ## Does it suit its poses?
#
# - Then squared distances follow $\chi^2$ with 69 degrees of freedom, mean 69.
# - Nine in ten should be between {{ chi2.ppf(0.05, 69):.0f}} and {{ chi2.ppf(0.95, 69):.0f}}.

# %%
flat = drawn[:, 1:].reshape(len(drawn), -1)
own = rng.multivariate_normal(mean, C, size=4000)
L = np.linalg.cholesky(C)
low, high = chi2.ppf([0.05, 0.95], 69)
fits_prior = {}  # the mean, and the share inside
for name, poses in (("drawn from it", own), ("drawn from eight Gaussians", flat)):
    d2 = np.sum(np.linalg.solve(L, (poses - mean).T) ** 2, axis=0)
    inside = np.mean((low < d2) & (d2 < high))
    fits_prior[name] = d2.mean(), inside
    print(
        f"{name:27} mean {d2.mean():5.1f}, between {low:.0f} and {high:.0f}: {100 * inside:.0f} %, "
        f"expected 90"
    )

# %% slide [markdown]
# ## Poses are not Gaussian
#
# - Drawn from the prior itself: mean {{ fits_prior['drawn from it'][0]:.0f}},
#   {{ 100 * fits_prior['drawn from it'][1]:.0f}} % inside
# - Drawn from a model of eight Gaussians: mean {{ fits_prior['drawn from eight Gaussians'][0]:.0f}},
#   {{ 100 * fits_prior['drawn from eight Gaussians'][1]:.0f}} % inside
# - People walk, sit, reach; nobody does what lies half-way.

# %% [markdown]
# ## One Gaussian is not enough
#
# The second line says that poses are not
# Gaussian{{ abs(fits_prior['drawn from it'][0] - 69) < 1 and fits_prior['drawn from eight Gaussians'][1] < 0.75 }}.
# People walk, sit and reach. Nobody does what lies
# half-way between these, but a single Gaussian has its mean there. Nor does it know that knees stop when
# they are straight:

# %%
backwards, likelihoods = {}, {}
for name, poses in (("one Gaussian", own), ("eight of them", flat)):
    bent_back = backwards[name] = np.mean(poses.reshape(-1, 23, 3)[:, knee - 1, 0] < -0.1)
    likely = likelihoods[name] = logsumexp(mixture.log_density(poses[:1000]), axis=1).mean()
    print(
        f"drawn from {name}: left knee bent backwards by 0.1 rad and more in {100 * bent_back:.1f} %, "
        f"mean log density by the eight {likely:.0f}"
    )

with house_style():
    figure, axes = sheet(9.5, 4.0, columns=2)
    for ax, (name, poses) in zip(
        axes, (("one Gaussian", own), ("eight Gaussians", flat)), strict=True
    ):
        angle = poses[:1500].reshape(-1, 23, 3)[:, :, 0]
        ax.plot(angle[:, hip - 1], angle[:, knee - 1], ".", ms=2)
        ax.axhline(0, color="0.4", lw=0.8)
        ax.set(
            title=name,
            xlabel="left hip, about x (rad)",
            ylabel="left knee, about x (rad)",
            xlim=(-2.5, 1.2),
            ylim=(-1.2, 3),
        )
Picture(
    figure,
    "1500 poses each. Below the line a knee is bent the wrong way. Eight Gaussians keep most people in a "
    "tighter band and have deep bends apart; but they too know no hard stop.",
)

# %% slide [markdown]
# ## Knees bent the wrong way
#
# - Backwards by 0.1 rad and more: {{ 100 * backwards['one Gaussian']:.1f}} % of one Gaussian's poses,
#   {{ 100 * backwards['eight of them']:.1f}} % of eight Gaussians'
# - Neither knows a hard stop.

# %% [markdown]
# (The log densities are taken under the mixture of eight, which favours its own samples; but a difference of
# {{ likelihoods['eight of them'] - likelihoods['one Gaussian']:.0f}} means a factor of $e^{
# {{ likelihoods['eight of them'] - likelihoods['one Gaussian']:.0f}}
# }$.{{ 0 < backwards['eight of them'] < backwards['one Gaussian'] }})

# %% slide [markdown]
# ## A mixture is no sum of squares; its best component is
#
# $$ \min_j \left( \tfrac12 \|L_j^{-1} (x - \mu_j)\|^2 + \tfrac12 \log \det C_j - \log c_j \right) $$
#
# - SMPLify takes the *least* cost of a component in the place of $-\log \sum_j c_j N_j(x)$.

# %% [markdown]
# A **mixture** has $k$ Gaussians with shares $c_j$; its cost is $-\log \sum_j c_j N_j(x)$. That is no
# sum of squares. [SMPLify](https://doi.org/10.1007/978-3-319-46454-1_34) takes the *least* cost of one component
# instead of the sum:
#
# $$ \min_j \left( \tfrac12 \|L_j^{-1} (x - \mu_j)\|^2 + \tfrac12 \log \det C_j - \log c_j \right) + \text{const} , $$
#
# (the constant is $\tfrac n2 \log 2 \pi$). Which component that is depends on $x$, but the cost of each
# is a sum of squares plus a number. And little is lost. The largest of $k$ terms $c_j N_j$ is no more than their
# sum, and no less than a $k$-th of it. The logarithms keep this order, and minus the logarithm of the largest term is
# the least of the costs, so that
#
# $$ 0 \;\le\; \min_j(-\log c_j N_j) + \log \sum_j c_j N_j \;\le\; \log k . $$

# %% slide [markdown]
# ## Little is lost
#
# $$ 0 \;\le\; \min_j(-\log c_j N_j) + \log \sum_j c_j N_j \;\le\; \log k $$
#
# - The largest of $k$ terms is at most their sum, and at least a $k$-th of it.

# %%
dense = mixture.log_density(flat)
loss = logsumexp(dense, axis=1) - dense.max(axis=1)
print(f"on 4000 poses: from {loss.min():.1e} to {loss.max():.3f}; log 8 = {np.log(8):.3f}")

# %% [markdown]
# Here at most {{ loss.max():.3f}} is lost{{ -1e-9 < loss.min() and loss.max() < 0.1 * np.log(8) }}. The numbers
# $\tfrac12 \log \det C_j$ and $-\log c_j$ do not move the minimum of a single component,
# and are often forgotten. But they decide *which* component it is:

# %% slide [markdown]
# ## On 4000 poses: hardly anything
#
# - Lost at most {{ loss.max():.3f}}; the bound is $\log 8$ = {{ np.log(8):.2f}}.
# - $\log \det C_j$ and $\log c_j$ move no minimum of one component, so they are often forgotten.

# %%
heights = np.array([0.5 * np.linalg.slogdet(c)[1] for c in mixture.covariances]) - np.log(
    mixture.shares
)
without = (-dense - heights).argmin(axis=1)
print(
    f"without them, {100 * np.mean(without != dense.argmax(axis=1)):.0f} % of the poses are given to "
    f"another component; the numbers range over {np.ptp(heights):.0f}"
)

# %% slide [markdown]
# ## Forgotten numbers choose the component
#
# - They range over {{ np.ptp(heights):.0f}}.
# - Without them {{ 100 * np.mean(without != dense.argmax(axis=1)):.0f}} % of the poses are given to another
#   component.

# %% [markdown]
# Without them {{ 100 * np.mean(without != dense.argmax(axis=1)):.0f}} % of the poses change their component.
#
# ## Wrong data
#
# Now all vertices are seen to 5 mm, but a tenth, a fifth or two fifths of them are wrong by 30 cm in each
# coordinate. Least squares believe them all (the shape has its prior, the pose has none):

# %% slide [markdown]
# ## Wrong data: a tenth of the vertices off by 30 cm
#
# - All vertices seen, good ones to 5 mm
# - Squares believe them all.

# %%
truth = {
    "pose": 0.3 * rng.standard_normal((24, 3)),
    "betas": rng.standard_normal(body.n_betas),
    "trans": np.zeros(3),
}
surface = body.vertices(**truth)
observed = wb.Block("observed", surface.shape, "m")
KERNELS = {
    "squares": (wb.residuals.quadratic, 0.005),
    "Huber": (wb.residuals.huber(), 0.005),
    "Geman-McClure": (wb.residuals.geman_mcclure, 0.02),
}
vertices = body.points(pose, betas, trans)
fits = {
    name: wb.Problem(
        [wb.residuals.vertices(vertices, observed.symbol, sigma=sigma, kernel=kernel), shape],
        ["pose", "betas", "trans"],
        blocks=[observed],
    )
    for name, (kernel, sigma) in KERNELS.items()
}


def data_with(share, seed=1):
    """The surface to 5 mm, a share of its vertices to 30 cm."""
    draw = np.random.default_rng(seed)
    wide = np.where(draw.random(len(surface)) < share, 0.3, 0.005)
    return surface + wide[:, None] * draw.standard_normal(surface.shape)


def fitted(name, share, start=None):
    """How far the skin is off on average, mm, and the solution."""
    given = body.start() | (start or {}) | {"observed": data_with(share)}
    solution = wb.solve(fits[name], given)
    values = {key: solution.values[key] for key in truth}
    return 1e3 * np.linalg.norm(body.vertices(**values) - surface, axis=1).mean(), solution


shares = (0.0, 0.1, 0.2, 0.4)
errors = {name: [] for name in fits}
huber_end = {}
for share in shares:
    for name in fits:
        begun = huber_end[share] if name == "Geman-McClure" else None
        error, solution = fitted(name, share, begun)
        errors[name].append(error)
        if name == "Huber":
            huber_end[share] = {key: solution.values[key] for key in truth}
for name, found in errors.items():
    said = (f"{100 * s:.0f} %: {e:.1f} mm" for s, e in zip(shares, found, strict=True))
    print(f"{name:14}", ", ".join(said))

# %% slide [markdown]
# ## Three losses, and a tenth of wrong vertices
#
# | wrong | squares | Huber | Geman-McClure |
# | --- | --- | --- | --- |
# | 0 % | {{ errors['squares'][0]:.1f}} mm | {{ errors['Huber'][0]:.1f}} mm | {{ errors['Geman-McClure'][0]:.1f}} mm |
# | 10 % | {{ errors['squares'][1]:.0f}} mm | {{ errors['Huber'][1]:.1f}} mm | {{ errors['Geman-McClure'][1]:.1f}} mm |
# | 40 % | {{ errors['squares'][3]:.0f}} mm | {{ errors['Huber'][3]:.1f}} mm | {{ errors['Geman-McClure'][3]:.1f}} mm |

# %% [markdown]
# Least squares believe all, and with a tenth of wrong vertices they are off by {{ errors['squares'][1]:.0f}} mm. The
# other two lines (here {{ errors['Huber'][1]:.1f}} and {{ errors['Geman-McClure'][1]:.1f}}
# mm{{ max(errors['Huber'] + errors['Geman-McClure']) < 10 < 10 * errors['squares'][0] < errors['squares'][1] and errors['Geman-McClure'][3] < 1.5 * errors['Geman-McClure'][0] }})
# change one thing: how much a large residual costs. (The third begins where the second ended; why, we
# shall see.)
#
# ## What a residual costs
#
# The larger a residual is, the harder its square pulls. Replace the square by a **robust loss** $\rho$.
# Huber's continues in a straight line: beyond a border, all residuals pull alike. That of Geman and
# McClure levels off,
#
# $$ \rho(x) = \frac{x^2}{\sigma^2 + x^2}, \qquad \rho(\sigma) = \tfrac12, \qquad \rho < 1, $$
#
# Its pull is the derivative $\rho' = 2 \sigma^2 x / (\sigma^2 + x^2)^2$, which is called the **influence**. The derivative
# of the influence has the sign of $\sigma^2 - 3 x^2$. So the influence is largest at $x = \sigma / \sqrt 3$, where it is
# $3 \sqrt 3 / (8 \sigma) \approx 0.65 / \sigma$, and then it falls to nothing. Data that are far off have no
# effect.

# %% slide [markdown]
# ## What a residual costs, and how hard it pulls
#
# $$ \rho(x) = \frac{x^2}{\sigma^2 + x^2}, \qquad \rho' = \frac{2 \sigma^2 x}{(\sigma^2 + x^2)^2} $$
#
# - Huber: beyond a border all residuals pull alike.
# - Geman and McClure: the **influence** $\rho'$ is largest at $\sigma / \sqrt 3$, then falls to nothing.

# %%
x = np.linspace(0, 5, 500)  # in sigmas
losses = {
    "squares": (x**2, 2 * x),
    "Huber, border 1.345": (
        np.where(x < 1.345, x**2, 2 * 1.345 * x - 1.345**2),
        2 * np.minimum(x, 1.345),
    ),
    "Geman-McClure": (x**2 / (1 + x**2), 2 * x / (1 + x**2) ** 2),
}
peak = losses["Geman-McClure"][1]
print(
    f"the influence is largest at {x[peak.argmax()]:.3f} sigma (1 / sqrt 3 = {1 / np.sqrt(3):.3f}): "
    f"{peak.max():.4f} / sigma"
)
with house_style():
    figure, axes = sheet(12.5, 3.8, columns=3)
    for (name, (loss, pull)), dash in zip(losses.items(), ("-", "--", "-."), strict=True):
        axes[0].plot(x, loss, dash, label=name)
        axes[1].plot(x, pull, dash, label=name)
    for (name, found), mark in zip(errors.items(), ("o-", "s--", "^-."), strict=True):
        axes[2].semilogy(100 * np.array(shares), found, mark, label=name)
    axes[0].set(xlabel="residual (σ)", ylabel="loss", ylim=(0, 5))
    axes[1].set(xlabel="residual (σ)", ylabel="influence (1/σ)", ylim=(0, 4))
    axes[2].set(xlabel="wrong vertices (%)", ylabel="skin off by (mm)")
    axes[0].legend()
    axes[2].legend()
Picture(
    figure,
    "Left and centre: what a residual costs, and how hard it pulls. Right: the fits. Squares suffer "
    "from the first wrong vertices; Geman and McClure's loss hardly notices two fifths of them.",
)

# %% slide [markdown]
# ## Squares suffer from the first wrong vertex
#
# - Geman and McClure's loss hardly notices two fifths of them.

# %% [markdown]
# ## For Gauss-Newton
#
# A least-squares solver needs residuals that it can square{{ abs(peak.max() - 3 * np.sqrt(3) / 8) < 1e-3 }}. So it is
# given
# $\tilde x = x / \sqrt{\sigma^2 + x^2}$, whose square is $\rho$: with the sign of $x$, and smooth at
# zero. The library writes a kernel as the factor $g(s) = \sqrt{\rho / s}$ for $s = (x / \sigma)^2$:

# %% slide [markdown]
# ## For a least-squares solver
#
# $$ \tilde x = \frac{x}{\sqrt{\sigma^2 + x^2}}, \qquad \tilde x^2 = \rho(x) $$
#
# - With the sign of $x$, and smooth at zero
# - The library writes a kernel as the factor by which a residual shrinks before it is squared.

# %%
source(wb.residuals.geman_mcclure)

# %%
source(wb.Residual.whitened)

# %% [markdown]
# ## The price: begin near
#
# A loss that ignores what is far off also ignores good data, if the fit begins far from them. So far
# the third fit began where Huber's had ended. Begun at rest, where most vertices are decimetres off, or
# 2 m away, where all of them are, it ends here:

# %% slide [markdown]
# ## The price: begin near
#
# - What ignores data that are far off ignores *good* data, too, if the fit begins far from them.
# - So far it began where Huber's had ended.

# %%
begun_off = {}  # mm
for name, start in (
    ("at rest", None),
    ("2 m away", {"trans": np.array([2.0, 0, 0])}),
    ("where Huber's ended", huber_end[0.2]),
):
    error, solution = fitted("Geman-McClure", 0.2, start)
    begun_off[name] = error
    print(
        f"Geman-McClure, begun {name:19}: {solution.status.name} after {solution.iterations} "
        f"iterations, skin off by {error:.1f} mm"
    )

# %% slide [markdown]
# ## Three starts, three ends, all converged
#
# | begun | skin off by |
# | --- | --- |
# | at rest | {{ begun_off['at rest']:.0f}} mm |
# | 2 m away | {{ begun_off['2 m away']:.0f}} mm |
# | where Huber's ended | {{ begun_off["where Huber's ended"]:.1f}} mm |
#
# - Most of the body can be an outlier. So fit in stages.

# %% [markdown]
# The first two have converged, truly: their gradients are zero. But they leave the skin {{ begun_off['at rest']:.0f}}
# and {{ begun_off['2 m away']:.0f}} mm off, and the third {{ begun_off["where Huber's ended"]:.1f}}
# mm{{ min(begun_off['at rest'], begun_off['2 m away']) > 10 * begun_off["where Huber's ended"] }}. Most of the body
# can be an outlier to
# such a loss, which has a minimum where only the rest is met. Therefore one fits in stages: first with
# a loss on which all data have an effect, or with a large $\sigma$, and then with the loss that is
# wanted.

# %% slide [markdown]
# ## Weights have units
#
# - $\sigma^2 x^2 / (\sigma^2 + x^2)$ or $x^2 / (\sigma^2 + x^2)$: with $\sigma = 100$ px they differ by $10^4$.
# - The weight of a prior belongs to one of the two.
# - SMPLify's weights multiply *residuals*: 4.78 is {{ 4.78**2:.1f}} in the energy.

# %% [markdown]
# ## Weights have units
#
# SMPLify writes $\sigma^2 x^2 / (\sigma^2 + x^2)$, which for small $x$ is $x^2$ in pixels squared. The
# lecture *Training a Body Model and Fitting SMPL to Scans* and this library have it without the
# $\sigma^2$. With SMPLify's $\sigma = 100$ px the two differ by $10^4$. The weight of SMPLify's prior
# is meant for the first form; in the second one, the prior outweighs the data. There is one more trap:
# in SMPLify's code, weights multiply *residuals*, so they appear squared in the energy: 4.78 is {{ 4.78**2:.1f}}.


# %%
def angle_with(factor, weight=4.78):
    """An angle seen as 0.8 rad through a 300 px bone, with a prior for 0 (Geman-McClure on px)."""
    a = np.linspace(-0.2, 1.2, 140001)
    pixels = 300 * (a - 0.8)
    cost = factor * pixels**2 / (100**2 + pixels**2) + weight**2 * (a / 0.5) ** 2
    return a[cost.argmin()]


print(
    f"with sigma^2: {angle_with(100**2):.3f} rad; without it and with the same weight: {angle_with(1):.3f} rad"
)

# %% slide [markdown]
# ## A copied weight, and the answer is gone
#
# - An angle seen as 0.8 rad: with $\sigma^2$ {{ angle_with(100**2):.2f}} rad, without {{ angle_with(1):.3f}}
#   rad
# - The library has no weights: a residual of one sigma costs one half, whatever it is made of.

# %% [markdown]
# So the answer of 0.8 rad becomes {{ angle_with(1):.3f}}
# rad{{ abs(angle_with(100**2) - 0.8) < 0.01 > angle_with(1) }}. The library avoids weights: each residual has a sigma
# in its own unit, so a residual of one sigma costs
# one half whatever it is made of.
#
# ## What to remember
#
# - A prior is a residual: $L^{-1} (x - \mu)$. Correlations say much about what was not seen.
# - People's poses are no single Gaussian. The least of a mixture's components is within $\log k$ of the
#   mixture; keep $\log \det$ and the shares.
# - A robust loss bounds the pull of a residual. Geman and McClure's ignores what is far off, so begin
#   near, or in stages.
# - Ask for the unit of a weight before you copy it.

# %% slide [markdown]
# ## What to remember
#
# - A prior is a residual, $L^{-1} (x - \mu)$; correlations say much about what was not seen.
# - Poses are no single Gaussian; keep $\log \det$ and the shares.
# - A robust loss bounds the pull: begin near, or in stages. Ask for the unit of a weight.
