"""A hand from 21 points: 16 joints and 5 finger tips, which are vertices of the skin.

Hand, shape and pose are drawn from the embedded hand and its synthetic pose space; no hand was
measured for either. The pose is an affine map of a few coefficients, so that a body takes it
wherever it takes a pose, and joints and tips are one set of points with one residual. The left hand
is the right one in a mirror.
"""

import numpy as np
from scipy.spatial.transform import Rotation

import workbench as wb
from workbench.blocks import Block
from workbench.bodies import HAND_POINTS, hand_points, pose_space
from workbench.geometry.mirror import AXIAL, REFLECTION
from workbench.residuals import gaussian, landmarks

NOISE = 0.002  # m
hand, left = wb.load_body("hand"), wb.load_body("hand-left")
space = pose_space(hand, 15)

# What is unknown: coefficients of the pose, the turn of the wrist, shape and place.
coefficients, wrist = space.block(), Block("wrist", (1, 3), "rad", ("wrist",))
betas, trans = hand.blocks()[1:]
pose = space.pose(hand, coefficients.symbol, wrist.symbol)
points = hand_points(hand, pose, betas.symbol, trans.symbol)
observed = Block("observed", (21, 3), "m", HAND_POINTS)
problem = wb.Problem(
    [
        landmarks(points, observed.symbol, sigma=NOISE),
        gaussian(coefficients.symbol, covariance=space.deviations**2, name="likely poses"),
        gaussian(betas.symbol, name="likely shapes"),
    ],
    free=["coefficients", "wrist", "betas", "trans"],
    blocks=[coefficients, wrist, observed],
)


def at(values: wb.Values) -> np.ndarray:
    """The 21 points (21, 3) m at values of the unknowns."""
    numeric = points.source.numeric
    assert numeric is not None
    return numeric.evaluate(values).points


def skin(values: wb.Values) -> np.ndarray:
    """The posed surface (778, 3) m."""
    whole = space.poses(hand, values["coefficients"])
    whole[0] = values["wrist"][0]
    return hand.vertices(whole, values["betas"], values["trans"])


def start(seen: np.ndarray) -> wb.Values:
    """The mean hand in the mean pose, turned and moved onto 21 points."""
    mean = {"coefficients": np.zeros(15), "wrist": np.zeros((1, 3)), "betas": np.zeros(10)}
    own = at(mean | {"trans": np.zeros(3)})
    turn, _ = Rotation.align_vectors(seen - seen.mean(axis=0), own - own.mean(axis=0))
    place = seen.mean(axis=0) - turn.apply(own.mean(axis=0))  # the wrist, which is the origin
    return mean | {"wrist": turn.as_rotvec()[None], "trans": place, "observed": seen}


rng = np.random.default_rng(0)
medians, solutions = [], []
for _ in range(10):
    truth = {
        "coefficients": space.deviations * rng.standard_normal(15),
        "wrist": Rotation.random(random_state=rng).as_rotvec()[None],
        "betas": rng.standard_normal(10),
        "trans": rng.standard_normal(3),
    }
    seen = at(truth) + NOISE * rng.standard_normal((21, 3))
    solutions.append(wb.solve(problem, start(seen)))
    errors = 1e3 * np.linalg.norm(skin(solutions[-1].values) - skin(truth), axis=1)
    medians.append(float(np.median(errors)))
    print(f"median error of a vertex {medians[-1]:.1f} mm, largest {errors.max():.1f} mm")

# The same hand on the left: rotation vectors keep x and turn y and z, positions turn x.
values = solutions[-1].values
turned = space.poses(hand, values["coefficients"])
turned[0] = values["wrist"][0]
mirrored = left.vertices(turned * AXIAL, values["betas"], values["trans"] * REFLECTION)
apart = float(abs(mirrored * REFLECTION - skin(values)).max())
print(f"the left hand is the right one in a mirror to {apart:.0e} m")
