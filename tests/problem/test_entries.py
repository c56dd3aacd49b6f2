"""Entries of blocks are free by name, and all else stays as it was given."""

import casadi as cs
import numpy as np
import pytest

import workbench as wb
from tests.bodies_made_up import smpl_like_body
from tests.problem.test_chain import assert_same
from tests.tiers import few
from workbench import SOLVERS, residuals
from workbench.blocks import Layout
from workbench.blocks.layout import entries
from workbench.errors import BadBounds, MissingValue, ShapeMismatch, UnknownName

BODY = smpl_like_body()
POSE, BETAS, TRANS = (block.symbol for block in BODY.blocks())
RNG = np.random.default_rng(0)
TRUTH = {
    "pose": RNG.normal(scale=0.2, size=(24, 3)),
    "betas": RNG.normal(size=4),
    "trans": np.array([0.3, -0.2, 0.5]),
}
SEEN = BODY.vertices(TRUTH["pose"], TRUTH["betas"], TRUTH["trans"])
CHOICES = (
    ("pose[pelvis]",),
    ("trans", "pose[pelvis]"),
    ("pose[left_hip]", "betas[0:2]", "pose[pelvis, y]", "trans[1]"),
    ("pose[3:6]", "betas", "pose[23, z]"),
    ("betas[1]", "pose"),
)
EACH = pytest.mark.parametrize("free", few(CHOICES, [CHOICES[2], CHOICES[3]]), ids=str)


def mesh() -> wb.Residual:
    return residuals.vertices(BODY.points(POSE, BETAS, TRANS), SEEN, sigma=0.01)


def face() -> wb.Residual:
    joints = BODY.joint_points(POSE, BETAS, TRANS)
    return residuals.landmarks(joints, BODY.joints(TRUTH["pose"]), sigma=0.02)


def priors() -> tuple[wb.Residual, ...]:
    return (
        residuals.gaussian(BETAS, name="shape prior"),
        residuals.gaussian(cs.vec(POSE), name="pose prior"),
    )


def problem(free: tuple[str, ...], **more: object) -> wb.Problem:
    return wb.Problem([mesh(), face(), *priors()], free, **more)


def start() -> wb.Values:
    rng = np.random.default_rng(7)
    return {name: value + rng.normal(scale=0.05, size=value.shape) for name, value in TRUTH.items()}


def of_the_whole(free: tuple[str, ...]) -> np.ndarray:
    """Where the free entries stand among those of a problem in which all is free."""
    return entries(problem(("pose", "betas", "trans")).free, free)


def in_its_order(part: wb.Problem) -> np.ndarray:
    """The same in the order of a problem's own free numbers."""
    whole = problem(("pose", "betas", "trans")).free
    return np.concatenate(
        [[whole.place(block.name, entry) for entry in block.places] for block in part.free.blocks]
    )


# Names.


def test_syntax_of_entries() -> None:
    layout = problem(("pose", "betas", "trans")).free
    assert entries(layout, "pose[pelvis]").tolist() == [0, 1, 2]
    assert entries(layout, "pose[pelvis, x]").tolist() == [0]
    assert entries(layout, "pose[1:3]").tolist() == list(range(3, 9))
    assert entries(layout, "pose[2, y]").tolist() == [7]
    assert entries(layout, "betas[0:3]").tolist() == [72, 73, 74]
    assert entries(layout, "betas[2:]").tolist() == [74, 75]
    assert entries(layout, "betas[:1]").tolist() == [72]
    assert entries(layout, ("trans", "betas[0]")).tolist() == [72, 76, 77, 78]
    odd = Layout((wb.Block("a", (2,)), wb.Block("a[b]", (3,))))
    assert entries(odd, "a[b]").tolist() == [2, 3, 4]
    assert entries(odd, "a[b][1]").tolist() == [3]
    assert entries(odd, "a[1]").tolist() == [1]


def test_unknown_entries_are_refused_with_those_that_exist() -> None:
    for name, sentence in [
        ("pose[knee]", r"no entry is called 'pose\[knee\]'; there are .*pose\[left_hip\]"),
        ("betas[2:9]", r"no entry is called 'betas\[2:9\]'; there are betas\[0\], betas\[1\]"),
        ("poze[pelvis]", "no block is called 'poze.*'; there are .*pose"),
        ("pose[", r"no entry is called 'pose\['; there are"),
    ]:
        with pytest.raises(UnknownName, match=sentence):
            problem((name,))
        with pytest.raises(UnknownName, match=sentence):
            problem(("trans",)).freeing("trans", name)


@EACH
def test_free_entries_keep_labels_and_units(free: tuple[str, ...]) -> None:
    part, whole = problem(free), problem(("pose", "betas", "trans"))
    places = in_its_order(part)
    assert sorted(places.tolist()) == of_the_whole(free).tolist()
    assert part.free.size == len(places)
    assert [part.free.label(i) for i in range(part.free.size)] == [
        whole.free.label(int(i)) for i in places
    ]
    assert [part.free.unit(i) for i in range(part.free.size)] == [
        whole.free.unit(int(i)) for i in places
    ]
    again = part.freeing(*part.free.spelled())  # and the names mean the same again
    assert in_its_order(again).tolist() == places.tolist()
    assert entries(part.free, part.free.spelled()).tolist() == list(range(part.free.size))


# Numbers.


@EACH
def test_split_and_values_keep_held_entries(free: tuple[str, ...]) -> None:
    part = problem(free)
    x, fixed = part.split(TRUTH)
    back = part.values(x, fixed)
    assert set(back) == set(TRUTH)
    for name, value in TRUTH.items():
        np.testing.assert_array_equal(back[name], value)
    moved = part.values(x + 1, fixed)
    np.testing.assert_array_equal(part.split(moved)[1], fixed)  # whatever the free ones are
    np.testing.assert_array_equal(part.split(moved)[0], x + 1)
    changed = sum(int(np.sum(moved[name] != TRUTH[name])) for name in TRUTH)
    assert changed == part.free.size
    if part.free.parts:
        with pytest.raises(MissingValue):
            part.free.unpack(x)


@EACH
def test_jacobian_has_the_columns_of_free_entries(free: tuple[str, ...]) -> None:
    part, whole = problem(free), problem(("pose", "betas", "trans"))
    values = start()
    assert_same(part, values)
    places, here = in_its_order(part), whole.linearize(values)
    J = part.linearize(values).jacobian
    scale = np.abs(here.jacobian).max()
    np.testing.assert_allclose(J, here.jacobian[:, places], rtol=0, atol=1e-12 * scale)
    x, fixed = part.split(values)
    H = whole.hessian_at(*whole.split(values))[np.ix_(places, places)]
    np.testing.assert_allclose(part.hessian_at(x, fixed), H, rtol=0, atol=1e-11 * np.abs(H).max())
    end = wb.solve(part, values)
    x, fixed = part.split(values | end.values)
    assert part.optimality(x, part.linearize_at(x, fixed)) < 1e-6


# Bounds and constraints.


def test_bounds_of_blocks_and_of_entries() -> None:
    low = np.arange(72.0).reshape(24, 3) - 100
    part = problem(("pose[pelvis]", "pose[left_knee]", "trans"), bounds={"pose": (low, 100)})
    at = [part.free.place("pose", e) for e in (0, 1, 2, 12, 13, 14)]
    np.testing.assert_array_equal(part.lower[at], low.ravel()[[0, 1, 2, 12, 13, 14]])
    assert np.isinf(part.lower[part.free.slices["trans"]]).all()
    both = problem(("pose",), bounds={"pose[left_knee, x]": (0, 2), "pose": (-3, 3)})
    assert (both.lower[12], both.upper[12]) == (0, 2)  # the entry's own count more
    assert (both.lower[13], both.upper[13]) == (-3, 3)
    row = problem(("pose",), bounds={"pose[left_knee]": ([0, -1, -2], [1, 2, 3])})
    np.testing.assert_array_equal(row.lower[12:15], [0, -1, -2])
    narrower = both.freeing("pose[left_knee]")
    assert narrower.lower.tolist() == [0, -3, -3]
    assert not both.freeing("trans").bounded
    with pytest.raises(BadBounds, match=r"entry 'pose\[left_knee\]' has bounds but is fixed"):
        problem(("pose[pelvis]",), bounds={"pose[left_knee]": (0, 1)})
    with pytest.raises(BadBounds, match=r"pose\[left_knee, x\] has the lower bound 2"):
        problem(("pose[left_knee]",), bounds={"pose[left_knee, x]": (2, 1)})
    with pytest.raises(ShapeMismatch):
        problem(("pose",), bounds={"pose[left_knee]": (np.zeros(7), 1)})
    with pytest.raises(UnknownName, match="no entry is called"):
        problem(("pose",), bounds={"pose[tail]": (0, 1)})


# Solvers.


@pytest.mark.parametrize(
    "name",
    few(["levenberg-marquardt", "ipopt", "dogleg", "scipy-trf", "nlopt-lbfgs", "sqp"], 2),
)
def test_solution_has_whole_blocks(name: str) -> None:
    part, values = problem(("trans", "pose[pelvis]")), start()
    solution = wb.solve(part, values, solver=SOLVERS[name])
    assert set(solution.values) == {"trans", "pose"}
    pose = solution.values["pose"]
    assert pose.shape == (24, 3)
    np.testing.assert_array_equal(pose[1:], values["pose"][1:])
    assert (pose[0] != values["pose"][0]).all()
    assert solution.cost < part.linearize(values).cost
    assert solution.trace[-1].values["pose"].shape == (24, 3)
    again = part.linearize(values | solution.values)
    np.testing.assert_allclose(again.cost, solution.cost, rtol=1e-9)
