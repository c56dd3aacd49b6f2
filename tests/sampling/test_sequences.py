"""Posteriors of sequences: what the band says of what is not sampled is what arrays say."""

import numpy as np
import pytest

import workbench as wb
from tests.problem.sequences import SHARED, SMOOTH, both_storages, frame, values
from tests.tiers import few
from workbench.errors import TooLarge
from workbench.sampling import integrated
from workbench.sampling.conditioning import conditioning
from workbench.sampling.subspace import BandedRest, Improper, fixed, subspace_of

T = 5


@pytest.fixture
def both(monkeypatch: pytest.MonkeyPatch) -> tuple[wb.Problem, wb.Problem, wb.Values]:
    def build() -> wb.Problem:
        return wb.sequence([frame()] * T, shared=SHARED, between=SMOOTH)

    plain, blocked = both_storages(build, monkeypatch)
    at = values(T)
    return plain, blocked, at | wb.solve(plain, at).values


@pytest.mark.parametrize("names", few(["betas", ("betas[1]", "trans[2]"), "pose[3, pelvis]"], 1))
def test_integrated_rest_by_band_is_that_by_array(
    both: tuple[wb.Problem, wb.Problem, wb.Values], names: str | tuple[str, ...]
) -> None:
    plain, blocked, at = both
    if names == "pose[3, pelvis]":
        names = f"pose[3, {plain.free['pose'].labels[0]}]"  # type: ignore[index]
    x, given = plain.split(at)
    by_array = subspace_of(plain, x, given, names, integrated)
    by_band = subspace_of(blocked, x, given, names, integrated)
    assert isinstance(by_band.rest, BandedRest)
    assert by_band.rest.shape == by_array.rest.shape
    np.testing.assert_allclose(by_band.along, by_array.along, atol=1e-9)
    half = by_band.rest.times(np.eye(by_band.rest.shape[1]))  # rows: what each w moves
    covariance = np.asarray(by_array.rest) @ np.asarray(by_array.rest).T
    np.testing.assert_allclose(half.T @ half, covariance, atol=1e-9 * covariance.max())
    assert not half[:, by_band.entries].any()
    z = by_array.centre + 0.1
    told = conditioning(plain, given, by_array, z), conditioning(blocked, given, by_band, z)
    np.testing.assert_allclose(told[1].marginal, told[0].marginal, rtol=1e-6)
    assert told[1].count == told[0].count == 0
    with pytest.raises(TooLarge, match="shorter part"):
        _ = by_band.span


def test_conditioning_by_band_is_that_by_array(
    both: tuple[wb.Problem, wb.Problem, wb.Values],
) -> None:
    plain, blocked, at = both
    x, given = plain.split(at)
    told = []
    for problem in (plain, blocked):
        space = subspace_of(problem, x, given, "betas", fixed)
        told.append(conditioning(problem, given, space, space.centre))
    by_array, by_band = told
    np.testing.assert_allclose(by_band.conditional, by_array.conditional, rtol=1e-6)
    np.testing.assert_allclose(by_band.marginal, by_array.marginal, rtol=1e-6)
    assert (by_band.ratios > 1.001).all()
    assert by_band.names == by_array.names
    assert by_band.count == by_array.count


@pytest.mark.thorough
def test_draws_of_shared_numbers_have_marginal_width(
    both: tuple[wb.Problem, wb.Problem, wb.Values],
) -> None:
    _, blocked, at = both
    near = wb.laplace(blocked, at, "betas", rest=integrated, draws=400)
    assert near.points(7).shape == (7, blocked.free.size)
    here = blocked.linearize(at)
    columns = np.eye(blocked.free.size)[:, blocked.free.slices["betas"]]
    found = here.inverse_times(columns)
    assert found is not None
    expected = np.sqrt(np.diag(found[blocked.free.slices["betas"]]))
    np.testing.assert_allclose(near.sd, expected, rtol=0.2)  # of 400 draws


def test_improper_frames_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    where, shape = wb.Block("where", (3,)), wb.Block("shape", (2,))
    flat = wb.Residual("square", where.symbol**2, 1.0)  # whose slope is zero where it is zero
    prior = wb.residuals.gaussian(shape.symbol, name="prior")

    def build() -> wb.Problem:
        one = wb.Problem((flat, prior), ("shape", "where"))
        return wb.sequence([one] * 3, shared=("shape",))

    at = {"shape": np.zeros(2), "where": np.zeros((3, 3))}
    for problem in both_storages(build, monkeypatch):
        x, given = problem.split(at)
        if problem.linearize_at(x, given).by_frames:
            with pytest.raises(Improper, match="no width"):
                subspace_of(problem, x, given, "shape", integrated)
        else:
            there = subspace_of(problem, x, given, "shape", integrated)
            assert there.rest.shape == (len(x), 0)
            assert not there.along[problem.free.slices["where"]].any()
