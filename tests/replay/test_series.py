"""Registrations, frames, motions, comparisons, stages and hypotheses, as replays show them."""

import base64
import gzip
import html
import json
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import workbench as wb
from tests.browsers import asked_of_replay
from tests.registration.clouds import cloud, person
from workbench.arrays import Array
from workbench.errors import BadArgument, NotSupported
from workbench.experiments import find
from workbench.fitting.setup import Setup
from workbench.registration import FitStage, Recipe, Registration, register
from workbench.reports.replay import (
    Recording,
    recorded_frames,
    recorded_motion,
    recorded_registration,
    recorded_solution,
)
from workbench.reports.replay.recording import DTYPES
from workbench.reports.replays import motion_page, replay_page

BODY = wb.load_body("small")
STAGES = FitStage(200, 0.02, 0.1, 3, 10), FitStage(300, 0.02, 0.1, 2, 10)
VERTICES = "answers.vertices = one.labels.map((_, i) => [...one.surface(i).points]);"


def numbers(given: dict[str, str]) -> Array:
    """What `packed` packed."""
    text = gzip.decompress(base64.b64decode(given["gzip"]))
    return np.frombuffer(text, DTYPES[given["kind"]]).astype(float)


def series(recording: Recording | None, k: int = 0) -> dict[str, Any]:
    assert recording is not None
    found: dict[str, Any] = recording.data["series"][k]
    return found


@cache
def registration() -> Registration:
    return register(BODY, cloud(BODY, person(BODY, 0.0)), recipe=Recipe(STAGES))


@cache
def markers() -> Setup:
    return find("markers", {"body": "small", "frames": 4}).setup()


@cache
def landmarks() -> Setup:
    return find("landmarks", {"body": "small"}).setup()


def moving() -> wb.Motion:
    pose = np.zeros((7, BODY.n_joints, 3))
    pose[:, 18, 1] = np.linspace(0, -2, 7)
    trans = np.linspace([0, 0, 0], [0, 0, 2.0], 7)
    return wb.Motion(pose, trans, 30.0, BODY.joint_names, 0.5 * np.ones(3))


@pytest.mark.thorough
def test_recorded_scan_has_its_distances() -> None:
    found, shown = registration(), series(recorded_registration(registration()))
    far = numbers(shown["far"]).reshape(5, -1)[-1]
    M = found.scan.n_points
    assert far.shape == (M,)
    wanted = np.abs(found.distances)
    near = np.isfinite(wanted)
    np.testing.assert_allclose(far[near], 1e5 * wanted[near], atol=0.51)
    np.testing.assert_array_equal(far == 65_535, ~near)
    share = 100 * np.mean(wanted < found.reach)
    assert f"{share:.0f} % of the {M:,} points shown are in contact" in shown["said"][-1]
    places, points = (numbers(one).reshape(5, -1, 3)[-1] for one in shown["links"])
    there = np.isfinite(places[:, 0])
    ends = np.linalg.norm(places - points, axis=1)[there]
    assert np.isin(np.round(1e5 * ends[:20]), [far.round() + d for d in (-1, 0, 1)]).all()


def test_recorded_frames_have_poses() -> None:
    setup = markers()
    shown = series(recorded_frames(setup, setup.start))
    x = numbers(shown["x"]).reshape(4, -1)
    pose, trans = setup.start["pose"], setup.start["trans"]
    np.testing.assert_allclose(x[:, :72], pose.reshape(4, -1), atol=1e-6)
    np.testing.assert_allclose(x[:, -3:], trans, atol=1e-6)


def test_recorded_solution_has_stages_and_hypotheses() -> None:
    setup = landmarks()
    solver = wb.Staged((("trans", "pose"),), wb.TrustRegion(max_iterations=20))
    found = wb.solve(setup.problem, setup.start, solver)
    shown = series(recorded_solution(found, setup.problem, setup.start, BODY))
    assert shown["labels"] == ["start", "stage 1", "stage 2"]
    x = numbers(shown["x"]).reshape(3, -1)
    np.testing.assert_allclose(x[-1, :72], found.values["pose"].ravel(), atol=1e-6)
    turned = {"pose": np.zeros((24, 3)) + [[0, 2.5, 0]] * (np.arange(24) == 0)[:, None]}
    starts = wb.Starts(({}, turned), wb.TrustRegion(max_iterations=20))
    found = wb.solve(setup.problem, setup.start, starts)
    assert len(found.hypotheses) == 2
    shown = series(recorded_solution(found, setup.problem, setup.start, BODY))
    assert [text[:2] for text in shown["labels"]] == ["1:", "2:"]
    assert f"at cost {found.hypotheses[1].cost:.4g}; 1 of the starts" in shown["said"][1]


def test_recorded_motion_is_a_page_and_a_notebook_frame() -> None:
    motion = moving()
    shown = series(recorded_motion(motion, BODY))
    assert shown["fps"] == 30
    x = numbers(shown["x"]).reshape(7, -1)
    np.testing.assert_allclose(x[:, 72:75], 0.5)
    np.testing.assert_allclose(x[:, 75:82], 0)
    page = wb.show(motion, body=BODY)
    framed = page._repr_html_()
    assert framed.startswith("<iframe srcdoc=")
    assert 'sandbox="allow-scripts"' in framed
    assert html.unescape(framed.split('srcdoc="')[1].split('"')[0]) == page.html
    assert len(framed) < 750_000
    assert "7 frames at 30 frames a second" in motion_page(motion, BODY, "turn").html
    long = wb.Motion(np.zeros((900, 24, 3)), np.zeros((900, 3)), 60.0, BODY.joint_names)
    shown = series(recorded_motion(long, BODY))
    assert len(shown["labels"]) == 400
    assert shown["labels"][-1] == "900"


def test_show_refuses_what_it_cannot_show() -> None:
    with pytest.raises(BadArgument, match="what can be shown is"):
        wb.show(3)
    setup = landmarks()
    found = wb.solve(setup.problem, setup.start, wb.GaussNewton(max_iterations=2))
    with pytest.raises(BadArgument, match="does not know its body; give body="):
        wb.show(found)
    with pytest.raises(BadArgument, match="does not know its problem"):
        wb.show(found, body=BODY)
    with pytest.raises(NotSupported, match="nothing moves on a page of this Motion"):
        wb.show(moving(), body=wb.load_body("small-scape"))


@pytest.mark.thorough
def test_surfaces_of_a_registration_in_the_browser_are_those_of_python(tmp_path: Path) -> None:
    recording = recorded_registration(registration())
    assert recording is not None
    asked = f"const [one] = replay.series; {VERTICES} press('start'); answers.said = replay.said();"
    answers = asked_of_replay(replay_page(recording).html, asked, tmp_path)
    found = registration().surfaces
    for points, wanted in zip(answers["vertices"], found.values(), strict=True):
        off = np.array(points).reshape(-1, 3) - wanted
        assert np.linalg.norm(off, axis=1).max() < 1e-6  # m
    assert answers["said"] == recording.data["series"][0]["said"][0]


@pytest.mark.thorough
def test_frames_in_the_browser_are_those_of_python(tmp_path: Path) -> None:
    setup = markers()
    recording = recorded_frames(setup, setup.start)
    assert recording is not None
    asked = f"const [one] = replay.series; {VERTICES} replay.take(1); answers.said = replay.said();"
    answers = asked_of_replay(replay_page(recording).html, asked, tmp_path)
    values = [setup.start[name] for name in ("pose", "betas", "trans")]
    for t, points in enumerate(answers["vertices"]):
        wanted = BODY.vertices(values[0][t], values[1], values[2][t])
        assert np.linalg.norm(np.array(points).reshape(-1, 3) - wanted, axis=1).max() < 1e-6
    assert answers["said"].startswith("Frame 4 of 4.")
    assert "http" not in json.dumps(recording.data)
