"""Promised ratios through time: what counts as slower, and that the page is what the file says."""

import json
from pathlib import Path
from typing import Any

import pytest

from benchmarks import history, history_page, targets
from benchmarks.__main__ import BUSY, PARTS
from benchmarks.fits import LM, TWO_STEPS
from benchmarks.ours import COMPILED, NUMPY
from benchmarks.targets import Target
from benchmarks.timing import best

HERE = Path(history_page.__file__).parent
RESULTS = HERE / "results"
MOST, LEAST = Target("a / b", 1.0, 2.0, True), Target("b / a", 1.0, 4.0, False)


def entry(date: str, processor: str = "here", **ratios: float) -> dict[str, Any]:
    named = {key.replace("_", " / "): value for key, value in ratios.items()}
    return {"part": "fits", "date": date, "processor": processor, "ratios": named}


def changes(*entries: dict[str, Any]) -> dict[str, tuple[float, bool]]:
    found = history.courses(entries, [MOST, LEAST])
    return {one.name: (one.change, one.slower) for one in found}


def test_a_limit_from_above_and_one_from_below_both_rise_when_slower() -> None:
    found = changes(entry("2026-01-01", a_b=1.0, b_a=6.0), entry("2026-01-02", a_b=1.2, b_a=5.0))
    assert found["a / b"] == (pytest.approx(1.2), True)
    assert found["b / a"] == (pytest.approx(1.2), True)
    found = changes(entry("2026-01-01", a_b=1.2, b_a=5.0), entry("2026-01-02", a_b=1.0, b_a=6.0))
    assert found["a / b"] == (pytest.approx(1 / 1.2), False)
    assert found["b / a"] == (pytest.approx(1 / 1.2), False)


def test_the_newest_is_compared_with_the_median_of_those_before_on_its_processor() -> None:
    past = [entry(f"2026-01-0{k}", a_b=a_b) for k, a_b in enumerate([1.0, 1.1, 9.0], start=1)]
    elsewhere = entry("2026-01-04", processor="there", a_b=0.1)
    assert changes(*past, elsewhere, entry("2026-01-05", a_b=1.1))["a / b"] == (1.0, False)
    assert changes(*past, elsewhere)["a / b"] == (1.0, False)  # the first of its kind


def test_runs_of_one_version_are_not_called_slower() -> None:
    assert changes(entry("1", a_b=1.0), entry("2", a_b=1.1))["a / b"][1] is False


def test_what_was_measured_is_remembered_once(tmp_path: Path) -> None:
    data = json.loads((RESULTS / "fingers.json").read_text())
    for _ in range(2):
        history.remember(tmp_path, "fingers", data)
    (one,) = history.read(tmp_path)
    promised = targets.all_of({"fingers": data})
    assert one["ratios"] == {
        target.name: pytest.approx(target.measured, rel=1e-3) for target in promised
    }
    history.remember(tmp_path, "fits", {**data, "found": {}})  # promises nothing
    assert history.read(tmp_path) == [one]


def test_the_page_is_written_from_the_file(tmp_path: Path) -> None:
    parts = [*PARTS, *(part + BUSY for part in PARTS)]
    files = {part: RESULTS / f"{part}.json" for part in parts}
    results = {part: json.loads(f.read_text()) for part, f in files.items() if f.exists()}
    found = history.courses(history.read(RESULTS), targets.all_of(results))
    assert len(found) == len(targets.all_of(results))  # every promise has been remembered
    (tmp_path / "results").mkdir()
    page = tmp_path / history_page.PAGE
    page.write_text((HERE / history_page.PAGE).read_text(encoding="utf-8"), encoding="utf-8")
    history_page.write(tmp_path, found)
    assert page.read_text(encoding="utf-8") == (HERE / history_page.PAGE).read_text("utf-8")
    latest = {one.name: one.measured[-1].target.measured for one in found}
    named = {target.name: target.measured for target in targets.all_of(results)}
    assert latest == pytest.approx(named, rel=1e-3)


def test_the_readme_says_what_was_measured() -> None:
    """How many times as long JAX takes for a Jacobian, and the residual alone beside JAX's."""
    parts = ("derivatives", "fits")
    results = {part: json.loads((RESULTS / f"{part}.json").read_text()) for part in parts}
    ratio = {target.name: target.measured for target in targets.all_of(results)}
    text = " ".join((HERE.parent / "README.md").read_text(encoding="utf-8").split())
    assert (
        "in less than a tenth of the time that JAX needs; with a C compiler, in less than a" in text
    )
    assert 10 < ratio["workbench: JAX / Jacobian"] < 12
    assert 40 < ratio["workbench, compiled: JAX / Jacobian"] < 50
    plain, compiled = (
        ratio[f"{way}: forward / JAX"] for way in ("workbench", "workbench, compiled")
    )
    assert (
        f"takes {plain:.1f} times as long as with JAX, and {compiled:.1f} times as long w" in text
    )
    fits = [value for name, value in ratio.items() if "our Jacobian / LM" in name]
    assert "between a quarter and a twenty-second of what `scipy.optimize.least_squares`" in text
    assert (round(min(fits)), round(max(fits))) == (4, 22)


def test_the_readme_says_what_a_video_takes() -> None:
    results = {"sequences": json.loads((RESULTS / "sequences.json").read_text())}
    found = results["sequences"]["found"]
    ratios = {
        target.name: target.measured
        for target in targets.all_of(results)
        if "linearized one by one" in target.name
    }
    text = " ".join((HERE.parent / "README.md").read_text(encoding="utf-8").split())
    assert (
        "takes about as long as computing the residuals and Jacobians of these frames one" in text
    )
    assert len(ratios) == 2
    assert all(0.8 < ratio < 1.2 for ratio in ratios.values())
    long = found["frames"]["2000"]
    assert f"2,000 frames, with {long['unknowns']:,} unknowns, takes about a second" in text
    assert 0.5 < best(long["seconds"]["LM iteration"]) < 1.5
    assert "and the whole fit about a gigabyte of memory" in text
    assert 0.85e9 < long["peak"] - long["before"] < 1.15e9


def test_the_page_says_what_two_steps_with_each_jacobian_take() -> None:
    found = json.loads((RESULTS / "fits.json").read_text())["found"]
    ratios = [
        best(each["seconds"][f"{way}: {TWO_STEPS}"]) / best(each["seconds"][f"{way}: {LM}"])
        for each in found.values()
        for way in (NUMPY, COMPILED)
        if f"{way}: {LM}" in each["seconds"]
    ]
    assert len(ratios) == 10
    text = " ".join((HERE / "README.md").read_text(encoding="utf-8").split())
    assert f"takes {min(ratios):.2f} to {max(ratios):.2f} of the time of one step" in text
