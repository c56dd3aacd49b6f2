"""The page of fits to one image is what its numbers say."""

import json
import math

import numpy as np
import pytest

from benchmarks.images import choices
from benchmarks.images.one_camera import BEGIN, END, FAILED, PAGE, RESULTS, tables

FOUND = json.loads(RESULTS.read_text())


def test_the_tables_are_written_from_the_numbers() -> None:
    text = PAGE.read_text().partition(BEGIN)[2].partition(END)[0]
    assert text.strip() == tables(FOUND).strip()


@pytest.mark.parametrize("scene", ["balance", "people", "outliers"])
def test_every_fit_was_given_the_same_images(scene: str) -> None:
    assert len({len(each["MPJPE"]) for each in FOUND[scene].values()}) == 1


def test_what_is_said_of_the_new_fit_holds() -> None:
    """In CHANGELOG and README: failures of synthetic people, before and now."""

    def failures(scene: str, name: str) -> float:
        return float(np.mean(np.array(FOUND[scene][name]["MPJPE"]) > FAILED))

    assert failures("people", "regressed start") == pytest.approx(0.005)
    assert failures("people", "as before") == pytest.approx(0.275)
    now, best = (
        np.mean(FOUND["people"][name]["MPJPE"]) for name in ("regressed start", "from the truth")
    )
    assert now < 1.1 * best
    assert np.mean(FOUND["outliers"]["regressed start"]["MPJPE"]) < 120
    assert all(math.isfinite(v) for v in FOUND["balance"]["regressed start"]["MPJPE"])


def test_what_is_said_of_the_heavy_tails_holds() -> None:
    """Student's t and the Gaussian, both with outliers from 3.5 % on; in CHANGELOG, too."""
    text = " ".join(PAGE.read_text().split())

    def of(scene: str, what: str) -> tuple[str, str]:
        t, gaussian = (
            np.mean(FOUND[scene][f"regressed start, {name}"][what])
            for name in ("Student's t of poses", "outliers from 3.5 % on")
        )
        return f"{t:.1f}", f"{gaussian:.1f}"

    (t, g), (pa_t, pa_g) = of("balance", "MPJPE"), of("balance", "PA")
    assert f"the t has {t} mm and a PA of {pa_t} mm on `balance`" in text
    assert f"where the Gaussian has {g} and {pa_g} mm" in text
    (t, g), (pa_t, pa_g) = of("people", "MPJPE"), of("people", "PA")
    assert f"{t} and {pa_t} mm where it has {g} and {pa_g} mm on synthetic people" in text
    t, g = of("outliers", "MPJPE")
    assert f"{t} mm where it has {g} mm with four gross outliers" in text
    usual = FOUND["balance"]["regressed start"]
    assert np.mean(usual["MPJPE"]) < 88
    both = f"{np.mean(usual['MPJPE']):.1f} and {np.mean(usual['PA']):.1f} mm"
    assert f"The likeliest body, which the fit reports, has {both}" in text


def test_what_is_said_of_the_mean_of_the_posterior_holds() -> None:
    """And of a choice among minima, in CHANGELOG, too."""
    text = " ".join(PAGE.read_text().split())
    usual, mean = "regressed start", "regressed start, mean of the posterior"

    def of(scene: str, what: str) -> tuple[str, str]:
        new, old = (f"{np.mean(FOUND[scene][name][what]):.1f}" for name in (mean, usual))
        assert float(new) < float(old)
        return new, old

    (m, u), (pa_m, pa_u) = of("balance", "MPJPE"), of("balance", "PA")
    told = f"{m} mm and a PA of {pa_m} mm where the likeliest body has {u} and {pa_u} mm"
    assert told in text
    changed = " ".join((PAGE.parents[1] / "CHANGELOG.md").read_text().split())
    assert f"{m} mm instead of {u} on `balance`" in changed
    assert float(m) < 88
    assert float(pa_m) < 60
    (m, u), (pa_m, pa_u) = of("people", "MPJPE"), of("people", "PA")
    assert f"{m} and {pa_m} mm where it has {u} and {pa_u} mm on synthetic people" in text
    (m, u), (pa_m, pa_u) = of("outliers", "MPJPE"), of("outliers", "PA")
    assert f"{m} and {pa_m} mm where it has {u} and {pa_u} mm with four gross outliers" in text
    m, u = of("balance", "absolute")
    assert f"In space, `balance` has {m} mm where it has {u} mm" in text
    pa = np.array(FOUND["balance"][usual]["PA"])
    low, high = (f(pa.reshape(-1, 4).mean(axis=0)) for f in (np.min, np.max))
    assert f"PA is {low:.0f} to {high:.0f} mm in the four cameras" in text
    worst = pa.mean() - np.sort(pa)[:-5].mean()
    assert f"{np.median(pa):.1f} mm in the median of the 100 fits; the five worst" in text
    assert f"raise the mean by {worst:.1f} mm" in text


def test_what_is_said_of_a_choice_among_minima_holds() -> None:
    found, page = json.loads(choices.RESULTS.read_text()), PAGE.read_text()
    begin, end = choices.MARKS
    assert page.partition(begin)[2].partition(end)[0].strip() == choices.table(found)
    text = " ".join(page.split())

    def of(scene: str, name: str) -> str:
        return f"{np.mean(found[scene][name]['MPJPE']):.1f}"

    balance, people = found["balance"], found["people"]
    for key in ("minima", "near the lowest"):
        assert f"{np.mean(balance[key]):.1f}" in text
        assert f"{np.mean(people[key]):.1f}" in text
    assert f"{len(balance['minima'])} images of `balance`" in text
    assert f"{len(people['minima'])} people other than those above" in text
    first, minima, laplace = "the first start's", "mean of the minima", "mean of Laplace's draws"
    for scene in ("balance", "people"):
        for name in ("the lowest", "of most evidence", "nearest to all"):
            assert float(of(scene, name)) >= float(of(scene, first))
        assert float(of(scene, laplace)) > float(of(scene, first))
        assert float(of(scene, "mean of the posterior")) < 0.95 * float(of(scene, first))
    assert f"has {of('people', minima)} mm on synthetic people where the first start's has" in text
    assert f"{of('people', first)} mm, and {of('balance', minima)} mm on `balance` where" in text
    assert f"with {of('people', laplace)} and {of('balance', laplace)} mm" in text
