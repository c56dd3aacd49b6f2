"""Replays show what Python found: the numbers in the page, and the bodies in a real browser."""

import base64
import gzip
import json
import re
from functools import cache
from typing import Any

import numpy as np
import pytest

from tests.browsers import asked_of_replay
from workbench.arrays import Array
from workbench.blocks import Values
from workbench.experiments import find, run
from workbench.experiments.running import Outcome
from workbench.plots.palette import solver_styles
from workbench.reports.replay import Recording, recorded_run
from workbench.reports.replay.recording import DTYPES, packed
from workbench.reports.replay.runs import kept_iterates
from workbench.reports.run import run_page

pytestmark = pytest.mark.xdist_group("replays of a run")  # which is solved once

LARGEST = 750_000  # bytes that a replay adds to the page of a run

ASKED = """
  const [run] = replay.runs;
  answers.vertices = run.iterates.map((_, i) => [...replay.iterate(run, i).points]);
  const places = replay.places(replay.iterate(run, run.iterates.length - 1));
  answers.pixels = replay.lenses.map(lens => replay.landmarks.names.map(
    (_, m) => lens.pixel([...places.subarray(3 * m, 3 * m + 3)])));
  answers.onRays = replay.lenses.map(lens => lens.rays.map((ray, m) =>
    lens.pixel(lens.eye.map((x, d) => x + 3 * ray[d])).map((u, d) => u - lens.observed[m][d])));
  press("cam02");
  answers.camera = replay.sentence.textContent;
  press("directions");
  replay.take(1);
  answers.direction = replay.sentence.textContent;
  answers.colour = run.colour;
  press("Laplace's draws");
  replay.take(0);
  answers.draw = replay.sentence.textContent;
  answers.moved = [...replay.surface(replay.moved()).points];
"""


@cache
def outcome() -> Outcome:
    return run(find("balance", {}), compare=False)


@cache
def recording() -> Recording:
    found = recorded_run(outcome())
    assert found is not None
    return found


def numbers(given: dict[str, str]) -> Array:
    """What `packed` packed."""
    text = gzip.decompress(base64.b64decode(given["gzip"]))
    return np.frombuffer(text, DTYPES[given["kind"]]).astype(float)


def vertices(values: Values) -> Array:
    body = outcome().setup.body
    assert body is not None
    return body.vertices(*({**outcome().values, **values}[block.name] for block in body.blocks()))


@pytest.mark.parametrize("kind", DTYPES)
def test_packed_arrays_come_back(kind: str) -> None:
    array = np.arange(24).reshape(2, 3, 4)
    np.testing.assert_array_equal(numbers(packed(array, kind)), array.ravel())


@pytest.mark.parametrize("count", [1, 5, 64, 65, 1000])
def test_kept_iterates_include_first_and_last(count: int) -> None:
    at = kept_iterates(count)
    assert len(at) <= 64
    assert (at[0], at[-1]) == (0, count - 1)
    assert (np.diff(at) > 0).all()


@pytest.mark.browser
def test_recorded_run_has_the_iterates_of_the_solver() -> None:
    (track,) = recording().data["runs"]
    trace = outcome().solution.trace
    assert track["iterates"] == list(range(len(trace)))
    np.testing.assert_allclose(track["cost"], [one.cost for one in trace], rtol=1e-11)
    x = numbers(track["x"]).reshape(len(trace), -1)
    for one, row in zip(trace, x, strict=True):
        wanted = np.concatenate([np.ravel(one.values[name]) for name in ("pose", "betas", "trans")])
        np.testing.assert_allclose(row, wanted, rtol=1e-6, atol=1e-7)
    assert track["evaluations"] == sorted(track["evaluations"])
    assert track["condition"][-1] == pytest.approx(outcome().diagnosis.condition, rel=1e-5)


@pytest.mark.browser
def test_unseen_directions_change_no_data() -> None:
    d = outcome().data_alone
    assert d is not None
    directions = recording().data["directions"]
    unseen = [one for one in directions if one["kind"].startswith("not seen")]
    assert len(unseen) >= 10
    for one in unseen:
        step = numbers(one["step"])  # of pose, betas and trans, which are what is free
        assert np.linalg.norm(d.here.along(step)) < 1e-6  # sigma a unit
    for one in directions:
        assert one["exact"][10] == pytest.approx(0, abs=1e-9)
        first_order = one["change"] * one["reach"] / 10  # a tenth of the way
        second_order = max(one["exact"]) / 100
        assert one["exact"][11] < 1.2 * first_order + 3 * second_order + 1e-3


@pytest.mark.browser
def test_recorded_draws_have_the_covariance_of_the_solution() -> None:
    d = outcome().diagnosis
    assert recording().data["draws"]["name"] == "Laplace's draws"  # and none of a sampler's
    draws = numbers(recording().data["draws"]["x"]).reshape(40, -1)
    x = d.free.pack(d.values)
    whitened = (draws - x) @ np.linalg.inv(np.linalg.cholesky(d.here.covariance)).T
    assert np.mean(whitened**2) == pytest.approx(1, abs=4 * np.sqrt(2 / whitened.size))


@pytest.mark.browser
@pytest.mark.thorough
def test_replay_is_small_and_fetches_nothing() -> None:
    text = run_page(outcome(), {})
    found = recording()
    assert len(json.dumps([found.body, found.data])) < LARGEST
    assert not re.findall(r"""(?:src|href)=["']https?:|@import|fetch\(|import\(""", text)


def test_run_without_a_body_has_no_replay() -> None:
    assert recorded_run(run(find("nist-chwirut2", {}), compare=False)) is None


@pytest.fixture(scope="module")
def answers(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """What the replay on the page of a run says when it is asked in the browser."""
    return asked_of_replay(run_page(outcome(), {}), ASKED, tmp_path_factory.mktemp("page"))


@pytest.mark.thorough
def test_bodies_in_the_browser_are_those_of_python(answers: Any) -> None:
    for one, points in zip(outcome().solution.trace, answers["vertices"], strict=True):
        off = np.array(points).reshape(-1, 3) - vertices(one.values)
        assert np.linalg.norm(off, axis=1).max() < 1e-6  # m


@pytest.mark.thorough
def test_cameras_in_the_browser_are_those_of_python(answers: Any) -> None:
    for pixels, overlay in zip(answers["pixels"], outcome().overlays, strict=True):
        np.testing.assert_allclose(pixels, overlay.projected, atol=0.01)  # px
    assert np.abs(np.array(answers["onRays"], dtype=float)).max() < 1e-6  # px


@pytest.mark.thorough
def test_replay_says_what_it_shows(answers: Any) -> None:
    (measure,) = (m for m in outcome().measures if m.name == "reprojection, cam02")
    assert f"{measure.value:.1f} px off on average" in answers["camera"]
    first = recording().data["directions"][0]
    assert answers["direction"].startswith(f"Along “{first['name']}”, which is not seen")
    assert answers["colour"] == solver_styles(["trust-region"])["trust-region"].color
    assert answers["draw"].startswith("Draw 1 of 40 from the Gaussian about the solution")
    draw = numbers(recording().data["draws"]["x"]).reshape(40, -1)[0]
    pose, betas, trans = np.split(draw, [72, 82])
    off = np.array(answers["moved"]).reshape(-1, 3) - vertices(
        {"pose": pose.reshape(24, 3), "betas": betas, "trans": trans}
    )
    assert np.linalg.norm(off, axis=1).max() < 1e-6
