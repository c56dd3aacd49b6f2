"""What keypoints tell of a real person's pose and shape: emcee, with one camera and with two.

The person on the beam of `04_a_real_person` is seen by one camera, and by two. Free are the place,
the turn of the pelvis, the pose as 24 principal components of the pose prior (as in MANO: Romero
et al., Embodied Hands, 2017), and all ten betas; nothing is held fixed. The pose blend shapes,
which would move these keypoints by a few millimetres, are left out, because the chains are long.
A chain is judged before its numbers are read. To one camera, a tall person far away looks like a
short one nearby; a second camera tells them apart.
"""

from pathlib import Path

import casadi as cs
import numpy as np

import workbench as wb
from workbench.bodies.ablations import without_pose_blend_shapes
from workbench.experiments.balance import observations
from workbench.fitting.body_priors import shape_prior
from workbench.fitting.keypoints import camera_residual, keypoint_fit
from workbench.priors.poses import shipped_gaussian
from workbench.residuals.kernels import quadratic

SIGMA = 4.0  # px
COMPONENTS = 24  # of the 69 of the prior
STEPS = {1: 20_000, 2: 14_000}  # at most, for as many cameras; a chain ends when it is usable
CAMERAS = ("cam01", "cam02", "cam03", "cam04")

whole = wb.load_body("small")
body = without_pose_blend_shapes(whole)
joint = {name: k for k, name in enumerate(body.joint_names)}
prior = shipped_gaussian()
variances, axes = np.linalg.eigh(prior.covariance)
share = variances[-COMPONENTS:].sum() / variances.sum()
spread = axes[:, -COMPONENTS:] * np.sqrt(variances[-COMPONENTS:])  # (69, 24) rad

# the same keypoints as in `balance`, with the pose made of components
root = wb.Block("root", (1, 3), "rad", ("pelvis",))
components = wb.Block("components", (COMPONENTS,))
_, betas, trans = body.blocks()
others = cs.reshape(cs.DM(prior.mean) + cs.DM(spread) @ components.symbol, 3, 23)
landmarks = body.landmark_names("coco")
points = body.landmark_points("coco", cs.horzcat(root.symbol, others), betas.symbol, trans.symbol)
standard = wb.residuals.gaussian(components.symbol, covariance=1.0, name="pose prior")


def fitted(count: int) -> tuple[wb.Problem, wb.Values]:
    """The problem with the first `count` cameras, and its least-squares answer."""
    placed = keypoint_fit(observations()[0], body, "its start", held_out=CAMERAS[count:]).start
    cameras = [wb.Camera(f"{name}/") for name in CAMERAS[:count]]
    seen = [camera_residual(points, one, landmarks, SIGMA, quadratic)[0] for one in cameras]
    blocks = [root, components, *(block for one in cameras for block in one.blocks)]
    free = ["trans", "root", "components", "betas"]
    problem = wb.Problem([*seen, standard, shape_prior(body)], free, blocks=blocks)
    start = placed | {"root": placed["pose"][:1], "components": np.zeros(COMPONENTS)}
    return problem, start | wb.solve(problem, start).values


def pose_of(values: wb.Values) -> np.ndarray:
    """The pose (24, 3) rad of a draw."""
    below = prior.mean + spread @ values["components"]
    return np.vstack([values["root"], below.reshape(23, 3)])


NAMED = ("distance from camera 1 (m)", "height (m)", "left elbow's bend (deg)", "betas[0] (sd)")
LIMB = ("shoulder", "elbow", "wrist")


def named(values: wb.Values) -> list[float]:
    """The numbers of NAMED."""
    places = body.joints(pose_of(values), values["betas"], values["trans"])
    distance = wb.Camera("cam01/").depths(places[:1], values)[0]  # of the pelvis
    shoulder, elbow, wrist = (places[joint[f"left_{name}"]] for name in LIMB)
    upper, fore = elbow - shoulder, wrist - elbow
    bend = np.arccos(upper @ fore / np.linalg.norm(upper) / np.linalg.norm(fore))
    height = np.ptp(body.vertices(betas=values["betas"])[:, 1])
    return [distance, height, np.degrees(bend), values["betas"][0]]


posteriors, numbers, errors = {}, {}, {}
for count, name in ((1, "one camera"), (2, "two cameras")):
    problem, answer = fitted(count)
    posteriors[name] = wb.sample(problem, answer, steps=STEPS[count], seed=0)
    numbers[name] = np.array([named(draw) for draw in posteriors[name].values(3000)])  # (3000, 4)
everything, four = fitted(4)
reference = np.array(named(four))
sds = {name: some.std(axis=0) for name, some in numbers.items()}
intervals = {name: np.quantile(some, [0.05, 0.95], axis=0).T for name, some in numbers.items()}
together = np.corrcoef(numbers["one camera"].T)[0, 1]  # of distance and height
shifts = body.landmark("coco", pose_of(four), four["betas"], four["trans"])
shifts = shifts - whole.landmark("coco", pose_of(four), four["betas"], four["trans"])
shift = 1e3 * np.linalg.norm(shifts, axis=1).mean()  # mm, by the pose blend shapes

if __name__ == "__main__":
    import corner
    from matplotlib.figure import Figure

    from workbench.plots import house_style, png
    from workbench.plots.palette import BLUE, VERMILLION

    print(f"{COMPONENTS} components hold {share:.0%} of the prior's variance")
    print(f"pose blend shapes would move the keypoints by {shift:.1f} mm on average")
    for name, posterior in posteriors.items():
        mixing = posterior.mixing
        print(f"\n{name}: {posterior.verdict}")
        print(
            f"  {mixing.steps} steps after {mixing.discarded}, the longest autocorrelation time "
            f"{mixing.times.max():.0f} steps, the largest R-hat {mixing.scales.max():.4f}, "
            f"{posterior.seconds:.0f} s"
        )
        for what, sd, (low, high), other in zip(
            NAMED, sds[name], intervals[name], reference, strict=True
        ):
            print(
                f"  {what:28} sd {sd:7.3f}, 90 % from {low:7.3f} to {high:7.3f}; "
                f"four cameras {other:7.3f}"
            )
    low, high = np.quantile(numbers["one camera"], [0.005, 0.995], axis=0)
    with house_style():
        figure = Figure(figsize=(8, 8))
        for colour, bins, some in zip((BLUE, VERMILLION), (25, 60), numbers.values(), strict=True):
            corner.corner(
                some,
                bins=bins,
                fig=figure,
                labels=[text.replace(" (", "\n(") for text in NAMED],
                color=colour,
                range=list(zip(low, high, strict=True)),
                smooth=1.0,
                plot_datapoints=False,
                plot_density=False,
                no_fill_contours=True,
                hist_kwargs={"density": True},
            )
        for column in range(4):  # the second histogram is the higher one
            figure.axes[5 * column].relim()
            figure.axes[5 * column].autoscale(axis="y")
        corner.overplot_lines(figure, reference, color="black", lw=0.8)
        for height, (colour, name) in enumerate(zip((BLUE, VERMILLION), numbers, strict=True)):
            figure.text(0.7, 0.9 - 0.04 * height, name, color=colour)
        figure.text(0.7, 0.82, "black: fit to four cameras")
    Path(__file__).with_name("one_camera_and_two.png").write_bytes(png(figure))
    print(f"with one camera, distance and height have a correlation of {together:.2f}")
    print("Each number alone, and in pairs, with contours that hold 12, 39, 68 and 86 % of the")
    print(
        "draws, slightly smoothed. With one camera, distance, height and betas[0] lie near a line."
    )
    print("A second camera narrows all four, the first two by much and the elbow by little.")
