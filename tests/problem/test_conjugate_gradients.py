"""Steps by conjugate gradients against Cholesky's, where both exist."""

import numpy as np
import pytest
from scipy.sparse import csc_array, random_array

from workbench.errors import BadArgument
from workbench.problem.conjugate_gradients import ConjugateGradients
from workbench.problem.linearization import Linearization
from workbench.problem.steps import cholesky

EXACT = ConjugateGradients(tolerance=1e-13)


def model(n: int = 60, seed: int = 0) -> Linearization:
    rng = np.random.default_rng(seed)
    rows = random_array((4 * n, n), density=0.05, rng=rng, data_sampler=rng.standard_normal)
    J = csc_array(np.vstack([rows.toarray(), np.eye(n) * rng.uniform(0.5, 50, n)]))
    return Linearization(rng.standard_normal(5 * n), J)


@pytest.mark.parametrize("block", [1, 2, 3, 5])
@pytest.mark.parametrize("damping", [0.0, 3.0])
def test_the_step_is_choleskys(block: int, damping: float) -> None:
    here, D = model(), np.linspace(0.5, 2, 60)
    expected = cholesky(here, damping, D)
    assert expected is not None
    found = ConjugateGradients(block, 1e-13)(here, damping, D)
    np.testing.assert_allclose(found.p, expected.p, rtol=0, atol=1e-10)


def test_a_jacobian_that_is_an_array_is_taken_too() -> None:
    sparse = model()
    array = Linearization(sparse.residual, sparse.jacobian.toarray())
    np.testing.assert_allclose(EXACT(array, 0.0, np.ones(60)).p, EXACT(sparse, 0.0, np.ones(60)).p)


def test_blocks_that_are_all_of_the_matrix_take_one_product() -> None:
    vertices = [np.random.default_rng(i).standard_normal((4, 3)) for i in range(5)]
    J = np.zeros((20, 15))
    for i, block in enumerate(vertices):
        J[4 * i : 4 * i + 4, 3 * i : 3 * i + 3] = block
    here = Linearization(np.arange(20.0), csc_array(J))
    found = ConjugateGradients(3, 1e-12, products=1)(here, 0.0, np.ones(15))
    np.testing.assert_allclose(found.p, -np.linalg.lstsq(J, here.residual)[0], atol=1e-9)


def test_steps_that_end_early_are_shorter_and_predict_less_but_never_a_rise() -> None:
    here, D = model(), np.ones(60)
    steps = [ConjugateGradients(1, 1e-14, products=k)(here, 0.0, D).p for k in (1, 2, 3, 4)]
    gains = [here.predicted_decrease(p) for p in steps]
    assert gains[0] > 0
    assert (np.diff(gains) > 0).all()


def test_directions_that_nothing_determines_are_left_alone() -> None:
    here = model()
    J = here.jacobian.toarray()
    J[:, 30:33] = 0.0
    found = EXACT(Linearization(here.residual, csc_array(J)), 0.0, np.ones(60)).p
    assert (found[30:33] == 0).all()
    expected = -np.linalg.lstsq(J, here.residual)[0]
    np.testing.assert_allclose(found, expected, atol=1e-10)


def test_unknowns_that_cannot_be_divided_and_odd_settings_are_refused() -> None:
    with pytest.raises(BadArgument, match="60 unknowns cannot be divided into blocks of 7"):
        ConjugateGradients(7)(model(), 0.0, np.ones(60))
    for wrong in (
        lambda: ConjugateGradients(0),
        lambda: ConjugateGradients(products=0),
        lambda: ConjugateGradients(tolerance=1.0),
    ):
        with pytest.raises(BadArgument, match="tolerance between 0 and 1"):
            wrong()
