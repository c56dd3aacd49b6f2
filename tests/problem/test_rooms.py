"""Memory of large Jacobians is used again, and never while somebody holds an array in it."""

import gc
import sys

import casadi as cs
import numpy as np
import pytest

import workbench as wb
from tests.bodies_made_up import random_body
from workbench.problem.rooms import KEPT, LINE, WORTH_KEEPING, Rooms
from workbench.residuals.kernels import quadratic
from workbench.residuals.residual import Residual

ROWS, COLUMNS = 400, 500  # 1.6 MB


def place(array: np.ndarray) -> int:
    return int(array.__array_interface__["data"][0])


def test_a_room_is_used_again_once_all_views_are_gone() -> None:
    rooms = Rooms()
    room, first = rooms.array(ROWS, COLUMNS)
    room[:] = 7.0
    del room
    at, view = place(first), first.T[3:]
    del first
    room, second = rooms.array(ROWS, COLUMNS)
    assert place(second) != at  # a view of the first is still there
    room[:] = 1.0
    assert (view == 7.0).all()
    del view
    room, third = rooms.array(ROWS, COLUMNS)
    assert place(third) == at
    assert (third == 7.0).all()  # what the last one left


@pytest.mark.parametrize("columns", [COLUMNS, COLUMNS + 1, 50 * COLUMNS])
def test_rooms_begin_at_a_cache_line(columns: int) -> None:
    room, found = Rooms().array(ROWS, columns)
    assert place(room) % LINE == 0
    assert place(found) == place(room)
    assert not room.any()


def test_nobody_else_can_write_to_a_room() -> None:
    _, found = Rooms().array(ROWS, COLUMNS)
    with pytest.raises(ValueError, match="read-only"):
        found[0, 0] = 1.0
    with pytest.raises(ValueError, match="WRITEABLE"):
        found.flags.writeable = True


def test_few_rooms_wait_and_small_arrays_need_none() -> None:
    rooms = Rooms()
    made = [rooms.array(ROWS, COLUMNS)[1] for _ in range(KEPT + 2)]
    made.clear()
    assert len(rooms._free) == KEPT
    _, other = rooms.array(ROWS, COLUMNS + 1)
    assert other.shape == (ROWS, COLUMNS + 1)
    small = Rooms()
    _, some = small.array(3, 4)
    assert some.nbytes < WORTH_KEEPING
    del some
    assert not small._free
    assert small.array(0, 5)[1].shape == (0, 5)


def test_arrays_outlive_their_rooms(monkeypatch: pytest.MonkeyPatch) -> None:
    raised: list[object] = []  # what callbacks raise is only printed otherwise
    monkeypatch.setattr(sys, "unraisablehook", raised.append)
    rooms = Rooms()
    room, found = rooms.array(ROWS, COLUMNS)
    room[:] = 3.0
    del room, rooms
    gc.collect()
    others = [np.full((ROWS, COLUMNS), 7.0) for _ in range(3)]  # where it would be free
    assert (found == 3.0).all()
    del found, others
    gc.collect()
    assert raised == []


def test_jacobians_that_are_kept_keep_their_numbers() -> None:
    body = random_body(0, n_vertices=2000, n_joints=8, n_betas=4)
    points = body.points(*(block.symbol for block in body.blocks()))
    seen = wb.residuals.vertices(points, body.template, sigma=0.01)
    problem = wb.Problem([seen], ["pose", "betas", "trans"])
    rng = np.random.default_rng(0)
    xs = [0.3 * rng.standard_normal(problem.free.size) for _ in range(5)]
    kept = [problem.linearize_at(x, np.zeros(0)).jacobian for x in xs]
    gc.collect()
    for x, J in zip(xs, kept, strict=True):
        np.testing.assert_array_equal(problem.linearize_at(x, np.zeros(0)).jacobian, J)


def test_what_was_in_a_room_before_never_shows() -> None:
    """Rows that read x directly, where a joint leaves a vertex alone; and rows of other points."""
    body = wb.load_body("default")
    pose, betas, trans = (block.symbol for block in body.blocks())
    points = body.points(pose, betas, trans)
    sway = 0.1 * cs.sin(cs.sum1(cs.vec(pose)) * cs.DM(np.arange(1.0, body.n_vertices + 1)).T)
    swaying = cs.vec(points.symbol + cs.repmat(sway, 3, 1))
    moved = Residual("moved", swaying, 0.01, "m", quadratic, (points,))
    calm = wb.residuals.gaussian(betas)
    at = body.joint_points(pose, betas, trans)
    apart = cs.vec(at.symbol[:, 1:] - at.symbol[:, :-1])  # so that products add to its rows
    joints = Residual("apart", apart, 1.0, "m", quadratic, (at,))

    def problem() -> wb.Problem:
        return wb.Problem([calm, moved, joints], ["pose", "betas", "trans"])

    used, rng = problem(), np.random.default_rng(0)
    for _ in range(4):
        x = 0.3 * rng.standard_normal(used.free.size)
        expected = problem().linearize_at(x, np.zeros(0)).jacobian
        np.testing.assert_array_equal(used.linearize_at(x, np.zeros(0)).jacobian, expected)
        gc.collect()
    assert used._chain._rooms._free  # it was used again
