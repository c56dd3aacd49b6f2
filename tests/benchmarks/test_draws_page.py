"""The section on draws is what its numbers say."""

import json
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from benchmarks.images import draws
from benchmarks.images.draws_tables import (
    BEGIN,
    END,
    KINDS,
    RESULTS,
    bias,
    compared,
    judged,
    of_kind,
    outside,
    shapes,
    tables,
)
from benchmarks.images.intervals import WHAT, places_of, share
from benchmarks.images.limbs import NAMES
from benchmarks.images.one_camera import PAGE
from benchmarks.images.one_camera import RESULTS as FITTED
from benchmarks.images.one_posterior import LEAPFROGS, NUMBERS, STEPS, compiled_places
from tests.benchmarks.prose import Prose, unheld
from workbench import load_body
from workbench.bodies import SkinnedBody
from workbench.compiling import NoLibrary
from workbench.fitting.depth_interval import OFFSET, Z90
from workbench.sampling.mixing import TIMES

FOUND = json.loads(RESULTS.read_text())
TEXT = Prose(PAGE, "Draws of the same posteriors")


def test_the_tables_are_written_from_the_numbers() -> None:
    text = PAGE.read_text().partition(BEGIN)[2].partition(END)[0]
    assert text.strip() == tables(FOUND).strip()


@pytest.mark.parametrize("kind", ["unknown", "known"])
def test_what_is_said_of_balance_holds(kind: str) -> None:
    runs = of_kind(FOUND, kind)
    laplace, drawn = (judged(runs, way) for way in ("Laplace", "draws"))
    model = drawn["along"]["factor"]
    approximation = laplace["along"]["factor"] / model
    assert approximation > 1.1
    assert model == pytest.approx(approximation, rel=0.06)  # about as much
    assert drawn["across"]["factor"] < laplace["across"]["factor"]
    found = shapes(runs)
    assert max(abs(found[name]["sd"] - 1) for name in WHAT[:2]) < 0.06
    assert abs(found["along"]["sd"] - 1) < 0.1
    assert found["along"]["widest"] >= 1.7
    assert "in the median and 1.7 or more times as large in one of twenty" in TEXT
    assert "agree with Laplace's to 6 % in the median" in TEXT
    off = bias(runs)
    part = {"unknown": 1 / 3, "known": 2 / 5}[kind]
    assert 1 - off["draws"] / off["fit"] == pytest.approx(part, abs=0.02)
    wide = judged(runs, "draws with offsets")
    assert share(wide["along"]) == "94 %"
    assert f"With the {1e3 * OFFSET:g} mm of offsets that were chosen" in TEXT
    assert "along the axis in 94 %, where Laplace's hold 89 % and 88 %" in TEXT
    assert wide["depth"]["factor"] < 0.9
    depth = drawn["depth"]
    if kind == "unknown":
        assert f"hold depth in all {depth['of']} posteriors" in TEXT
        assert depth["within"] == depth["of"]
    else:
        assert f"instead of Laplace's {laplace['depth']['within']}." in TEXT
        held = f"in {depth['within']} of {depth['of']} instead of Laplace's"
        assert f"{held} {laplace['depth']['within']}" in TEXT
    with_offsets = judged(runs, "Laplace with offsets")["along"]
    assert share(with_offsets) == {"unknown": "89 %", "known": "88 %"}[kind]


def test_what_is_said_of_synthetic_people_and_times_holds() -> None:
    runs = of_kind(FOUND, "people")
    laplace, drawn = (judged(runs, way)["along"] for way in ("Laplace", "draws"))
    assert abs(drawn["factor"] - 1) < 0.1
    assert laplace["factor"] > 1.1 * drawn["factor"]
    assert drawn["within"] / drawn["of"] > 0.88
    everywhere = [of_kind(FOUND, kind) for kind in KINDS]
    assert "because draws take 10 to 20 CPU seconds and a fit takes 50 ms" in TEXT
    usual = json.loads(FITTED.read_text())["balance"]["regressed start"]["ms"]
    assert np.median(usual) == pytest.approx(50, abs=5)
    assert all(9 < np.median([r["seconds"] for r in some.values()]) < 21 for some in everywhere)
    front = [run["draws"]["ends"][0][0] for some in everywhere for run in some.values()]
    assert min(front) > 0
    assert (LEAPFROGS.ensembles * LEAPFROGS.walkers, LEAPFROGS.steps) == (32, 30_000)
    assert "with 32 chains in four groups" in TEXT
    assert f"or for {LEAPFROGS.steps:,} leapfrog steps of each chain" in TEXT
    assert f"until the draws of {NUMBERS} numbers (depth, stature, and of {len(NAMES)} ends" in TEXT
    assert 2 + 3 * len(NAMES) == NUMBERS
    assert f"{TIMES:g} times as long as their autocorrelation times" in TEXT
    body = load_body("default")
    assert f"All {sum(block.size for block in body.blocks())} unknowns are drawn" in TEXT


def test_what_is_said_of_emcee_holds() -> None:
    pairs = dict(compared(FOUND))
    assert len(pairs) == 4
    assert "Four of the posteriors were drawn by emcee as well" in TEXT
    assert {name.partition(",")[0] for name in pairs} == {"unknown", "known"}
    emcee, other = ([pair[way] for pair in pairs.values()] for way in ("emcee", "hamiltonian"))

    def ends(of: str, apart: bool = False) -> str:
        each = [one[of] / (two[of] if apart else 1) for one, two in zip(emcee, other, strict=True)]
        return f"{min(each):,.0f} to {max(each):,.0f}"

    assert f"needs {ends('evaluations', apart=True)} times as many evaluations" in TEXT
    assert f"and {ends('seconds', apart=True)} times the CPU time" in TEXT
    assert f"After {STEPS:,} steps of each walker, its draws are {ends('times')} times" in TEXT
    assert f"of the 85 unknowns ({ends('autocorrelation')} steps)" in TEXT
    (evaluations,) = {one["evaluations"] for one in emcee}
    assert f"{evaluations / 1e6:.0f} million were not enough" in TEXT
    assert "by four ensembles of 192 walkers" in TEXT
    assert evaluations % (4 * 192) == 0
    assert all(one["usable"] for one in (*emcee, *other))
    assert max(one["times"] for one in emcee) < TIMES
    worst = min(pairs.values(), key=lambda pair: float(pair["within 2"]))
    assert [pair["within 2"] > 0.9 * pair["of"] for pair in pairs.values()].count(False) == 1
    assert f"The {worst['of']} numbers that are compared in each posterior" in TEXT
    assert f"in which only {worst['within 2']} of them agree, most standard" in TEXT
    sds = [np.array(worst[way]["draws"]["sd"]) for way in ("emcee", "hamiltonian")]
    assert np.mean(sds[1] < sds[0]) > 0.8
    assert f"are smaller than emcee's, by up to {100 * (worst['ratio'][1] - 1):.0f} %." in TEXT


def test_how_many_were_looked_at_first() -> None:
    looked = 54
    drawn = sum(len(of_kind(FOUND, kind)) for kind in KINDS)
    assert f"the first {looked} posteriors were looked at before the other {drawn - looked}" in TEXT


def test_no_number_of_its_prose_is_held_by_nothing() -> None:
    tests = (
        partial(test_what_is_said_of_balance_holds, "unknown"),
        partial(test_what_is_said_of_balance_holds, "known"),
        test_what_is_said_of_synthetic_people_and_times_holds,
        test_what_is_said_of_emcee_holds,
        test_how_many_were_looked_at_first,
    )
    given = (
        "The 95 % intervals of the factors are from a bootstrap",
        "An interval of draws is that from their 5 % to their 95 % quantile",
    )
    once = ("Draws of 50 such times had been estimated to need 51 million evaluations",)
    assert not unheld(TEXT, tests, given, once)


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
