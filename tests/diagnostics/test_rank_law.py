"""How much of a pose joints tell: the law of the tree, and the names."""

from collections import Counter

import casadi as cs
import numpy as np
import pytest

from tests.bodies_made_up import SMPL_NAMES, smpl_like_body
from tests.tiers import few
from workbench import (
    Block,
    Diagnosis,
    Problem,
    Residual,
    Values,
    diagnose,
    residuals,
)
from workbench.blocks import Layout, Tree
from workbench.diagnostics.gauges import INSIDE
from workbench.diagnostics.null_space import Direction, named_by_joints
from workbench.diagnostics.rank_law import law_in_words, rank_of_observed_joints
from workbench.geometry.rotation import matrix_from_vector
from workbench.problem import Linearization


def skew(w: np.ndarray) -> np.ndarray:
    return np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])


def left_jacobian(w: np.ndarray) -> np.ndarray:
    """d exp(w) = (left_jacobian(w) dw) x exp(w)."""
    t, W = float(np.linalg.norm(w)), skew(w)
    return np.eye(3) + (1 - np.cos(t)) / t**2 * W + (t - np.sin(t)) / t**3 * W @ W


def posed(
    parents: tuple[int, ...], offsets: np.ndarray, pose: np.ndarray
) -> tuple[np.ndarray, list[np.ndarray]]:
    """Joints (K, 3), and what carries a turn of each joint's vector into space (K of (3, 3))."""
    turned: list[np.ndarray] = []
    carried: list[np.ndarray] = []
    joints = np.zeros((len(parents), 3))
    for k, parent in enumerate(parents):
        above = np.eye(3) if parent < 0 else turned[parent]
        if parent >= 0:
            joints[k] = joints[parent] + above @ offsets[k]
        carried.append(above @ left_jacobian(pose[k]))
        turned.append(above @ np.asarray(matrix_from_vector(pose[k])))
    return joints, carried


def jacobian_of(
    parents: tuple[int, ...],
    joints: np.ndarray,
    carried: list[np.ndarray],
    observed: list[int],
    translation: bool,
) -> np.ndarray:
    """Of the observed joints' positions by all rotation vectors, and by a translation."""
    J = np.zeros((3 * len(observed), 3 * len(parents) + 3 * translation))
    for i, joint in enumerate(observed):
        rows, k = slice(3 * i, 3 * i + 3), parents[joint]
        while k >= 0:
            J[rows, 3 * k : 3 * k + 3] = -skew(joints[joint] - joints[k]) @ carried[k]
            k = parents[k]
        if translation:
            J[rows, -3:] = np.eye(3)
    return J


def named(J: np.ndarray, parents: tuple[int, ...], translation: bool) -> tuple[Direction, ...]:
    names = tuple(f"joint{k}" for k in range(len(parents)))
    pose, trans = Block("pose", (len(parents), 3), "rad", names), Block("trans", (3,), "m")
    free = Layout((pose, trans) if translation else (pose,))
    here = Linearization(np.zeros(len(J)), J)
    null = here.spectrum.Vt[here.spectrum.rank :].T
    return named_by_joints(null, free, (Tree("pose", names, parents),), here, INSIDE)


@pytest.mark.parametrize("batch", few(range(4), 1))
def test_law_singular_values_and_names_agree(batch: int) -> None:
    for case in range(5):
        rng = np.random.default_rng([batch, case])
        K = int(rng.integers(5, 61))
        reach = int(rng.integers(1, 7))  # 1: a chain; more: bushier
        parents = (-1, *(int(rng.integers(max(0, k - reach), k)) for k in range(1, K)))
        observed = np.sort(rng.permutation(K)[: int(rng.integers(1, K + 1))]).tolist()
        translation = bool(rng.integers(2))
        joints, carried = posed(parents, rng.normal(size=(K, 3)), rng.normal(size=(K, 3)))
        J = jacobian_of(parents, joints, carried, observed, translation)

        s, Vt = np.linalg.svd(J)[1:]
        rank = int(np.sum(s > 1e-11 * s.max(initial=1.0)))
        law = rank_of_observed_joints(parents, joints, observed, translation=translation)
        assert law == rank, (batch, case)

        found = named(J, parents, translation)
        assert len(found) == J.shape[1] - rank, (batch, case)
        assert {d.kind for d in found} <= {"entry", "twist", "joint", "mixed"}, (batch, case)
        if found:
            V = np.linalg.qr(np.column_stack([d.vector for d in found]))[0]
            null = Vt[rank:].T
            sine = np.linalg.norm(null - V @ (V.T @ null), 2)
            # null spaces of matrices that differ by rounding, eps max(m, n) s_1 at most, differ by
            # an angle of sine eps max(m, n) s_1 / s_r (Wedin 1972), on any processor; linear
            # programs and what is rounded in between cost 20 times that at the worst of 200 cases
            rounding = np.finfo(float).eps * max(J.shape) * s[0] / s[max(rank, 1) - 1]
            assert sine < 1000 * rounding, (batch, case)


def test_the_law_in_words_adds_up() -> None:
    body = smpl_like_body()
    joints = body.joints(np.zeros((24, 3)), np.zeros(4))
    everything = range(24)
    for translation, rank in ((False, 40), (True, 43)):
        assert (
            rank_of_observed_joints(body.parents, joints, everything, translation=translation)
            == rank
        )
        words = law_in_words(body.parents, translation=translation)
        assert words.endswith(f"= {rank}")
        assert "3 x 2 joints with several children + 2 x 17 with one child" in words


def observing(chosen: tuple[str, ...], *free: str) -> tuple[Problem, Values]:
    """Some joints of a body on SMPL's tree, in a random pose."""
    body = smpl_like_body()
    joints = body.joint_points(*(block.symbol for block in body.blocks()))
    columns = [SMPL_NAMES.index(name) for name in chosen]
    expression = cs.vec(joints.symbol[:, columns])
    problem = Problem((Residual("some joints", expression, 0.01, "m", points=(joints,)),), free)
    rng = np.random.default_rng(5)
    return problem, body.start() | {"pose": rng.normal(scale=0.5, size=(24, 3))}


def kinds(diagnosis: Diagnosis) -> dict[str, int]:
    return dict(Counter(d.kind for d in diagnosis.null_directions))


@pytest.mark.parametrize("free", [("pose",), ("pose", "trans")], ids="+".join)
def test_an_unseen_elbow_swivels(free: tuple[str, ...]) -> None:
    chosen = tuple(name for name in SMPL_NAMES if name != "left_elbow")
    diagnosis = diagnose(*observing(chosen, *free))
    names = [d.name for d in diagnosis.null_directions]
    assert "a turn of pose[left_shoulder], undone at left_wrist" in names
    assert "a turn of pose[right_shoulder], undone at right_elbow" in names
    assert set(kinds(diagnosis)) == {"entry", "twist"}
    assert diagnosis.rank_law is not None
    assert diagnosis.rank_law[0] == diagnosis.rank
    assert diagnosis.rank_law[1] == "23 of 24 joints are observed"


@pytest.mark.parametrize("seed", few(range(3), 1))
def test_the_law_holds_for_any_subset_of_a_body(seed: int) -> None:
    rng = np.random.default_rng(seed)
    chosen = tuple(name for name in SMPL_NAMES if rng.random() < 0.4) or ("head",)
    diagnosis = diagnose(*observing(chosen, "pose", "trans"))
    assert diagnosis.rank_law is not None
    assert diagnosis.rank_law[0] == diagnosis.rank
    assert len(diagnosis.null_directions) == 75 - diagnosis.rank
    assert set(kinds(diagnosis)) <= {"entry", "twist", "joint", "mixed"}


def test_law_is_for_observed_joints_alone() -> None:
    problem, values = observing(SMPL_NAMES, "pose", "betas")
    assert diagnose(problem, values).rank_law is None
    pose = problem.free["pose"].symbol
    prior = residuals.gaussian(pose)
    assert diagnose(Problem((*problem.residuals, prior), ("pose",)), values).rank_law is None
    assert diagnose(problem.freeing("betas"), values).rank_law is None
    (joints,) = problem.residuals[0].points
    heights = Residual("heights", joints.symbol[1, :].T, 0.01, "m", points=(joints,))
    assert diagnose(Problem((heights,), ("pose",)), values).rank_law is None
