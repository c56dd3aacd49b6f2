# %% [markdown]
# # Fitting images
#
# **What can one photograph tell?**
#
# A detector finds the shoulder, the knee and the heel of a person in a photograph. From these few points in
# two dimensions we want the whole body in three: its pose, its shape, and where it stands. SMPLify (Bogo et
# al., *Keep it SMPL*, 2016) did this as a least-squares problem, and SPIN (Kolotouros et al., *Learning to
# Reconstruct 3D Human Pose and Shape via Model-fitting in the Loop*, 2019) let a network learn from such
# fits. We rebuild both, one term after the other, and take no term before something has failed without it.
#
# There are two kinds of people here. One is real: `balance` is a person on a beam whom four cameras saw. We
# fit one camera at a time, and what we call the truth is the fit to all four. (It is not exact, and it is only
# one person.) The others are **made up**: their poses are drawn from a mixture of Gaussians that was learned
# from motion capture, the same body model made them and is fitted to them, and their keypoints have an error of
# 5 px. Of these we know the truth. Lengths are in metres, errors in millimetres, places in images in pixels (px),
# angles in radians.

# %%
from dataclasses import replace

import numpy as np
from scipy.special import logsumexp

import workbench as wb
from workbench.bodies import capsule_gaps, capsule_points, capsules_of
from workbench.course import Picture, source
from workbench.fitting import (
    PoseRegressor,
    WithStature,
    image_fit,
    image_priors,
    regressed_start,
    shape_prior,
    shipped_regressor,
    stature,
)
from workbench.fitting.image_recipe import NEARLY, ROUGHLY, smplify_stages
from workbench.fitting.image_starts import turned_about
from workbench.fitting.keypoint_problem import KeypointProblem, camera_residual, usual_priors
from workbench.fitting.keypoints import keypoint_setup
from workbench.fitting.observations import COCO, LIMBS, SIDES
from workbench.fitting.pose_regressor import normalised
from workbench.fitting.regressor_training import radian_lengths
from workbench.fitting.synthetic_views import draw_facings, draw_views, people_in
from workbench.geometry.rotation import matrix_from_vector
from workbench.lectures.material.photographs import (
    draw_from_aside,
    draw_in_image,
    in_camera,
    made_up_shots,
    shots_of_balance,
)
from workbench.plots import house_style, sheet
from workbench.priors.poses import draw_poses, shipped_gaussian, shipped_mixture
from workbench.problem.stages import in_stage
from workbench.residuals import apart, bending, geman_mcclure, max_mixture, quadratic, scaled, spheres
from workbench.residuals.bending import HINGES
from workbench.solvers import SolveStage, Staged, Starts

SIGMA = 4.0  # px, of a keypoint
NAMES = ("pose", "betas", "trans")
body = wb.load_body("default")
landmarks = body.landmark_names("coco")
limbs = [landmarks.index(f"{side}_{part}") for side in SIDES for part in LIMBS]
hips = [landmarks.index(f"{side}_hip") for side in SIDES]
mixture = shipped_mixture()
real = shots_of_balance(body, (0, 32, 64))  # three frames, each of four cameras alone
draw = np.random.default_rng(16)
people = made_up_shots(body, draw_poses(mixture, 16, draw), draw_facings(16, draw), draw, noise=5.0)


def places(values):
    """The landmarks (23, 3) m of a body."""
    return body.landmark("coco", *(values[name] for name in NAMES))


def in_space(values, truth):
    """How far the twelve landmarks of the limbs are off on average, mm."""
    return 1e3 * np.linalg.norm((places(values) - places(truth))[limbs], axis=1).mean()


def mpjpe(values, truth):
    """The same after the middle of the hips was moved to its true place, mm."""
    off = places(values) - places(truth)
    return 1e3 * np.linalg.norm((off - off[hips].mean(axis=0))[limbs], axis=1).mean()


print(f"{len(real)} real images, {len(people)} made up; {len(landmarks)} landmarks each")

# %% [markdown]
# `mpjpe` is called *mean per joint position error* in the literature: it asks for the pose alone, and forgives
# a body that stands in the wrong place. `in_space` forgives nothing.
#
# ## Meet the keypoints
#
# The camera takes a point $p$ of the world to $\Pi(p) = (f X / Z + c_u,\; f Y / Z + c_v)$, where $(X, Y, Z)$
# are its coordinates in the camera's frame (lecture 9). Landmark $k$ of the body is a linear combination of
# its vertices, and so the model predicts a pixel for it. The difference from what the detector found is the
# **reprojection error**. SMPLify's data term is
#
# $$ E_J(\theta, \beta, t) = \sum_k w_k\, \rho\bigl(\Pi(p_k(\theta, \beta, t)) - \hat u_k\bigr) $$
#
# with a weight $w_k$ from the detector's confidence. Let $\rho$ be the square for now. With the names of this
# library the term is one line. The keypoints themselves and their confidences are blocks that stay fixed, so
# that the same problem serves all images:

# %%
source(camera_residual)


# %%
def fit(of, shot, start=None, solver=NEARLY):
    """The values at the end of a fit, the solution, and the setup that says what was seen."""
    setup = keypoint_setup(of, shot.observed, "")
    given = setup.start | {name: start[name] for name in NAMES if start}
    solution = solver.solve(setup.problem, given)
    return given | solution.values, solution, setup


def missed(values, setup):
    """The median distance in the image of the fitted landmarks from those observed, px."""
    view = setup.views[0]
    off = np.linalg.norm(view.camera.pixels(places(values), values) - view.observed, axis=1)
    return np.median(off[view.confidence > 0])


bare = KeypointProblem(body, SIGMA, priors=lambda body: ())  # nothing but E_J
shot = real[0]
begun = keypoint_setup(bare, shot.observed, "")
here = begun.problem.linearize(begun.start)
m, p = here.dense.shape
exact, _, setup = fit(bare, shot)
print(f"equations {m}, unknowns {p}, rank {here.rank}")
print(
    f"keypoints alone: in the image {missed(exact, setup):.2f} px off (median), "
    f"the pose {mpjpe(exact, shot.truth):.0f} mm, in space {in_space(exact, shot.truth):.0f} mm"
)

with house_style():
    figure, axes = sheet(11, 4.6, columns=3)
    view = setup.views[0]
    draw_in_image(body, view, exact, ax=axes[0])
    axes[0].legend(loc="lower left", fontsize=8)
    draw_from_aside(body, view, exact, ax=axes[1])
    draw_from_aside(body, view, exact | shot.truth, ax=axes[2])
    for ax, title in zip(axes, ("in the image", "from aside", "the truth, from aside"), strict=True):
        ax.set_title(title)
Picture(
    figure,
    "A fit to keypoints alone. In the image (left) the fitted landmarks lie in the middle of the observed "
    "ones. From the side (middle) it is no person; the right one is the fit to four cameras.",
)

# %% [markdown]
# The problem is solved, exactly, and the answer is worthless. It has 46 equations for 85 unknowns: at least
# 39 directions of the unknowns are seen by no keypoint (lecture 8), and the optimizer goes along them wherever
# the way is easy. Adding the priors of lecture 10, the Gaussian of poses and the standard normal law of the
# betas, says what people do:

# %%
usual = KeypointProblem(body, SIGMA, priors=usual_priors)
with_priors, _, setup = fit(usual, shot)
print(
    f"with priors: in the image {missed(with_priors, setup):.1f} px off (median), "
    f"the pose {mpjpe(with_priors, shot.truth):.0f} mm, in space {in_space(with_priors, shot.truth):.0f} mm"
)

# %% [markdown]
# The keypoints are met less well, and the pose is several times better. From here on everything has these
# priors. Three troubles are left, and they are the rest of this lecture: keypoints that are wrong, minima that
# are wrong, and the distance from the camera.
#
# ## Where to begin: similar triangles
#
# These fits began with the resting body, placed as SMPLify places it. A length $H$ across the line of
# sight, seen with $h$ pixels, is at the depth $Z = f H / h$. Of all lengths the sides of the torso, from
# shoulder to hip, change least with the pose. SMPLify takes their means and holds them against the image; if
# the shoulders are nearer together than 25 px, the person may be seen from the side, and it tries the body
# turned by half a turn as well. This library fits the torso in eight directions and keeps the best. How far
# is the start from the truth?


# %%
def depth(values, setup):
    """How far the pelvis is in front of the camera, m."""
    pelvis = body.joints(*(values[name] for name in NAMES))[:1]
    return float(in_camera(pelvis, setup.views[0], setup.start)[0, 2])


for name, shots in (("balance", real), ("made up", people)):
    setups = [keypoint_setup(usual, one.observed, "") for one in shots]
    shares = [
        depth(setup.start, setup) / depth(one.truth, setup)
        for one, setup in zip(shots, setups, strict=True)
    ]
    print(
        f"{name:8} depth of the start over the true one: from {min(shares):.2f} to {max(shares):.2f}, "
        f"median {np.median(shares):.2f}"
    )

# %% [markdown]
# A torso that leans towards the camera looks short, and is taken to be far away. The person on the beam stands
# upright, and the start is good. The others bend and lie, and for some of them it is off by half. As a start this
# will do, if the rest of the fit can repair it.
#
# ## One keypoint is wrong
#
# Detectors confuse left and right, and take the arm of a neighbour for that of the person. We move the left
# wrist in one real image by up to 400 px and fit again, each time from the truth, so that nothing but the loss
# matters. The square lets one bad keypoint drag the whole body. Lecture 10 had the remedy, the loss of Geman and McClure,
# and SMPLify takes it with a scale of 100 px. But it has one number, $\sigma$, for two things: how accurate good
# keypoints are, and where bad ones begin. Both choices of that one number are tried here. And then a loss with a
# **scale of its own**:
#
# $$ c^2\, \rho\!\left(\frac{r^2}{c^2 \sigma^2}\right), \qquad \rho(s) = \frac{s}{1 + s} . $$
#
# Near zero it is $r^2 / \sigma^2$, whatever $c$ is. Beyond $c\, \sigma$ it levels off.

# %%
source(scaled)

# %%
SCALE = 40.0  # px: where outliers begin
LOSSES = {
    "squares": (SIGMA, quadratic),
    "one number, 4 px": (SIGMA, geman_mcclure),
    "one number, 40 px": (SCALE, geman_mcclure),
    "4 px, and 40 px": (SIGMA, scaled(geman_mcclure, SCALE / SIGMA)),
}
wrist, AWAY = landmarks.index("left_wrist"), (0, 50, 150, 300)  # px
others = [k for k in limbs if k != wrist]


def with_wrong_wrist(shot, px):
    """The same shot, in which the left wrist was found so many px to the right."""
    (photo,) = shot.observed.photographs
    pixels = photo.pixels.copy()
    pixels[shot.observed.names.index("left_wrist"), 0] += px
    return replace(shot, observed=replace(shot.observed, photographs=(replace(photo, pixels=pixels),)))


def others_off(values, truth):
    """`mpjpe` without the wrist in question, mm."""
    off = places(values) - places(truth)
    return 1e3 * np.linalg.norm((off - off[hips].mean(axis=0))[others], axis=1).mean()


spoilt = real[4]
off_by = {}
for name, (sigma, kernel) in LOSSES.items():
    of = KeypointProblem(body, sigma, kernel, image_priors)
    ends = [fit(of, with_wrong_wrist(spoilt, px), spoilt.truth)[0] for px in AWAY]
    off_by[name] = [others_off(end, spoilt.truth) for end in ends]
    said = ", ".join(f"{one:.0f}" for one in off_by[name])
    print(f"{name:18}: others off by {said} mm")

with house_style():
    figure, (left, right) = sheet(10, 4, columns=2)
    r = np.linspace(0, 300, 301)
    losses = {
        "squares": (r / SIGMA) ** 2,
        "one number, 4 px": r**2 / (SIGMA**2 + r**2),
        "one number, 40 px": r**2 / (SCALE**2 + r**2),
        "4 px, and 40 px": (SCALE / SIGMA) ** 2 * r**2 / (SCALE**2 + r**2),
    }
    for (name, loss), dash in zip(losses.items(), ("-", ":", "-.", "--"), strict=True):
        left.semilogy(r[1:], loss[1:], dash)
        right.plot(AWAY, off_by[name], dash, marker="o", ms=4, label=name)
    left.set(xlabel="reprojection error (px)", ylabel="what it costs", ylim=(1e-3, 2e4))
    right.set(xlabel="left wrist is wrong by (px)", ylabel="other limbs off by (mm)", ylim=(0, None))
    right.legend(fontsize=8)
Picture(
    figure,
    "Left: what the error of a coordinate costs, on a logarithmic scale. Right: the fits. The square follows "
    "the wrong keypoint without end. With one number the whole image counts too little, and the priors win. "
    "The loss with two numbers gives up the keypoint and keeps the others.",
)

# %% [markdown]
# With a single number of 4 px, a coordinate costs at most one half, and so all keypoints together cost less
# than it costs to leave the mean pose: the prior wins. With 100 px, good keypoints are believed as little as if
# they had been measured to 100 px: the prior wins again. Two numbers say two things.
#
# ### Confidence is a weight
#
# A detector says how sure it is, with a confidence $c$ between zero and one. Where does it belong? Outside of
# $\rho$, as $w\, \rho(s)$ with $w = c^2$ (this is what SPIN does; SMPLify takes $w = c$). Inside, as
# $\rho(w s)$, it does the same for small errors. For large ones it is the opposite of what we want:


# %%
def robust(s):
    """Geman and McClure's loss with its scale, of squares in units of sigma."""
    c = SCALE / SIGMA
    return c**2 * s / (c**2 + s)


s, w = (400.0 / SIGMA) ** 2, 0.1**2  # 400 px off, with a confidence of 0.1
print(f"sure: {robust(s):.0f}; doubtful, weight outside: {w * robust(s):.1f}, inside: {robust(w * s):.1f}")

# %% [markdown]
# A doubtful keypoint that is 400 px off costs 6 with the weight outside, one hundredth of a sure one. Inside,
# it costs fifteen times as much, because the weight has moved the border beyond which a keypoint counts as an
# outlier.
#
# ## Knees that bend backwards
#
# Now we look at the minima. From the front, a shin that points a little towards the camera looks like one that
# points away from it (lecture 12): there are two bent knees for one image, and only one of them is possible.
# Bogo et al. add a term for elbows and knees,
#
# $$ E_a(\theta) = \sum_{i} \exp(s_i\, \theta_i), $$
#
# over one angle of each of these joints. In the paper it stands without the signs $s_i$ and says that angles of
# natural bending are negative. In SMPL's files they are not all: a left elbow bends naturally with a negative
# angle about $y$, a right elbow with a positive one, and both knees with a positive angle about $x$. The course
# notes *SMPL and SMPLify* have the formula without the signs as well. And the residual of SMPLify's code is the
# exponential itself, so that the energy is $\exp(2 s_i \theta_i)$.

# %%
source(bending)

# %%
for angle in (1.5, -0.5):
    told = "natural" if angle > 0 else "backwards"
    print(
        f"left knee at {angle:4} rad, {told:9}: cost with the sign {0.5 * np.exp(-2 * angle):.2f}, "
        f"without it {0.5 * np.exp(2 * angle):.2f}"
    )

# %% [markdown]
# Without the sign a natural knee costs more than one that is bent backwards. With it, does the term repair our
# fits? We count knees and elbows that are bent backwards by more than a tenth of a radian, over all images, and fit
# with the robust loss, without the term and with it.

# %%
KERNEL = LOSSES["4 px, and 40 px"][1]
unhinged = KeypointProblem(body, SIGMA, KERNEL, usual_priors)
of_images = KeypointProblem(body, SIGMA, KERNEL, image_priors)  # usual_priors and bending


def bent_back(values):
    """How many of the four hinges are bent backwards by more than 0.1 rad."""
    pose = values["pose"]
    turned = [h.backwards * pose[body.joint_names.index(k), h.axis] for k, h in HINGES.items()]
    return int((np.array(turned) > 0.1).sum())


def mean_errors(ends, shots):
    return np.array([mpjpe(end[0], one.truth) for end, one in zip(ends, shots, strict=True)])


from_rest = {}
for name, of in (("without E_a", unhinged), ("with E_a", of_images)):
    for kind, shots in (("balance", real), ("made up", people)):
        from_rest[kind, name] = ends = [fit(of, one) for one in shots]
        off = mean_errors(ends, shots)
        print(
            f"{kind:8} {name:11}: {sum(bent_back(end[0]) for end in ends):2} bent backwards, "
            f"off by {off.mean():.0f} mm on average, {(off > 150).sum()} above 150 mm"
        )

# %% [markdown]
# It hardly helps. To see why, we take a person who stands in front of a camera with the left knee bent by 0.8
# rad, hold everything at the truth but the angle of the knee, and draw the cost over it.

# %%
knee, hip = (body.joint_names.index(f"left_{part}") for part in ("knee", "hip"))
stand = np.zeros((24, 3))
stand[1:] = shipped_gaussian().mean.reshape(23, 3)
stand[knee, 0], stand[hip, 0] = 0.8, -0.4
towards = np.diag([1.0, -1.0, -1.0])  # the camera stands in front
(standing,) = made_up_shots(body, stand[None], towards[None], np.random.default_rng(3), noise=0.0)
angles = np.linspace(-1.2, 1.4, 27)  # rad


def costs_over(problem, given):
    """The lowest cost at each angle of the knee; hip and ankle are free."""
    costs, held = [], problem.freeing("pose[left_hip]", "pose[left_ankle]")
    for angle in angles:
        pose = given["pose"].copy()
        pose[knee, 0] = angle
        costs.append(NEARLY.solve(held, given | {"pose": pose}).cost)
    return np.array(costs)


setup = keypoint_setup(of_images, standing.observed, "")
given = setup.start | standing.truth
loose = keypoint_setup(unhinged, standing.observed, "").problem
stage = in_stage(setup.problem, None, {"keypoints(camera)": (SIGMA / 41) ** 2})
curves = {
    "keypoints to 4 px, without E_a": costs_over(loose, given),
    "keypoints to 4 px, with E_a": costs_over(setup.problem, given),
    "keypoints to 41 px, with E_a": costs_over(stage, given),
}
minima = {}
for name, curve in curves.items():
    inner = (curve[1:-1] < curve[:-2]) & (curve[1:-1] < curve[2:])
    minima[name] = angles[1:-1][inner], curve[1:-1][inner]
    said = ", ".join(f"{a:.2f} rad at cost {c:.1f}" for a, c in zip(*minima[name], strict=True))
    print(f"{name:31} minima: {said}")

with house_style():
    figure, (ax,) = sheet(7.5, 4)
    for (name, curve), dash in zip(curves.items(), ("-", "--", "-."), strict=True):
        ax.plot(angles, curve - curve.min(), dash, label=name)
    ax.axvline(0.8, color="0.4", lw=0.8)
    ax.set(xlabel="left knee (rad); natural to the right", ylabel="cost above its lowest", ylim=(-1, 60))
    ax.legend(fontsize=8)
Picture(
    figure,
    "The cost over the angle of one knee; the thin line is the truth. With keypoints to 4 px there is a hill "
    "between the knee that is bent backwards and the right one. The term raises the wrong minimum, but the hill "
    "remains. If keypoints count little, there is one minimum.",
)

# %% [markdown]
# The term says which of the two minima is the better one, and an optimizer that is in the wrong one does not
# learn of it: to leave it, the shin would have to straighten, and the foot would have to miss its keypoint by
# dozens of pixels. But the last curve has only one minimum. There the keypoints count so little that priors
# and $E_a$ decide.
#
# ## Stages are data
#
# Hence fit in **stages**: first with keypoints that count little, and each further stage begins where the last
# one ended. A stage changes two things of a problem: which names are free, and how much residuals count.
# SMPLify's schedule is a list of these. At first only the place and the rotation of the root are free. Then all
# is, with weights $\lambda$ of the priors that fall from 404 to 4.78:

# %%
source(smplify_stages)

# %% [markdown]
# What does a weight of 404 mean? SMPLify multiplies *residuals* by $\lambda_\theta$, keypoints are squares in
# pixels, and the prior on the pose is half of a squared distance. So the energy is, up to the factor
# $\lambda_\theta^2$,
#
# $$ \frac{1}{\lambda_\theta^2} \sum_k \|r_k\|^2 + \frac12\, d(\theta)^2 , $$
#
# and a keypoint has the standard deviation $\sigma = \lambda_\theta / \sqrt 2$: 286 px in the first two stages,
# then 41 px, and 3.4 px at last. We take three stages before the last one, in the same manner:

# %%
ROWS = "keypoints(camera)"
stages = Staged((SolveStage(weights={ROWS: (SIGMA / 41) ** 2}, solver=ROUGHLY),), NEARLY)
found = {("rest", kind): from_rest[kind, "with E_a"] for kind in ("balance", "made up")}
SHOTS = {"balance": real, "made up": people}


def told(name, kind):
    """Print how good the fits of a kind are."""
    off = mean_errors(found[name, kind], SHOTS[kind])
    away = np.mean([in_space(e[0], s.truth) for e, s in zip(found[name, kind], SHOTS[kind], strict=True)])
    print(
        f"{kind:8} {name:12}: off by {off.mean():.0f} mm on average, {(off > 150).sum()} above 150 mm; "
        f"{sum(bent_back(e[0]) for e in found[name, kind])} bent backwards; in space {away:.0f} mm"
    )


for kind, shots in SHOTS.items():
    found["staged", kind] = [fit(of_images, one, solver=stages) for one in shots]
    told("staged", kind)

# %% [markdown]
# The wrong knees are gone, and so are most of the fits that had failed. Note that the problem has not changed at all:
# the last stage is the same as before, with the same costs. Only the way to its minimum is another one.
#
# ## The start matters most
#
# If it is the way that matters, why not begin nearer? There are two cheap ideas and a clever one. Begin at the
# resting body, and at the same body turned about its own axis, four starts, and keep the end with the lowest
# cost. Or *learn* where to begin: draw thousands of poses from the mixture, give each a random
# shape and a random camera, and let a small network learn to tell the pose from the keypoints. Its images cost
# nothing, since no photograph is needed. A network of this kind comes with the workbench.

# %%
source(PoseRegressor._forward)


# %%
def turned(shot, count=4):
    """The starts: the resting body where its torso was seen, turned about its own axis."""
    setup = keypoint_setup(of_images, shot.observed, "")
    return turned_about(body, setup.start, count)


def learned(shot, regressor=None):
    """What a regressor makes of the keypoints."""
    setup = keypoint_setup(of_images, shot.observed, "")
    return regressed_start(regressor or shipped_regressor(), body, setup.views[0], setup.start)


network = shipped_regressor()
found["four turned", "made up"] = [
    fit(of_images, one, solver=Starts(turned(one), NEARLY)) for one in people
]
told("four turned", "made up")
for kind, shots in SHOTS.items():
    found["learned", kind] = [fit(of_images, one, learned(one, network)) for one in shots]
    found["from truth", kind] = [fit(of_images, one, one.truth) for one in shots]
    told("learned", kind)
    told("from truth", kind)
alone = np.mean([mpjpe(learned(one, network), one.truth) for one in people])
print(f"the network alone, made up: {alone:.0f} mm")

with house_style():
    figure, (ax,) = sheet(8, 4)
    order = ("rest", "four turned", "staged", "learned", "from truth")
    for k, name in enumerate(order):
        off = np.sort(mean_errors(found[name, "made up"], people))
        ax.plot(k + np.linspace(-0.3, 0.3, len(off)), off, "o", ms=4)
        ax.plot([k - 0.35, k + 0.35], [off.mean()] * 2, "k-", lw=1.2)
    ax.axhline(150, color="0.6", lw=0.8, ls="--")
    ax.set(xticks=range(len(order)), xticklabels=order, ylabel="pose off by (mm)", ylim=(0, None))
    ax.set_xlabel("start of the fit")
Picture(
    figure,
    "The same problem for the same made-up people, begun in five ways. A dot is a person, sorted; the black line "
    "is the mean. The failures, above the dashed line, are a matter of the start, and so they vanish.",
)

# %% [markdown]
# The network alone is worse than most fits: it has never heard of the keypoints to the pixel. But as a *start* it
# is nearly as good as stages, without the stages. "From truth" begins at the answer, which nobody can do. It shows what is left
# when nothing is lost on the way, and this is half or more of the error: no optimizer will take it away,
# because the image does not tell it. (These people were drawn from the mixture that the network learned from. On 200
# people in recorded poses that neither had seen, the tables of `benchmarks/IMAGES.md` have the same order.)
#
# ## Hypotheses
#
# Several starts give several ends, and the lowest cost is not all that they tell. `Starts` keeps the different
# minima as hypotheses. How often is the lowest one also the nearest to the truth?

# %%
lowest, nearest, within = [], [], []
for (_, solution, setup), one in zip(found["four turned", "made up"], people, strict=True):
    off = [mpjpe(setup.start | end.values, one.truth) for end in solution.hypotheses]
    lowest.append(off[0])
    nearest.append(min(off))
    within.append(sum(end.cost < solution.cost + 2 for end in solution.hypotheses))
picked = np.isclose(lowest, nearest).sum()
print(
    f"the lowest of the ends is the nearest for {picked} of {len(people)}: off by {np.mean(lowest):.0f} mm, "
    f"the nearest by {np.mean(nearest):.0f} mm"
)

# %% [markdown]
# Not always. Each hypothesis meets the keypoints and is a possible pose, and a cost that is lower by one means
# a posterior density that is higher by a factor of $e$, no more (lecture 12). Whoever needs certainty should
# look at all of them, or add a camera.
#
# ## A better prior?
#
# Lecture 10 told that poses are not Gaussian, and SMPLify has a mixture of eight. Its cost is the least of
# the components', $\min_j e_j(\theta)$, in place of $-\log \sum_j \exp(-e_j)$, and the two differ by at most
# $\log C$ for $C$ components: the largest of $C$ terms is at most their sum, and at least a $C$-th of it. We give
# it to the fit, from the same starts, and compare both the answers and the two costs at the answers.


# %%
def mixture_priors(body):
    """The mixture in the place of the Gaussian."""
    pose = body.blocks()[0]
    poses = max_mixture(
        pose.symbol[:, 1:],
        shares=mixture.shares,
        means=mixture.means,
        covariances=mixture.covariances,
        name="pose prior",
    )
    return poses, shape_prior(body), bending(pose)


of_mixture = KeypointProblem(body, SIGMA, KERNEL, mixture_priors)
gaps = []
for kind, shots in SHOTS.items():
    found["mixture", kind] = [fit(of_mixture, one, learned(one, network)) for one in shots]
    flat = np.array([end[0]["pose"][1:].ravel() for end in found["mixture", kind]])
    each = mixture.log_density(flat)
    gaps.extend(logsumexp(each, axis=1) - each.max(axis=1))
    told("learned", kind)
    told("mixture", kind)
print(f"least of the components minus log-sum, largest: {max(gaps):.3f}; log 8 = {np.log(8):.2f}")

# %% [markdown]
# The bound is never nearly reached: at the answers one component is by far the likeliest, and the difference
# is below 0.1. So it does not matter which of the two forms is taken. But the answers are not better either. On
# the real images the mixture is no better than the Gaussian. On the made-up people it can only be flattered,
# since it drew them. (The measurements on other people agree: see `benchmarks/IMAGES.md`, whose recipe
# has the Gaussian.)
#
# ## How far away, and how tall?
#
# Look at the last column once more. After all these repairs the pose is off by less than a decimetre, and the place
# by two. A tall person far away and a short one nearby have nearly the same image (lecture 12), and the shape prior alone tells them
# apart. To see what it pays for, we put the person of a real image at different distances along the line
# of sight, hold the place, and fit pose and shape.

# %%
true_height = float(stature(body, shot.truth["betas"]))
of_tall = KeypointProblem(body, SIGMA, KERNEL, WithStature(true_height))
factors = np.linspace(0.85, 1.15, 7)
profiles = {}
found_here = found["learned", "balance"][0][0]
setup = keypoint_setup(of_images, shot.observed, "")
R, t = matrix_from_vector(setup.start["camera/rotation"]), setup.start["camera/translation"]
centre = -R.T @ t  # of the camera, in the world
pelvis = body.joints(*(found_here[name] for name in NAMES))[0]
near = depth(found_here, setup)
for name, of in (("stature unknown", of_images), ("stature known", of_tall)):
    held = keypoint_setup(of, shot.observed, "").problem.freeing("pose", "betas")
    rows = []
    for factor in factors:
        moved = (pelvis - centre) * (factor * depth(shot.truth, setup) / near - 1)
        given = setup.start | found_here | {"trans": found_here["trans"] + moved}
        end = NEARLY.solve(held, given)
        rows.append((end.cost, float(stature(body, end.values["betas"]))))
    profiles[name] = np.array(rows)
    said = ", ".join(f"{100 * f:.0f} %: {c:.0f}" for f, (c, _) in zip(factors, rows, strict=True))
    print(f"{name}, cost at a share of the true distance: {said}")
tallest = profiles["stature unknown"][[0, -1], 1]
print(f"stature of the ends, if unknown: {tallest[0]:.2f} m and {tallest[1]:.2f} m; true {true_height:.2f} m")

with house_style():
    figure, (left, right) = sheet(10, 3.8, columns=2)
    for (name, rows), dash in zip(profiles.items(), ("o-", "s--"), strict=True):
        left.plot(100 * factors, rows[:, 0] - rows[:, 0].min(), dash, ms=4, label=name)
        right.plot(100 * factors, rows[:, 1], dash, ms=4, label=name)
    left.set(xlabel="distance (% of the true one)", ylabel="cost above its lowest", ylim=(-1, 40))
    right.set(xlabel="distance (% of the true one)", ylabel="stature (m)")
    left.legend(fontsize=8)
Picture(
    figure,
    "A real person, held at a wrong distance. Left: what the fit then costs. Right: the stature with which it "
    "gets by. If the stature is unknown, the person grows with the distance and the cost hardly rises.",
)

# %% [markdown]
# 30 % of distance cost next to nothing, and 40 cm of stature. So measure the person, once: a stature known to
# 1 cm is one more residual, linear in the betas.

# %%
for name, of in (("unknown", of_images), ("known", of_tall)):
    ends, deviations, deep = [], [], []
    for one in real:
        height = float(stature(body, one.truth["betas"]))
        end = fit(of, one, learned(one, network))
        ends.append(in_space(end[0], one.truth))
        ray = matrix_from_vector(end[0]["camera/rotation"])[2]
        rows = end[2].problem.free.slices["trans"]
        covariance = end[2].problem.linearize(end[0]).covariance[rows, rows]
        deviations.append(1e3 * np.sqrt(ray @ covariance @ ray))
        deep.append(1e3 * ray @ (end[0]["trans"] - one.truth["trans"]))
    print(
        f"stature {name:7}: in space off by {np.mean(ends):.0f} mm; depth off by {np.sqrt(np.mean(np.square(deep))):.0f} mm, "
        f"root mean square; Laplace's standard deviation {np.mean(deviations):.0f} mm"
    )

# %% [markdown]
# ## Limbs in limbs
#
# Nothing so far keeps an arm out of the chest. SMPLify fills the body with spheres along capsules and adds
#
# $$ E_{sp} = \sum \exp\left( - \frac{\|C_i - C_j\|^2}{s_i^2 + s_j^2} \right), \qquad s_i = 0.3\, r_i , $$
#
# over pairs of spheres (the paper's formula lacks the minus sign; with it missing the energy grows with the
# distance). This library has the distance of two **capsules**, tubes with round ends, and the residual
# $\max(0, r_i + r_j - d_{ij})$: how deep they overlap.

# %%
source(apart)

# %%
capsules = capsules_of(body)
symbols = [block.symbol for block in body.blocks()]
tubes, radii = capsule_points(body, *symbols), capsules.radii_in(symbols[1])
TERMS = {
    "nothing": lambda: (),
    "spheres": lambda: (spheres(tubes, radii, capsules.pairs, sigma=0.03),),
    "capsules": lambda: (apart(tubes, radii, capsules.pairs, sigma=0.001),),
}


def deepest(values):
    """The deepest overlap of two capsules, mm."""
    return max(0.0, -1e3 * capsule_gaps(body, *(values[name] for name in NAMES)).min())


fits = [end[0] for end in found["learned", "made up"]]
worst = np.argsort([-deepest(values) for values in fits])[:2]
overlaps, kept = {}, {}
for name, term in TERMS.items():
    of = KeypointProblem(body, SIGMA, KERNEL, lambda body, term=term: (*image_priors(body), *term()))
    ends = [fit(of, people[i], fits[i], ROUGHLY) for i in worst]
    overlaps[name] = [deepest(end[0]) for end in ends]
    kept[name] = ends[0][0]
    said = ", ".join(f"{one:.0f}" for one in overlaps[name])
    print(f"{name:8}: deepest overlap {said} mm; in the image {missed(*ends[0][::2]):.1f} px off")

with house_style():
    figure, axes = sheet(11, 4, columns=3)
    apart_by = np.linspace(0, 0.12, 200)  # m, of two spheres with r = 0.05 m
    width = 0.3**2 * 2 * 0.05**2
    push = {
        "spheres": apart_by / width * np.exp(-(apart_by**2) / width),
        "capsules": np.maximum(0, 0.1 - apart_by),
    }
    for (name, force), dash in zip(push.items(), ("-", "--"), strict=True):
        axes[0].plot(1e3 * apart_by, force / force.max(), dash, label=name)
    axes[0].axvline(100, color="0.6", lw=0.8)
    axes[0].set(xlabel="distance of the axes (mm)", ylabel="push apart, over its largest")
    axes[0].legend(fontsize=8)
    for ax, name in zip(axes[1:], ("nothing", "capsules"), strict=True):
        setup = keypoint_setup(of_images, people[worst[0]].observed, "")
        draw_in_image(body, setup.views[0], kept[name], ax=ax)
        ax.set_title(f"{name}: {overlaps[name][0]:.0f} mm deep")
Picture(
    figure,
    "Left: how hard two parts with radii of 5 cm are pushed apart; they touch at the thin line. Spheres push only "
    "when the axes are near, and not at all where they meet. Middle and right: one fit without and with capsules.",
)

# %% [markdown]
# (An honest word: these made-up people overlap themselves, because nobody told the mixture about skin, so the term does not bring
# them nearer to their truth.)
#
# ## Regressors in the loop
#
# A network gives starts to fits. And fits give a network what it needs to learn from: pairs of keypoints and
# poses. SPIN closes the loop. For every image it keeps the best fit that it has ever had, the one with the lowest
# cost. In each round the network says where to begin, the fits run, a fit that is better replaces the one
# that was kept, and the network learns from those that are kept.
#
# We do this in the small and **without any truth**: all that is given are the keypoints of our made-up people. The
# first fits are those that began at rest, among which many had failed. The regressor has one layer of random
# features that is never trained, so that learning is one linear least-squares problem. It learns from each kept
# body as seen by a hundred random cameras.

# %%
rows = [landmarks.index(name) for name in COCO]
lengths = radian_lengths(body)  # (24,) m: what a radian of each joint counts


def taught(poses, rng, each=80, hidden=300):
    """A regressor that has learned from these poses (n, 24, 3), each seen by several cameras."""
    upright = poses.copy()
    upright[:, 0] = 0
    seen = people_in(body, np.repeat(upright, each, axis=0), rng)
    R = draw_facings(len(seen.poses), rng)
    rays, confidence = draw_views(seen.landmarks[:, rows], R, COCO, rng)
    x, to_virtual = normalised(rays, confidence)
    x = x.reshape(len(R), -1)
    W, b = rng.standard_normal((x.shape[1], hidden)) / np.sqrt(8), 0.5 * rng.standard_normal(hidden)
    H = np.column_stack([np.maximum(x @ W + b, 0), np.ones(len(R))])  # the features
    mean = upright.mean(axis=0)
    joints = ((seen.poses - mean) * lengths[:, None])[:, 1:].reshape(len(R), -1)
    facing = lengths[0] * (to_virtual @ R)[..., :2].reshape(len(R), 6)
    B = np.linalg.solve(H.T @ H + 10 * np.eye(hidden + 1), H.T @ np.hstack([facing, joints]))
    return PoseRegressor(COCO, body.joint_names, (W, B[:-1]), (b, B[-1]), mean, lengths)


kept_fits = [(end[0], end[1].cost) for end in found["rest", "made up"]]
rounds = []
for k in range(3):
    off = np.array([mpjpe(v, one.truth) for (v, _), one in zip(kept_fits, people, strict=True)])
    price = np.mean([c for _, c in kept_fits])
    rounds.append((off.mean(), price))
    print(f"round {k}: kept fits off by {off.mean():.0f} mm, {(off > 150).sum()} above 150 mm; mean cost {price:.1f}")
    if k == 2:
        break
    regressor = taught(np.array([v["pose"] for v, _ in kept_fits]), np.random.default_rng(k))
    for i, one in enumerate(people):
        values, solution, _ = fit(of_images, one, learned(one, regressor))
        if solution.cost < kept_fits[i][1]:
            kept_fits[i] = values, solution.cost
alone_now = np.mean([mpjpe(learned(one, regressor), one.truth) for one in people])
print(f"the last regressor alone: {alone_now:.0f} mm")
