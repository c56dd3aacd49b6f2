"""A sequence is the sum of its frames, and of what is between them, whatever the frames are."""

from dataclasses import replace

import casadi as cs
import numpy as np
import pytest

import workbench as wb
from tests.problem.sequences import (
    BETAS,
    BODY,
    FREE,
    JOINTS,
    OF_CAMERA,
    PIXELS,
    POSE,
    SEEN,
    SHARED,
    SMOOTH,
    SURE,
    TRANS,
    assert_numbers,
    both_storages,
    frame,
    frame_by_frame,
    in_blocks_of_frames,
    of_frame,
    values,
)
from tests.tiers import THOROUGH, few
from workbench import residuals
from workbench.errors import BadArgument, BadBounds, BadResidual, UnknownName, WorkbenchError
from workbench.problem.banded import BlockMatrix
from workbench.residuals import huber

ONCE = ("shape prior",)


@pytest.fixture(params=["blocks of frames", pytest.param("array", marks=THOROUGH)])
def storage(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    if request.param != "array":
        in_blocks_of_frames(monkeypatch)
    return str(request.param)


def assert_frames(
    whole: wb.Problem, each: list[wb.Problem], numbers: wb.Values, once: tuple[str, ...] = ONCE
) -> None:
    """Every number is that of the whole graph, and rows of frames are those of frames alone."""
    here = assert_numbers(whole, numbers)
    r, J, known = frame_by_frame(whole, each, numbers, once)
    np.testing.assert_allclose(here.residual[known], r[known], atol=1e-10)
    np.testing.assert_allclose(here.dense[known], J[known], atol=1e-11 * np.abs(J).max())
    between = [name for name in whole.rows if not any(name in problem.rows for problem in each)]
    assert (~known).sum() == sum(len(here.residual[whole.rows[name]]) for name in between)
    made_of = whole.rounding(*whole.split(numbers), here.residual).rows
    for t, problem in enumerate(each):
        x, fixed = problem.split(of_frame(whole, numbers, t))
        own = problem.rounding(x, fixed, problem.residual(x, fixed)).rows
        for name, rows in problem.rows.items():
            if name not in once and all(name in other.rows for other in each):
                size = rows.stop - rows.start
                first = whole.rows[name].start + sum(
                    other.rows[name].stop - other.rows[name].start for other in each[:t]
                )
                if whole.free.parts:
                    continue  # a frame alone is made of all that is free in it
                np.testing.assert_allclose(made_of[first : first + size], own[rows], rtol=1e-9)


# The numbers.


@pytest.mark.parametrize("storage", ["array", "blocks of frames"], indirect=True)
@pytest.mark.parametrize("count", [1, 5])
def test_sequence_of_a_repeated_frame(count: int, storage: str) -> None:
    each = [frame()] * count
    between = SMOOTH if count > 2 else ()
    whole = wb.sequence(each, shared=SHARED, between=between)
    assert_frames(whole, each, values(count))
    assert isinstance(whole.linearize(values(count)).jacobian, np.ndarray) == (storage == "array")


@pytest.mark.parametrize("shared", few([("trans", "betas"), (), "betas", OF_CAMERA], 2), ids=str)
def test_sequence_shares_any_blocks(shared: str | tuple[str, ...], storage: str) -> None:
    numbers = values(3)
    names = (shared,) if isinstance(shared, str) else shared
    for name in frame().known:
        if name in ("betas", *OF_CAMERA) and name not in names:
            numbers[name] = np.stack([numbers[name] + 0.01 * t for t in range(3)])
        elif name in names and name == "trans":
            numbers[name] = numbers[name][0]
    each = [frame()] * 3
    whole = wb.sequence(each, shared=shared, between=SMOOTH[:1])
    for block in whole.known.values():
        assert block.framed == (block.name not in names)
    assert_frames(whole, each, numbers, ONCE if "betas" in names else ())


def test_shared_blocks_may_be_free(storage: str) -> None:
    one = frame().freeing("pose", "left/focal", "left/rotation")
    whole = wb.sequence([one] * 3, shared=SHARED, between=SMOOTH)
    assert whole.free.names == ("pose", "left/focal", "left/rotation")
    assert_frames(whole, [one] * 3, values(3))


def test_frames_may_miss_a_camera(storage: str) -> None:
    each = [frame(), frame(), frame().without("image"), frame()]
    whole = wb.sequence(each, shared=SHARED, between=SMOOTH)
    assert whole.rows["image"].stop - whole.rows["image"].start == 3 * 16
    assert_frames(whole, each, values(4))
    labels = [
        whole.row_label(i) for i in range(whole.rows["image"].start, whole.rows["image"].stop)
    ]
    assert {int(label.split("[")[1].split(",")[0]) for label in labels} == {0, 1, 3}


def test_frames_may_have_blocks_of_their_own(storage: str) -> None:
    """The second frame alone has a marker, whose offset is free there."""
    offset = wb.Block("offset", (3,), "m")
    marker = wb.Residual(
        "marker", JOINTS.symbol[:, 2] + offset.symbol - 0.3, 0.01, "m", points=(JOINTS,)
    )
    more = wb.Problem((*frame().residuals, marker), (*FREE, "offset"), blocks=(offset,))
    each = [frame(), more, frame()]
    whole = wb.sequence(each, shared=SHARED)
    assert whole.known["offset"].shape == (3, 3)
    here = assert_numbers(whole, numbers := values(3) | {"offset": np.ones((3, 3))})
    r, J, known = frame_by_frame(whole, each, numbers, ONCE)
    assert known.all()
    np.testing.assert_allclose(here.residual, r, atol=1e-10)
    np.testing.assert_allclose(here.dense, J, atol=1e-10 * np.abs(J).max())
    silent = here.column_norms[whole.free.slices["offset"]].reshape(3, 3) == 0
    np.testing.assert_array_equal(silent.all(axis=1), [True, False, True])


def counted(count: int, seed: int, **more: object) -> wb.Problem:
    """A frame in which `count` of the joints were seen, as numbers and not as a block."""
    seen = np.random.default_rng(seed).standard_normal((count, 3))
    off = cs.vec(JOINTS.symbol[:, :count] - cs.DM(seen.T))
    data = wb.Residual("joints", off, 0.02, "m", points=(JOINTS,), rows_per_point=3)
    prior = residuals.gaussian(POSE.symbol, covariance=0.09, name="pose prior")
    return wb.Problem((replace(data, **more), prior), ("pose", "trans"))


def test_residuals_of_frames_may_differ_in_rows(storage: str) -> None:
    each = [counted(2, 0), counted(3, 1), counted(1, 2), counted(3, 3)]
    whole = wb.sequence(each, shared="betas", between=SMOOTH[:1])
    assert whole.rows["joints"] == slice(0, 27)
    assert_frames(whole, each, values(4), ())
    assert whole.row_label(8) == "joints[1, 2]"


def test_weights_of_frames_may_differ(storage: str) -> None:
    sure = wb.Block("certain", (3,))
    each = [
        counted(3, 0),
        counted(3, 1, weights=np.array([0.5, 2.0, 1.0])),
        counted(3, 2, weights=0.3),
        counted(2, 3, weights=np.linspace(0.1, 2, 6)),
        counted(3, 4, weights=sure.symbol),
    ]
    numbers = wb.sequence(each[:4], shared="betas")
    assert_frames(numbers, each[:4], values(4), ())
    whole = wb.sequence(each, shared="betas")
    numbers = values(5) | {"certain": np.linspace(0.1, 3, 15).reshape(5, 3)}
    assert_frames(whole, each, numbers, ())


def test_shared_priors_count_once() -> None:
    whole = wb.sequence([frame()] * 4, shared=SHARED)
    assert whole.rows["shape prior"].stop - whole.rows["shape prior"].start == 2
    alone = wb.sequence([frame()] * 4, shared=OF_CAMERA)
    assert alone.rows["shape prior"].stop - alone.rows["shape prior"].start == 8
    # Frames that say different things about what they share are all heard.
    said = [
        wb.Problem(
            (
                *frame().without("shape prior").residuals,
                residuals.gaussian(BETAS.symbol, mean=float(t), name="shape prior"),
            ),
            FREE,
            blocks=(SEEN, PIXELS, SURE),
        )
        for t in range(3)
    ]
    heard = wb.sequence(said, shared=SHARED)
    assert heard.rows["shape prior"].stop - heard.rows["shape prior"].start == 6
    assert_frames(heard, said, values(3), ())


def test_frames_built_one_by_one_share_names() -> None:
    """Blocks go by their names: a loop that makes a Block in each turn is a usual thing."""

    def built(mean: float) -> wb.Problem:
        x, s = wb.Block("x", (2,)), wb.Block("s")
        terms = [
            wb.Residual("off", x.symbol - s.symbol, 0.1),
            residuals.gaussian(x.symbol, mean=mean, name="near"),
            residuals.gaussian(s.symbol, name="shared"),
        ]
        return wb.Problem(terms, ("x", "s"))

    each = [built(float(t)) for t in range(3)]
    whole = wb.sequence(each, shared="s")
    assert_frames(whole, each, {"x": np.arange(6.0).reshape(3, 2), "s": np.array(2.0)}, ())
    only_late = [each[0].without("shared"), each[1]]
    late = wb.sequence(only_late, shared="s")
    assert_frames(late, only_late, {"x": np.ones((2, 2)), "s": np.array(2.0)}, ())


CHOICES = (
    ("pose[1]", "betas"),
    ("betas[1]", "pose[2, joint0]", "trans[0]", "trans[2, y]"),
    ("pose[0]", "pose[2]", "betas"),  # the frame between is held
    ("pose[:, joint1]", "trans"),
    ("pose[1:3]", "betas"),
    ("betas", "trans", "pose"),
)


@pytest.mark.parametrize("free", few(CHOICES, 2), ids=str)
def test_sequence_of_free_entries(free: tuple[str, ...], storage: str) -> None:
    whole = wb.sequence([frame()] * 3, shared=SHARED, between=SMOOTH)
    part = whole.freeing(*free)
    here = assert_numbers(part, values(3))
    J = whole.linearize(values(3)).dense
    chosen = [
        whole.free.place(block.name, entry) for block in part.free.blocks for entry in block.places
    ]
    np.testing.assert_allclose(here.dense, J[:, chosen], rtol=0, atol=1e-10 * np.abs(J).max())


# Bounds and constraints.


def test_bounds_of_frames_and_of_shared_blocks() -> None:
    terms, blocks = frame().residuals, (SEEN, PIXELS, SURE)
    one = wb.Problem(terms, FREE, {"pose": (-1.0, 2.0), "betas": (-3.0, 2.0)}, blocks)
    other = wb.Problem(terms, FREE, {"pose[joint1]": (-0.5, 0.5), "betas": (-2.0, 3.0)}, blocks)
    whole = wb.sequence([one, other, frame()], shared=SHARED)
    lower, upper = whole.free.unpack(whole.lower), whole.free.unpack(whole.upper)
    np.testing.assert_array_equal(lower["betas"], [-2, -2])
    np.testing.assert_array_equal(upper["betas"], [2, 2])
    np.testing.assert_array_equal(upper["pose"][0], np.full((3, 3), 2.0))
    np.testing.assert_array_equal(upper["pose"][1][1], [0.5, 0.5, 0.5])
    assert np.isinf(upper["pose"][1][[0, 2]]).all()
    assert np.isinf(upper["pose"][2]).all()
    assert np.isinf(lower["trans"]).all()
    apart = wb.Problem(terms, FREE, {"betas": (4.0, 5.0)}, blocks)
    with pytest.raises(BadBounds, match=r"betas\[0\] has the lower bound 4 and the upper bound 2"):
        wb.sequence([one, apart], shared=SHARED)


def lifted(t: int) -> wb.Constraint:
    return wb.Constraint("lifted", TRANS.symbol[1], 0.1 * t, np.inf, "m", tolerance=1e-6 * (t + 1))


def test_constraints_of_frames_are_stacked() -> None:
    # The distance of two joints is one in all frames; the height is another in each.
    gap = JOINTS.symbol[:, 2] - JOINTS.symbol[:, 0]
    apart = wb.Constraint("apart", cs.sumsqr(gap), 0.0, 4.0, "m^2", (JOINTS,))
    narrow = wb.Constraint("narrow", BETAS.symbol[0], -1.0, 1.0)
    each = [
        wb.Problem(frame().residuals, FREE, None, (SEEN, PIXELS, SURE), (lifted(t), apart, narrow))
        for t in range(3)
    ]
    whole = wb.sequence(each, shared=SHARED)
    assert [c.name for c in whole.constraints] == ["lifted", "apart", "narrow"]
    assert [c.size for c in whole.constraints] == [3, 3, 1]
    np.testing.assert_allclose(whole.constraints[0].limits[0], [0.0, 0.1, 0.2])
    assert whole.constraints[0].tolerance == 1e-6
    numbers = values(3)
    here = whole.linearize(numbers).constraints
    assert here is not None
    expected = np.concatenate(
        [
            numbers["trans"][:, 1],
            [
                np.sum((j[2] - j[0]) ** 2)
                for j in (
                    BODY.joints(p, numbers["betas"], t)
                    for p, t in zip(numbers["pose"], numbers["trans"], strict=True)
                )
            ],
            [numbers["betas"][0]],
        ]
    )
    np.testing.assert_allclose(here.values, expected, atol=1e-12)
    solution = wb.Ipopt().solve(whole, numbers)
    assert solution.converged, solution.message
    assert (solution.values["trans"][:, 1] > [-1e-6, 0.1 - 1e-6, 0.2 - 1e-6]).all()


# Names.


def test_every_entry_and_row_has_a_name() -> None:
    whole = wb.sequence([frame()] * 3, shared=SHARED, between=SMOOTH)
    entries = [whole.free.label(i) for i in range(whole.free.size)]
    assert len(set(entries)) == len(entries)
    assert entries[:4] == ["trans[0, x]", "trans[0, y]", "trans[0, z]", "trans[1, x]"]
    assert "pose[2, joint1, z]" in entries
    assert entries[-1] == "betas[1]"
    rows = [whole.row_label(i) for i in range(whole.size)]
    assert len(set(rows)) == len(rows)
    assert rows[0] == "joints[0, joint0, x]"
    assert "joints[2, joint1, z]" in rows
    assert "image[1, 3, v]" in rows or any(row.startswith("image[1, ") for row in rows)
    assert "shape prior[1]" in rows
    assert "smooth(pose)[1 to 2, joint2, y]" in rows
    assert "smooth(trans, order 2)[0 to 2, x]" in rows
    numbers = values(3)
    back = whole.values(*whole.split(numbers))
    assert back["pose"].shape == (3, 3, 3)
    for name, value in numbers.items():
        np.testing.assert_array_equal(back[name], value)


# Solutions.


def test_banded_solution_is_the_dense_one(monkeypatch: pytest.MonkeyPatch) -> None:
    numbers = values(6)
    plain, blocked = both_storages(
        lambda: wb.sequence([frame()] * 6, shared=SHARED, between=SMOOTH), monkeypatch
    )
    solver = wb.LevenbergMarquardt(gradient_tolerance=1e-10)
    one, other = solver.solve(plain, numbers), solver.solve(blocked, numbers)
    assert one.converged
    assert other.converged
    assert other.trace[-1].linear_algebra == "band cholesky"
    assert isinstance(blocked.linearize(numbers).jacobian, BlockMatrix)
    for name in FREE:
        np.testing.assert_allclose(other.values[name], one.values[name], rtol=0, atol=1e-9)
    assert other.cost == pytest.approx(one.cost, rel=1e-12)


# Bad input.


def test_bad_sequences_are_refused() -> None:
    wider = residuals.gaussian(wb.Block("pose", (4, 3)).symbol, name="pose prior")
    other = wb.Problem((wider,), ("pose",))
    with pytest.raises(BadArgument, match="at least one frame"):
        wb.sequence([])
    with pytest.raises(WorkbenchError, match="the frames of a sequence"):
        wb.sequence([frame(), "frame"])  # type: ignore[list-item]
    with pytest.raises(BadArgument, match="'pose' has the shape"):
        wb.sequence([frame(), frame(), other])
    with pytest.raises(BadArgument, match="'betas' is not free"):
        wb.sequence([frame(), frame().freeing("pose", "trans")])
    with pytest.raises(UnknownName, match=r"no block is called 'beta'.*betas"):
        wb.sequence([frame()] * 2, shared="beta")
    with pytest.raises(BadArgument, match=r"function from Frames to a Residual.* of type str"):
        wb.sequence([frame()] * 2, between=["pose"])  # type: ignore[list-item]
    with pytest.raises(BadResidual, match="makes a Residual of them, not something of type MX"):
        wb.sequence([frame()] * 2, between=[lambda frames: frames["pose"].symbol])  # type: ignore[list-item,return-value]


def test_residuals_of_one_name_must_be_alike() -> None:
    with pytest.raises(BadResidual, match="'joints' has another kernel in frame 1 than in frame 0"):
        wb.sequence([counted(3, 0), counted(3, 1, kernel=huber(1.0))])
    with pytest.raises(BadResidual, match="'joints' has another unit in frame 1"):
        wb.sequence([counted(3, 0), counted(3, 1, unit="mm")])
