"""What accuracies and posteriors count and compare, and what their kept numbers promise."""

from importlib import import_module
from typing import Any

import numpy as np
import pytest
from scipy.spatial import cKDTree

from benchmarks import accuracy, known_posteriors, posteriors
from benchmarks.accuracy import conversion, design, images, rigid, scans, training
from benchmarks.measuring import MissingData, kept

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


def test_data_that_are_missing_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(accuracy.KINECT, "no/such/file.npz")
    with pytest.raises(MissingData, match=r"set WORKBENCH_KINECT to the file that examples/26"):
        accuracy.needed(accuracy.KINECT)
    with pytest.raises(MissingData):
        accuracy.taken(False, accuracy.KINECT)
    assert accuracy.taken(True, accuracy.KINECT) == set()


def test_distances_of_limbs_are_taken_about_the_hips() -> None:
    true = np.random.default_rng(0).standard_normal((5, len(images.NAMES), 3))
    assert images.mpjpe(true + [1.0, 2.0, 3.0], true) == pytest.approx(0, abs=1e-9)
    moved = true.copy()
    moved[:, 0, 0] += 0.12
    assert 0 not in images.HIPS
    assert images.mpjpe(moved, true) == pytest.approx(10)


def test_blocks_of_a_scan_are_held_out_as_a_whole() -> None:
    """Half of the points either way, but in blocks the nearest fitted one is far away."""
    rng = np.random.default_rng(0)
    points = np.column_stack([rng.random((20_000, 2)), np.zeros(20_000)])
    far = []
    for choose in (scans.at_random, scans.in_blocks):
        fitted = choose(points, 1)
        assert 0.4 < fitted.mean() < 0.6
        assert (fitted != choose(points, 2)).any()
        far.append(np.median(cKDTree(points[fitted]).query(points[~fitted])[0]))
    assert far[0] < 0.008
    assert far[1] > 0.010


def test_predictions_of_designs_are_judged_by_order() -> None:
    names = ("a", "b", "c")
    rows = [
        {"frame": t, "first": first, "second": second, "predicted": i + 1.0, "error": 10.0 * i}
        for t in range(3)
        for first in names
        for i, second in enumerate(n for n in (*names, "d") if n != first)
    ]
    told = design.judged(rows)
    assert told["best is best"] == told["tau"] == 1
    assert design.judged([row | {"error": -row["error"]} for row in rows])["tau"] == -1


def test_simulated_designs_have_the_predicted_spread() -> None:
    """60 fits know a standard deviation to 9 %, and 4 of these are allowed."""
    again = design.compared("a decay", 60)
    for when in ("before", "after"):
        ratio = again[when]["predicted"] / again[when]["simulated"]
        assert abs(ratio - 1) < 4 / np.sqrt(120)
        assert again[when]["low"] < again[when]["simulated"] < again[when]["high"]


def test_shape_is_pose_without_pose_normalisation() -> None:
    made = training.measured(True)
    rows = {row["name"]: row for row in made["terms"]}  # type: ignore[attr-defined]
    raw, normal = rows["not pose-normalised"], rows["all terms"]
    assert raw["pose in shape"][0] > max(0.5, normal["pose in shape"][0])
    assert rows["no E_Y"]["asymmetry"] > 2 * normal["asymmetry"]
    assert rows["no E_P"]["posedirs"] > 2 * normal["posedirs"]
    degrees = made["mean error in degrees"]
    assert degrees["edges"] < 0.7 * degrees["vertices"]  # type: ignore[index]
    assert "off by" in training.tables(made)


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


def test_simulated_fits_are_covered() -> None:
    """Two fits of each kind of problem, bodies among them."""
    for make in posteriors.PROBLEMS.values():
        told = posteriors.covered(make(), 2, seed=5)
        assert (told["usable"], told["failed"]) == (2, 0)
        assert max(told["covered"]) == 2


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
