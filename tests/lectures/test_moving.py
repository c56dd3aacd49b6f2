"""Figures that answer to the hand: what they compute, and what is seen where they cannot be."""

import re
from pathlib import Path

import numpy as np
import pytest

import workbench as wb
from tests.browsers import DRAWING, asked_of_replay, dumped, need_browser
from workbench.arrays import Array
from workbench.course import Picture
from workbench.lectures.material.arm import arm_page
from workbench.plots import house_style, sheet
from workbench.reports.replays import ReplayPage
from workbench.solvers.dogleg import cauchy_point, dogleg_step
from workbench.solvers.levenberg_marquardt import eased

pytestmark = pytest.mark.thorough

UPPER, LOWER = 0.3, 0.25  # m
BEYOND = np.array([0.2, 0.7])


def arm(damping: float = 0.01) -> ReplayPage:
    return arm_page(UPPER, LOWER, np.array([1.5, 0.6]), np.array([0.1, 0.46]), BEYOND, damping)


def wrist(x: Array) -> Array:
    a, b = x
    return UPPER * np.array([np.cos(a), np.sin(a)]) + LOWER * np.array(
        [np.cos(a + b), np.sin(a + b)]
    )


def linear(x: Array, star: Array) -> wb.Linearization:
    a, b = x
    by_b = LOWER * np.array([-np.sin(a + b), np.cos(a + b)])
    by_a = UPPER * np.array([-np.sin(a), np.cos(a)]) + by_b
    return wb.Linearization(wrist(x) - star, np.column_stack([by_a, by_b]))


ARM = """
  press("put it beyond");
  const now = replay.judged(), here = now.here;
  answers.start = { ...replay.state, x: [...replay.state.x] };
  Object.assign(answers, { p: now.p, promised: now.promised, fell: now.fell });
  answers.newton = replay.step(here, 0);
  answers.legs = replay.dogleg(here, answers.newton, 0.2);
  press("next iteration");
  answers.x = replay.state.x;
  answers.damping = replay.state.damping;
  answers.said = replay.sentence.textContent;
  const canvas = root.querySelector("canvas");
  canvas.focus();
  const key = new KeyboardEvent("keydown", { key: "ArrowLeft" });
  for (let n = 0; n < 5; n++) canvas.dispatchEvent(key);
  answers.dragged = replay.state.x;
"""


def test_the_arm_in_the_browser_is_the_librarys(tmp_path: Path) -> None:
    answers = asked_of_replay(arm().html, ARM, tmp_path)
    x, star = np.array([1.5, 0.6]), BEYOND
    here = linear(x, star)
    p = here.step(0.01)
    np.testing.assert_allclose(answers["p"], p, rtol=1e-9)
    assert answers["promised"] == pytest.approx(here.predicted_decrease(p), rel=1e-9)
    fell = here.cost - linear(x + p, star).cost
    assert answers["fell"] == pytest.approx(fell, rel=1e-9)
    newton, ones = here.step(), np.ones(2)
    np.testing.assert_allclose(answers["newton"], newton, rtol=1e-8)
    cauchy = cauchy_point(here, ones)
    np.testing.assert_allclose(answers["legs"][0], cauchy, rtol=1e-9)
    np.testing.assert_allclose(
        answers["legs"][1], dogleg_step(newton, cauchy, ones, 0.2), rtol=1e-8
    )
    np.testing.assert_allclose(answers["x"], x + p, rtol=1e-9)
    gain = fell / here.predicted_decrease(p)
    assert answers["damping"] == pytest.approx(0.01 * eased(gain), rel=1e-9)
    assert answers["said"].startswith("The step was taken.")
    moved = wrist(answers["dragged"]) - wrist(x + p)
    assert moved[0] < -0.01  # m: the keys draw the wrist to the left
    assert abs(moved[1]) < 1e-6


def test_still_figure_stands_above_what_moves(tmp_path: Path) -> None:
    """The page below the first figure becomes ready, and that below the second one never does."""
    need_browser()
    with house_style():
        figure, (ax,) = sheet(3, 2)
        ax.plot([0, 1])
    still = Picture(figure, "a line")
    works = Picture(figure, "a line", arm)
    broken = ReplayPage(
        arm().html.replace("function figure(root", "function missing(root"), "broken"
    )
    stays = Picture(figure, "a line", lambda: broken)
    assert "<iframe" not in still._repr_html_()
    assert works.image == still.image
    page = tmp_path / "index.html"
    page.write_text(f"<!doctype html>{works._repr_html_()}{stays._repr_html_()}", encoding="utf-8")
    for _ in range(3):  # on a busy machine the browser may stop before the first page is ready
        text, complaints = dumped(page, *DRAWING)
        frames = re.findall(r"<iframe[^>]*style=\"([^\"]*)\"", text)
        assert len(frames) == len(re.findall(r"<img[^>]*>\s*<figcaption>", text)) == 2, complaints
        if "height: 0" not in frames[0]:
            break
    (height,) = re.findall(r"height: (\d+)px", frames[0])
    assert int(height) > 300
    assert "height: 0" in frames[1]
