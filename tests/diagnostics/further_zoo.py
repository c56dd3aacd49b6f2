"""Further problems whose null directions are known: less common forms and other fields."""

from itertools import combinations

import casadi as cs
import numpy as np

from tests.bodies_made_up import smpl_like_body
from tests.diagnostics.zoo import (
    PLANE,
    RIGID,
    SIMILARITY,
    Specimen,
    all_of,
    beside,
    numbers,
    observed,
    pixels,
    problem_of,
    simulated,
    turned,
)
from workbench import Block, Problem, Residual, Values


def two_views_of_their_own_focals() -> tuple[Problem, Values]:
    """A fundamental matrix has 7 numbers: 5 of the relative pose and two focal lengths."""
    rng = np.random.default_rng(42)
    X = Block("landmarks", (14, 3), "m")
    blocks, at, seen = [X], {"landmarks": rng.normal(size=(14, 3))}, []
    for k in range(2):
        turn = Block(f"view{k}/turn", (3,), "rad")
        place = Block(f"view{k}/place", (3,), "m")
        focal = Block(f"view{k}/focal", (), "px")
        blocks += [turn, place, focal]
        at[turn.name] = rng.normal(scale=0.4, size=3)
        at[place.name] = np.array([0.0, 0.0, 7.0]) + rng.normal(size=3)
        at[focal.name] = np.array(700.0 + 50 * k)
        there = turned(turn.symbol, X.symbol) + beside(place.symbol, 14)
        seen.append(observed(f"image {k}", pixels(there, focal.symbol), 1.0, "px"))
    return problem_of(seen, *blocks), at


def five_cameras_in_two_blocks() -> tuple[Problem, Values]:
    """Turns (5, 3) and shifts (5, 3), in no unit, as in a file that names none."""
    rng = np.random.default_rng(5)
    X, turns, shifts = Block("points", (9, 3)), Block("turns", (5, 3)), Block("shifts", (5, 3))
    seen = [
        observed(
            f"image {k}",
            pixels(turned(turns.symbol[:, k], X.symbol) + beside(shifts.symbol[:, k], 9)),
            1.0,
            "px",
        )
        for k in range(5)
    ]
    return problem_of(seen, X, turns, shifts), {
        "points": rng.normal(size=(9, 3)),
        "turns": rng.normal(scale=0.3, size=(5, 3)),
        "shifts": np.array([0.0, 0.0, 6.0]) + rng.normal(size=(5, 3)),
    }


def four_cameras_in_quaternions() -> tuple[Problem, Values]:
    """Turns are unit quaternions, whose length a residual tells. Two points and a number hold it.

    Of a quaternion three numbers are free to move, so that a camera cannot be held as a whole.
    """
    rng = np.random.default_rng(200)
    X = Block("points", (10, 3), "m")
    blocks, at, seen = [X], {"points": rng.normal(size=(10, 3))}, []
    for k in range(4):
        q, t = Block(f"cam{k}/quaternion", (4,)), Block(f"cam{k}/place", (3,), "m")
        blocks += [q, t]
        start = np.array([1.0, 0.0, 0.0, 0.0]) + 0.3 * rng.normal(size=4)
        at[q.name] = start / np.linalg.norm(start)
        at[t.name] = np.array([0.0, 0.0, 7.0]) + rng.normal(size=3)
        w, v = q.symbol[0], cs.skew(q.symbol[1:])
        R = cs.MX.eye(3) + 2 * w * v + 2 * v @ v
        there = R @ X.symbol + beside(t.symbol, 10)
        seen.append(observed(f"image {k}", pixels(there), 1.0, "px"))
        seen.append(observed(f"length {k}", cs.dot(q.symbol, q.symbol) - 1, 1e-3, "1"))
    return problem_of(seen, *blocks), at


def rig_in_a_frame_of_its_own() -> tuple[Problem, Values]:
    """Three cameras on a rigid rig at four places: its frame may move against all mounts, too."""
    rng = np.random.default_rng(101)
    X = Block("points", (12, 3), "m")
    blocks, at = [X], {"points": rng.normal(size=(12, 3))}

    def pose(name: str, away: float, spread: float) -> tuple[Block, Block]:
        turn, place = Block(f"{name}/turn", (3,), "rad"), Block(f"{name}/place", (3,), "m")
        blocks.extend([turn, place])
        at[turn.name] = rng.normal(scale=0.3, size=3)
        at[place.name] = np.array([0.0, 0.0, away]) + spread * rng.normal(size=3)
        return turn, place

    def moved(by: tuple[Block, Block], points: cs.MX) -> cs.MX:
        return turned(by[0].symbol, points) + beside(by[1].symbol, 12)

    rigs = [pose(f"rig{k}", 7.0, 0.7) for k in range(4)]
    mounts = [pose(f"mount{c}", 0.0, 0.4) for c in range(3)]
    seen = [
        observed(f"image {k} {c}", pixels(moved(mount, moved(rig, X.symbol))), 1.0, "px")
        for k, rig in enumerate(rigs)
        for c, mount in enumerate(mounts)
    ]
    return problem_of(seen, *blocks), at


def projective_cameras() -> tuple[Problem, Values]:
    """Three cameras as matrices (3, 4): any projective map of the points cancels, 15 numbers.

    Each matrix has a factor of its own that no pixel shows. Of the 15 numbers 3 shift, 3 turn and
    one scales the points, 5 stretch or shear them, and 3 move the plane at infinity.
    """
    rng = np.random.default_rng(70)
    X = Block("points", (14, 3), "m")
    blocks, at, seen = [X], {"points": rng.normal(size=(14, 3))}, []
    for k in range(3):
        P = Block(f"cam{k}", (3, 4))
        blocks.append(P)
        at[P.name] = np.hstack([np.eye(3), [[0.0], [0.0], [7.0]]]) + 0.2 * rng.normal(size=(3, 4))
        there = P.symbol.T @ cs.vertcat(X.symbol, cs.MX.ones(1, 14))
        seen.append(observed(f"image {k}", pixels(there), 1.0, "px"))
    return problem_of(seen, *blocks), at


def _homogeneous(points: cs.MX) -> cs.MX:
    return cs.vertcat(points, cs.MX.ones(1, points.shape[1]))


def homographies_of_a_board() -> tuple[Problem, Values]:
    """Three homographies of unknown points of a board: any projective map of the plane cancels.

    That is 2 + 1 + 1 of a similarity, 2 stretches and shears, and 2 that move the line at infinity;
    each matrix has a factor of its own.
    """
    rng = np.random.default_rng(102)
    X = Block("corners", (9, 2), "m")
    blocks, at, seen = [X], {"corners": rng.normal(size=(9, 2))}, []
    for k in range(3):
        H = Block(f"view{k}", (3, 3))
        blocks.append(H)
        at[H.name] = np.diag([1.0, 1.0, 5.0]) + 0.3 * rng.normal(size=(3, 3))
        seen.append(observed(f"image {k}", pixels(H.symbol.T @ _homogeneous(X.symbol)), 1.0, "px"))
    return problem_of(seen, *blocks), at


def one_view_of_a_plane() -> tuple[Problem, Values]:
    """A flat target across the view: focal length against depth, middle against shift."""
    rng = np.random.default_rng(0)
    focal, middle = Block("focal", (), "px"), Block("middle", (2,), "px")
    turn, shift = Block("turn", (3,), "rad"), Block("shift", (3,), "m")
    flat = np.column_stack([rng.normal(size=(12, 2)), np.zeros(12)])
    X = cs.MX(cs.DM(flat.T))
    # to first order about no turn, which is what counts here
    there = X + cs.skew(turn.symbol) @ X + beside(shift.symbol, 12)
    image = pixels(there, focal.symbol) + cs.repmat(middle.symbol, 12, 1)
    return problem_of([observed("image", image, 1.0, "px")], focal, middle, turn, shift), {
        "focal": np.array(900.0),
        "middle": np.array([300.0, 200.0]),
        "turn": np.zeros(3),
        "shift": np.array([0.1, -0.2, 5.0]),
    }


def hand_and_eye_with_unknown_squares() -> tuple[Problem, Values]:
    """A camera on a hand of known motions and a board of unknown size: all is seen."""
    rng = np.random.default_rng(303)
    turn, place = Block("eye/turn", (3,), "rad"), Block("eye/place", (3,), "m")
    board_turn, board_place = Block("board/turn", (3,), "rad"), Block("board/place", (3,), "m")
    size = Block("square", (), "m")
    corners = cs.MX(cs.DM(np.array([[i, j, 0.0] for i in range(3) for j in range(4)]).T))
    seen = []
    for k in range(5):
        R = turned(cs.MX(cs.DM(rng.normal(scale=0.3, size=3))), cs.MX.eye(3))
        world = size.symbol * turned(board_turn.symbol, corners) + beside(board_place.symbol, 12)
        hand = R.T @ (world - beside(cs.DM(rng.normal(scale=0.4, size=3)), 12))
        eye = turned(turn.symbol, hand) + beside(place.symbol, 12)
        seen.append(observed(f"image {k}", pixels(eye), 0.3, "px"))
    return problem_of(seen, turn, place, board_turn, board_place, size), {
        "eye/turn": np.array([0.2, -0.1, 0.1]),
        "eye/place": np.array([0.1, 0.0, 0.2]),
        "board/turn": np.array([0.3, 0.1, -0.2]),
        "board/place": np.array([-0.2, -0.1, 3.0]),
        "square": np.array(0.1),
    }


def body_of_unknown_size() -> tuple[Problem, Values]:
    """A body of free scale, root and place in one image: twice as large at twice the distance."""
    rng = np.random.default_rng(49)
    body, size = smpl_like_body(), Block("size", ())
    joints = body.joint_points(*(block.symbol for block in body.blocks()))
    there = size.symbol * joints.symbol + beside(cs.DM([0.0, 0.0, 4.0]), 24)
    seen = Residual("image", pixels(there), 1.0, "px", points=(joints,), blocks=(size,))
    at = body.start() | {"size": np.array(1.1), "trans": np.array([0.1, 0.2, 0.3])}
    at["pose"] = rng.normal(scale=0.3, size=(24, 3))
    return Problem((seen,), ("size", "trans", "pose[pelvis]")), at


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
    people = beside(cs.vec(template.symbol), 5) + shapes.symbol @ betas.symbol
    return problem_of([observed("people", people, 0.01, "m")], template, shapes, betas), {
        "template": rng.normal(size=(4, 3)),
        "shapes": rng.normal(scale=0.1, size=(2, 12)),
        "betas": rng.normal(size=(5, 2)),
    }


def weights_by_softmax() -> tuple[Problem, Values]:
    """Training: blend weights of five vertices, each a softmax of three numbers."""
    rng = np.random.default_rng(209)
    logits = Block("logits", (5, 3))
    rows = []
    for v in range(5):
        share = cs.exp(logits.symbol[:, v])
        for _ in range(3):
            rows.append(cs.DM(rng.normal(size=(3, 3))) @ share / cs.sum1(share))
    return problem_of(all_of(rows, 0.01, "m"), logits), {"logits": rng.normal(size=(5, 3))}


def markers_on_two_segments() -> tuple[Problem, Values]:
    """Motion capture: markers on two segments with a ball joint, in frames that are their own.

    Both frames may be chosen at will: six numbers of each.
    """
    rng = np.random.default_rng(832)
    upper, lower = Block("upper", (4, 3), "m"), Block("lower", (4, 3), "m")
    joint, end = Block("joint_in_upper", (3,), "m"), Block("joint_in_lower", (3,), "m")
    blocks, rows = [upper, lower, joint, end], []
    at = {"upper": rng.normal(size=(4, 3)), "lower": rng.normal(size=(4, 3))}
    at |= {joint.name: rng.normal(size=3), end.name: rng.normal(size=3)}
    for f in range(4):
        turn, bend = Block(f"frame{f}/turn", (3,), "rad"), Block(f"frame{f}/bend", (3,), "rad")
        place = Block(f"frame{f}/place", (3,), "m")
        blocks += [turn, place, bend]
        at |= {b.name: rng.normal(scale=0.6, size=3) for b in (turn, place, bend)}
        middle = turned(turn.symbol, joint.symbol) + place.symbol
        away = turned(bend.symbol, lower.symbol - beside(end.symbol, 4))
        rows.append(cs.vec(turned(turn.symbol, upper.symbol) + beside(place.symbol, 4)))
        rows.append(cs.vec(away + beside(middle, 4)))
    return problem_of(all_of(rows, 0.001, "m"), *blocks), at


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
    return problem_of([found], turn, offset, length, tool), {
        "base_turn": np.array(0.3),
        "offset": np.array([0.02, -0.01]),
        "length": np.array(0.5),
        "tool": np.array([0.2, 0.05]),
    }


def survey_in_east_and_north() -> tuple[Problem, Values]:
    """Distances of places whose two coordinates are blocks of their own."""
    rng = np.random.default_rng(212)
    east, north = Block("east", (7,), "m"), Block("north", (7,), "m")
    rows = [
        cs.sqrt((east.symbol[i] - east.symbol[j]) ** 2 + (north.symbol[i] - north.symbol[j]) ** 2)
        for i, j in combinations(range(7), 2)
    ]
    at = {"east": rng.normal(size=7), "north": rng.normal(size=7)}
    return problem_of(all_of(rows, 0.01, "m"), east, north), at


def cylinder_through_points() -> tuple[Problem, Values]:
    """Distances of known points from a cylinder: it turns about its axis, and slides along it."""
    rng = np.random.default_rng(813)
    turn, place = Block("turn", (3,), "rad"), Block("place", (3,), "m")
    radius = Block("radius", (), "m")
    axis = turned(turn.symbol, cs.MX(cs.DM([0.0, 0.0, 1.0])))
    rows = []
    for _ in range(14):
        out = cs.DM(rng.normal(size=3)) - place.symbol
        rows.append(cs.norm_2(cs.cross(axis, out)) - radius.symbol)
    return problem_of(all_of(rows, 0.001, "m"), turn, place, radius), {
        "turn": np.array([0.4, 0.2, -0.3]),
        "place": np.array([0.1, -0.2, 0.3]),
        "radius": np.array(0.8),
    }


def tilt_series() -> tuple[Problem, Values]:
    """Electron tomography: markers on a stage that is tilted about y, seen along parallel rays.

    Tilts, shifts and magnifications of the views are unknown.
    """
    rng = np.random.default_rng(831)
    X = Block("markers", (6, 3), "nm")
    tilt, shift = Block("tilts", (6,), "rad"), Block("shifts", (6, 2), "nm")
    size = Block("magnifications", (6,))
    rows = []
    for k in range(6):
        c, s = cs.cos(tilt.symbol[k]), cs.sin(tilt.symbol[k])
        across = c * X.symbol[0, :] + s * X.symbol[2, :]
        image = size.symbol[k] * cs.vertcat(across, X.symbol[1, :])
        rows.append(cs.vec(image + beside(shift.symbol[:, k], 6)))
    at = {
        "markers": rng.normal(size=(6, 3)),
        "tilts": np.linspace(-1.0, 1.0, 6) + 0.1 * rng.normal(size=6),
        "shifts": rng.normal(size=(6, 2)),
        "magnifications": rng.uniform(0.9, 1.1, size=6),
    }
    return problem_of(all_of(rows, 0.01, "nm"), X, tilt, shift, size), at


def magnetometer() -> tuple[Problem, Values]:
    """|A (m - b)| = 1 for readings m: A may be followed by any rotation."""
    rng = np.random.default_rng(216)
    A, b = Block("A", (3, 3)), Block("b", (3,), "uT")
    rows = [cs.norm_2(A.symbol.T @ (cs.DM(rng.normal(size=3)) - b.symbol)) for _ in range(20)]
    return problem_of(all_of(rows), A, b), {
        "A": np.eye(3) + 0.2 * rng.normal(size=(3, 3)),
        "b": 0.2 * rng.normal(size=3),
    }


def tensor_in_a_turned_frame() -> tuple[Problem, Values]:
    """Dipolar couplings v'R'S R v: the turn of the frame against S, of which v'S v sees half."""
    rng = np.random.default_rng(815)
    turn, S = Block("turn", (3,), "rad"), Block("S", (3, 3))
    rows = []
    for _ in range(12):
        v = turned(turn.symbol, cs.MX(cs.DM(rng.normal(size=3))))
        rows.append(cs.dot(v, S.symbol.T @ v))
    at = {"turn": np.array([0.3, -0.4, 0.2]), "S": rng.normal(size=(3, 3))}
    return problem_of(all_of(rows), turn, S), at


def coils_and_image() -> tuple[Problem, Values]:
    """Magnetic resonance: a complex image times linear, complex sensitivities of three coils.

    A complex number common to all coils may be taken out of the image: a factor and a phase.
    """
    rng = np.random.default_rng(800)
    image = Block("image", (10, 2))
    coils = [Block(f"coil{c}", (3, 2)) for c in range(3)]
    rows = []
    for p in range(10):
        basis = cs.DM([1.0, *rng.uniform(-1, 1, size=2)])
        for coil in coils:
            s, m = coil.symbol @ basis, image.symbol[:, p]
            rows += [s[0] * m[0] - s[1] * m[1], s[0] * m[1] + s[1] * m[0]]
    at = {coil.name: rng.normal(size=(3, 2)) for coil in coils}
    return problem_of(all_of(rows), image, *coils), at | {"image": rng.normal(size=(10, 2))}


def crystal_from_intensities() -> tuple[Problem, Values]:
    """Equal atoms from intensities of diffraction: all may move together, and be exchanged."""
    rng = np.random.default_rng(837)
    atom = Block("atoms", (4, 2))
    rows = []
    for h in range(3):
        for k in range(-2, 3):
            if h > 0 or k > 0:
                phase = 2 * np.pi * (h * atom.symbol[0, :] + k * atom.symbol[1, :])
                rows.append(cs.sum2(cs.cos(phase)) ** 2 + cs.sum2(cs.sin(phase)) ** 2)
    return problem_of(all_of(rows), atom), {"atoms": rng.uniform(0, 1, size=(4, 2))}


def tucker_factors() -> tuple[Problem, Values]:
    """A core of 2 x 2 x 2 and three factors: any invertible matrix acts on each way of the core.

    The core is held as one thing; what then is left are four factors of its two terms.
    """
    rng = np.random.default_rng(820)
    A, B, C = Block("A", (4, 2)), Block("B", (4, 2)), Block("C", (4, 2))
    core = Block("core", (2, 2, 2))
    G = core.symbol  # (2, 4): the last axis down, the first two along
    rows = []
    for i in range(4):
        for j in range(4):
            both = cs.kron(A.symbol[:, i], B.symbol[:, j])
            rows.append(cs.vec(C.symbol.T @ (G @ both)))
    at = {name: rng.normal(size=(4, 2)) for name in "ABC"}
    return problem_of(all_of(rows), A, B, C, core), at | {"core": rng.normal(size=(2, 2, 2))}


def embeddings_with_biases() -> tuple[Problem, Values]:
    """w_i c_j + b_i + d_j: a matrix between words and contexts, and five levels.

    A vector added to all words is undone by the biases of contexts, and the other way round.
    """
    rng = np.random.default_rng(836)
    w, c = Block("words", (6, 2)), Block("contexts", (5, 2))
    b, d = Block("word_biases", (6,)), Block("context_biases", (5,))
    table = w.symbol.T @ c.symbol + beside(b.symbol, 5) + cs.repmat(d.symbol.T, 6, 1)
    at = {"words": rng.normal(size=(6, 2)), "contexts": rng.normal(size=(5, 2))}
    at |= {"word_biases": rng.normal(size=6), "context_biases": rng.normal(size=5)}
    return problem_of([observed("table", table, 0.1, "1")], w, c, b, d), at


def factors_of_a_covariance() -> tuple[Problem, Values]:
    """L L' + diag(own): the loadings L may be multiplied by any rotation."""
    rng = np.random.default_rng(115)
    L, own = Block("loadings", (8, 3)), Block("own", (8,))
    C = L.symbol.T @ L.symbol + cs.diag(own.symbol)
    lower = cs.vertcat(*[C[i, j] for i in range(8) for j in range(i + 1)])
    at = {"loadings": rng.normal(size=(8, 3)), "own": rng.uniform(0.5, 1.5, size=8)}
    return problem_of([observed("covariance", lower, 0.05, "1")], L, own), at


def age_period_cohort() -> tuple[Problem, Values]:
    """age + period + cohort, where cohort = period - age: two levels, and a trend of all three."""
    rng = np.random.default_rng(817)
    age, period, cohort = Block("age", (4,)), Block("period", (5,)), Block("cohort", (8,))
    rows = [
        age.symbol[a] + period.symbol[p] + cohort.symbol[p - a + 3]
        for a in range(4)
        for p in range(5)
    ]
    at = {"age": rng.normal(size=4), "period": rng.normal(size=5), "cohort": rng.normal(size=8)}
    return problem_of(all_of(rows, 0.1), age, period, cohort), at


def responses_of_a_system() -> tuple[Problem, Values]:
    """C A^n B: the state of a linear system may be measured along any two axes."""
    A, B, C = Block("A", (2, 2)), Block("B", (2, 1)), Block("C", (1, 2))
    rows, state = [], B.symbol.T
    for _ in range(8):
        rows.append(C.symbol.T @ state)
        state = A.symbol.T @ state
    return problem_of(all_of(rows), A, B, C), {
        "A": np.array([[0.8, 0.3], [-0.2, 0.6]]),
        "B": np.array([[1.0], [0.5]]),
        "C": np.array([[0.7, -0.4]]),
    }


def decays_from_an_unknown_start() -> tuple[Problem, Values]:
    """Three decays since an unknown time: each amount can undo it. The terms may be exchanged."""
    amount, rate, start = Block("amount", (3,)), Block("rate", (3,), "1/s"), Block("start", (), "s")
    t = cs.DM(np.linspace(0.0, 6.0, 40)) - start.symbol
    total = sum(amount.symbol[k] * cs.exp(-rate.symbol[k] * t) for k in range(3))
    return problem_of([observed("decay", total, 0.01, "1")], amount, rate, start), {
        "amount": np.array([1.0, 2.0, 1.5]),
        "rate": np.array([0.3, 1.0, 3.0]),
        "start": np.array(0.2),
    }


def prey_without_predators() -> tuple[Problem, Values]:
    """Lotka and Volterra, where only prey is counted: predators have no unit."""
    s, blocks, at = numbers(birth=1.0, eaten=0.5, death=0.8, growth=0.4, prey=2.0, predators=1.5)

    def slope(x: cs.MX) -> cs.MX:
        met = x[0] * x[1]
        return cs.vertcat(
            s["birth"] * x[0] - s["eaten"] * met, s["growth"] * met - s["death"] * x[1]
        )

    start = cs.vertcat(s["prey"], s["predators"])
    seen = [x[0] for x in simulated(slope, start, 0.2, 30)]
    return problem_of(all_of(seen), *blocks), at


FURTHER_ZOO = (
    # the focal length of view 0 is known, so it cannot be held as a whole: turn, place, one more
    Specimen(two_views_of_their_own_focals, SIMILARITY, 7, 3, "landmarks"),
    Specimen(five_cameras_in_two_blocks, SIMILARITY, 7, 2, "points"),
    Specimen(four_cameras_in_quaternions, SIMILARITY, 7, 3, "points"),
    Specimen(rig_in_a_frame_of_its_own, {"translation": 6, "rotation": 6, "scale": 1}, 13, 3),
    Specimen(
        projective_cameras, RIGID | {"scale": 4, "mixing": 5, "projective": 3}, 18, 4, "points cam0"
    ),
    Specimen(
        homographies_of_a_board,
        PLANE | {"scale": 4, "mixing": 2, "projective": 2},
        11,
        3,
        "corners",
    ),
    Specimen(one_view_of_a_plane, {}, 3, 1, "focal middle"),
    Specimen(hand_and_eye_with_unknown_squares, {}, 0, 0),
    Specimen(body_of_unknown_size, {"trade-off": 1}, 1, 1, "size trans"),
    Specimen(template_and_shapes, {"offset": 2, "scale": 2, "mixing": 2}, 6, 3, "betas"),
    Specimen(weights_by_softmax, {"offset": 5}, 5, 5, "logits"),
    Specimen(markers_on_two_segments, {"translation": 6, "rotation": 6}, 12, 2, "upper lower"),
    Specimen(arm_with_a_tool, {"trade-off": 2}, 2, 1, "tool"),
    Specimen(survey_in_east_and_north, PLANE, 3, 3, "east north"),
    Specimen(cylinder_through_points, {"trade-off": 2}, 2, 2, "turn place"),
    Specimen(tilt_series, {"offset": 4, "scale": 1}, 5, 2, "markers tilts"),
    Specimen(magnetometer, {"rotation": 3}, 3, 3, "A", exchanged=("A",)),
    Specimen(tensor_in_a_turned_frame, {"trade-off": 6}, 6, 2, "turn S"),
    Specimen(coils_and_image, {"scale": 1, "rotation": 1}, 2, 1, "image"),
    Specimen(crystal_from_intensities, {"offset": 2}, 2, 1, "atoms", exchanged=("atoms",)),
    Specimen(tucker_factors, {"scale": 6, "mixing": 6}, 12, 3, "A B C core"),
    Specimen(
        embeddings_with_biases, {"offset": 5, "scale": 2, "mixing": 2}, 9, 5, "words contexts"
    ),
    Specimen(factors_of_a_covariance, {"rotation": 3}, 3, 3, "loadings"),
    Specimen(age_period_cohort, {"offset": 2}, 3, 3, "age period cohort"),
    Specimen(responses_of_a_system, {"scale": 1, "trade-off": 3}, 4, 2, "A B C"),
    Specimen(
        decays_from_an_unknown_start,
        {"trade-off": 1},
        1,
        1,
        "amount start",
        exchanged=("amount", "rate"),
    ),
    Specimen(prey_without_predators, {"scale": 1}, 1, 1, "eaten predators"),
)
