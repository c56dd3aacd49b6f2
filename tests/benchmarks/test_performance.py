"""The benchmarks run at tiny sizes and agree; how fast they are is not asked here."""

from collections.abc import Callable
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

import pytest

from benchmarks import (
    closest,
    figure,
    fits,
    ours,
    overhead,
    page,
    peers,
    sequences,
    table,
    targets,
    vertices,
)
from benchmarks.__main__ import main
from benchmarks.bodies_made_up import case_of, random_body
from benchmarks.candidates import Disagreement, check
from benchmarks.derivatives import KINDS
from benchmarks.floor import FLOOR

pytestmark = pytest.mark.thorough

TINY = "40"


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("out")
    (out / "README.md").write_text(f"before\n{page.BEGIN}\n{page.END}\nafter\n")
    options = ["--bodies", TINY, "--rounds", "1", "--sizes", TINY, "--out", str(out), "--no-peers"]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(overhead, "OFTEN", {})  # no times are asserted here
        main(options)
    return out


def test_page_is_written_between_its_marks(written: Path) -> None:
    text = (written / "README.md").read_text()
    assert text.startswith("before\n")
    assert text.endswith("after\n")
    assert "| workbench |" in text
    assert "µs per vertex" in text


def test_differences_agree_with_the_workbench() -> None:
    case = case_of(TINY, random_body(40))
    x, y = case.people(2)
    apart = check(peers.by_differences(case.seeing(x)), case.seeing(x), y)
    assert apart["value"] < 1e-12
    assert apart["jacobian"] < 1e-6


@pytest.mark.filterwarnings("default")  # they have warnings of their own
@pytest.mark.parametrize(
    ("make", "packages"), [(peers.in_jax, ["jax"]), (peers.in_torch, ["torch", "smplx"])]
)
def test_peers_agree_with_the_workbench(make: Callable, packages: list[str]) -> None:
    if any(find_spec(package) is None for package in packages):
        pytest.skip(f"{' and '.join(packages)} needed: pip install '.[bench]'")
    case = case_of(TINY, random_body(40))
    x, y = case.people(2)
    check(make(case.seeing(x)), case.seeing(x), y)


def test_candidates_that_disagree_are_refused() -> None:
    case = case_of(TINY, random_body(40))
    (x,) = case.people(1)
    right = ours.candidate("wrong", case)
    wrong = replace(right, forward=lambda x: right.forward(x) + 1e-6)
    with pytest.raises(Disagreement, match="wrong on 40: its value is"):
        check(wrong, case, x)


def made_up_results() -> dict:
    """All parts in round numbers: 2 ms, 20 for JAX and torch, 1 s for 100,000 vertices."""
    machine = {
        "processor": "P",
        "cores": 2,
        "cores used": 1,
        "system": "S",
        "python": "3",
        "versions": {"numpy": "2"},
        "date": "2026-01-31T00:00:00",
    }
    times = {ours.NUMPY: [2e-3], peers.JAX: [20e-3], peers.TORCH: [20e-3], FLOOR: [1e-3]}
    body = {"vertices": 6890, "unknowns": 85, "seconds": {kind: times for kind in KINDS}}
    labels = [f"{ours.NUMPY}: {m}" for m in (fits.LM, fits.ALONE, fits.IPOPT, fits.SCIPY_LM)]
    fit = {
        "vertices": 6890,
        "evaluations": {label: [{"jacobian": 7}] for label in labels},
        "seconds": {label: [0.1] for label in labels},
    }
    by_size = {"6890": [2e-3], "100000": [1.0]}
    memory = {size: dict.fromkeys(table.MEMORY, 10**6) for size in by_size}
    scale = {
        "sizes": [6890, 100000],
        "bytes": {ours.NUMPY: memory},
        "seconds": {kind: {ours.NUMPY: by_size, FLOOR: by_size} for kind in KINDS},
    }
    around = {
        "body": "default",
        "vertices": 1229,
        "seconds": {
            "A": [1.2],
            f"A{overhead.HAND}": [1.0],
            f"A{overhead.DECIDING}": [1.15],
            "B": [1.0],
            f"B{overhead.HAND}": [1.0],
        },
    }
    found = {
        "derivatives": {"6890": body},
        "fits": {"6890": fit},
        "scaling": scale,
        "overhead": around,
    }
    return {part: {"machine": machine, "found": one} for part, one in found.items()}


def test_figure_is_drawn_from_the_numbers(tmp_path: Path) -> None:
    caption = figure.draw(made_up_results(), tmp_path / "figure.svg")
    assert (tmp_path / "figure.svg").read_text().startswith("<?xml")
    assert "1 of 2 cores of P" in caption


def test_steps_of_free_vertices_agree() -> None:
    """`measure` compares the steps before it times them."""
    found = vertices.measure(1, ("small",))
    one = found["small"]
    assert (one["unknowns"], one["rows"]) == (3 * 369, 5517)
    assert set(one["seconds"]) == {vertices.OURS, vertices.DIRECT, vertices.KRYLOV}
    assert one["bytes"]["peak"] > one["bytes"]["before"]
    assert "| small | 1,107 | 5,517 |" in table.vertices(found)
    assert vertices.registration("small")[0].sparse


def test_videos_are_timed_beside_their_frames() -> None:
    """`measure` compares the steps, and solutions of six frames, before it tells anything."""
    found = sequences.measure(1, (sequences.JOINTS,), frames=4, lengths=(3,))
    one = found["seen"][sequences.JOINTS]
    assert one["unknowns"] == 4 * 75 + 10
    assert one["rows"] == 4 * (4 * 48 + 72) + 10 + 3 * 75
    assert one["off"] < sequences.SAME
    assert len(one["seconds"][sequences.ITERATION]) > 2
    alone = found["frames"]["3"]
    assert alone["unknowns"] == 235
    assert alone["peak"] >= alone["problem"] > alone["before"]
    said = table.sequences(found)
    assert "| 24 joints, 4 frames | 310 |" in said
    assert "| 3 | 235 |" in said
    fast = {sequences.ITERATION: [1.0], sequences.APART: [2.0]}
    made_up = {
        "seen": {"joints": {"frames": 200, "seconds": fast}},
        "frames": {str(n): {"seconds": {sequences.ITERATION: [1e-3 * n**1.5]}} for n in (4, 16)},
    }
    judged = targets.all_of({"sequences": {"found": made_up}})
    assert [target.measured for target in judged] == pytest.approx([0.5, 2.0])
    assert [target.holds for target in judged] == [True, False]


def test_closest_places_agree() -> None:
    found = closest.measure(1, peers=False, body="small", count=200)
    assert set(found["seconds"]) == {*closest.KINDS, closest.REFIT}
    assert "200 points, 734 triangles" in table.closest(found)
    made_up = {closest.COMPILED: [0.01], closest.NUMPY: [0.4], closest.IGL: [0.02]}
    told = {**found, "seconds": {"near": made_up, "clutter": {}, "off": {}, closest.REFIT: {}}}
    assert "| libigl | 20 / 20 | 2 |" in table.closest(told)
    judged = {target.name: target for target in targets.all_of({"closest": {"found": told}})}
    assert judged["closest places, near: compiled / libigl"].measured == 0.5
    assert judged["closest places, near: compiled / libigl"].holds
    assert not judged["closest places, near: NumPy / compiled"].holds
