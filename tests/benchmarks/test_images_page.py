"""The page of fits to one image is what its numbers say."""

import json
import math

import numpy as np
import pytest

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
    assert f"reached, and the second is {np.mean(usual['PA']):.1f} mm" in text
