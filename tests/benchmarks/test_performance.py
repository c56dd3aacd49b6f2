"""The benchmarks run at tiny sizes and agree; how fast they are is not asked here."""

import json
import sys
import tracemalloc
from collections.abc import Callable
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

from benchmarks import (
    closest,
    figure,
    fingers,
    fits,
    floors,
    history,
    ours,
    overhead,
    page,
    peers,
    rigid,
    sequences,
    table,
    targets,
    vertices,
)
from benchmarks.__main__ import PARTS, main
from benchmarks.bodies_made_up import case_of, random_body
from benchmarks.candidates import Candidate, Disagreement, check
from benchmarks.derivatives import KINDS
from benchmarks.floor import FLOOR, OWN
from benchmarks.floor_of_arithmetic import ARITHMETIC, products
from tests import bodies_made_up
from tests.compilers import NEEDS_A_COMPILER
from workbench import LevenbergMarquardt
from workbench.bodies.forward.packed_vertices import PLAIN, PackedVertices

pytestmark = pytest.mark.thorough

RESULTS = Path(__file__).parents[2] / "benchmarks" / "results"
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


def read(out: Path, part: str) -> dict:
    return json.loads((out / "results" / f"{part}.json").read_text())


def test_every_part_is_written_with_its_keys(written: Path) -> None:
    for part in PARTS:
        found = read(written, part)
        assert set(found) == {"machine", "options", "found"}
        assert {"processor", "cores", "versions", "date", "load"} <= set(found["machine"])
        assert found["options"] == {"bodies": [TINY], "rounds": 1, "peers": False}
    body = read(written, "derivatives")["found"][TINY]
    assert set(body) == {"vertices", "unknowns", "apart", "remarks", "seconds"}
    assert body["unknowns"] == 85
    for kind in KINDS:
        assert {ours.NUMPY, FLOOR} <= set(body["seconds"][kind])
        assert all(t > 0 for timings in body["seconds"][kind].values() for t in timings)
    fit = read(written, "fits")["found"][TINY]
    assert set(fit["seconds"]) == set(fit["evaluations"])
    assert f"{ours.NUMPY}: {fits.LM}" in fit["seconds"]
    found = read(written, "overhead")["found"]
    pairs = overhead.pairs(found["seconds"])
    for solver, ways in overhead.BY_HAND.items():
        assert {how for label, how in pairs if solver in label} == set(ways)
    assert len({label for label, _ in pairs}) + len(pairs) == len(found["seconds"])
    found = read(written, "scaling")["found"]
    assert found["sizes"] == [int(TINY)]
    memory = found["bytes"][ours.NUMPY][TINY]
    assert 0 < memory["before"] <= memory["body"] <= memory["forward"] <= memory["peak"]


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


def test_promises_are_judged() -> None:
    judged = {target.name: target for target in targets.all_of(made_up_results())}
    assert judged[f"{ours.NUMPY}: JAX / Jacobian"].holds
    assert not judged[f"{ours.NUMPY}: torch / Jacobian"].holds
    assert judged[f"{ours.NUMPY}: LM / its own parts"].holds
    assert not judged[f"{ours.NUMPY}: {fits.SCIPY_LM} / LM"].holds
    step = judged[f"{ours.NUMPY}: step per vertex, 100,000 / 6,890"]
    np.testing.assert_allclose(step.measured, 1.0 / 100_000 / (2e-3 / 6890))
    assert not step.holds
    assert not judged["A / by hand"].holds
    assert judged["A / by hand, deciding"].holds
    assert judged["B / by hand"].holds
    assert "B / by hand, deciding" not in judged


def test_figure_is_drawn_from_the_numbers(tmp_path: Path) -> None:
    caption = figure.draw(made_up_results(), tmp_path / "figure.svg")
    assert (tmp_path / "figure.svg").read_text().startswith("<?xml")
    assert "1 of 2 cores of P" in caption


def test_a_candidate_is_three_functions() -> None:
    case = case_of(TINY, random_body(40))
    one: Candidate = ours.candidate("one", case)
    (x,) = case.people(1)
    r, J = one.jacobian(x)
    np.testing.assert_allclose(r, one.forward(x))
    np.testing.assert_allclose(one.step(x), -np.linalg.lstsq(J, r, rcond=None)[0], rtol=1e-8)


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


def test_videos_by_blocks_agree_with_arrays() -> None:
    made = sequences.film(2)
    with sequences._by_blocks():
        blocks = sequences.film(2).video
        assert blocks.sparse
    with sequences._as_an_array():
        assert not sequences.film(2).video.sparse
    x, fixed = made.split
    np.testing.assert_allclose(
        blocks.linearize_at(x, fixed).dense, made.video.linearize_at(x, fixed).dense, atol=1e-9
    )
    assert len(made.apart) == 2
    r = np.concatenate([made.frame.residual(*one) for one in made.apart])
    size = made.frame.rows["camera 1"].stop
    rows = made.video.rows["camera 1"]
    np.testing.assert_allclose(made.video.residual(x, fixed)[rows][:size], r[:size], atol=1e-9)


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


def test_costs_of_fingers_are_judged() -> None:
    timings = {fingers.PLAIN: [0.02, 0.01], fingers.HANDS: [0.03, 0.021]}
    found = {
        "sizes": {
            fingers.PLAIN: {"vertices": 12272, "unknowns": 85},
            fingers.HANDS: {"vertices": 10490, "unknowns": 169},
        },
        "seconds": {f"workbench: {fingers.JACOBIAN}": timings, fingers.FRAME: timings},
    }
    assert "| frame | 10 / 15 | 21 / 25.5 | 2.1 |" in table.fingers(found)
    judged = targets.all_of({"fingers": {"found": found}})
    assert [(target.limit, target.holds) for target in judged] == [(2.2, True), (2.5, True)]
    assert table.fingers({}) == ""


@NEEDS_A_COMPILER
def test_floors_are_measured_and_judged() -> None:
    found = floors.measure(["default"], rounds=1, with_peers=False)
    one = found["default"]
    assert set(one["seconds"]["step"]) == {ours.COMPILED, OWN, FLOOR}
    assert set(one["seconds"]["jacobian"]) == {ours.COMPILED, OWN, FLOOR, ARITHMETIC}
    assert one["written"] == 8 * 3 * 1229 * 85
    assert 1e6 < one["stored"] < 8 * 1229 * 3 * 207  # posedirs that are zero are not stored
    assert "MB stored, 2.51 MB of Jacobian" in table.floors(found)
    times = {ours.COMPILED: [2e-3], OWN: [1e-3], FLOOR: [1.6e-3], peers.JAX: [4e-3]}
    made_up = {"default": {**one, "seconds": dict.fromkeys(KINDS, times)}}
    judged = targets.all_of({"floors-busy": {"found": made_up}})
    assert [target.measured for target in judged] == pytest.approx([0.5, 2.0, 1.25])
    assert [target.holds for target in judged] == [True, False, True]
    assert floors.measure([TINY], rounds=1) == {}


def test_products_of_a_body_are_counted() -> None:
    """Joint 1 carries a group of four vertices, so that joint 0 turns it, too; joint 2 bends it."""
    sizes = {"n_vertices": 4, "n_joints": 3, "n_betas": 2}
    body = bodies_made_up.random_body(**sizes, parents=(-1, 0, 0))
    posedirs = body.posedirs * (np.arange(18) >= 9)
    body = replace(body, weights=np.eye(3)[[1, 1, 1, 1]], posedirs=posedirs)
    points, by_betas = 6 + 9 + 12, 2 * (9 + 3)
    by_pose = 12 + 2 * (3 + 18) + 27
    for packing, slopes in ((PLAIN, 9 * (3 + 9)), (PLAIN._replace(by_halves=True), 9 * 3 + 60)):
        packed = PackedVertices.of(body, body.parents, slice(None), 4, packing)
        expected = 4 * (points + 27), 4 * (points + slopes + by_pose + by_betas)
        assert products(packed) == expected


def test_measurements_are_remembered_once(tmp_path: Path) -> None:
    data = json.loads((RESULTS / "fingers.json").read_text())
    for _ in range(2):
        history.remember(tmp_path, "fingers", data)
    (one,) = history.read(tmp_path)
    promised = {one.name: one.measured for one in targets.all_of({"fingers": data})}
    assert one["ratios"] == pytest.approx(promised, rel=1e-3)
    history.remember(tmp_path, "fits", {**data, "found": {}})  # promises nothing
    assert history.read(tmp_path) == [one]


def test_rigid_registrations_are_measured_without_peers(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "open3d", None)  # an import of it fails
    monkeypatch.setattr(rigid, "POINTS", 300)
    found = rigid.measure(1)
    assert all(len(row["mm"]) == 1 for row in found.values())
    assert found["ours, distance, then Geman-McClure, the mesh"]["mm"][0] < 5


def peak(frames: int) -> int:
    """Bytes of arrays at the worst in a solve of a few iterations."""
    made = sequences.film(frames)
    made.video.prepare()
    tracemalloc.start()
    try:
        LevenbergMarquardt(max_iterations=5).solve(made.video, made.values)
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def test_solves_of_videos_take_less_than_half_a_megabyte_a_frame() -> None:
    """CasADi takes less than a tenth of a megabyte more."""
    few, many = 40, 80
    assert (peak(many) - peak(few)) / (many - few) < 0.45e6
