"""Hands that nothing was learned from: other people, other poses, and the teacher's deformation."""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array
from scipy.spatial.transform import Rotation

from builder.base_mesh import read_base_mesh
from builder.hands.mesh import PARENTS, read_hand
from builder.hands.sets import HandPoses, HandTeacher, draw_hands
from builder.population import read_shape_targets
from builder.wheel import Wheel
from workbench.arrays import Array
from workbench.bodies import HAND_POINTS, SkinnedBody
from workbench.bodies.forward.posing import Posing
from workbench.fitting.hands import points_of
from workbench.synthetic import Holes, Noise, SimulatedScan, scan, scanners
from workbench.synthetic.teacher import joint_positions

PLACE = 0.3  # m along each axis
DISTANCE, DEPTH_NOISE = 0.4, 0.0005  # m, of the scanners and of their depths
HOLES = Holes(2, 0.01)


@dataclass(frozen=True, eq=False)
class Stranger:
    """One synthetic hand.

    Attributes:
        vertices: (778, 3) m, the true surface.
        points: (21, 3) m, the true joints and finger tips, in the order of `HAND_POINTS`.
    """

    vertices: Array
    points: Array


def of_the_model(body: SkinnedBody, count: int, seed: int) -> tuple[Stranger, ...]:
    """Hands of the body itself: betas from N(0, 1), and angles drawn as those of training were."""
    rng = np.random.default_rng(seed)
    poses = HandPoses(body.joints(), body.landmark("tips")).draw(count, rng)
    poses[:, 0] = Rotation.random(count, random_state=rng).as_rotvec()
    names = [block.name for block in body.blocks()]
    found = []
    for pose in poses:
        at = pose, rng.standard_normal(body.n_betas), PLACE * rng.standard_normal(3)
        values = dict(zip(names, at, strict=True))
        found.append(Stranger(body.vertices(*at), points_of(body, values)))
    return tuple(found)


def strangers(wheel: Wheel, body: SkinnedBody, count: int, seed: int) -> tuple[Stranger, ...]:
    """Hands of people drawn anew from the artists' shape targets, posed by the teacher."""
    mesh = read_base_mesh(wheel)
    own = read_hand(wheel, mesh)
    targets = read_shape_targets(wheel, len(mesh.vertices))
    people = draw_hands(mesh, own, targets, count, seed, lambda text: None)
    rng = np.random.default_rng((seed, 1))
    poses = HandPoses(people.joints.mean(axis=0), people.ends.mean(axis=0)).draw(count, rng)
    poses[:, 0] = Rotation.random(count, random_state=rng).as_rotvec()
    tips = body.landmarks["tips"]
    names = [*body.joint_names, *tips.names]
    order = [names.index(name) for name in HAND_POINTS]
    found = []
    for rest, joints, pose in zip(people.vertices, people.joints, poses, strict=True):
        shift = PLACE * rng.standard_normal(3)
        posed = HandTeacher(rest, joints, csr_array(own.weights)).vertices(pose) + shift
        at = joint_positions(Posing.of(pose[None], PARENTS).world[0], joints, PARENTS) + shift
        points = np.concatenate([at, tips.regressor @ posed])[order]
        found.append(Stranger(posed, points))
    return tuple(found)


def noisy(points: Array, sigma: float, seed: int | tuple[int, ...]) -> Array:
    """Points with errors of `sigma` m along each axis."""
    return np.asarray(points + sigma * np.random.default_rng(seed).standard_normal(points.shape))


def scanned(body: SkinnedBody, hand: Stranger, seed: int, views: int) -> SimulatedScan:
    """A scan by depth cameras that stand around a hand at 40 cm, with 0.5 mm of noise and holes."""
    around = scanners(views, distance=DISTANCE, target=hand.vertices.mean(axis=0))
    return scan(
        hand.vertices,
        body.faces,
        around,
        seed=seed,
        noise=Noise(growth=0.0, floor=DEPTH_NOISE, grazing=0.0),
        holes=HOLES,
    )
