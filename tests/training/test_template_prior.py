"""Templates held by edges: a Gaussian whose shape directions are eliminated."""

from dataclasses import replace

import numpy as np
import pytest

from tests.training.test_symbolic_form import BODY, ESTIMATE, OBJECTIVE, START
from workbench.errors import BadArgument
from workbench.training.blocks import BLOCKS, BlockInput
from workbench.training.normal_equations import NormalEquations
from workbench.training.objective import trusted
from workbench.training.registrations import Batch, InMemory
from workbench.training.symbolic_form import SymbolicTraining
from workbench.training.template_prior import PLACE, smooth_prior

PRIOR = smooth_prior(START.faces, BODY.shapedirs, 0.01)
RNG = np.random.default_rng(5)
N = len(START.template)


def test_the_precision_is_the_inverse_of_the_covariance() -> None:
    some = RNG.standard_normal((4, N, 3))
    expected = np.linalg.solve(PRIOR.covariance(), some.reshape(4, -1).T).T
    np.testing.assert_allclose(PRIOR.curved(some).reshape(4, -1), expected, rtol=1e-7, atol=1e-6)


def test_betas_cost_what_a_standard_normal_costs() -> None:
    """Along a shape direction the cost is at most betas^2 / 2, whatever the edges would say."""
    for k in range(BODY.n_betas):
        d = BODY.shapedirs[None, :, :, k]
        assert 0 < np.vdot(d, PRIOR.curved(d)) <= 1


def test_edges_do_not_see_the_place() -> None:
    without = smooth_prior(START.faces, BODY.shapedirs[:, :, :0], 0.01)
    moved = np.broadcast_to([0.0, 0.0, PLACE], (1, N, 3))
    assert np.vdot(moved, without.curved(moved)) == pytest.approx(1.0)


def test_a_bump_costs_more_than_a_smooth_change_of_the_same_size() -> None:
    bump = np.zeros((1, N, 3))
    bump[0, N // 2] = 1.0
    smooth = np.ones((1, N, 3)) / np.sqrt(3 * N)
    assert np.vdot(bump, PRIOR.curved(bump)) > 100 * np.vdot(smooth, PRIOR.curved(smooth))


def test_bends_cost_what_neighbours_do_not_share() -> None:
    """A displacement of all vertices costs nothing more; a bump of one does, by its own square."""
    nothing = BODY.shapedirs[:, :, :0]
    plain, bent = (
        smooth_prior(START.faces, nothing, 0.01),
        smooth_prior(START.faces, nothing, 0.01, bends=0.002),
    )
    moved = np.broadcast_to([0.0, 0.0, 0.1], (1, N, 3))
    assert np.vdot(moved, bent.curved(moved)) == pytest.approx(
        np.vdot(moved, plain.curved(moved)), rel=1e-9
    )
    bump = np.zeros((1, N, 3))
    bump[0, N // 2, 1] = 0.002
    more = np.vdot(bump, bent.curved(bump)) - np.vdot(bump, plain.curved(bump))
    assert 1 < more < 2  # the vertex itself, and a share of it for each neighbour
    with pytest.raises(BadArgument, match="bends is above 0 m"):
        smooth_prior(START.faces, nothing, 0.01, bends=0.0)


def test_no_sigma_is_refused() -> None:
    for sigma in (0.0, -1.0, np.inf, np.nan):
        with pytest.raises(BadArgument, match="above 0 m"):
            smooth_prior(START.faces, BODY.shapedirs, sigma)


HELD = replace(OBJECTIVE, freedom=PRIOR, first_posedirs=BODY.posedirs + 0.001)


@pytest.mark.parametrize("term", ["E_T", "E_P"])
def test_the_terms_are_those_of_the_symbols(term: str) -> None:
    symbolic = SymbolicTraining.of(BODY, HELD)
    found = symbolic.problem([term]).linearize(symbolic.values(ESTIMATE)).cost
    assert found == pytest.approx(HELD.costs(ESTIMATE)[term], rel=1e-8)


def matrices(count: int) -> np.ndarray:
    """Symmetric (count, N, 3, 3) with eigenvalues from 0 to 1."""
    Q, _ = np.linalg.qr(RNG.standard_normal((count, N, 3, 3)))
    return np.asarray(np.einsum("jnab,jnb,jncb->jnac", Q, RNG.uniform(0, 1, (count, N, 3)), Q))


BATCH = OBJECTIVE.registrations.read(slice(0, len(OBJECTIVE.registrations.subject)))
SOFT = replace(
    HELD, registrations=InMemory(BATCH.vertices, BATCH.subject, matrices(len(BATCH.subject)))
)


@pytest.mark.parametrize("name", ["templates", "posedirs", "joints", "poses"])
def test_the_slope_with_confidence_by_direction_is_that_of_the_cost(name: str) -> None:
    slope = NormalEquations(SOFT, ESTIMATE, (name,)).slope[name]
    change = {name: RNG.standard_normal(slope.shape)}
    h = 1e-6
    ahead, behind = (SOFT.cost(ESTIMATE.moved(change, s * h)) for s in (1, -1))
    assert (behind - ahead) / (2 * h) == pytest.approx(np.vdot(slope, change[name]), rel=1e-5)


def test_a_number_is_the_confidence_of_all_directions() -> None:
    alike = np.einsum("jn,ab->jnab", BATCH.confidence, np.eye(3))
    same = replace(HELD, registrations=InMemory(BATCH.vertices, BATCH.subject, alike))
    assert same.cost(ESTIMATE) == pytest.approx(HELD.cost(ESTIMATE), rel=1e-12)
    some = RNG.standard_normal((*BATCH.vertices.shape, 4))
    by_matrix = trusted(replace(BATCH, confidence=alike), some)
    np.testing.assert_allclose(by_matrix, trusted(BATCH, some), atol=1e-14)
    np.testing.assert_allclose(replace(BATCH, confidence=alike).trust, BATCH.confidence, atol=1e-14)


@pytest.mark.parametrize("block", ["rest", "surfaces", "regressor", "weights", "people"])
def test_every_block_lowers_the_cost_with_confidence_by_direction(block: str) -> None:
    found = BLOCKS[block](BlockInput(SOFT, START.faces), ESTIMATE).estimate
    assert SOFT.cost(found) <= SOFT.cost(ESTIMATE) * (1 + 1e-9)
    assert isinstance(BATCH, Batch)
