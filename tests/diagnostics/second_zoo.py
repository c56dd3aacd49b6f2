"""A second set of problems with known gauges and least remedies, to test what the first one taught.

They were written by somebody who had read what the functions promise and not how they work. All
predictions were committed before any of these problems was diagnosed. Gauges, numbers and acts are
counted as in `zoo.py`.

In the first run 19 of 24 were as predicted in everything. Five were not:

- `affine_cameras`: stretches and shears of the points had no name (mended);
- `body_of_unknown_size`: the scale was called `size against trans` (mended);
- `template_and_shapes`: the betas were taken for points that translate and turn (mended);
- `equal_rates_at_a_point`: it was not said that the terms can be exchanged (mended);
- `arm_with_a_tool`: the rotation was called `offset against tool` (mended). The prediction of two
  acts was wrong: both offsets are one thing, and are held in one act.

The count of numbers was right in 24 of 24, the count of acts in 23, the kinds of gauges in 20.
"""

import casadi as cs
import numpy as np

from tests.bodies_made_up import smpl_like_body
from tests.diagnostics.zoo import SIMILARITY, Specimen, observed, pixels, turned
from workbench import Block, Problem, Residual, Values, residuals
from workbench.geometry.camera import Camera


def _problem(seen: list[Residual], blocks: list[Block]) -> Problem:
    return Problem(seen, [block.name for block in blocks], blocks=blocks)


def _repeated(column: cs.MX, count: int) -> cs.MX:
    return cs.repmat(column, 1, count)


# cameras


def _views(count: int, points: int, *, own_focal: bool) -> tuple[Problem, Values]:
    """Cameras of unknown focal length, which is common or each camera's own."""
    rng = np.random.default_rng(40 + count)
    X = Block("landmarks", (points, 3), "m")
    blocks, at, seen = [X], {"landmarks": rng.normal(size=(points, 3))}, []
    common = Block("focal", (), "px")
    if not own_focal:
        blocks.append(common)
        at["focal"] = np.array(820.0)
    for k in range(count):
        turn = Block(f"view{k}/turn", (3,), "rad")
        place = Block(f"view{k}/place", (3,), "m")
        own = Block(f"view{k}/focal", (), "px")
        blocks += [turn, place] + [own] * own_focal
        at[turn.name] = rng.normal(scale=0.4, size=3)
        at[place.name] = np.array([0.0, 0.0, 7.0]) + rng.normal(size=3)
        if own_focal:
            at[own.name] = np.array(700.0 + 50 * k)
        there = turned(turn.symbol, X.symbol) + _repeated(place.symbol, points)
        focal = own.symbol if own_focal else common.symbol
        seen.append(observed(f"image {k}", pixels(there, focal), 1.0, "px"))
    return _problem(seen, blocks), at


def three_views_of_one_focal() -> tuple[Problem, Values]:
    """Three views determine the focal length that they share."""
    return _views(3, 15, own_focal=False)


def two_views_of_their_own_focals() -> tuple[Problem, Values]:
    """A fundamental matrix has 7 numbers: 5 of the relative pose and two focal lengths."""
    return _views(2, 14, own_focal=True)


def five_views_of_their_own_focals() -> tuple[Problem, Values]:
    return _views(5, 10, own_focal=True)


def four_cameras_as_rows() -> tuple[Problem, Values]:
    """Four cameras as the rows of one array (4, 6): turn, then place."""
    rng = np.random.default_rng(44)
    X, cameras = Block("points", (11, 3), "m"), Block("cameras", (4, 6))
    seen = []
    for k in range(4):
        turn, place = cameras.symbol[:3, k], cameras.symbol[3:, k]
        there = turned(turn, X.symbol) + _repeated(place, 11)
        seen.append(observed(f"image {k}", pixels(there), 1.0, "px"))
    rows = np.hstack([rng.normal(scale=0.3, size=(4, 3)), rng.normal(size=(4, 3)) + [0, 0, 6.0]])
    return _problem(seen, [X, cameras]), {"points": rng.normal(size=(11, 3)), "cameras": rows}


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
        image = A.symbol.T @ X.symbol + _repeated(b.symbol, 12)
        seen.append(observed(f"image {k}", image, 1.0, "px"))
    return _problem(seen, blocks), at


def stereo_rig_of_known_baseline() -> tuple[Problem, Values]:
    """Two cameras on a bar of known length at three places: the scale is known."""
    rng = np.random.default_rng(46)
    X = Block("points", (10, 3), "m")
    blocks, at, seen = [X], {"points": rng.normal(size=(10, 3))}, []
    for k in range(3):
        turn, place = Block(f"rig{k}_turn", (3,), "rad"), Block(f"rig{k}_place", (3,), "m")
        blocks += [turn, place]
        at[turn.name] = rng.normal(scale=0.3, size=3)
        at[place.name] = np.array([0.0, 0.0, 6.0]) + rng.normal(size=3)
        left = turned(turn.symbol, X.symbol) + _repeated(place.symbol, 10)
        right = left - _repeated(cs.DM([0.2, 0.0, 0.0]), 10)
        seen.append(observed(f"left {k}", pixels(left), 0.5, "px"))
        seen.append(observed(f"right {k}", pixels(right), 0.5, "px"))
    return _problem(seen, blocks), at


def _board(views: int, *, square: bool) -> tuple[Problem, Values]:
    """A flat board of 4 x 5 corners in tilted views, by a camera of four unknown numbers."""
    rng = np.random.default_rng(47 + views)
    focal, centre = Block("focal", (2,), "px"), Block("centre", (2,), "px")
    size = Block("square", (), "m")
    corners = np.array([[i, j, 0.0] for i in range(4) for j in range(5)])
    blocks = [focal, centre] + [size] * square
    at = {"focal": np.array([900.0, 920.0]), "centre": np.array([320.0, 240.0])}
    if square:
        at["square"] = np.array(0.1)
    board = (size.symbol if square else 0.1) * cs.MX(cs.DM(corners.T))
    seen = []
    for k in range(views):
        turn, place = Block(f"board{k}_turn", (3,), "rad"), Block(f"board{k}_place", (3,), "m")
        blocks += [turn, place]
        at[turn.name] = rng.uniform(0.3, 0.6, size=3) * rng.choice([-1, 1], size=3)
        at[place.name] = np.array([-0.2, -0.1, 1.0]) + rng.normal(scale=0.05, size=3)
        there = turned(turn.symbol, board) + _repeated(place.symbol, 20)
        ratio = there[:2, :] / cs.repmat(there[2, :], 2, 1)
        image = _repeated(focal.symbol, 20) * ratio + _repeated(centre.symbol, 20)
        seen.append(observed(f"image {k}", image, 0.3, "px"))
    return _problem(seen, blocks), at


def board_of_unknown_squares() -> tuple[Problem, Values]:
    """Zhang's calibration, in three views: all but the size of a square, against the distance."""
    return _board(3, square=True)


def one_tilted_view_of_a_board() -> tuple[Problem, Values]:
    """A homography has 8 numbers: of 6 of the pose and 4 of the camera two stay unknown."""
    return _board(1, square=False)


# bodies


def body_before_a_free_camera() -> tuple[Problem, Values]:
    """Place, an elbow and the camera are free, and the root does not turn: only shifts cancel."""
    rng = np.random.default_rng(48)
    body, camera = smpl_like_body(), Camera("camera/")
    seen_at, confidence = Block("observed", (24, 2), "px"), Block("confidence", (24,))
    joints = body.joint_points(*(block.symbol for block in body.blocks()))
    seen = residuals.keypoints(joints, camera, seen_at.symbol, confidence.symbol, sigma=1.0)
    at = body.start() | camera.values(K=[[1000, 0, 500], [0, 1000, 500], [0, 0, 1]])
    at |= {
        "pose": rng.normal(scale=0.3, size=(24, 3)),
        "camera/rotation": np.array([0.2, -0.1, 0.1]),
        "camera/translation": np.array([0.1, 0.2, 4.0]),
        "observed": np.zeros((24, 2)),
        "confidence": np.ones(24),
    }
    names = ("trans", "pose[left_elbow]", "camera/rotation", "camera/translation")
    return Problem((seen,), names), at


def body_of_unknown_size() -> tuple[Problem, Values]:
    """A body of free scale, root and place in one image: twice as large at twice the distance."""
    rng = np.random.default_rng(49)
    body, size = smpl_like_body(), Block("size", ())
    joints = body.joint_points(*(block.symbol for block in body.blocks()))
    there = size.symbol * joints.symbol + _repeated(cs.DM([0.0, 0.0, 4.0]), 24)
    seen = Residual("image", pixels(there), 1.0, "px", points=(joints,), blocks=(size,))
    at = body.start() | {"size": np.array(1.1), "trans": np.array([0.1, 0.2, 0.3])}
    at["pose"] = rng.normal(scale=0.3, size=(24, 3))
    return Problem((seen,), ("size", "trans", "pose[pelvis]")), at


# networks


def double_banana() -> tuple[Problem, Values]:
    """18 distances of 8 points that fit the count and still leave a hinge through two points.

    A point of each half moves in three independent ways, so two rows take 6 of the 7 away.
    """
    X = Block("points", (8, 3), "m")
    halves = [(0, 1, 2), (3, 4, 5)]
    pairs = [(i, j) for half in halves for i in half for j in half if i < j]
    pairs += [(i, end) for half in halves for i in half for end in (6, 7)]
    apart = [cs.norm_2(X.symbol[:, i] - X.symbol[:, j]) for i, j in pairs]
    found = observed("distances", cs.vertcat(*apart), 0.01, "m")
    return _problem([found], [X]), {"points": np.random.default_rng(50).normal(size=(8, 3))}


def trilateration_in_the_plane() -> tuple[Problem, Values]:
    """Seven points, each tied to three before it."""
    X = Block("stations", (7, 2), "m")
    pairs = [(0, 1)] + [(j, i) for i in range(2, 7) for j in range(max(0, i - 3), i)]
    apart = [cs.norm_2(X.symbol[:, i] - X.symbol[:, j]) for i, j in pairs]
    found = observed("distances", cs.vertcat(*apart), 0.01, "m")
    return _problem([found], [X]), {"stations": np.random.default_rng(51).normal(size=(7, 2))}


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
    return _problem([found], [place, heading, marks]), {
        "robot_place": rng.normal(scale=3.0, size=(4, 2)),
        "robot_heading": rng.normal(size=4),
        "landmarks": rng.normal(size=(8, 2)),
    }


def pose_graph_in_the_plane() -> tuple[Problem, Values]:
    """Six poses, each seen from the one before and from the one before that."""
    rng = np.random.default_rng(53)
    place, heading = Block("place", (6, 2), "m"), Block("heading", (6,), "rad")
    seen = []
    for i in range(6):
        for j in range(i + 1, min(i + 3, 6)):
            way = place.symbol[:, j] - place.symbol[:, i]
            c, s = cs.cos(heading.symbol[i]), cs.sin(heading.symbol[i])
            seen += [c * way[0] + s * way[1], c * way[1] - s * way[0]]
            seen.append(heading.symbol[j] - heading.symbol[i])
    found = observed("relative poses", cs.vertcat(*seen), 0.01, "1")
    return _problem([found], [place, heading]), {
        "place": rng.normal(size=(6, 2)),
        "heading": rng.normal(size=6),
    }


def _levels(lines: list[tuple[int, int]], count: int, *, staff: bool) -> tuple[Problem, Values]:
    height, unit = Block("height", (count,), "m"), Block("staff", ())
    steps = cs.vertcat(*(height.symbol[i] - height.symbol[j] for i, j in lines))
    found = observed("steps", unit.symbol * steps if staff else steps, 0.001, "m")
    at = {"height": np.random.default_rng(54).normal(size=count)}
    return _problem([found], [height] + [unit] * staff), at | (
        {"staff": np.array(1.02)} if staff else {}
    )


def levelling_in_two_parts() -> tuple[Problem, Values]:
    """Heights by their differences, along lines that never join two halves."""
    lines = [(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 4)]
    return _levels(lines, 7, staff=False)


def levelling_with_an_odd_staff() -> tuple[Problem, Values]:
    """The unit of the staff is unknown too: heights have no origin and no scale."""
    return _levels([(0, 1), (1, 2), (2, 3), (3, 0), (0, 2)], 4, staff=True)


# clocks, ranges, phases


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
    return _problem([found], [offset, drift]), {
        "offset": rng.normal(size=5),
        "drift": rng.normal(scale=0.1, size=5),
    }


def ranges_of_satellites() -> tuple[Problem, Values]:
    """Ranges to seven satellites of known places: the receiver's clock against all of theirs."""
    rng = np.random.default_rng(56)
    place, mine, theirs = (
        Block("place", (8, 3), "m"),
        Block("receiver_clock", (8,), "m"),
        Block("satellite_clock", (7,), "m"),
    )
    up = rng.normal(size=(7, 3))
    up = 20.0 * up / np.linalg.norm(up, axis=1, keepdims=True)
    ranges = [
        cs.norm_2(place.symbol[:, t] - cs.DM(up[k])) + mine.symbol[t] - theirs.symbol[k]
        for t in range(8)
        for k in range(7)
    ]
    found = observed("ranges", cs.vertcat(*ranges), 1.0, "m")
    return _problem([found], [place, mine, theirs]), {
        "place": 5.0 * rng.normal(size=(8, 3)),
        "receiver_clock": rng.normal(size=8),
        "satellite_clock": rng.normal(size=7),
    }


def phases_of_an_array() -> tuple[Problem, Values]:
    """Phases of antennas in the plane, and the direction to a source: a tilt of phases cancels."""
    rng = np.random.default_rng(57)
    phase, source = Block("phase", (6,), "rad"), Block("source", (2,), "rad")
    antennas = rng.normal(size=(6, 2))
    apart = [
        phase.symbol[i] - phase.symbol[j] + cs.dot(source.symbol, cs.DM(antennas[i] - antennas[j]))
        for i in range(6)
        for j in range(i)
    ]
    found = observed("phases", cs.vertcat(*apart), 0.05, "rad")
    return _problem([found], [phase, source]), {
        "phase": rng.normal(size=6),
        "source": np.array([0.1, -0.2]),
    }


# sums, products, training


def equal_rates_at_a_point() -> tuple[Problem, Values]:
    """Three decays, two of one rate: their amounts, and their rates, cancel in pairs.

    This is no gauge but a singular point. All three terms may be exchanged.
    """
    amount, rate = Block("amount", (3,)), Block("rate", (3,), "1/s")
    t = cs.DM(np.linspace(0.0, 4.0, 20))
    total = sum(amount.symbol[k] * cs.exp(-rate.symbol[k] * t) for k in range(3))
    return _problem([observed("decay", total, 0.01, "1")], [amount, rate]), {
        "amount": np.array([1.0, 2.0, 0.7]),
        "rate": np.array([0.6, 0.6, 2.5]),
    }


def difficulty_and_ability() -> tuple[Problem, Values]:
    """Answers a_j (theta_i - b_j): abilities and difficulties have no origin and no unit."""
    rng = np.random.default_rng(58)
    theta, a, b = Block("ability", (6,)), Block("slope", (5,)), Block("difficulty", (5,))
    table = [a.symbol[j] * (theta.symbol[i] - b.symbol[j]) for i in range(6) for j in range(5)]
    found = observed("answers", cs.vertcat(*table), 0.1, "1")
    return _problem([found], [theta, a, b]), {
        "ability": rng.normal(size=6),
        "slope": rng.uniform(0.5, 2.0, size=5),
        "difficulty": rng.normal(size=5),
    }


def template_and_shapes() -> tuple[Problem, Values]:
    """Training: five people as a template and two shapes, with free betas.

    Betas may be mapped by any affine map of the plane, 6 numbers: four of a 2 x 2 matrix that the
    shapes undo, and two that the template undoes. Three rows of betas hold them all.
    """
    rng = np.random.default_rng(59)
    template, shapes, betas = (
        Block("template", (4, 3), "m"),
        Block("shapes", (2, 12), "m"),
        Block("betas", (5, 2)),
    )
    people = _repeated(cs.vec(template.symbol), 5) + shapes.symbol @ betas.symbol
    return _problem([observed("people", people, 0.01, "m")], [template, shapes, betas]), {
        "template": rng.normal(size=(4, 3)),
        "shapes": rng.normal(scale=0.1, size=(2, 12)),
        "betas": rng.normal(size=(5, 2)),
    }


def weights_against_templates() -> tuple[Problem, Values]:
    """Training: three vertices, each of two weights that need not sum to one.

    A vertex (w_0 R_0 + w_1 R_1) t may have larger weights and a shorter t: three factors.
    """
    rng = np.random.default_rng(60)
    template, weights = Block("template", (3, 3), "m"), Block("weights", (3, 2))
    seen = []
    for pose in range(4):
        bones = [turned(cs.MX(cs.DM(rng.normal(size=3))), cs.MX.eye(3)) for _ in range(2)]
        for v in range(3):
            w = weights.symbol[:, v]
            skin = w[0] * bones[0] + w[1] * bones[1]
            seen.append(observed(f"pose {pose}, {v}", skin @ template.symbol[:, v], 0.01, "m"))
    return _problem(seen, [template, weights]), {
        "template": rng.normal(size=(3, 3)),
        "weights": rng.uniform(0.2, 0.8, size=(3, 2)),
    }


def arm_with_a_tool() -> tuple[Problem, Values]:
    """A planar arm of two joints: base against the first offset, tool against the second.

    The tool (2,) is a point in the frame of the last link, which may turn if the offset does.
    """
    rng = np.random.default_rng(61)
    turn, offset = Block("base_turn", (), "rad"), Block("offset", (2,), "rad")
    length, tool = Block("length", (), "m"), Block("tool", (2,), "m")
    tips = []
    for q in rng.uniform(-1.5, 1.5, size=(10, 2)):
        first = turn.symbol + q[0] + offset.symbol[0]
        second = first + q[1] + offset.symbol[1]
        c, s = cs.cos(second), cs.sin(second)
        tip = length.symbol * cs.vertcat(cs.cos(first), cs.sin(first))
        x, y = tool.symbol[0], tool.symbol[1]
        tips.append(tip + cs.vertcat(c * x - s * y, s * x + c * y))
    found = observed("tips", cs.vertcat(*tips), 0.001, "m")
    return _problem([found], [turn, offset, length, tool]), {
        "base_turn": np.array(0.3),
        "offset": np.array([0.02, -0.01]),
        "length": np.array(0.5),
        "tool": np.array([0.2, 0.05]),
    }


SECOND_ZOO = (
    Specimen(three_views_of_one_focal, SIMILARITY, 7, 2),
    # the focal length of view 0 is known, so it cannot be held as a whole: turn, place, one more
    Specimen(two_views_of_their_own_focals, SIMILARITY, 7, 3),
    Specimen(five_views_of_their_own_focals, SIMILARITY, 7, 3),
    Specimen(four_cameras_as_rows, SIMILARITY, 7, 2),
    Specimen(affine_cameras, SIMILARITY | {"mixing": 5}, 12, 3),
    Specimen(stereo_rig_of_known_baseline, {"translation": 3, "rotation": 3}, 6, 1),
    Specimen(board_of_unknown_squares, {"scale": 1}, 1, 1),
    Specimen(one_tilted_view_of_a_board, {}, 2, 1),
    Specimen(body_before_a_free_camera, {"translation": 3}, 3, 1),
    Specimen(body_of_unknown_size, {"scale": 1}, 1, 1),
    Specimen(double_banana, {"translation": 3, "rotation": 3}, 7, 3),
    Specimen(trilateration_in_the_plane, {"translation": 2, "rotation": 1}, 3, 2),
    Specimen(bearings_of_robots, {"translation": 2, "rotation": 1, "scale": 1}, 4, 2),
    Specimen(pose_graph_in_the_plane, {"translation": 2, "rotation": 1}, 3, 2),
    Specimen(levelling_in_two_parts, {"offset": 2}, 2, 2),
    Specimen(levelling_with_an_odd_staff, {"offset": 1, "scale": 1}, 2, 2),
    Specimen(clocks_that_drift, {"offset": 2}, 2, 2),
    Specimen(ranges_of_satellites, {"offset": 1}, 1, 1),
    Specimen(phases_of_an_array, {"offset": 1}, 3, 2),
    Specimen(equal_rates_at_a_point, {}, 2, 2, exchanged=("amount", "rate")),
    Specimen(difficulty_and_ability, {"offset": 1, "scale": 1}, 2, 2),
    Specimen(template_and_shapes, {"offset": 2, "scale": 2, "mixing": 2}, 6, 3),
    Specimen(weights_against_templates, {"scale": 3}, 3, 3),
    Specimen(arm_with_a_tool, {"rotation": 1}, 2, 1),
)
