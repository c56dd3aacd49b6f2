"""Sequences whose frames are unlike, held, unseen, or out of order."""

import casadi as cs
import numpy as np
import pytest

import workbench as wb
from tests.bodies_made_up import random_body
from tests.problem.sequences import assert_numbers
from workbench.blocks import Values
from workbench.diagnostics import SequenceDiagnosis, diagnose
from workbench.errors import BadArgument, BadConstraint, BadResidual
from workbench.problem import frame_chain
from workbench.residuals import Residual, gaussian, huber, landmarks, smooth
from workbench.residuals.frames import Frames
from workbench.sampling.conditioning import conditioning
from workbench.sampling.subspace import fixed, subspace_of

BODY = random_body(0, n_vertices=9, n_joints=3, n_betas=2)


def differences(problem: wb.Problem, x: np.ndarray, given: np.ndarray) -> np.ndarray:
    h = 1e-6
    columns = [
        (problem.residual(x + h * e, given) - problem.residual(x - h * e, given)) / (2 * h)
        for e in np.eye(len(x))
    ]
    return np.array(columns).T


@pytest.mark.parametrize("some", [(1, 3), (3, 1), (3, 0), (2, 2)])
def test_points_of_frames_in_any_order_have_the_right_derivative(some: tuple[int, int]) -> None:
    pose, betas, trans = BODY.blocks()
    points = BODY.joint_points(pose.symbol, betas.symbol, trans.symbol)
    priors = [gaussian(block.symbol, name=block.name) for block in BODY.blocks()]
    frame = wb.Problem(priors, ["pose", "betas", "trans"], blocks=BODY.blocks())

    def closing(frames: Frames) -> Residual:
        seen, n = frames.points(points, some), points.count
        gap = 2 * seen.symbol[:, :n] - seen.symbol[:, n : 2 * n]
        return Residual("closing", cs.vec(gap), 1.0, "m", points=(seen,))

    whole = wb.sequence([frame] * 4, shared=("betas",), between=[closing])
    rng = np.random.default_rng(0)
    shapes = {"pose": (4, *pose.shape), "betas": betas.shape, "trans": (4, 3)}
    x, given = whole.split({n: 0.3 * rng.standard_normal(s) for n, s in shapes.items()})
    J = whole.linearize_at(x, given).dense
    np.testing.assert_allclose(J, differences(whole, x, given), atol=1e-7)


def test_a_frame_that_does_not_exist_is_refused() -> None:
    pose, betas, trans = BODY.blocks()
    points = BODY.joint_points(pose.symbol, betas.symbol, trans.symbol)
    frame = wb.Problem([gaussian(pose.symbol)], ["pose"], blocks=BODY.blocks())
    for some in ((-1, 0), (0, 4)):
        with pytest.raises(BadResidual, match="the frames are 0 to 3"):
            wb.sequence([frame] * 4, between=[lambda f, s=some: f.points(points, s)])  # type: ignore[misc]


def test_entries_of_many_frames_are_found_by_their_labels() -> None:
    """A name for each free entry of each frame: a look into a table, not a search."""
    y = wb.Block("y", (24, 3))
    part = wb.Problem([gaussian(y.symbol)], [f"y[{k}]" for k in range(1, 24)], blocks=(y,))
    whole = wb.sequence([part] * 60)
    assert whole.free.size == 60 * 69
    assert whole.free.label(0) == "y[0, 1, x]"


def linear_frames(count: int, extra: tuple[Residual, ...] = ()) -> tuple[wb.Problem, Values]:
    y, s, obs = wb.Block("y", (5,)), wb.Block("s", (2,)), wb.Block("obs", (5,))
    W = cs.DM(np.random.default_rng(0).standard_normal((5, 2)))
    data = Residual("data", y.symbol + W @ s.symbol - obs.symbol, 0.1, blocks=(y, s, obs))
    priors = (gaussian(y.symbol, name="prior"), gaussian(s.symbol, name="ps"))
    free = ["y", "s", *(one.blocks[0].name for one in extra)]
    more = tuple(block for one in extra for block in one.blocks)
    frame = wb.Problem([data, *priors, *extra], free, blocks=(y, s, obs, *more))
    values: Values = {"y": np.zeros((count, 5)), "s": np.zeros(2), "obs": np.ones((count, 5))}
    for block in more:
        values[block.name] = np.zeros((count, *block.shape))
    between = [smooth("y", sigma=0.1)]
    return wb.sequence([frame] * count, shared=("s",), between=between), values


@pytest.mark.parametrize("free", ["y[1:1000]", "y[0:999]", "y[0:900]"])
def test_frames_at_either_end_may_be_held(free: str) -> None:
    whole, values = linear_frames(1000)
    diagnosis = diagnose(whole.freeing("s", free), values)
    assert isinstance(diagnosis, SequenceDiagnosis)
    first, _, last = free[2:-1].partition(":")
    assert diagnosis.rank == 5 * (int(last) - int(first)) + 2


def test_what_nothing_determines_does_not_hide_what_is_determined() -> None:
    """Standard deviations of s are finite although z0 - z1 is not seen, however many frames."""
    z = wb.Block("z", (2,))
    sum_of_z = Residual("z", cs.sum1(z.symbol), 1.0, blocks=(z,))
    for count in (20, 1000):
        whole, values = linear_frames(count, (sum_of_z,))
        x, given = whole.split(values)
        space = subspace_of(whole, x, given, ["s"], fixed)
        marginal = conditioning(whole, given, space, space.centre).marginal
        diagnosis = diagnose(whole, values)
        known = (
            diagnosis.sigma[whole.free.slices["s"]]
            if isinstance(diagnosis, SequenceDiagnosis)
            else diagnosis.identifiability.sigma[whole.free.slices["s"]]
        )
        np.testing.assert_allclose(marginal, known, rtol=1e-6)


def test_a_chain_that_is_seen_at_one_end_alone_is_solved(monkeypatch: pytest.MonkeyPatch) -> None:
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
    monkeypatch.setattr(frame_chain, "is_sparse", lambda *a: True)
    whole = wb.sequence(frames, between=[smooth("y", sigma=1.0, order=2)])
    start = {"y": rng.standard_normal((T, 3)), "o": rng.standard_normal((T, 3))}
    found = wb.solve(whole, start, wb.SOLVERS["gauss-newton"])
    assert whole.linearize(start).by_frames
    assert found.converged
    assert found.cost < 1e-12  # two frames determine a straight line exactly; 1 at the start


def test_constraints_of_one_name_agree() -> None:
    y = wb.Block("y", (3,))

    def frame(unit: str, tolerance: float) -> wb.Problem:
        limit = wb.Constraint("c", y.symbol[0], 0, 1, unit, tolerance=tolerance)
        return wb.Problem([gaussian(y.symbol)], ["y"], blocks=(y,), constraints=[limit])

    assert wb.sequence([frame("m", 1e-2), frame("m", 1e-6)]).constraints[0].tolerance == 1e-6
    with pytest.raises(BadConstraint, match="unit rad in frame 1 and m in frame 0"):
        wb.sequence([frame("m", 1e-2), frame("rad", 1e-2)])


def test_equal_kernels_are_equal() -> None:
    x = wb.Block("x", (2,))

    def frame(t: int) -> wb.Problem:
        seen = Residual("r", x.symbol - t, 0.1, kernel=huber(1.345), blocks=(x,))
        return wb.Problem([seen], ["x"], blocks=(x,))

    assert wb.sequence([frame(t) for t in range(3)]).size == 6


def test_a_shared_prior_counts_once_for_each_residual() -> None:
    y = wb.Block("y", (3,))
    one, other = (wb.Problem([gaussian(y.symbol, name="p")], ["y"], blocks=(y,)) for _ in range(2))
    assert wb.sequence([one, one, one], shared="y").size == 3
    assert wb.sequence([one, one, other], shared="y").size == 6
    assert wb.sequence([one, other, one, other], shared="y").size == 6


def test_a_frame_whose_weights_are_all_zero_has_no_say() -> None:
    x, b, o = wb.Block("x", (2,)), wb.Block("b", (2,)), wb.Block("o", (2,))

    def frame(weight: float) -> wb.Problem:
        gps = Residual("gps", x.symbol + b.symbol - o.symbol, 0.1, weights=np.full(2, weight))
        return wb.Problem([gps, gaussian(x.symbol, name="prior")], ["x"], blocks=(x, b, o))

    whole = wb.sequence([frame(1.0), frame(0.0), frame(1.0)], shared="b")
    values = {"x": np.ones((3, 2)), "b": np.ones(2), "o": np.zeros((3, 2))}
    assert whole.linearize(values).cost == pytest.approx(3 + 2 * 400)
    found = wb.solve(whole, values)
    np.testing.assert_allclose(found.values["x"][1], 0, atol=1e-5)
    np.testing.assert_allclose(found.values["x"][0], -100 / 101, atol=1e-5)


def test_the_sigma_of_smoothness_is_that_of_a_frame() -> None:
    x = wb.Block("x", (2,))
    frame = wb.Problem([gaussian(x.symbol)], ["x"], blocks=(x,))
    for sigma in ([0.1, 0.2, 0.3], [0.1] * 4):
        with pytest.raises(BadResidual, match="one for each of the 2 entries of a frame"):
            wb.sequence([frame] * 3, between=[smooth("x", sigma=sigma)])
    for wrong in (-1.0, np.nan, [0.1, 0.0]):
        with pytest.raises(BadResidual, match="finite sigma above zero"):
            smooth("x", sigma=wrong)
    one = wb.Block("a", ())
    single = wb.Problem([gaussian(one.symbol)], ["a"], blocks=(one,))
    assert wb.sequence([single] * 3, between=[smooth("a", sigma=[0.1])]).size == 5


def test_what_is_between_frames_is_a_list() -> None:
    x = wb.Block("x", (2,))
    frame = wb.Problem([gaussian(x.symbol)], ["x"], blocks=(x,))
    with pytest.raises(BadArgument, match="put the one into a list"):
        wb.sequence([frame] * 3, between=3)  # type: ignore[arg-type]


def test_a_block_that_is_free_in_part_and_that_nothing_between_frames_reads() -> None:
    """Residuals between frames have only the fixed numbers that their chain rule needs."""
    pose, betas, trans = BODY.blocks()
    points = BODY.joint_points(pose.symbol, betas.symbol, trans.symbol)
    seen = wb.Block("seen", (3, 3), "m")
    terms = [landmarks(points, seen.symbol, sigma=0.1), gaussian(pose.symbol, name="prior")]
    frame = wb.Problem(terms, ["pose[1:3]", "betas[1]", "trans"], blocks=(seen,))
    whole = wb.sequence([frame] * 3, shared=("betas",), between=[smooth("trans", sigma=0.1)])
    rng = np.random.default_rng(0)
    assert_numbers(whole, {n: rng.standard_normal(b.shape) for n, b in whole.known.items()})
