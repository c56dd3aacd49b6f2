"""A diagnosis of anything at all ends in a report and in data; what the data hold is fixed."""

import json
from collections.abc import Callable

import casadi as cs
import numpy as np
import pytest

from tests.diagnostics import cases
from tests.tiers import few
from workbench import Block, Problem, Residual, diagnose

SHAPES = ((), (1,), (2,), (3,), (4,), (2, 3), (3, 2), (1, 3))
BENT: tuple[Callable[[cs.MX], cs.MX], ...] = (
    lambda r: r,
    lambda r: r**2,
    cs.sin,
    lambda r: r * r[0],
    cs.sqrt,
    lambda r: 1 / r,
    cs.floor,
)


def anything(rng: np.random.Generator) -> tuple[Problem, dict[str, np.ndarray]]:
    """A small problem: empty rows and columns, too few rows, no Jacobian, nothing free, NaN."""
    blocks = [
        Block(name, SHAPES[rng.integers(len(SHAPES))], str(rng.choice(["1", "m", "rad"])))
        for name in "abc"[: rng.integers(1, 4)]
    ]
    x = cs.vertcat(*[cs.vec(block.symbol) for block in blocks])
    found = []
    for k in range(rng.integers(1, 4)):
        A = rng.normal(size=(rng.integers(1, 9), x.shape[0])) * 10.0 ** rng.integers(-9, 9)
        A[rng.random(len(A)) < 0.2] = 0
        A[:, rng.random(x.shape[0]) < 0.2] = 0
        A *= rng.random(A.shape) < rng.choice([0.3, 1])
        A = cs.DM(A) if rng.random() < 0.5 else cs.sparsify(cs.DM(A))
        r = BENT[rng.integers(len(BENT))](A @ x + rng.integers(2)) + 0 * x[0]
        found.append(Residual(f"r{k}", r, float(rng.choice([0.01, 1, 100]))))
    read = {name for residual in found for name in residual.reads}
    free = [b.name for b in blocks if b.name in read and rng.random() < 0.8]
    at = {b.name: rng.normal(size=b.shape) * rng.integers(2) for b in blocks}
    return Problem(found, free, blocks=blocks), at


@pytest.mark.parametrize("batch", few(range(6), 1))
def test_no_problem_is_too_odd_for_a_report(batch: int) -> None:
    for case in range(8):
        rng = np.random.default_rng([batch, case])
        problem, at = anything(rng)
        priors = tuple(name for name in problem.rows if rng.random() < 0.3)
        found = diagnose(problem, at, priors=priors)
        where = (batch, case)
        assert str(found), where
        assert found.report().startswith("FINDINGS"), where
        json.dumps(found.data(), allow_nan=False)
        for suggestion in found.suggestions:
            again = diagnose(suggestion.problem, suggestion.values)
            assert again.state.rank == suggestion.after.rank, where
        if found.here.finite:
            assert len(found.null_directions) == found.shape[1] - found.rank, where
            assert found.rank <= found.structural_rank, where


@pytest.mark.parametrize("case", [cases.joints_only, cases.naive_rodrigues])
def test_data_have_a_version_and_the_ranks(case: Callable[[], cases.Case]) -> None:
    """Whoever takes a key away or changes its meaning raises the version."""
    found = cases.diagnosed(case)
    data = json.loads(json.dumps(found.data(), allow_nan=False))
    assert (data["schema"], data["version"]) == ("workbench.diagnosis", 3)
    assert data["finite"] == found.here.finite == ("rank" in data)
    if found.here.finite:
        assert data["rank"] == data["rank_law"]["rank"] == 43
        assert len(data["null_directions"]) == data["shape"][1] - 43
        assert data["condition"] is None  # infinite
