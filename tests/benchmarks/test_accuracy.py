"""What accuracies and posteriors count and compare, and what their kept numbers promise."""

from importlib import import_module
from typing import Any

import numpy as np
import pytest

from benchmarks import accuracy, known_posteriors, posteriors
from benchmarks.accuracy import conversion, rigid, scans
from benchmarks.measuring import kept

pytestmark = pytest.mark.thorough


def found(name: str) -> dict[str, Any]:
    data = kept(name)
    assert data is not None, name
    numbers: dict[str, Any] = data["found"]
    return numbers


@pytest.mark.parametrize("name", accuracy.NAMES)
def test_tables_are_made_of_what_is_kept(name: str) -> None:
    module = import_module(f"benchmarks.accuracy.{name}")
    text = module.tables(found(f"accuracy_{name}"))
    rows = [line for line in text.splitlines() if line.startswith("| ")]
    assert len(rows) > 3
    assert all(line.endswith(" |") and "nan" not in line for line in rows)


def test_few_cases_are_measured_and_written(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without any data that do not come with the workbench."""
    for variable in accuracy.DATA:
        monkeypatch.delenv(variable, raising=False)
    made = rigid.measured(True)
    assert all(row["within 20 mm"] == 1 for row in made.values())  # type: ignore[index]
    assert rigid.tables(made).count("\n") == 2 + len(made)
    pair = conversion.pair("default", "small", range(1))
    assert pair["mean"][0] < pair["copied"][0]
    kept_numbers = found("accuracy_conversion") | {"pairs": [pair]}
    assert conversion.tables(kept_numbers).startswith("| 1 clips, mm |")


def test_known_densities_are_what_they_say() -> None:
    """Costs are minus the log densities, up to a constant."""
    one = known_posteriors.tails_together(5.0, 3, ("x[0]",))
    L = np.linalg.cholesky(known_posteriors._covariance(3, 1e3))
    rng = np.random.default_rng(0)
    x = (rng.standard_normal((5, 3)) * 2) @ L.T
    x0, given = one.problem.split(one.at)
    u = np.sum(np.linalg.solve(L, x.T) ** 2, axis=0) / 5
    np.testing.assert_allclose(one.problem.costs(x0, given)(x), 4 * np.log(1 + u), rtol=1e-6)
    funnel = known_posteriors.wide_funnel()
    x0, given = funnel.problem.split(funnel.at)
    z = rng.standard_normal((5, 30))
    v, w = z[:, 0], z[:, 1:]
    minus_log = v**2 / 2 + 29 * v / 2 + np.sum(w**2, axis=1) * np.exp(-v) / 2
    costs = funnel.problem.costs(x0, given)(z)
    np.testing.assert_allclose(costs - costs[0], minus_log - minus_log[0], rtol=1e-9)


def test_runs_are_counted_by_verdict_and_truth() -> None:
    both = (True, False)
    runs = [{"usable": usable, "right": right} for usable in both for right in both]
    counts = {"runs": 4, "right": 2, "usable": 2, "wrong": 1, "refused": 1}
    assert known_posteriors.counted(runs) == counts


def test_kept_posteriors_keep_their_promise() -> None:
    """None that is called usable is wrong, and they cover truths drawn from the prior."""
    numbers = found("posteriors")
    assert "| decay | 2 |" in posteriors.tables(numbers)
    assert set(numbers["nuts"]) == set(posteriors.BLOCKS)
    assert all(one["agree"] for one in numbers["nuts"].values())
    assert set(numbers["known"]) == set(known_posteriors.DENSITIES)
    for name, counts in numbers["known"].items():
        assert counts["wrong"] == 0 < counts["runs"], name
    for name, one in numbers["coverage"].items():
        low, high = posteriors.band(one["usable"], len(one["covered"]))
        assert low <= min(one["covered"]) <= max(one["covered"]) <= high, name


def test_kept_registrations_are_nearer_than_the_model_and_the_peer() -> None:
    numbers = found("accuracy_scans")
    assert numbers["models"]["4 views"]["good"] >= 0.95 * numbers["models"]["4 views"]["fits"]
    rows, ours = numbers["vertices"]["4"], "model follows"
    assert np.median([row[ours]["seen"] / row["model"]["seen"] for row in rows]) < 0.7
    assert np.mean([row[ours]["all"] < row[scans.PEER]["all"] for row in rows]) >= 0.8
