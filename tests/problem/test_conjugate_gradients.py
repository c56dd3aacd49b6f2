"""Steps by conjugate gradients against Cholesky's, where both exist."""

import numpy as np
import pytest
from scipy.sparse import csc_array, diags_array, random_array
from scipy.sparse.linalg import cg

from workbench.errors import BadArgument
from workbench.problem.conjugate_gradients import ConjugateGradients
from workbench.problem.linearization import Linearization
from workbench.problem.steps import cholesky

EXACT = ConjugateGradients(tolerance=1e-13)


N = 240


def model(n: int = N, seed: int = 0, dense_columns: int = 0) -> Linearization:
    """Rows that read three unknowns or fewer, and the first `dense_columns`."""
    rng = np.random.default_rng(seed)
    rows = random_array((n, n), density=2 / n, rng=rng, data_sampler=rng.standard_normal)
    J = np.vstack([rows.toarray(), np.eye(n) * rng.uniform(0.5, 50, n)])
    J[:, :dense_columns] += rng.standard_normal((2 * n, dense_columns))
    return Linearization(rng.standard_normal(2 * n), csc_array(J))


@pytest.mark.parametrize("block", [1, 3, 7])
@pytest.mark.parametrize("damping", [0.0, 3.0])
@pytest.mark.parametrize("dense_columns", [0, 5])
def test_the_step_is_choleskys(block: int, damping: float, dense_columns: int) -> None:
    here, D = model(dense_columns=dense_columns), np.linspace(0.5, 2, N)
    expected = cholesky(here, damping, D)
    assert expected is not None
    found = ConjugateGradients(block, 1e-13)(here, damping, D)
    np.testing.assert_allclose(found.p, expected.p, rtol=0, atol=1e-10)


def test_a_jacobian_that_is_an_array_is_taken_too() -> None:
    sparse = model()
    array = Linearization(sparse.residual, sparse.jacobian.toarray())
    np.testing.assert_allclose(EXACT(array, 0.0, np.ones(N)).p, EXACT(sparse, 0.0, np.ones(N)).p)


def test_blocks_that_are_all_of_the_matrix_take_one_product() -> None:
    vertices = [np.random.default_rng(i).standard_normal((4, 3)) for i in range(5)]
    J = np.zeros((20, 15))
    for i, block in enumerate(vertices):
        J[4 * i : 4 * i + 4, 3 * i : 3 * i + 3] = block
    here = Linearization(np.arange(20.0), csc_array(J))
    found = ConjugateGradients(3, 1e-12, products=1)(here, 0.0, np.ones(15))
    np.testing.assert_allclose(found.p, -np.linalg.lstsq(J, here.residual)[0], atol=1e-9)


def test_steps_that_end_early_are_shorter_and_predict_less_but_never_a_rise() -> None:
    here, D = model(), np.ones(N)
    steps = [ConjugateGradients(1, 1e-14, products=k)(here, 0.0, D).p for k in (1, 2, 3, 4)]
    gains = [here.predicted_decrease(p) for p in steps]
    assert gains[0] > 0
    assert (np.diff(gains) > 0).all()


def test_directions_that_nothing_determines_are_left_alone() -> None:
    here = model()
    J = here.jacobian.toarray()
    J[:, 30:33] = 0.0
    found = EXACT(Linearization(here.residual, csc_array(J)), 0.0, np.ones(N)).p
    assert (found[30:33] == 0).all()
    expected = -np.linalg.lstsq(J, here.residual)[0]
    np.testing.assert_allclose(found, expected, atol=1e-10)


def test_a_border_is_worth_a_block_of_its_own() -> None:
    """Twenty columns without zeros, more and more alike: as one block they need few products."""
    b, rng = 20, np.random.default_rng(1)
    here = model(dense_columns=b)
    J = here.jacobian.toarray()
    J[:, 1:b] = J[:, :1] + np.geomspace(1e-3, 1, b - 1) * rng.standard_normal((2 * N, b - 1))
    alike = Linearization(here.residual, csc_array(J))
    least = alike.predicted_decrease(-np.linalg.lstsq(J, here.residual)[0])
    single = diags_array(1 / alike.normal.diagonal())
    apart, _ = cg(alike.normal, -alike.gradient, rtol=1e-15, maxiter=20, M=single)
    found = ConjugateGradients(1, 1e-14, products=20)(alike, 0.0, np.ones(N)).p
    assert alike.predicted_decrease(found) == pytest.approx(least, rel=1e-7)
    assert alike.predicted_decrease(apart) < 0.98 * least


def test_odd_settings_are_refused() -> None:
    for wrong in (
        lambda: ConjugateGradients(0),
        lambda: ConjugateGradients(products=0),
        lambda: ConjugateGradients(tolerance=1.0),
    ):
        with pytest.raises(BadArgument, match="tolerance between 0 and 1"):
            wrong()
