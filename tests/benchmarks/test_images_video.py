"""The page on videos says what was measured, and its measures are those of their names."""

import json

import numpy as np
import pytest

from benchmarks.images import video_errors
from benchmarks.images.limbs import HIPS, NAMES, mpjpe
from benchmarks.images.video import PAGE as FILE
from benchmarks.images.video import PARTS as RANGES
from benchmarks.images.video import RESULTS, acceleration, limits_table, means, table
from tests.benchmarks.prose import Prose, unheld
from workbench import load_body
from workbench.bodies import SkinnedBody
from workbench.experiments.balance_video import FPS
from workbench.fitting.image_recipe import COUNTED
from workbench.fitting.stature import stature
from workbench.fitting.video_mean import APART, BLUR

PAGE = FILE.read_text()
TEXT = Prose(FILE)
FOUND = json.loads(RESULTS.read_text())
HALF = 65.4  # mm, on the tuning frames, with a prior that counts half
MEASURED_ONCE = (
    "changed the mean distance by less than 1 mm",
    "the distance is 108.2 mm, and with the better of both starts 108.0 mm",
    "and 69.8 mm with a Student's t of which 20 numbers count",
    "the t has 67.9 mm, and 84.8 mm if all of its numbers count",
    f"the tuning frames have {HALF} mm",
)
PARTS = [part for part in ("tuning", "report", "whole") if part in FOUND]


@pytest.mark.parametrize("part", PARTS)
def test_its_tables_are_the_stored_results(part: str) -> None:
    assert table(FOUND[part]) in PAGE


def test_its_sentences_hold() -> None:
    assert f"({FPS:g} frames per second)" in TEXT
    assert f"means over {len(NAMES)} landmarks of the limbs" in TEXT
    tuned, new, every = (RANGES[part] for part in ("tuning", "report", "whole"))
    assert f"Frames {tuned[0]} to {tuned[-1]}, on which smoothness was chosen:" in TEXT
    assert f"Frames {new[0]} to {new[-1]}, not looked at before:" in TEXT
    assert f"All {len(every)} frames:" in TEXT
    found = means(FOUND["report"])
    assert f"{found['together']:.1f} mm together and {found['apart']:.1f} mm apart" in TEXT
    assert found["together"] > 0.95 * found["apart"]  # not confirmed, not 5 % below
    assert f"If frames count as independent, it is {found['independent']:.1f} mm" in TEXT
    assert found["independent"] > 1.1 * found["together"]
    assert means(FOUND["tuning"])["together"] < 0.95 * means(FOUND["tuning"])["apart"]
    rows = FOUND["report"]
    assert max(abs(row["together"]["stature"]) for row in rows) > 50
    assert "Stature within 50 mm in each camera was wanted as well, and is not reached" in TEXT
    worst = {
        name: max(abs(row[name]["stature"]) / row[name]["stature sd"] for row in rows)
        for name in ("together", "independent")
    }
    assert worst["together"] < 1.5
    assert "stature lies within 1.5 of its standard deviations of the truth in all four" in TEXT
    assert worst["independent"] == pytest.approx(6.5, abs=0.05)
    assert "if frames count fully, it is up to 6.5 of them off" in TEXT
    assert f"Over all {len(every)} frames, {len(tuned)} of which were used for tuning" in TEXT
    whole = means(FOUND["whole"])
    assert f"{whole['together']:.1f} mm together and {whole['apart']:.1f} mm apart, and no" in TEXT
    ratios = [row["together"]["mpjpe"] / row["apart"]["mpjpe"] for row in FOUND["whole"]]
    assert max(ratios) < 1.05
    assert "no camera is more than 5 % worse" in TEXT
    within = sum(row["together"]["CPU seconds"] <= 4 for row in FOUND["whole"])
    many = ("no", "one", "two", "three", "all")[within]
    assert f"The fit of all {len(every)} frames takes at most the wanted 4 s of CPU time" in TEXT
    assert f"4 s of CPU time in {many} camera{'' if within == 1 else 's'} of four" in TEXT
    step = FOUND["step"]
    assert "An iteration at 200 frames takes" in TEXT
    assert f"takes {step['CPU seconds']:.2f} s and {step['MB']:.0f} MB" in TEXT
    assert step["CPU seconds"] < 0.2
    assert step["MB"] < 200


def test_what_is_said_of_the_mean_holds() -> None:
    report, whole = (means(FOUND[part]) for part in ("report", "whole"))
    assert f"With the mean of the posterior it is {report['mean']:.1f} mm" in TEXT
    below = 1 - report["mean"] / report["apart"]
    assert below > 0.05
    assert "5 % below that of frames apart was wanted; the mean of the posterior reaches it" in TEXT
    assert f"in frames that are 1/{1 / APART:.0f} s apart, with the shape of the fit" in TEXT
    assert pytest.approx(round(1 / APART)) == 1 / APART
    assert f"smoothed with a Gaussian of {BLUR:g} s" in TEXT
    nearer = [row["mean"]["mpjpe"] < row["together"]["mpjpe"] for row in FOUND["report"]]
    many = ("no", "one", "two", "three", "all")[sum(nearer)]
    assert f"nearer to the truth in {many} cameras of four" in TEXT
    assert f"which is {100 * below:.0f} % below the frames apart, and no camera is worse" in TEXT
    assert all(row["mean"]["mpjpe"] < row["apart"]["mpjpe"] for row in FOUND["report"])
    assert f"it is {whole['mean']:.1f} mm with the mean of the posterior" in TEXT
    worst = max(row["mean"]["mpjpe"] / row["apart"]["mpjpe"] for row in FOUND["whole"])
    assert worst < 1.05
    assert f"whose worst camera has {worst:.2f} times the distance apart" in TEXT
    took = [row["mean"]["CPU seconds"] for row in FOUND["whole"]]
    assert f"the mean takes {min(took):.1f} to {max(took):.1f} s more" in TEXT


def test_what_is_said_of_limits_holds() -> None:
    found = FOUND["limits"]
    assert limits_table(found) in PAGE

    def mean(name: str) -> str:
        return f"{np.mean([each[name]['mpjpe'] for each in found.values()]):.1f}"

    usual, true = "usual start", "from the truth"
    together = means(FOUND["report"])["together"]
    assert np.mean([each[usual]["mpjpe"] for each in found.values()]) == pytest.approx(
        together, abs=0.05
    )
    assert f"{together:.1f} mm from the usual start and {mean(true)} mm from the truth" in TEXT
    known = (mean(f"{name}, shape known") for name in (usual, true))
    assert f"where the mean distances are {' and '.join(known)} mm" in TEXT
    for end in ("", ", shape known"):
        apart = [each[true + end]["cost"] - each[usual + end]["cost"] for each in found.values()]
        assert min(apart) > -0.01
        assert f"costs differ by at most {max(apart):.1f}." in TEXT
    assert abs(found["cam03"][usual]["mpjpe"] - found["cam03"][true]["mpjpe"]) < 0.5
    tuned, new = means(FOUND["tuning"])["together"], RANGES["report"]
    assert f"tuning frames the mean distance is {tuned:.1f} mm" in TEXT
    assert f"The fits to frames {new[0]} to {new[-1]} once more" in TEXT
    assert f"the one in which {COUNTED:g} numbers count" in TEXT
    assert f"the tuning frames have {HALF} mm. This gain of {tuned - HALF:.1f} mm is" in TEXT


def test_what_is_said_of_stature_holds() -> None:
    body = load_body("default")
    assert isinstance(body, SkinnedBody)
    slopes = stature(body, np.eye(body.n_betas)) - stature(body, np.zeros(body.n_betas))
    told = "The statures of the shape space have a standard deviation of {:.0f} mm"
    assert told.format(1e3 * np.linalg.norm(slopes)) in TEXT
    rows = [row["together"] for row in FOUND["report"]]
    sds = [row["stature sd"] for row in rows]
    assert f"lowers it only to {min(sds):.0f} to {max(sds):.0f} mm" in TEXT
    rms = np.sqrt(np.mean([row["stature"] ** 2 for row in rows]))
    assert f"have a root mean square of {rms:.0f} mm" in TEXT
    assert min(sds) > 50
    assert "A stature within 50 mm in every camera is not to be expected" in TEXT


def test_the_other_errors_of_a_video_are_what_was_measured() -> None:
    found = json.loads(video_errors.RESULTS.read_text())
    begin, end = video_errors.MARKS
    assert video_errors.table(found) == PAGE.partition(begin)[2].partition(end)[0].strip()
    told = video_errors.means(found["report"])
    usual = told["as `video_fit`"]["mpjpe"]
    few = told["offsets, 5 mm"]["mpjpe"]
    together = FOUND["report"]
    expected = np.mean([row["together"]["mpjpe"] for row in together])
    assert usual == pytest.approx(expected, abs=0.1)  # the same fit, built by itself
    independent = np.mean([row["independent"]["mpjpe"] for row in together])
    assert f"less than the {independent:.1f} mm of frames that are taken as independent" in TEXT
    assert "Offsets of 5 mm raise the mean distance on the new frames" in TEXT
    assert f"frames from {usual:.1f} to {few:.1f} mm, and wider ones raise it further" in TEXT
    assert few < told["offsets, 15 mm"]["mpjpe"] < told["offsets, 30 mm"]["mpjpe"]
    full = told["offsets, 15 mm, frames count fully"]["stature"]
    assert "beside offsets of 15 mm, stature is off by" in TEXT
    assert f"stature is off by {full / 1e3:.1f} m" in TEXT
    wide, narrow = (told[one.name]["mpjpe"] for one in video_errors.TRIED[5:7])
    assert f"is {wide:.1f} mm with 8 px of it and {narrow:.1f} mm with 3.5 px" in TEXT
    assert [one.drift for one in video_errors.TRIED[5:7]] == [8, 3.5]
    assert usual < min(wide, narrow)
    assert max(wide, narrow) < independent
    assert f"but more than the {usual:.1f} mm of the weight" in TEXT
    apart = means(together)["apart"]
    assert all(one["mpjpe"] > 0.95 * apart for one in told.values())
    assert means(together)["mean"] < 0.95 * apart
    assert "The wanted 5 % below frames apart are therefore not reached by any of these" in TEXT
    for part in ("tuning", "report"):
        best = video_errors.means(found[part])
        assert min(best, key=lambda name: best[name]["mpjpe"]) == "as `video_fit`"
    rho = max(row["errors"]["rho"] for row in found["report"])
    assert f"AR(1), with a correlation of {rho:g} from one frame to the next" in TEXT


def test_no_number_of_its_prose_is_held_by_nothing() -> None:
    tests = (
        test_its_sentences_hold,
        test_what_is_said_of_the_mean_holds,
        test_what_is_said_of_limits_holds,
        test_what_is_said_of_stature_holds,
        test_the_other_errors_of_a_video_are_what_was_measured,
    )
    given = ("of the first order, AR(1), with",)
    assert not unheld(TEXT, tests, given, MEASURED_ONCE)


def test_distances_are_of_the_limbs_about_the_hips() -> None:
    true = np.random.default_rng(0).standard_normal((5, len(NAMES), 3))
    assert mpjpe(true + [1.0, 2.0, 3.0], true) == pytest.approx(0, abs=1e-9)
    moved = true.copy()
    moved[:, 0, 0] += 0.12
    assert 0 not in HIPS
    assert mpjpe(moved, true) == pytest.approx(10)
    line = np.arange(6)[:, None, None] ** 2 * np.ones((6, 12, 3)) * [1e-3, 0, 0]
    assert acceleration(line) == pytest.approx(2)
