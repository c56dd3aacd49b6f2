"""Further problems whose null directions are known: less common forms and other fields."""

import casadi as cs
import numpy as np

from tests.diagnostics.zoo import (
    RIGID,
    SIMILARITY,
    Specimen,
    all_of,
    beside,
    observed,
    pixels,
    problem_of,
    turned,
)
from workbench import Block, Problem, Values


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


def factors_of_a_covariance() -> tuple[Problem, Values]:
    """L L' + diag(own): the loadings L may be multiplied by any rotation."""
    rng = np.random.default_rng(115)
    L, own = Block("loadings", (8, 3)), Block("own", (8,))
    C = L.symbol.T @ L.symbol + cs.diag(own.symbol)
    lower = cs.vertcat(*[C[i, j] for i in range(8) for j in range(i + 1)])
    at = {"loadings": rng.normal(size=(8, 3)), "own": rng.uniform(0.5, 1.5, size=8)}
    return problem_of([observed("covariance", lower, 0.05, "1")], L, own), at


FURTHER_ZOO = (
    Specimen(five_cameras_in_two_blocks, SIMILARITY, 7, 3, "points"),
    Specimen(four_cameras_in_quaternions, SIMILARITY, 7, 3, "points"),
    Specimen(rig_in_a_frame_of_its_own, {"translation": 6, "rotation": 6, "scale": 1}, 13, 3),
    Specimen(
        projective_cameras, RIGID | {"scale": 4, "mixing": 5, "projective": 3}, 18, 4, "points cam0"
    ),
    Specimen(one_view_of_a_plane, {}, 3, 1, "focal middle"),
    Specimen(template_and_shapes, {"offset": 2, "scale": 2, "mixing": 2}, 6, 3, "betas"),
    Specimen(weights_by_softmax, {"offset": 5}, 5, 5, "logits"),
    Specimen(tucker_factors, {"scale": 6, "mixing": 6}, 12, 3, "A B C core"),
    Specimen(factors_of_a_covariance, {"rotation": 3}, 3, 3, "loadings"),
)
