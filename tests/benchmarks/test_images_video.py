"""The page on videos says what was measured, and its measures are those of their names."""

import json

import numpy as np
import pytest

from benchmarks.images.limbs import HIPS, NAMES, mpjpe
from benchmarks.images.video import PAGE as FILE
from benchmarks.images.video import RESULTS, acceleration, limits_table, means, table

PAGE = FILE.read_text()
TEXT = " ".join(PAGE.split())
FOUND = json.loads(RESULTS.read_text())
PARTS = [part for part in ("tuning", "report", "whole") if part in FOUND]


@pytest.mark.parametrize("part", PARTS)
def test_its_tables_are_the_stored_results(part: str) -> None:
    assert table(FOUND[part]) in PAGE


def test_its_sentences_hold() -> None:
    found = means(FOUND["report"])
    assert f"{found['together']:.1f} mm together and {found['apart']:.1f} mm apart" in TEXT
    assert found["together"] > 0.95 * found["apart"]  # not confirmed, not 5 % below
    assert f"If frames count as independent, it is {found['independent']:.1f} mm" in TEXT
    assert found["independent"] > 1.1 * found["together"]
    assert means(FOUND["tuning"])["together"] < 0.95 * means(FOUND["tuning"])["apart"]
    rows = FOUND["report"]
    assert max(abs(row["together"]["stature"]) for row in rows) > 50
    worst = {
        name: max(abs(row[name]["stature"]) / row[name]["stature sd"] for row in rows)
        for name in ("together", "independent")
    }
    assert worst["together"] < 1.5
    assert worst["independent"] == pytest.approx(6.5, abs=0.05)
    whole = means(FOUND["whole"])
    assert f"{whole['together']:.1f} mm together and {whole['apart']:.1f} mm apart, and no" in TEXT
    ratios = [row["together"]["mpjpe"] / row["apart"]["mpjpe"] for row in FOUND["whole"]]
    assert max(ratios) < 1.05
    within = sum(row["together"]["CPU seconds"] <= 4 for row in FOUND["whole"])
    many = ("no", "one", "two", "three", "all")[within]
    assert f"4 s of CPU time in {many} camera{'' if within == 1 else 's'} of four" in TEXT
    step = FOUND["step"]
    assert f"takes {step['CPU seconds']:.2f} s and {step['MB']:.0f} MB" in TEXT
    assert step["CPU seconds"] < 0.2
    assert step["MB"] < 200


def test_what_is_said_of_the_mean_holds() -> None:
    """In CHANGELOG, too."""
    report, whole = (means(FOUND[part]) for part in ("report", "whole"))
    assert f"With the mean of the posterior it is {report['mean']:.1f} mm" in TEXT
    below = 1 - report["mean"] / report["apart"]
    assert below > 0.05
    assert f"which is {100 * below:.0f} % below the frames apart, and no camera is worse" in TEXT
    assert all(row["mean"]["mpjpe"] < row["apart"]["mpjpe"] for row in FOUND["report"])
    assert f"it is {whole['mean']:.1f} mm with the mean of the posterior" in TEXT
    worst = max(row["mean"]["mpjpe"] / row["apart"]["mpjpe"] for row in FOUND["whole"])
    assert worst < 1.05
    assert f"whose worst camera has {worst:.2f} times the distance apart" in TEXT
    took = [row["mean"]["CPU seconds"] for row in FOUND["whole"]]
    assert f"the mean takes {min(took):.1f} to {max(took):.1f} s more" in TEXT
    changed = " ".join((FILE.parents[1] / "CHANGELOG.md").read_text().split())
    told = f"{report['mean']:.1f} mm instead of {report['together']:.1f} on new frames of `balance`"
    assert told in changed


def test_what_is_said_of_limits_holds() -> None:
    found = FOUND["limits"]
    assert limits_table(found) in PAGE

    def mean(name: str) -> str:
        return f"{np.mean([each[name]['mpjpe'] for each in found.values()]):.1f}"

    usual, true = "usual start", "from the truth"
    together = means(FOUND["report"])["together"]
    assert np.mean([each[usual]["mpjpe"] for each in found.values()]) == pytest.approx(
        together, abs=0.05
    )
    assert f"{together:.1f} mm from the usual start and {mean(true)} mm from the truth" in TEXT
    known = (mean(f"{name}, shape known") for name in (usual, true))
    assert f"where the mean distances are {' and '.join(known)} mm" in TEXT
    for end in ("", ", shape known"):
        apart = [each[true + end]["cost"] - each[usual + end]["cost"] for each in found.values()]
        assert min(apart) > -0.01
        assert f"costs differ by at most {max(apart):.1f}." in TEXT
    assert abs(found["cam03"][usual]["mpjpe"] - found["cam03"][true]["mpjpe"]) < 0.5
    assert f"tuning frames the mean distance is {means(FOUND['tuning'])['together']:.1f} mm" in TEXT


def test_distances_are_of_the_limbs_about_the_hips() -> None:
    true = np.random.default_rng(0).standard_normal((5, len(NAMES), 3))
    assert mpjpe(true + [1.0, 2.0, 3.0], true) == pytest.approx(0, abs=1e-9)
    moved = true.copy()
    moved[:, 0, 0] += 0.12
    assert 0 not in HIPS
    assert mpjpe(moved, true) == pytest.approx(10)
    line = np.arange(6)[:, None, None] ** 2 * np.ones((6, 12, 3)) * [1e-3, 0, 0]
    assert acceleration(line) == pytest.approx(2)
