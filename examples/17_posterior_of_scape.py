"""What 24 joints tell of pose and shape if the body is SCAPE: emcee over theta and beta.

A synthetic person of `small-scape` is seen as the joints in space, each known to 10 mm. Free are
the place, the turn of the pelvis, the pose as 12 principal components of the pose prior, and all
ten betas; nothing is held fixed. SCAPE has no bones; its joints are means of vertices of the
stitched surface. The chain of nearly two million evaluations is short enough because such a mean
is a sum over the body's parts, for which no surface has to be stitched. The chain is judged
before its numbers are read, and compared with Laplace's approximation and with the prior.
"""

from pathlib import Path

import casadi as cs
import numpy as np

import workbench as wb
from workbench.fitting.body_priors import shape_prior
from workbench.geometry.solids import volume
from workbench.priors.poses import shipped_gaussian

SIGMA = 0.01  # m
COMPONENTS = 12  # of the 69 of the prior
STEPS = 6000  # at most; the chain ends when it is usable
SEED = 3

body = wb.load_body("small-scape")
prior = shipped_gaussian()
variances, axes = np.linalg.eigh(prior.covariance)
share = variances[-COMPONENTS:].sum() / variances.sum()
spread = axes[:, -COMPONENTS:] * np.sqrt(variances[-COMPONENTS:])  # (69, 12) rad

root = wb.Block("root", (1, 3), "rad", ("pelvis",))
components = wb.Block("components", (COMPONENTS,))
_, betas, trans = body.blocks()
others = cs.reshape(cs.DM(prior.mean) + cs.DM(spread) @ components.symbol, 3, 23)
points = body.joint_points(cs.horzcat(root.symbol, others), betas.symbol, trans.symbol)


def pose_of(values: wb.Values) -> np.ndarray:
    """The pose (24, 3) rad of a draw."""
    below = prior.mean + spread @ values["components"]
    return np.vstack([values["root"], below.reshape(23, 3)])


rng = np.random.default_rng(SEED)
truth = {
    "root": 0.3 * rng.standard_normal((1, 3)),
    "components": rng.standard_normal(COMPONENTS),
    "betas": rng.standard_normal(body.n_betas),
    "trans": 0.2 * rng.standard_normal(3),
}
joints = body.joints(pose_of(truth), truth["betas"], truth["trans"])
observed = joints + SIGMA * rng.standard_normal(joints.shape)
problem = wb.Problem(
    [
        wb.residuals.vertices(points, observed, sigma=SIGMA, name="joints"),
        wb.residuals.gaussian(components.symbol, covariance=1.0, name="pose prior"),
        shape_prior(body),
    ],
    ["trans", "root", "components", "betas"],
    blocks=[root, components],
)
start = {block.name: np.zeros(block.shape) for block in (root, components, betas, trans)}
answer = wb.solve(problem, start).values
posterior = wb.sample(problem, answer, steps=STEPS, seed=0)
approximation = wb.laplace(problem, answer, seed=0)

NAMED = ("height (m)", "volume (l)", "left elbow's bend (deg)", "betas[0] (sd)", "betas[1] (sd)")
place = {name: k for k, name in enumerate(body.joint_names)}


def named(values: wb.Values) -> list[float]:
    """The numbers of NAMED."""
    rest = body.vertices(betas=values["betas"])
    places = body.joints(pose_of(values), values["betas"], values["trans"])
    shoulder, elbow, wrist = (places[place[f"left_{n}"]] for n in ("shoulder", "elbow", "wrist"))
    upper, fore = elbow - shoulder, wrist - elbow
    bend = np.arccos(upper @ fore / np.linalg.norm(upper) / np.linalg.norm(fore))
    litres = 1e3 * volume(rest, body.faces)
    return [float(np.ptp(rest[:, 1])), litres, np.degrees(bend), *values["betas"][:2]]


DRAWS = 1500
numbers = np.array([named(draw) for draw in posterior.values(DRAWS)])
by_prior = np.array(
    [
        named(truth | {"components": rng.standard_normal(12), "betas": rng.standard_normal(10)})
        for _ in range(DRAWS)
    ]
)
reference = np.array(named(truth))
narrower = by_prior.std(axis=0) / numbers.std(axis=0)
off = posterior.coordinates(truth) - posterior.mean
distance = float(off @ np.linalg.solve(posterior.covariance, off))  # chi^2 of 28 degrees of freedom

if __name__ == "__main__":
    import corner
    from matplotlib.figure import Figure

    from workbench.plots import house_style, png
    from workbench.plots.palette import BLUE

    mixing = posterior.mixing
    print(f"{COMPONENTS} components hold {share:.0%} of the pose prior's variance")
    print(posterior.verdict)
    print(
        f"{mixing.steps} steps after {mixing.discarded}, the "
        f"longest autocorrelation time {mixing.times.max():.0f} steps, the largest R-hat "
        f"{mixing.scales.max():.4f}, {posterior.seconds:.0f} s"
    )
    print(f"Laplace's approximation: {approximation.verdict}")
    for what, some, ratio, true in zip(NAMED, numbers.T, narrower, reference, strict=True):
        low, high = np.quantile(some, [0.05, 0.95])
        print(
            f"  {what:24} sd {some.std():6.3f}, {ratio:4.1f} times narrower than the prior; 90 % "
            f"from {low:7.3f} to {high:7.3f}; truth {true:7.3f}"
        )
    print(
        f"the synthetic person is {distance:.0f} away in squared standard deviations, where "
        f"{posterior.size} are expected"
    )
    with house_style():
        figure = Figure(figsize=(9, 9))
        corner.corner(
            numbers,
            bins=25,
            fig=figure,
            labels=[text.replace(" (", "\n(") for text in NAMED],
            color=BLUE,
            truths=list(reference),
            truth_color="black",
            smooth=1.0,
            plot_datapoints=False,
            plot_density=False,
            no_fill_contours=True,
        )
        figure.subplots_adjust(left=0.13, bottom=0.13)
    Path(__file__).with_name("posterior_of_scape.png").write_bytes(png(figure))
    print("Each number alone, and in pairs, with contours that hold 12, 39, 68 and 86 % of the")
    print("draws, slightly smoothed; black: the synthetic person. The joints tell the height to")
    print("about a centimetre, and the volume, which no joint sees, to about five litres.")
