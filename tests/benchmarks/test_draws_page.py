"""The section on draws is what its numbers say."""

import json
from pathlib import Path

import numpy as np
import pytest

from benchmarks.images import draws
from benchmarks.images.draws_tables import (
    BEGIN,
    END,
    RESULTS,
    judged,
    outside,
    tables,
)
from benchmarks.images.intervals import places_of
from benchmarks.images.one_camera import PAGE
from benchmarks.images.one_posterior import NUMBERS, compiled_places
from workbench import SkinnedBody, load_body
from workbench.compiling import NoLibrary
from workbench.fitting.depth_interval import Z90

FOUND = json.loads(RESULTS.read_text())
TEXT = " ".join(PAGE.read_text().split())


def test_the_tables_are_written_from_the_numbers() -> None:
    text = PAGE.read_text().partition(BEGIN)[2].partition(END)[0]
    assert text.strip() == tables(FOUND).strip()


def test_intervals_of_draws_are_measured_from_the_median_on_each_side() -> None:
    """Ends at -1 and 3 around 0: a truth of 1.5 is half way out, and one of -2 is twice too far."""
    true = np.zeros(NUMBERS)
    true[:2] = 1.5, -2.0
    ends = np.repeat([[-1.0], [0.0], [3.0]], NUMBERS, axis=1)
    laplace = {"fit": np.ones(NUMBERS), "sd": np.full(NUMBERS, 0.5), "lever": np.ones(NUMBERS)}
    run = {
        "laplace": {name: one.tolist() for name, one in (laplace | {"true": true}).items()},
        "draws": {"ends": ends.tolist(), "ends with offsets": (2 * ends).tolist()},
    }
    runs = {"one": run}
    assert outside(runs, "draws")[0, :3] == pytest.approx([0.5, 2.0, 0.0])
    assert outside(runs, "draws with offsets")[0, :2] == pytest.approx([0.25, 1.0])
    assert outside(runs, "Laplace")[0, :2] == pytest.approx([0.5 / (0.5 * Z90), 3 / (0.5 * Z90)])
    assert outside(runs, "Laplace with offsets")[0, 0] < 1 / Z90
    told = judged(runs, "draws")
    assert (told["depth"]["within"], told["stature"]["within"], told["along"]["of"]) == (1, 0, 12)


def test_compiled_places_are_those_of_the_body() -> None:
    body = load_body("default")
    assert isinstance(body, SkinnedBody)
    rng = np.random.default_rng(0)
    given = (0.3 * rng.normal(size=(3, *block.shape)) for block in body.blocks())
    pose, betas, trans = given
    try:
        places = compiled_places(body)
    except NoLibrary:
        pytest.skip("there is no compiler")
    right = places_of(body, pose, betas, trans)
    np.testing.assert_allclose(places(pose, betas, trans), right, atol=1e-12)


def test_an_interrupted_run_continues(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[int] = []

    def drawn(fits: object, kind: str, method: str, case: object, seed: int, saved: Path) -> object:
        seen.append(seed)
        if len(seen) == 2:
            raise KeyboardInterrupt
        assert (saved.parent, saved.suffix) == (tmp_path, ".h5")
        return {"seconds": 1.0, "times": 50.0, "seed": seed}

    monkeypatch.setattr(draws, "drawn", drawn)
    monkeypatch.setattr(draws, "compiled_places", lambda body: None)
    plan = (draws.Posteriors("people", "hamiltonian", (3, 4)),)
    with pytest.raises(KeyboardInterrupt):
        list(draws.draw(tmp_path, plan))
    told = list(draws.draw(tmp_path, plan))
    assert told == [f"people, {seed}, one, hamiltonian: 1 s, 50 times" for seed in (3, 4)]
    assert seen == [3, 4, 4]
    kept = [json.loads(line) for line in (tmp_path / "posteriors.jsonl").read_text().splitlines()]
    assert [one["run"]["seed"] for one in kept] == [3, 4]
