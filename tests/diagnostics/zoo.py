"""Problems of many fields whose null directions are known from geometry or algebra.

What is seen is irrelevant to rank: the residual is the expression itself. `gauges` counts the null
directions of each kind that have a name of their own, and trade-offs of single numbers, where they
were predicted; the others are combinations of entries or motions of joints. `numbers` is the least
count of numbers that have to be held, and `acts` how many things a user has to hold for that: a
camera, or a row, is one thing. `says` are words that the names of the directions have in them.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from itertools import combinations

import casadi as cs
import numpy as np

from tests.bodies_made_up import smpl_like_body
from workbench import Block, Constraint, Problem, Residual, Values, residuals
from workbench.geometry.camera import Camera

PLANE = {"translation": 2, "rotation": 1}
RIGID = {"translation": 3, "rotation": 3}
SIMILARITY = RIGID | {"scale": 1}


@dataclass(frozen=True, eq=False)
class Specimen:
    """A problem with what is known about it."""

    build: Callable[[], tuple[Problem, Values]]
    gauges: dict[str, int]
    numbers: int
    acts: int
    says: str = ""

    @property
    def name(self) -> str:
        return self.build.__name__


def turned(turn: cs.MX, X: cs.MX) -> cs.MX:
    """Points (3, N) turned by a rotation vector (3, 1) that is not zero."""
    angle = cs.norm_2(turn)
    K = cs.skew(turn / angle)
    R = cs.MX.eye(3) + cs.sin(angle) * K + (1 - cs.cos(angle)) * K @ K
    return R @ X


def pixels(X: cs.MX, focal: float | cs.MX = 800.0) -> cs.MX:
    return focal * cs.vec(X[:2, :] / cs.repmat(X[2, :], 2, 1))


def problem_of(seen: list[Residual], *blocks: Block) -> Problem:
    """A problem whose unknowns are all of these blocks."""
    return Problem(seen, [block.name for block in blocks], blocks=blocks)


def observed(name: str, expression: cs.MX, sigma: float, unit: str) -> Residual:
    return Residual(name, cs.vec(expression), sigma, unit)


def all_of(rows: list[cs.MX], sigma: float = 0.01, unit: str = "1") -> list[Residual]:
    """One residual of all these rows."""
    return [observed("seen", cs.vertcat(*rows), sigma, unit)]


def beside(column: cs.MX, count: int) -> cs.MX:
    """A column, as many times side by side."""
    return cs.repmat(column, 1, count)


def numbers(**values: float) -> tuple[dict[str, cs.MX], list[Block], Values]:
    """Symbols, blocks and values of single numbers."""
    blocks = [Block(name, ()) for name in values]
    return (
        {b.name: b.symbol for b in blocks},
        blocks,
        {name: np.array(value) for name, value in values.items()},
    )


def simulated(
    slope: Callable[[cs.MX], cs.MX], start: cs.MX, step: float, count: int
) -> list[cs.MX]:
    """The states of x' = slope(x) by Runge and Kutta's method of fourth order."""
    states, x = [], start
    for _ in range(count):
        a = slope(x)
        b = slope(x + step / 2 * a)
        c = slope(x + step / 2 * b)
        d = slope(x + step * c)
        x = x + step / 6 * (a + 2 * b + 2 * c + d)
        states.append(x)
    return states


def three_cameras() -> tuple[Problem, Values]:
    """Bundle adjustment: points and the poses of cameras of known focal lengths."""
    rng = np.random.default_rng(3)
    X = Block("points", (20, 3), "m")
    seen, blocks, at = [], [X], {"points": rng.normal(size=(20, 3))}
    for k in range(3):
        turn, place = Block(f"cam{k}_turn", (3,), "rad"), Block(f"cam{k}_place", (3,), "m")
        blocks += [turn, place]
        at[turn.name] = rng.normal(scale=0.3, size=3)
        at[place.name] = np.array([0.0, 0.0, 6.0]) + rng.normal(size=3)
        there = turned(turn.symbol, X.symbol) + beside(place.symbol, 20)
        seen.append(observed(f"image {k}", pixels(there), 1.0, "px"))
    return problem_of(seen, *blocks), at


def affine_cameras() -> tuple[Problem, Values]:
    """Images A X + b of three cameras (Tomasi and Kanade): any affine map of the points cancels.

    Of its 12 numbers 3 shift the points, 3 turn and one scales them; 5 stretch or shear. Holding
    camera 0 leaves what moves points along its line of sight, 4 numbers: a row of another A, and
    one entry of its b.
    """
    rng = np.random.default_rng(45)
    X = Block("points", (12, 3), "m")
    blocks, at, seen = [X], {"points": rng.normal(size=(12, 3))}, []
    for k in range(3):
        A, b = Block(f"cam{k}_A", (2, 3), "px/m"), Block(f"cam{k}_b", (2,), "px")
        blocks += [A, b]
        at[A.name], at[b.name] = 100 * rng.normal(size=(2, 3)), 100 * rng.normal(size=2)
        image = A.symbol.T @ X.symbol + beside(b.symbol, 12)
        seen.append(observed(f"image {k}", image, 1.0, "px"))
    return problem_of(seen, *blocks), at


def body_and_camera() -> tuple[Problem, Values]:
    """A body of fixed pose, whose root, place and camera are free: they move together."""
    rng = np.random.default_rng(2)
    body = smpl_like_body()
    camera = Camera("camera/")
    observed, confidence = Block("observed", (24, 2), "px"), Block("confidence", (24,))
    joints = body.joint_points(*(block.symbol for block in body.blocks()))
    seen = residuals.keypoints(joints, camera, observed.symbol, confidence.symbol, sigma=1.0)
    at = body.start() | camera.values(K=[[1000, 0, 500], [0, 1000, 500], [0, 0, 1]])
    at |= {
        "pose": rng.normal(scale=0.3, size=(24, 3)),
        "camera/rotation": np.array([0.1, 0.2, -0.1]),
        "camera/translation": np.array([0.1, 0.0, 4.0]),
        "observed": np.zeros((24, 2)),
        "confidence": np.ones(24),
    }
    names = ("pose[pelvis]", "trans", "camera/rotation", "camera/translation")
    return Problem((seen,), names), at


def joints_of_a_body() -> tuple[Problem, Values]:
    """The pose of a body from its joints: rank 40 of 72."""
    body = smpl_like_body()
    observed = Block("observed", (24, 3), "m")
    joints = body.joint_points(*(block.symbol for block in body.blocks()))
    pose = np.random.default_rng(1).normal(scale=0.4, size=(24, 3))
    found = residuals.landmarks(joints, observed.symbol, sigma=0.01)
    return Problem((found,), ("pose",)), body.start() | {
        "pose": pose,
        "observed": np.zeros((24, 3)),
    }


def people_of_one_shape() -> tuple[Problem, Values]:
    """Training: every person is the template times a size."""
    rng = np.random.default_rng(208)
    template, size = Block("template", (6, 3), "m"), Block("size", (4,))
    people = cs.vec(template.symbol) @ size.symbol.T
    return problem_of([observed("people", people, 0.01, "m")], template, size), {
        "template": rng.normal(size=(6, 3)),
        "size": rng.uniform(0.8, 1.2, size=4),
    }


def planar_arm() -> tuple[Problem, Values]:
    """The base may turn, and so may the first joint: only their sum is seen."""
    rng = np.random.default_rng(0)
    base, angle = Block("base", (2,), "m"), Block("base_angle", (), "rad")
    offset, length = Block("offset", (3,), "rad"), Block("length", (3,), "m")
    tips = []
    for q in rng.uniform(-1.5, 1.5, size=(12, 3)):
        place, heading = base.symbol, angle.symbol
        for k in range(3):
            heading = heading + q[k] + offset.symbol[k]
            place = place + length.symbol[k] * cs.vertcat(cs.cos(heading), cs.sin(heading))
        tips.append(place)
    return problem_of(all_of(tips, 0.001, "m"), base, angle, offset, length), {
        "base": np.array([0.1, 0.2]),
        "base_angle": np.array(0.3),
        "offset": np.array([0.02, -0.01, 0.03]),
        "length": np.array([0.5, 0.4, 0.3]),
    }


def _distances(X: cs.MX, pairs: Iterable[tuple[int, int]]) -> Residual:
    apart = [cs.norm_2(X[:, i] - X[:, j]) for i, j in pairs]
    return observed("distances", cs.vertcat(*apart), 0.01, "m")


def two_networks_in_the_plane() -> tuple[Problem, Values]:
    """Distances among five points each, and none between the two halves."""
    X = Block("points", (10, 2), "m")
    pairs = [(i, j) for i, j in combinations(range(10), 2) if i // 5 == j // 5]
    at = {"points": np.random.default_rng(10).normal(size=(10, 2))}
    return problem_of([_distances(X.symbol, pairs)], X), at


def anchored_network() -> tuple[Problem, Values]:
    """A constraint holds one point: what remains are the rotations about it."""
    X = Block("points", (6, 3), "m")
    seen = (_distances(X.symbol, combinations(range(6), 2)),)
    at = np.random.default_rng(6).normal(size=(6, 3))
    at[0] = 0.5
    anchor = Constraint("anchor", X.symbol[:, 0], 0.5, 0.5, "m")
    return Problem(seen, ("points",), blocks=(X,), constraints=[anchor]), {"points": at}


def bearings_of_robots() -> tuple[Problem, Values]:
    """Four robots of unknown heading see the bearings of eight landmarks in the plane."""
    rng = np.random.default_rng(52)
    place, heading = Block("robot_place", (4, 2), "m"), Block("robot_heading", (4,), "rad")
    marks = Block("landmarks", (8, 2), "m")
    bearings = []
    for k in range(4):
        for j in range(8):
            way = marks.symbol[:, j] - place.symbol[:, k]
            c, s = cs.cos(heading.symbol[k]), cs.sin(heading.symbol[k])
            bearings.append(cs.atan2(c * way[1] - s * way[0], c * way[0] + s * way[1]))
    found = observed("bearings", cs.vertcat(*bearings), 0.01, "rad")
    return problem_of([found], place, heading, marks), {
        "robot_place": rng.normal(scale=3.0, size=(4, 2)),
        "robot_heading": rng.normal(size=4),
        "landmarks": rng.normal(size=(8, 2)),
    }


def relative_turns() -> tuple[Problem, Values]:
    """Five turns, as rows of one array, each seen from two others."""
    rng = np.random.default_rng(214)
    turns = Block("turns", (5, 3), "rad")
    R = [turned(turns.symbol[:, k], cs.MX.eye(3)) for k in range(5)]
    ties = [(0, 1), (1, 2), (2, 3), (3, 4), (4, 0), (1, 3)]
    rows = [cs.vec(R[i].T @ R[j]) for i, j in ties]
    return problem_of(all_of(rows), turns), {"turns": rng.normal(scale=0.6, size=(5, 3))}


def clocks_that_drift() -> tuple[Problem, Values]:
    """Differences of five clocks at four times: neither the time nor its rate is known."""
    rng = np.random.default_rng(55)
    offset, drift = Block("offset", (5,), "s"), Block("drift", (5,), "s/h")
    apart = []
    for t in (0.0, 1.0, 2.5, 4.0):
        for i, j in [(0, 1), (1, 2), (2, 3), (3, 4), (4, 0)]:
            reading_i = offset.symbol[i] + t * drift.symbol[i]
            apart.append(reading_i - offset.symbol[j] - t * drift.symbol[j])
    found = observed("differences", cs.vertcat(*apart), 0.1, "s")
    return problem_of([found], offset, drift), {
        "offset": rng.normal(size=5),
        "drift": rng.normal(scale=0.1, size=5),
    }


def difficulty_and_ability() -> tuple[Problem, Values]:
    """Answers a_j (theta_i - b_j): abilities and difficulties have no origin and no unit."""
    rng = np.random.default_rng(58)
    theta, a, b = Block("ability", (6,)), Block("slope", (5,)), Block("difficulty", (5,))
    table = [a.symbol[j] * (theta.symbol[i] - b.symbol[j]) for i in range(6) for j in range(5)]
    found = observed("answers", cs.vertcat(*table), 0.1, "1")
    return problem_of([found], theta, a, b), {
        "ability": rng.normal(size=6),
        "slope": rng.uniform(0.5, 2.0, size=5),
        "difficulty": rng.normal(size=5),
    }


def photometric_stereo() -> tuple[Problem, Values]:
    """Shades are products of scaled normals and lights: any 3 x 3 matrix between them cancels."""
    rng = np.random.default_rng(110)
    normals, lights = Block("normals", (11, 3)), Block("lights", (5, 3))
    seen = [observed("shades", lights.symbol.T @ normals.symbol, 0.01, "1")]
    return problem_of(seen, normals, lights), {
        block.name: rng.normal(size=block.shape) for block in (normals, lights)
    }


def three_ways_of_a_table() -> tuple[Problem, Values]:
    """sum_k a_ik b_jk c_lk: of each of two terms two factors cancel (Harshman; Kruskal)."""
    rng = np.random.default_rng(217)
    a, b, c = Block("a", (5, 2)), Block("b", (4, 2)), Block("c", (3, 2))
    rows = [
        cs.dot(a.symbol[:, i] * b.symbol[:, j], c.symbol[:, n])
        for i in range(5)
        for j in range(4)
        for n in range(3)
    ]
    return problem_of(all_of(rows), a, b, c), {x.name: rng.normal(size=x.shape) for x in (a, b, c)}


def _network(unit: Callable[[cs.MX], cs.MX]) -> tuple[Problem, Values]:
    rng = np.random.default_rng(3)
    first, second = Block("first", (2, 4)), Block("second", (3, 2))
    x = cs.DM(rng.normal(size=(4, 30)))
    out = second.symbol.T @ unit(first.symbol.T @ x)
    at = {"first": rng.normal(size=(2, 4)), "second": rng.normal(size=(3, 2))}
    return problem_of([observed("outputs", out, 0.1, "1")], first, second), at


def linear_network() -> tuple[Problem, Values]:
    """Two layers without a nonlinearity: any invertible 2 x 2 matrix between them cancels."""
    return _network(lambda hidden: hidden)


def rectified_network() -> tuple[Problem, Values]:
    """What enters a unit max(0, x) may be scaled, and what leaves it scaled back."""
    return _network(lambda hidden: cs.fmax(hidden, 0))


def two_compartments_by_one() -> tuple[Problem, Values]:
    """Two compartments that both lose: of four rates three combinations are seen."""
    s, blocks, at = numbers(out1=0.3, over=0.8, back=0.5, out2=0.2)

    def slope(x: cs.MX) -> cs.MX:
        return cs.vertcat(
            -(s["out1"] + s["over"]) * x[0] + s["back"] * x[1],
            s["over"] * x[0] - (s["out2"] + s["back"]) * x[1],
        )

    seen = [x[0] for x in simulated(slope, cs.MX(cs.DM([1.0, 0.0])), 0.25, 30)]
    return problem_of(all_of(seen), *blocks), at


def pill() -> tuple[Problem, Values]:
    """Absorption and clearance: share, volume and clearance are known up to a common factor."""
    F, V, CL, ka = (
        Block("share", ()),
        Block("volume", (), "l"),
        Block("clearance", (), "l/h"),
        Block("absorption", (), "1/h"),
    )
    t = cs.DM(np.linspace(0.2, 12.0, 20))
    ke = CL.symbol / V.symbol
    level = F.symbol * 100 * ka.symbol / (V.symbol * (ka.symbol - ke))
    level *= cs.exp(-ke * t) - cs.exp(-ka.symbol * t)
    return problem_of([observed("level", level, 0.05, "mg/l")], F, V, CL, ka), {
        "share": np.array(0.7),
        "volume": np.array(30.0),
        "clearance": np.array(6.0),
        "absorption": np.array(1.5),
    }


def springs_and_masses() -> tuple[Problem, Values]:
    """Four oscillators by their frequencies: of each only the ratio of stiffness and mass."""
    k, m = Block("stiffness", (4,), "N/m"), Block("mass", (4,), "kg")
    return problem_of(all_of([cs.sqrt(k.symbol / m.symbol)], 0.01, "rad/s"), k, m), {
        "stiffness": np.array([10.0, 20.0, 15.0, 8.0]),
        "mass": np.array([1.0, 0.5, 2.0, 1.2]),
    }


ZOO = (
    Specimen(three_cameras, SIMILARITY, 7, 2, "points"),
    Specimen(affine_cameras, SIMILARITY | {"mixing": 5}, 12, 3, "points"),
    Specimen(body_and_camera, RIGID, 6, 1, "camera/"),
    Specimen(joints_of_a_body, {}, 32, 22, "pose"),
    Specimen(people_of_one_shape, {"scale": 1}, 1, 1, "template size"),
    Specimen(planar_arm, {}, 1, 1, "base_angle offset[0]"),
    Specimen(two_networks_in_the_plane, {"translation": 4, "rotation": 2}, 6, 4, "points"),
    Specimen(anchored_network, {"rotation": 3}, 3, 3, "points"),
    Specimen(bearings_of_robots, PLANE | {"scale": 1}, 4, 2, "landmarks robot_place"),
    Specimen(relative_turns, {"rotation": 3}, 3, 1, "turns"),
    Specimen(clocks_that_drift, {"offset": 2}, 2, 2, "offset drift"),
    Specimen(difficulty_and_ability, {"offset": 1, "scale": 1}, 2, 2, "ability difficulty"),
    Specimen(photometric_stereo, {"scale": 3, "mixing": 6}, 9, 3, "normals lights"),
    Specimen(three_ways_of_a_table, {"scale": 4}, 4, 2, "a b c"),
    Specimen(linear_network, {"scale": 2, "mixing": 2}, 4, 2, "first second"),
    Specimen(rectified_network, {"scale": 2}, 2, 1, "first second"),
    Specimen(two_compartments_by_one, {"trade-off": 1}, 1, 1, "out1 over back out2"),
    Specimen(pill, {"scale": 1}, 1, 1, "share volume clearance"),
    Specimen(springs_and_masses, {"scale": 4}, 4, 1, "stiffness mass"),
)
