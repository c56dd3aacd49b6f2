"""The tables of each page are those of the stored results, and these keep what is promised."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks import (
    conversion,
    conversion_page,
    free_vertices,
    kinect,
    page,
    registration,
    rigid,
    soft_tissue,
)
from benchmarks.choosing import page as choosing
from benchmarks.choosing.temperaments import TEMPERAMENTS
from benchmarks.design import __main__ as design
from benchmarks.gym import page as gym
from benchmarks.hands import __main__ as hands
from benchmarks.hands.tables import tables as tables_of_hands
from benchmarks.images import markers as of_markers
from benchmarks.images import (
    one_camera,
    video,
)
from benchmarks.posterior import __main__ as posterior
from benchmarks.posterior import coverage, known
from benchmarks.posterior import page as posterior_page
from workbench.solvers import DEFAULT

pytestmark = pytest.mark.thorough

PLACE = Path(page.__file__).parent
RESULTS = PLACE / "results"


def text(name: str) -> str:
    return (PLACE / name).read_text(encoding="utf-8")


def read(name: str) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((RESULTS / f"{name}.json").read_text(encoding="utf-8"))
    return found


def timed(parts: list[str]) -> dict[str, Any]:
    return {part: read(part) for part in parts if (RESULTS / f"{part}.json").exists()}


BETWEEN: dict[str, tuple[str, str, str, str, Callable[..., str]]] = {
    name: (file, begin, end, results, tables)
    for name, file, (begin, end), results, tables in (
        ("design", "DESIGN.md", (design.BEGIN, design.END), design.RESULTS.stem, design.tables),
        ("hands", "HANDS.md", (hands.BEGIN, hands.END), hands.RESULTS.stem, tables_of_hands),
        (
            "images",
            "IMAGES.md",
            (one_camera.BEGIN, one_camera.END),
            one_camera.RESULTS.stem,
            one_camera.tables,
        ),
        (
            "free vertices",
            "REGISTRATION.md",
            (free_vertices.BEGIN, free_vertices.END),
            free_vertices.RESULTS.stem,
            free_vertices.page,
        ),
        (
            "registration",
            "REGISTRATION.md",
            (registration.BEGIN, registration.END),
            registration.RESULTS.stem,
            registration.page,
        ),
    )
}


@pytest.mark.parametrize("name", BETWEEN)
def test_tables_between_marks_are_the_results(name: str) -> None:
    file, begin, end, results, tables = BETWEEN[name]
    shown = (PLACE / file).read_text(encoding="utf-8").partition(begin)[2].partition(end)[0]
    assert shown.strip() == tables(read(results)).strip()


def test_pages_without_marks_are_the_results() -> None:
    assert text("CONVERSION.md") == conversion_page.written(read("conversion"))
    assert text("SOLVERS.md") == "\n".join(choosing.lines(read("choosing"))) + "\n"
    assert text("TISSUE.md").split(soft_tissue.MARK)[1] == soft_tissue.tables(read("soft-tissue"))
    parts = {
        part: read(f"posterior-{part}") for part in posterior.PARTS if has(f"posterior-{part}")
    }
    assert text("POSTERIOR.md") == posterior_page.text(parts)


def has(name: str) -> bool:
    return (RESULTS / f"{name}.json").exists()


def test_page_of_times_is_the_results() -> None:
    assert page.text(timed([*page.SECTIONS])) in text("README.md")
    rows = read("rigid")["found"]
    assert f"{rigid.BEGIN}\n{rigid.table(rows)}\n{rigid.END}" in text("README.md")


def test_tables_of_videos_and_scans_are_the_results() -> None:
    found = read("images-video")
    for part in video.PARTS:
        assert video.table(found[part]) in text("VIDEO.md")
    assert video.limits_table(found["limits"]) in text("VIDEO.md")
    assert kinect.table(read("kinect")["runs"]) in text("REGISTRATION.md")


def test_tables_of_markers_and_rigging_are_the_results() -> None:
    """These are typed; means over seeds and single rows."""
    names = {"on the surface": "unknown", "on the surface, heights known": "known to 1 mm"}
    digits = {"shape_before": 1, "offsets_before": 2, "shape": 2, "offsets": 2}
    digits |= {"choosing_seconds": 2, "seconds": 2}
    for name, rows in json.loads(Path(of_markers.RESULTS).read_text())["rows"].items():
        means = [f"{np.mean([r[key] for r in rows]):.{n}f}" for key, n in digits.items()]
        assert f"| {names.get(name, name)} | {' | '.join(means)} |" in text("MARKERS.md")
    for name, one in read("rigging").items():
        kind, seed = name.split()
        ours = one["ours"]
        edges = f"{ours['edges']} of {ours['of_edges']}"
        row = f"| {kind} | {seed} | {ours['bones']} | {edges} | {ours['held_out_rms_m']:.0e} m |"
        assert row in text("RIGGING.md")


def test_page_of_the_gym_is_the_results() -> None:
    kept = {half: gym.read(RESULTS / f"gym-{half}.json") for half in ("tuning", "untouched")}
    assert text("GYM.md") == "\n".join(gym.lines(kept)) + "\n"


def test_stored_intervals_keep_their_promise() -> None:
    """None that is called usable is wrong, and they cover truths drawn from the prior."""
    found = read("posterior-known")["found"]
    for name, runs in found["densities"].items():
        assert known.counted(runs)["wrong"] == 0 < known.counted(runs)["runs"], name
    for name, one in read("posterior-coverage")["found"].items():
        low, high = coverage.band(one["usable"], len(one["covered"]))
        assert low <= min(one["covered"]) <= max(one["covered"]) <= high, name


@pytest.mark.parametrize("half", ["tuning", "untouched"])
def test_default_is_within_two_points_of_the_best_at_every_factor(half: str) -> None:
    found = gym.read(RESULTS / f"gym-{half}.json")
    assert gym.profiled(found)[0] == DEFAULT
    shares = gym.profile(found, list(np.geomspace(1, 1000, 300)))
    assert (shares[:, 0] >= shares.max(axis=1) - 0.02).all()


def test_default_solves_every_regression_of_nist() -> None:
    for half, family in (("tuning", "nist, tuned"), ("untouched", "nist")):
        found = gym.read(RESULTS / f"gym-{half}.json")
        rows = zip(found["cases"], found["solvers"][DEFAULT]["solved"], strict=True)
        solved = {n: ours for (n, kind), ours in rows if kind == family and "as far" not in n}
        assert len(solved) in {24, 30}
        assert all(solved.values()), [name for name, ours in solved.items() if not ours]


def test_registrations_are_nearer_than_the_model_and_the_peer() -> None:
    good = [run["error"] <= registration.GOOD for run in read("registration")["scenes"]["4 views"]]
    assert np.mean(good) >= 0.95
    rows = read("free-vertices")["views"]["4"]["scans"]
    ours = "edges, model follows"
    assert np.median([row[ours]["seen"] / row["model"]["seen"] for row in rows]) < 0.7
    assert np.mean([row[ours]["all"] < row[free_vertices.PEER]["all"] for row in rows]) >= 0.8


def test_stored_runs_are_of_the_present_plans() -> None:
    assert set(read("choosing")["found"]) == set(TEMPERAMENTS) == set(choosing.ADVICE)
    for pair in read("conversion")["pairs"]:
        assert len(pair["mean"]) == len(conversion.SEEDS)
