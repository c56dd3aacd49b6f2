"""Null spaces and near-dependencies that were planted are found, whatever the units."""

import casadi as cs
import numpy as np
import pytest

from tests.tiers import few
from workbench import Block, Diagnosis, Problem, Residual, diagnose
from workbench.problem import Linearization

SHAPES = ((), (1,), (2,), (3,), (5,), (2, 3), (4, 3), (3, 2), (1, 3), (2, 5))


def linear(A: np.ndarray, rng: np.random.Generator | None = None) -> Diagnosis:
    """The diagnosis of A x = noise, x cut into blocks of random shapes."""
    blocks: list[Block] = []
    while (left := A.shape[1] - sum(b.size for b in blocks)) > 0:
        shape = SHAPES[rng.integers(len(SHAPES))] if rng is not None else (left,)
        block = Block(f"b{len(blocks)}", shape, "m" if len(blocks) % 2 else "1")
        blocks.append(block if block.size <= left else Block(block.name, (left,)))
    x = cs.vertcat(*[cs.vec(block.symbol) for block in blocks])
    problem = Problem(
        (Residual("r", cs.DM(A) @ x, 1.0),), [block.name for block in blocks], blocks=blocks
    )
    return diagnose(problem, {block.name: np.zeros(block.shape) for block in blocks})


def planted(rng: np.random.Generator, dimension: int) -> tuple[np.ndarray, np.ndarray]:
    """A random A (m, n) and an orthonormal basis of its null space (n, dimension)."""
    n = int(rng.integers(max(2, dimension + 1), 40))
    m = int(rng.integers(n, 3 * n))
    V = rng.normal(size=(n, dimension))
    if rng.random() < 0.5:  # of few entries each
        V *= rng.random(V.shape) < 0.2
        V[rng.permutation(n)[:dimension], range(dimension)] = 1.0
    V = np.linalg.qr(V)[0]
    V[abs(V) < 1e-14] = 0
    return rng.normal(size=(m, n)) @ (np.eye(n) - V @ V.T), V


def largest_sine(a: np.ndarray, b: np.ndarray) -> float:
    """Of the angles between the spans of two sets of columns."""
    A, B = np.linalg.qr(a)[0], np.linalg.qr(b)[0]
    return float(np.linalg.norm(B - A @ (A.T @ B), 2)) if b.size else 0.0


@pytest.mark.parametrize("dimension", few((0, 1, 4, 9, 2, 3, 6)))
def test_planted_null_space_is_found(dimension: int) -> None:
    for case in range(6):
        rng = np.random.default_rng([dimension, case])
        A, V = planted(rng, dimension)
        found = linear(A, rng)
        assert found.rank == A.shape[1] - dimension, case
        vectors = [direction.vector for direction in found.null_directions]
        assert len(vectors) == dimension, case
        if dimension:
            assert largest_sine(np.column_stack(vectors), V) < 1e-8, case
            np.testing.assert_allclose(np.linalg.norm(vectors, axis=1), 1, rtol=1e-12)
            assert max(d.change for d in found.null_directions) < found.tolerance


@pytest.mark.parametrize("seed", few(range(6), 2))
def test_near_dependencies_are_ranked_by_distance(seed: int) -> None:
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(60, 20))
    a, b, c, d = rng.permutation(20)[:4].tolist()
    A[:, b] = A[:, a] + 1e-6 * rng.normal(size=60)
    A[:, d] = -3 * A[:, c] + 1e-10 * rng.normal(size=60)
    found = linear(A)
    assert found.rank == 20
    assert [{p.first, p.second} for p in found.parallel_columns] == [{c, d}, {a, b}]
    nearest, next_ = (p.sine for p in found.parallel_columns)
    assert 1e-11 < nearest < 1e-9
    assert 1e-7 < next_ < 1e-5
    first, second = found.weakest[:2]
    assert (set(first.columns), set(second.columns)) == ({c, d}, {a, b})
    assert first.change < 1e-8 < second.change < 1e-4


@pytest.mark.parametrize("count", [12, pytest.param(100, marks=pytest.mark.thorough)])
def test_null_vectors_are_right_at_any_ratio_of_columns(count: int) -> None:
    """None is NaN, and each is null to 1e-8 where columns have length 1; ratios up to 1e12."""
    for case in range(count):
        J, k = uneven_null_space(case)
        directions = linear(J).null_directions
        assert len(directions) == k, case
        V = np.column_stack([one.vector for one in directions])
        np.testing.assert_allclose(np.linalg.norm(V, axis=0), 1.0)
        whole = np.linalg.norm(np.linalg.norm(J, axis=0)[:, None] * V, axis=0)
        assert (np.linalg.norm(J @ V, axis=0) <= 1e-8 * whole).all(), case


def uneven_null_space(case: int) -> tuple[np.ndarray, int]:
    """J (m, n) with a null space of k dimensions and columns of lengths up to 1e12 times others."""
    rng = np.random.default_rng(case)
    n = int(rng.integers(3, 9))
    k = int(rng.integers(1, min(4, n)))
    V = rng.normal(size=(n, k))
    if rng.random() < 0.5:  # few unknowns in each
        V *= rng.random(V.shape) < 0.5
        V[rng.permutation(n)[:k], range(k)] = 1.0
    row_space = np.linalg.qr(V, mode="complete")[0][:, k:]
    row_space[np.linalg.norm(row_space, axis=1) < 1e-12] = 0.0
    A = rng.normal(size=(int(rng.integers(n, 2 * n)), n - k)) @ row_space.T
    spread = rng.uniform(0, 12)
    return A * 10.0 ** rng.uniform(-spread / 2, spread / 2, n), k


def test_a_row_of_very_long_and_short_columns_has_two_null_directions() -> None:
    J = np.array([[1e6, 1e-6, 1.0]])
    for one in linear(J).null_directions:
        assert np.isfinite(one.vector).all()
        assert abs(J @ one.vector) <= 1e-14 * (abs(J) @ abs(one.vector))
        assert np.count_nonzero(one.vector) == 2  # no unknown changes nothing by itself


# Units that differ by many powers of ten.

M, N = 30, 8


def scales(rng: np.random.Generator, spread: float) -> np.ndarray:
    """Units that differ by up to 10^(2 spread), and by at least 10^(2 spread - 1)."""
    exponents = rng.uniform(-spread, spread, N)
    exponents[:2] = -spread + 0.5, spread - 0.5
    return 10.0 ** rng.permutation(exponents)


def problem_of(A: np.ndarray) -> tuple[Problem, dict]:
    x = Block("x", (N,)).symbol
    return Problem((Residual("fit", A @ x - 1, 1.0),), "x"), {"x": np.zeros(N)}


@pytest.mark.parametrize("spread", [4.0, 8.0, 12.0])
@pytest.mark.parametrize("seed", few(range(4), 1))
def test_rank_does_not_depend_on_units(seed: int, spread: float) -> None:
    """Full; with a column that two others add up to; and with a column of zeros besides."""
    rng = np.random.default_rng(seed)
    A, D = rng.standard_normal((M, N)), scales(rng, spread)
    for rank in (8, 7, 6):
        problem, at = problem_of(A * D)
        found = diagnose(problem, at)
        assert found.rank == rank
        assert problem.linearize(at).rank == rank
        assert len(found.null_directions) == N - rank
        for direction in found.null_directions:
            terms = abs(A * D) @ abs(direction.vector)
            assert (abs(A * D @ direction.vector) <= 1e-9 * terms).all()
        if rank == 8:
            A[:, 3] = A[:, 1] + A[:, 2]
        else:
            A[:, 5] = 0.0


@pytest.mark.parametrize("long", [1e8, 1e12])
@pytest.mark.parametrize("short", [1e-12, 1.0])
def test_dependent_long_columns_hide_no_short_one(short: float, long: float) -> None:
    """The rounding errors of dependent long columns are larger than a short one that is seen."""
    a, b, d = np.random.default_rng(0).standard_normal((3, M))
    J = np.column_stack([a * long, b * long, (a + b) * long / 1.7, d * short])
    here = Linearization(np.zeros(M), J)
    assert here.rank == here.spectrum.rank == 3
    unseen = here.spectrum.Vt[-1]
    assert unseen[3] == 0
    assert np.linalg.norm(J @ unseen) < 1e-13 * long


def test_null_direction_of_unlike_columns_changes_nothing() -> None:
    a, b = Block("a", (1,)).symbol, Block("b", (1,)).symbol
    problem = Problem((Residual("r", 1e8 * a + b, 1.0),), ("a", "b"))
    (found,) = diagnose(problem, {"a": [0.0], "b": [0.0]}).null_directions
    np.testing.assert_allclose(found.vector, [-1e-8, 1.0], rtol=1e-12)
    assert found.change < 1e-15


def test_a_large_unknown_is_no_rounding_error() -> None:
    """A change of x by its own size, 1e16, changes the residual by one sigma."""
    x, y = Block("x").symbol, Block("y").symbol
    problem = Problem((Residual("r", cs.vertcat(1e-16 * x - 1, 10 * (y - 1)), 1.0),), ("x", "y"))
    assert diagnose(problem, {"x": 1e16, "y": 1.0}).rank == 2
    assert diagnose(problem, {"x": 1.0, "y": 1.0}).rank == 1
