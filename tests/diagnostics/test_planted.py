"""Null spaces and near-dependencies that were planted are found again, in size and in place."""

import casadi as cs
import numpy as np
import pytest

from workbench import Block, Diagnosis, Problem, Residual, diagnose

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


@pytest.mark.parametrize("dimension", range(11))
def test_a_planted_null_space_is_found_again(dimension: int) -> None:
    for case in range(19):
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


@pytest.mark.parametrize("seed", range(10))
def test_near_dependencies_are_ranked_by_how_near_they_are(seed: int) -> None:
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
    assert first.change == pytest.approx(first.singular_value, rel=1e-3)
    assert first.change < 1e-8 < second.change < 1e-4


def test_dependencies_of_the_same_size_are_told_apart() -> None:
    """Singular vectors of singular values that are nearly alike mix their columns."""
    rng = np.random.default_rng(1)
    A = np.linalg.qr(rng.normal(size=(60, 20)))[0]
    for a, b, apart in ((3, 11, 1e-6), (5, 17, 1e-6), (8, 9, 1e-3)):
        A[:, b] = A[:, a] + apart * np.linalg.qr(rng.normal(size=(60, 1)))[0][:, 0]
    found = linear(A)
    assert {frozenset(w.columns) for w in found.weakest} == {
        frozenset({3, 11}),
        frozenset({5, 17}),
        frozenset({8, 9}),
    }


def test_a_dependency_of_three_columns_is_no_parallel_pair_but_has_a_certificate() -> None:
    rng = np.random.default_rng(3)
    A = rng.normal(size=(40, 12))
    A[:, 7] = 2 * A[:, 2] - A[:, 5] + 1e-9 * rng.normal(size=40)
    found = linear(A)
    assert found.parallel_columns == ()
    assert set(found.weakest[0].columns) == {2, 5, 7}
    np.testing.assert_allclose(
        found.weakest[0].vector[[2, 5, 7]] * np.sqrt(6),
        np.array([2, -1, -1]) * np.sign(found.weakest[0].vector[2]),
        rtol=1e-6,
    )


def test_columns_that_are_equal_are_the_same_unknown_twice() -> None:
    rng = np.random.default_rng(0)
    A = rng.normal(size=(30, 6))
    A[:, 4] = A[:, 1]
    found = linear(A)
    (direction,) = found.null_directions
    assert direction.name == "a trade-off within b0: 0.71 b0[1] - 0.71 b0[4]"
    assert "1 pair of unknowns with parallel columns: b0[1] and b0[4]" in found.report()


def test_one_row_far_longer_than_all_others_does_not_hide_them() -> None:
    """Rows of very different sigmas: singular values over fifteen decades."""
    A = np.eye(4)
    A[0, 0] = 1e8
    found = linear(np.vstack([A, A[[0]]]))
    assert found.rank == 4
    assert found.scaled_rank == 4


@pytest.mark.parametrize("m", [40, 4000])
def test_rows_that_ask_the_same_are_paired(m: int) -> None:
    A = np.random.default_rng(2).normal(size=(m, 6))
    A[31] = -2.5 * A[7]
    assert [(p.first, p.second) for p in linear(A).parallel_rows] == [(7, 31)]
