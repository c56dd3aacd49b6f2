"""The diagnosis of long sequences says what the dense one says, in numbers and in names."""

import json
from collections.abc import Sequence
from pathlib import Path

import casadi as cs
import numpy as np
import pytest

from tests.diagnostics.zoo import body_and_camera
from tests.tiers import few
from workbench import Block, Problem, Values, diagnose, load_body, residuals, sequence
from workbench.diagnostics import Diagnosis, Gauge, SequenceDiagnosis, Undiagnosed
from workbench.diagnostics.active_set import linearized
from workbench.errors import BadArgument, NotFinite
from workbench.problem import frames as frame_chains
from workbench.problem import storage
from workbench.reports import write_diagnosis
from workbench.residuals import Residual
from workbench.residuals.sequences import Between


@pytest.fixture(autouse=True)
def always_long(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every sequence takes the long way, however short it is."""
    monkeypatch.setattr(frame_chains, "is_sparse", lambda *_: True)
    monkeypatch.setattr(frame_chains, "BAND_PER_ENTRY", 1e9)
    monkeypatch.setattr(storage, "SQUARE_UP_TO", 0)


def long(problem: Problem, at: Values, *, priors: Sequence[str] = ()) -> SequenceDiagnosis:
    """Its diagnosis by frames."""
    found = diagnose(problem, at, priors=priors)
    assert isinstance(found, SequenceDiagnosis)
    return found


def dense(d: SequenceDiagnosis) -> np.ndarray:
    """The Jacobian with columns of length 1."""
    J = d.here.dense
    return J / np.where(d.here.column_norms > 0, d.here.column_norms, 1.0)


def largest_sine(a: np.ndarray, b: np.ndarray) -> float:
    """Of the angles between the spans of two sets of columns."""
    a, b = np.linalg.qr(a)[0], np.linalg.qr(b)[0]
    return float(np.linalg.norm(a - b @ (b.T @ a), 2))


def check_against_dense(d: SequenceDiagnosis) -> None:
    """Rank, null space and sigmas are those of the whole Jacobian by SVD."""
    J = dense(d)
    _, s, Vt = np.linalg.svd(J, full_matrices=True)
    rank = int(np.sum(s > np.finfo(float).eps * max(J.shape) * s[0]))
    assert d.rank == rank
    null = Vt[rank:].T
    found = d.eliminated.null_vectors.toarray()
    assert found.shape == null.shape
    if rank < J.shape[1]:
        # singular values that are seen are above 1e-6 in all of these problems
        assert largest_sine(found, null) < 1e-8
    blind = np.sum(null**2, axis=1) > 1e-9
    assert np.array_equal(np.isinf(d.sigma), blind)
    half = Vt[:rank].T / s[:rank]
    sigma = np.linalg.norm(half, axis=1) / d.rows.lengths
    np.testing.assert_allclose(d.sigma[~blind], sigma[~blind], rtol=1e-7)


def arm(observed: Sequence[int], free: Sequence[str] = ("pose", "trans", "betas")) -> Problem:
    """A frame of the small body, some of whose joints are observed."""
    body = load_body("small")
    pose, betas, trans = body.blocks()
    joints = body.joint_points(pose.symbol, betas.symbol, trans.symbol)
    seen = cs.vec(joints.symbol[:, list(observed)])
    return Problem([Residual("joints", seen, 0.01, "m", points=(joints,))], free)


def somewhere(problem: Problem, seed: int = 0) -> Values:
    rng = np.random.default_rng(seed)
    blocks = {b.name: b.base for b in (*problem.free.blocks, *problem.fixed.blocks)}
    return {name: rng.normal(scale=0.3, size=b.shape) for name, b in blocks.items()}


EVERY = range(24)


SMOOTH = (residuals.smooth("pose", sigma=0.1),)
SMOOTHER = (residuals.smooth("pose", sigma=0.1, order=2),)
BOTH = (residuals.smooth("trans", sigma=0.1, order=2), residuals.smooth("pose", sigma=0.2))


@pytest.mark.parametrize(
    ("between", "shared", "observed"),
    few(
        [
            pytest.param(BOTH, ("betas",), EVERY, id="both"),
            pytest.param((), (), (0, 3, 6, 20), id="apart"),
            pytest.param(SMOOTH, ("betas", "trans"), EVERY, id="shared"),
            pytest.param(SMOOTHER, ("betas",), (0, 3, 6, 20), id="few"),
        ],
        1,
    ),
)
def test_numbers_are_those_of_the_whole_jacobian(
    between: tuple[Between, ...], shared: tuple[str, ...], observed: Sequence[int]
) -> None:
    if "trans" in shared:
        between = between[-1:]
    video = sequence([arm(observed)] * 4, shared=shared, between=between)
    check_against_dense(long(video, somewhere(video)))


def linear(
    rows: Sequence[np.ndarray], shared: Sequence[np.ndarray], between: Sequence[Between] = ()
) -> SequenceDiagnosis:
    """Frames whose residuals are A x + B s, x of three numbers."""
    x, s = Block("x", (3,), "rad"), Block("s", (shared[0].shape[1],), "sd")
    frames = [
        Problem(
            [Residual("seen", cs.DM(A) @ x.symbol + cs.DM(B) @ s.symbol, 0.5)],
            ("x", "s"),
            blocks=(x, s),
        )
        for A, B in zip(rows, shared, strict=True)
    ]
    video = sequence(frames, shared=("s",), between=between)
    return long(video, somewhere(video))


@pytest.mark.parametrize("seed", few(range(4), 1))
@pytest.mark.parametrize("order", [0, 1, 2])
def test_planted_null_spaces_are_found(seed: int, order: int) -> None:
    """Frames of any rank, whose shared unknowns hide behind their own."""
    rng = np.random.default_rng(seed)
    rows, shared = [], []
    hidden = rng.normal(size=(2, 3))  # of the shared unknowns: what frames can undo
    for _ in range(7):
        A = rng.normal(size=(6, 2)) @ rng.normal(size=(2, 3))
        A[:, rng.integers(3)] = 0
        B = A @ rng.normal(size=(3, 2)) @ hidden + rng.normal(size=(6, 1)) @ np.array([[1, 0, 0]])
        rows.append(A)
        shared.append(B)
    between = [residuals.smooth("x", sigma=0.7, order=order)] if order else []
    check_against_dense(linear(rows, shared, between))


def watched(seen_in: int, of: int) -> SequenceDiagnosis:
    """A point x of each frame, and a shape of which unknown 3 is seen in some frames only."""
    x, betas = Block("x", (3,), "m"), Block("betas", (5,), "sd")
    rng = np.random.default_rng(1)
    B = rng.normal(size=(9, 5))
    frames = []
    for t in range(of):
        some = B.copy()
        some[:, 3] *= t < seen_in
        r = cs.DM(np.eye(9, 3)) @ x.symbol + cs.DM(some) @ betas.symbol
        frames.append(Problem([Residual("seen", r, 0.1)], ("x", "betas"), blocks=(x, betas)))
    video = sequence(frames, shared=("betas",))
    return long(video, somewhere(video))


def test_a_shared_unknown_is_seen_in_some_frames() -> None:
    d = watched(12, 40)
    assert d.shared.frames_seen.tolist() == [40, 40, 40, 12, 40]
    assert "betas[3] is seen in 12 of 40 frames" in str(d)
    assert "note: betas[3] is seen in 12 of 40 frames" in d.report()
    assert d.rank == d.shape[1]
    d.assert_no_warnings()
    d.assert_rank(125)
    J = d.here.dense
    sigma = np.sqrt(np.diag(np.linalg.inv(J.T @ J)))
    np.testing.assert_allclose(d.sigma, sigma, rtol=1e-8)
    np.testing.assert_allclose(d.shared.sigma, sigma[d.rows.shared], rtol=1e-8)


def test_a_shared_unknown_seen_rarely_is_a_warning() -> None:
    few = watched(2, 40)
    with pytest.raises(Undiagnosed, match=r"betas\[3\] is seen in 2 of 40 frames"):
        few.assert_no_warnings()
    none = watched(0, 40)
    assert none.rank == none.shape[1] - 1
    assert [x.described(40) for x in none.null_directions] == ["betas[3]"]
    assert np.isinf(none.shared.sigma[3])
    assert any(f.warning and "seen in 0 of 40 frames" in f.text for f in none.findings)


def test_shifts_that_frames_undo_are_not_seen() -> None:
    """A shift that the frame's own translation hides is in the rows, and yet not seen."""
    A = np.eye(6, 3)
    B = np.zeros((6, 2))
    B[:3, 0] = 1.0  # in the range of A
    B[4, 1] = 1.0
    d = linear([A] * 5, [B] * 5)
    assert d.shared.frames_seen.tolist() == [0, 5]
    (unseen,) = d.null_directions
    assert unseen.described(5) == "s[0], undone by x in 5 of 5 frames"


def test_unseen_twists_are_gathered_over_frames() -> None:
    """The wrist is free to turn about the bone to the hand, as nothing but the hand is seen."""
    frame = arm(EVERY, ("pose[left_wrist]",))
    T = 6
    alone = sequence([frame] * T)
    at = somewhere(alone)
    d = long(alone, at)
    assert d.shape[1] - d.rank == T
    said = [x.described(T) for x in d.null_directions]
    assert said == ["a turn of pose[left_wrist] alone, in 6 of 6 frames"]
    assert "a turn of pose[left_wrist] alone, in 6 of 6 frames" in str(d)
    for value in at.values():
        value[:] = value[0]  # one axis in all frames, or smoothness would see a turn
    for order in (1, 2):
        between = [residuals.smooth("pose", sigma=0.1, order=order)]
        tied = long(sequence([frame] * T, between=between), at)
        assert tied.shape[1] - tied.rank == order
        (one,) = tied.null_directions
        assert (one.tied, one.count, one.frames) == (True, order, tuple(range(T)))
        assert one.joints == ("left_wrist",)
        words = "1 direction" if order == 1 else "2 directions"
        assert (
            one.described(T)
            == f"a turn of pose[left_wrist] alone: {words} over 6 of 6 frames together"
        )


def test_frames_without_data_are_told() -> None:
    x = Block("x", (2,), "m")
    own = Residual("seen", x.symbol, 0.1, "m")
    other = Residual("prior", x.symbol[0], 1.0, "m")
    frames = [
        Problem([own, other] if t not in (3, 4) else [other], ("x",), blocks=(x,)) for t in range(8)
    ]
    d = long(sequence(frames), {"x": np.zeros((8, 2))})
    assert [u.described(8) for u in d.null_directions] == ["x[1], in 2 of 8 frames"]
    smooth = residuals.smooth("x", sigma=0.2)
    shows = Block("shows", ())  # zero in frame 3
    blank = [
        Problem([Residual("seen", x.symbol * shows.symbol, 0.1, "m")], ("x",), blocks=(x,))
    ] * 8
    at = {"x": np.zeros((8, 2)), "shows": (np.arange(8) != 3).astype(float)}
    tied = long(sequence(blank, between=[smooth]), at)
    assert tied.rank == 16
    assert tied.warnings == ()
    assert int(np.argmax(tied.largest_sigma["x"])) == 3
    assert f"{tied.largest_sigma['x'][3]:.3g} (3)" in tied.report()


def test_a_frame_by_itself_is_diagnosed_as_its_problem_is() -> None:
    frame = arm(EVERY)
    video = sequence([frame] * 3, shared=("betas",), between=[residuals.smooth("pose", sigma=1.0)])
    at = somewhere(video)
    found = long(video, at).frame(2)
    own = {"pose": at["pose"][2], "trans": at["trans"][2], "betas": at["betas"]}
    here = linearized(frame, own)
    assert isinstance(found, Diagnosis)
    assert found.rank == Diagnosis(frame, own, here).rank
    assert found.free.names == ("pose", "trans", "betas")
    with pytest.raises(BadArgument, match="there is no frame 3"):
        long(video, at).frame(3)


def test_values_that_are_not_finite_are_named() -> None:
    x = Block("x", (2,), "m")
    frame = Problem([Residual("seen", cs.sqrt(x.symbol), 0.1)], ("x",), blocks=(x,))
    d = long(sequence([frame] * 3), {"x": np.array([[1.0, 1], [1, -1], [1, 1]])})
    assert "seen" in d.findings[0].text
    assert d.findings[0].warning
    assert "RANK" not in d.report()
    json.dumps(d.data(), allow_nan=False)
    with pytest.raises(Undiagnosed, match="there is no rank"):
        d.assert_rank(6)
    assert [d.problem.row_label(i) for i, j in d.not_finite if j < 0] == ["seen[1, 1]"]
    for part in ("rank", "sigma", "null_directions", "shared"):
        with pytest.raises(NotFinite, match="not_finite"):
            getattr(d, part)


def test_data_and_page_are_written(tmp_path: Path) -> None:
    d = watched(0, 5)
    data = d.data()
    assert data["rank"] == d.rank
    assert data["shared"][3]["frames_seen"] == 0
    assert data["shared"][3]["sigma"] is None
    page = write_diagnosis(d, tmp_path / "found", title="a long one")
    assert "seen in 0 of 5 frames" in page.read_text()
    assert json.loads((tmp_path / "found" / "diagnosis.json").read_text()) == data
    with pytest.raises(BadArgument, match="singular values"):
        write_diagnosis(d, tmp_path / "other", title="two", against=d)


def filmed_by_a_free_camera(frames: int) -> tuple[Problem, Values]:
    """A body of fixed shape in every frame, and one camera; nobody says where they are."""
    problem, one = body_and_camera()
    film = sequence([problem] * frames, shared=("camera/rotation", "camera/translation"))
    rng, at = np.random.default_rng(0), {}
    for name, block in film.known.items():
        x = np.asarray(one[name], dtype=float)
        moves = 0.1 * (name in ("pose", "trans"))
        several = [x + moves * rng.normal(size=x.shape) for _ in range(frames)]
        at[name] = np.stack(several) if block.framed else x
    return film, at


def test_gauges_of_all_frames_are_named() -> None:
    d = long(*filmed_by_a_free_camera(4))
    assert d.shape[1] - d.rank == 6
    said = [one.described(4) for one in d.null_directions]
    over = ": 1 direction over 4 of 4 frames together"
    assert said == [
        *(f"a translation along {a} of trans, undone by camera/translation{over}" for a in "xyz"),
        *(f"a rotation about {a} of trans, undone by pose and camera{over}" for a in "xyz"),
    ]


def test_a_declared_gauge_of_a_sequence_gets_its_name() -> None:
    problem, at = filmed_by_a_free_camera(3)
    lift = Gauge("a lift", lambda values: {"trans": np.tile([0.0, 1.0, 0.0], (3, 1))})
    d = diagnose(problem, at, gauges=[lift])
    assert d.null_directions[0].name == "a lift of trans, undone by camera/translation"
    assert sum(one.count for one in d.null_directions) == 6
