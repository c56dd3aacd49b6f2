"""Problems whose gauges and least remedies are known from geometry or algebra before any run.

`gauges` counts the null directions of each kind that have a name of their own; the others are
combinations of entries or motions of joints. `numbers` is the least count of numbers that have to
be held, and `acts` how many things a user has to do for that: a camera, or a row, is one thing.
The problems that are marked `held_out` were first run when the search was written, which was then
corrected for what they showed: one false name of a gauge. Two counts of acts were corrected too.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import combinations

import casadi as cs
import numpy as np

from tests.bodies_made_up import smpl_like_body
from tests.diagnostics import cases
from workbench import Block, Constraint, Problem, Residual, Values, residuals
from workbench.geometry.camera import Camera

SIMILARITY = {"translation": 3, "rotation": 3, "scale": 1}


@dataclass(frozen=True, eq=False)
class Specimen:
    """A problem with what is known about it."""

    build: Callable[[], tuple[Problem, Values]]
    gauges: dict[str, int]
    numbers: int
    acts: int
    held_out: bool = False
    exchanged: tuple[str, ...] = field(default=())

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


def all_of(rows: list[cs.MX], sigma: float = 0.01, unit: str = "1") -> list[Residual]:
    """One residual of all these rows."""
    return [observed("seen", cs.vertcat(*rows), sigma, unit)]


def beside(column: cs.MX, count: int) -> cs.MX:
    """A column, as many times side by side."""
    return cs.repmat(column, 1, count)


def observed(name: str, expression: cs.MX, sigma: float, unit: str) -> Residual:
    """What is seen is irrelevant to rank: the residual is the expression itself."""
    return Residual(name, cs.vec(expression), sigma, unit)


def _cameras(count: int, points: int, *, by_centre: bool = False) -> tuple[Problem, Values]:
    rng = np.random.default_rng(count)
    X = Block("points", (points, 3), "m")
    seen, blocks, at = [], [X], {"points": rng.normal(size=(points, 3))}
    for k in range(count):
        turn, place = Block(f"cam{k}_turn", (3,), "rad"), Block(f"cam{k}_place", (3,), "m")
        blocks += [turn, place]
        at[turn.name] = rng.normal(scale=0.3, size=3)
        at[place.name] = np.array([0.0, 0.0, 6.0 - 12.0 * by_centre]) + rng.normal(size=3)
        shift = cs.repmat(place.symbol, 1, points)
        there = (
            turned(turn.symbol, X.symbol - shift)
            if by_centre
            else turned(turn.symbol, X.symbol) + shift
        )
        seen.append(observed(f"image {k}", pixels(there), 1.0, "px"))
    return Problem(seen, [b.name for b in blocks], blocks=blocks), at


def three_cameras() -> tuple[Problem, Values]:
    return _cameras(3, 20)


def two_cameras() -> tuple[Problem, Values]:
    return _cameras(2, 12)


def four_cameras_by_their_centres() -> tuple[Problem, Values]:
    return _cameras(4, 8, by_centre=True)


def five_cameras_in_two_blocks() -> tuple[Problem, Values]:
    """Turns (5, 3) and shifts (5, 3), in no unit, as in a file that names none."""
    rng = np.random.default_rng(5)
    X, turns, shifts = Block("points", (9, 3)), Block("turns", (5, 3)), Block("shifts", (5, 3))
    seen = [
        observed(
            f"image {k}",
            pixels(turned(turns.symbol[:, k], X.symbol) + cs.repmat(shifts.symbol[:, k], 1, 9)),
            1.0,
            "px",
        )
        for k in range(5)
    ]
    return Problem(seen, ("points", "turns", "shifts"), blocks=(X, turns, shifts)), {
        "points": rng.normal(size=(9, 3)),
        "turns": rng.normal(scale=0.3, size=(5, 3)),
        "shifts": np.array([0.0, 0.0, 6.0]) + rng.normal(size=(5, 3)),
    }


def _distances(count: int, d: int, islands: int = 1, **more: object) -> tuple[Problem, Values]:
    X = Block("points", (count, d), "m")
    size = count // islands
    pairs = [(i, j) for i, j in combinations(range(count), 2) if i // size == j // size]
    apart = [cs.norm_2(X.symbol[:, i] - X.symbol[:, j]) for i, j in pairs]
    found = observed("distances", cs.vertcat(*apart), 0.01, "m")
    constraints = [Constraint("anchor", X.symbol[:, 0], 0.5, 0.5, "m")] if more else []
    at = np.random.default_rng(count).normal(size=(count, d))
    at[0] = 0.5 if more else at[0]
    return Problem((found,), ("points",), blocks=(X,), constraints=constraints), {"points": at}


def distances_in_space() -> tuple[Problem, Values]:
    return _distances(8, 3)


def distances_in_the_plane() -> tuple[Problem, Values]:
    return _distances(6, 2)


def two_networks_in_the_plane() -> tuple[Problem, Values]:
    return _distances(10, 2, islands=2)


def anchored_network() -> tuple[Problem, Values]:
    """A constraint holds one point: what remains are the rotations about it."""
    return _distances(6, 3, anchored=True)


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
    blocks = (base, angle, offset, length)
    problem = Problem(
        (observed("tips", cs.vertcat(*tips), 0.001, "m"),), [b.name for b in blocks], blocks=blocks
    )
    return problem, {
        "base": np.array([0.1, 0.2]),
        "base_angle": np.array(0.3),
        "offset": np.array([0.02, -0.01, 0.03]),
        "length": np.array([0.5, 0.4, 0.3]),
    }


def spatial_arm() -> tuple[Problem, Values]:
    """Three parallel axes, and the place of the tip: only the sum of the slides along them."""
    rng = np.random.default_rng(1)
    offset, length, slide = (
        Block("offset", (3,), "rad"),
        Block("length", (3,), "m"),
        Block("slide", (3,), "m"),
    )
    tips = []
    for q in rng.uniform(-1.5, 1.5, size=(14, 4)):
        heading, place = cs.MX(0.0), cs.MX.zeros(3)
        for k in range(3):
            heading = heading + q[k] + offset.symbol[k]
            step = cs.vertcat(cs.cos(heading), cs.sin(heading))
            place = place + cs.vertcat(length.symbol[k] * step, slide.symbol[k])
        c, s = np.cos(q[3]), np.sin(q[3])
        tips.append(cs.DM([[c, 0, s], [0, 1, 0], [-s, 0, c]]) @ place)
    blocks = (offset, length, slide)
    problem = Problem(
        (observed("tips", cs.vertcat(*tips), 0.001, "m"),), [b.name for b in blocks], blocks=blocks
    )
    return problem, {
        "offset": np.array([0.02, -0.01, 0.03]),
        "length": np.array([0.5, 0.4, 0.3]),
        "slide": np.array([0.1, 0.05, 0.02]),
    }


def two_exponentials() -> tuple[Problem, Values]:
    """Nothing is free to first order, but the two terms may be exchanged."""
    amount, rate = Block("amount", (2,)), Block("rate", (2,), "1/s")
    t = np.linspace(0.0, 3.0, 12)
    total = sum(amount.symbol[k] * cs.exp(-rate.symbol[k] * cs.DM(t)) for k in range(2))
    return Problem(
        (observed("decay", total, 0.01, "1"),), ("amount", "rate"), blocks=(amount, rate)
    ), {"amount": np.array([1.0, 2.0]), "rate": np.array([0.5, 2.0])}


def equal_rates() -> tuple[Problem, Values]:
    """Two exponentials of one known rate: only the sum of the amounts is seen."""
    amount, rate = Block("amount", (2,)), Block("rate", (), "1/s")
    t = cs.DM(np.linspace(0.0, 3.0, 12))
    total = cs.sum1(amount.symbol) * cs.exp(-rate.symbol * t)
    blocks = (amount, rate)
    return Problem((observed("decay", total, 0.01, "1"),), ("amount", "rate"), blocks=blocks), {
        "amount": np.array([1.0, 2.0]),
        "rate": np.array(0.7),
    }


def clocks() -> tuple[Problem, Values]:
    """Differences of six clocks."""
    clock = Block("clock", (6,), "s")
    pairs = [(0, 1), (1, 2), (2, 3), (3, 4), (4, 5), (5, 0), (0, 3)]
    apart = cs.vertcat(*(clock.symbol[i] - clock.symbol[j] for i, j in pairs))
    problem = Problem((observed("differences", apart, 0.1, "s"),), ("clock",), blocks=(clock,))
    return problem, {"clock": np.random.default_rng(0).normal(size=6)}


def rows_and_columns() -> tuple[Problem, Values]:
    """Sums a_i + b_j: what is added to all a may be taken from all b."""
    a, b = Block("a", (4,)), Block("b", (3,))
    sums = cs.vertcat(*(a.symbol[i] + b.symbol[j] for i in range(4) for j in range(3)))
    return Problem((observed("table", sums, 0.1, "1"),), ("a", "b"), blocks=(a, b)), {
        "a": np.array([1.0, 2.0, 0.5, -1.0]),
        "b": np.array([0.3, -0.2, 1.0]),
    }


def products() -> tuple[Problem, Values]:
    """Products u_i v_j: u may grow as v shrinks."""
    u, v = Block("u", (4,)), Block("v", (3,))
    table = cs.vec(u.symbol @ v.symbol.T)
    return Problem((observed("table", table, 0.1, "1"),), ("u", "v"), blocks=(u, v)), {
        "u": np.array([1.0, 2.0, 0.5, -1.0]),
        "v": np.array([0.3, -0.2, 1.0]),
    }


def _network(unit: Callable[[cs.MX], cs.MX]) -> tuple[Problem, Values]:
    rng = np.random.default_rng(3)
    first, second = Block("first", (2, 4)), Block("second", (3, 2))
    x = cs.DM(rng.normal(size=(4, 30)))
    hidden = unit(first.symbol.T @ x)
    out = second.symbol.T @ hidden
    problem = Problem(
        (observed("outputs", out, 0.1, "1"),), ("first", "second"), blocks=(first, second)
    )
    return problem, {"first": rng.normal(size=(2, 4)), "second": rng.normal(size=(3, 2))}


def linear_network() -> tuple[Problem, Values]:
    """Two layers without a nonlinearity: any invertible 2 x 2 matrix between them cancels."""
    return _network(lambda hidden: hidden)


def rectified_network() -> tuple[Problem, Values]:
    """What enters a unit max(0, x) may be scaled, and what leaves it scaled back."""
    return _network(lambda hidden: cs.fmax(hidden, 0))


def one_view_of_a_plane() -> tuple[Problem, Values]:
    """A flat target across the view: focal length against depth, middle against shift."""
    rng = np.random.default_rng(0)
    focal, middle = Block("focal", (), "px"), Block("middle", (2,), "px")
    turn, shift = Block("turn", (3,), "rad"), Block("shift", (3,), "m")
    flat = np.column_stack([rng.normal(size=(12, 2)), np.zeros(12)])
    X = cs.MX(cs.DM(flat.T))
    # to first order about no turn, which is what counts here
    there = X + cs.skew(turn.symbol) @ X + cs.repmat(shift.symbol, 1, 12)
    image = pixels(there, focal.symbol) + cs.repmat(middle.symbol, 12, 1)
    blocks = (focal, middle, turn, shift)
    return Problem(
        (observed("image", image, 1.0, "px"),), [b.name for b in blocks], blocks=blocks
    ), {
        "focal": np.array(900.0),
        "middle": np.array([300.0, 200.0]),
        "turn": np.zeros(3),
        "shift": np.array([0.1, -0.2, 5.0]),
    }


def scale_against_depth() -> tuple[Problem, Values]:
    return cases.scale_against_depth()


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


ZOO = (
    Specimen(three_cameras, SIMILARITY, 7, 2),
    Specimen(two_cameras, SIMILARITY, 7, 2),
    Specimen(distances_in_space, {"translation": 3, "rotation": 3}, 6, 4),
    Specimen(planar_arm, {}, 1, 1),
    Specimen(two_exponentials, {}, 0, 0, exchanged=("amount", "rate")),
    Specimen(clocks, {"offset": 1}, 1, 1),
    Specimen(products, {"scale": 1}, 1, 1),
    Specimen(joints_of_a_body, {}, 32, 22),
    Specimen(scale_against_depth, {"scale": 1}, 1, 1),
    Specimen(linear_network, {"scale": 2, "mixing": 2}, 4, 2),
    Specimen(four_cameras_by_their_centres, SIMILARITY, 7, 2, held_out=True),
    Specimen(five_cameras_in_two_blocks, SIMILARITY, 7, 2, held_out=True),
    Specimen(distances_in_the_plane, {"translation": 2, "rotation": 1}, 3, 2, held_out=True),
    Specimen(two_networks_in_the_plane, {"translation": 4, "rotation": 2}, 6, 4, held_out=True),
    Specimen(anchored_network, {"rotation": 3}, 3, 3, held_out=True),
    Specimen(spatial_arm, {}, 2, 2, held_out=True),
    Specimen(equal_rates, {}, 1, 1, held_out=True),
    Specimen(rows_and_columns, {"offset": 1}, 1, 1, held_out=True),
    Specimen(rectified_network, {"scale": 2}, 2, 1, held_out=True),
    Specimen(one_view_of_a_plane, {}, 3, 1, held_out=True),
    Specimen(body_and_camera, {"translation": 3, "rotation": 3}, 6, 1, held_out=True),
)
