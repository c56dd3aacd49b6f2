"""What is between the frames of a sequence, and sequences whose frames are unlike or held."""

import casadi as cs
import numpy as np
import pytest

import workbench as wb
from tests.bodies_made_up import random_body
from tests.differences import assert_jacobian
from tests.problem.sequences import assert_numbers
from workbench.errors import BadArgument, BadConstraint, BadResidual, UnknownName
from workbench.problem import frames as frame_chains
from workbench.residuals import Residual, gaussian, huber, landmarks, smooth
from workbench.residuals.sequences import Frames

BODY = random_body(1, n_vertices=5, n_joints=3, n_betas=2)
POSE, BETAS, TRANS = BODY.blocks()
JOINTS = BODY.joint_points(POSE.symbol, BETAS.symbol, TRANS.symbol)
FRAME = wb.Problem(
    (
        landmarks(JOINTS, np.zeros((3, 3)), sigma=0.1, name="joints"),
        gaussian(POSE.symbol, unit="rad", name="pose prior"),
    ),
    ("pose", "betas", "trans"),
)
RNG = np.random.default_rng(0)
T = 5
VALUES = {
    "pose": RNG.normal(scale=0.4, size=(T, 3, 3)),
    "betas": RNG.normal(size=2),
    "trans": RNG.normal(size=(T, 3)),
}


def rows(*between: object, count: int = T) -> dict[str, np.ndarray]:
    """The whitened rows of each residual between the frames, by name."""
    whole = wb.sequence([FRAME] * count, shared="betas", between=between)  # type: ignore[arg-type]
    first_frames = {n: v if n == "betas" else v[:count] for n, v in VALUES.items()}
    r = whole.residual(*whole.split(first_frames))
    return {n: r[at] for n, at in whole.rows.items() if n not in FRAME.rows}


@pytest.mark.parametrize(("name", "order"), [("pose", 1), ("trans", 2)])
def test_smooth_is_the_differences_of_a_block(name: str, order: int) -> None:
    (r,) = rows(smooth(name, sigma=0.2, order=order)).values()
    np.testing.assert_allclose(r, np.diff(VALUES[name], order, axis=0).ravel() / 0.2, atol=1e-12)


def test_smooth_is_the_differences_of_points() -> None:
    order = 2
    (r,) = rows(smooth(JOINTS, sigma=0.2, order=order)).values()
    joints = [
        BODY.joints(p, VALUES["betas"], t)
        for p, t in zip(VALUES["pose"], VALUES["trans"], strict=True)
    ]
    np.testing.assert_allclose(r, np.diff(joints, order, axis=0).ravel() / 0.2, atol=1e-12)


def test_smooth_takes_a_sigma_of_each_entry() -> None:
    sigma = RNG.uniform(0.1, 1, (3, 3))
    (r,) = rows(smooth("pose", sigma=sigma)).values()
    np.testing.assert_allclose(r, (np.diff(VALUES["pose"], axis=0) / sigma).ravel(), atol=1e-12)
    across = np.array([0.1, 0.2, 0.4])
    (r,) = rows(smooth("trans", sigma=across, order=2)).values()
    expected = np.diff(VALUES["trans"], 2, axis=0) / across
    np.testing.assert_allclose(r, expected.ravel(), atol=1e-12)


@pytest.mark.parametrize(("what", "order"), [("trans", 1), (JOINTS, 2)], ids=["block", "points"])
def test_derivatives_of_smooth_match_differences(what: str | wb.Points, order: int) -> None:
    between = [smooth(what, sigma=0.2, order=order, kernel=huber(0.5))]
    whole = wb.sequence([FRAME] * T, shared="betas", between=between)
    assert_jacobian(whole, *whole.split(VALUES), 1e-9)


def test_smooth_names_rows_and_units() -> None:
    between = [
        smooth("pose", sigma=0.1),
        smooth(JOINTS, sigma=0.1, order=2),
        smooth("trans", sigma=0.1, name="slow"),
    ]
    whole = wb.sequence([FRAME] * 3, shared="betas", between=between)
    named = {r.name: r for r in whole.residuals}
    assert list(named)[-3:] == ["smooth(pose)", "smooth(joints, order 2)", "slow"]
    assert [named[n].unit for n in list(named)[-3:]] == ["rad", "m", "m"]
    assert named["smooth(pose)"].label(0) == "smooth(pose)[0 to 1, joint0, x]"
    assert named["smooth(pose)"].label(17) == "smooth(pose)[1 to 2, joint2, z]"
    assert named["smooth(joints, order 2)"].label(4) == "smooth(joints, order 2)[0 to 2, joint1, y]"
    assert named["slow"].label(5) == "slow[1 to 2, z]"


def test_bad_smooth_terms_are_refused() -> None:
    with pytest.raises(BadArgument, match="order 1 or 2, not 3"):
        smooth("pose", sigma=0.1, order=3)
    with pytest.raises(BadArgument, match=r"name of a block.*or Points.*not something of type MX"):
        smooth(POSE.symbol, sigma=0.1)  # type: ignore[arg-type]
    with pytest.raises(BadResidual, match="all frames share the block 'betas'"):
        rows(smooth("betas", sigma=0.1))
    with pytest.raises(UnknownName, match="no block is called 'poze'"):
        rows(smooth("poze", sigma=0.1))
    with pytest.raises(BadResidual, match="order 1 take 2 frames, and there are 1"):
        rows(smooth("pose", sigma=0.1), count=1)
    with pytest.raises(BadResidual, match="one for each of the 3 entries of a frame"):
        rows(smooth("trans", sigma=[0.1, 0.2]))
    with pytest.raises(BadResidual, match="sigma above zero"):
        rows(smooth("pose", sigma=[0.1, 0.0]))


PERSON = random_body(0, n_vertices=9, n_joints=3, n_betas=2)


def differences(problem: wb.Problem, x: np.ndarray, fixed: np.ndarray) -> np.ndarray:
    h = 1e-6
    columns = [
        (problem.residual(x + h * e, fixed) - problem.residual(x - h * e, fixed)) / (2 * h)
        for e in np.eye(len(x))
    ]
    return np.array(columns).T


@pytest.mark.parametrize("some", [(3, 1), (2, 2)])
def test_points_of_frames_in_any_order(some: tuple[int, int]) -> None:
    pose, betas, trans = PERSON.blocks()
    points = PERSON.joint_points(pose.symbol, betas.symbol, trans.symbol)
    priors = [gaussian(block.symbol, name=block.name) for block in PERSON.blocks()]
    frame = wb.Problem(priors, ["pose", "betas", "trans"], blocks=PERSON.blocks())

    def closing(frames: Frames) -> Residual:
        seen, n = frames.points(points, some), points.count
        gap = 2 * seen.symbol[:, :n] - seen.symbol[:, n : 2 * n]
        return Residual("closing", cs.vec(gap), 1.0, "m", points=(seen,))

    whole = wb.sequence([frame] * 4, shared=("betas",), between=[closing])
    rng = np.random.default_rng(0)
    shapes = {"pose": (4, *pose.shape), "betas": betas.shape, "trans": (4, 3)}
    x, fixed = whole.split({n: 0.3 * rng.standard_normal(s) for n, s in shapes.items()})
    J = whole.linearize_at(x, fixed).dense
    np.testing.assert_allclose(J, differences(whole, x, fixed), atol=1e-7)


def test_chain_seen_at_one_end_is_solved(monkeypatch: pytest.MonkeyPatch) -> None:
    """Extrapolated over hundreds of frames, J is worse than 1e4, and still has full rank."""
    y, o = wb.Block("y", (3,)), wb.Block("o", (3,))
    far = Residual("eps", 1e-30 * y.symbol[0], 1.0, blocks=(y,))
    data = Residual("data", y.symbol - o.symbol, 1.0, blocks=(y, o))
    seen, unseen = (
        wb.Problem([data, far], ["y"], blocks=(y, o)),
        wb.Problem([far], ["y"], blocks=(y,)),
    )
    T, rng = 300, np.random.default_rng(0)
    frames = [seen if t < 2 else unseen for t in range(T)]
    monkeypatch.setattr(frame_chains, "is_sparse", lambda *a: True)
    whole = wb.sequence(frames, between=[smooth("y", sigma=1.0, order=2)])
    start = {"y": rng.standard_normal((T, 3)), "o": rng.standard_normal((T, 3))}
    solution = wb.solve(whole, start, wb.SOLVERS["gauss-newton"])
    assert whole.linearize(start).by_frames
    assert solution.converged
    assert solution.cost < 1e-12  # two frames determine a straight line exactly; 1 at the start


def test_constraints_of_one_name_must_agree() -> None:
    y = wb.Block("y", (3,))

    def frame(unit: str, tolerance: float) -> wb.Problem:
        limit = wb.Constraint("c", y.symbol[0], 0, 1, unit, tolerance=tolerance)
        return wb.Problem([gaussian(y.symbol)], ["y"], blocks=(y,), constraints=[limit])

    assert wb.sequence([frame("m", 1e-2), frame("m", 1e-6)]).constraints[0].tolerance == 1e-6
    with pytest.raises(BadConstraint, match="unit rad in frame 1 and m in frame 0"):
        wb.sequence([frame("m", 1e-2), frame("rad", 1e-2)])


def test_free_entries_unread_between_frames() -> None:
    """Residuals between frames have only the fixed numbers that their chain rule needs."""
    pose, betas, trans = PERSON.blocks()
    points = PERSON.joint_points(pose.symbol, betas.symbol, trans.symbol)
    seen = wb.Block("seen", (3, 3), "m")
    terms = [landmarks(points, seen.symbol, sigma=0.1), gaussian(pose.symbol, name="prior")]
    frame = wb.Problem(terms, ["pose[1:3]", "betas[1]", "trans"], blocks=(seen,))
    whole = wb.sequence([frame] * 3, shared=("betas",), between=[smooth("trans", sigma=0.1)])
    rng = np.random.default_rng(0)
    assert_numbers(whole, {n: rng.standard_normal(b.shape) for n, b in whole.known.items()})
