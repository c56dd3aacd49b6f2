"""`workbench sliders` and `workbench blendshapes`, as typed."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from tests.studies.test_figures_and_pages import STUDY
from workbench.cli import blendshapes
from workbench.cli.app import app
from workbench.errors import BadArgument, BadFile
from workbench.studies.blend_shapes.study import PredictorPlan, PredictorStudy
from workbench.studies.pages import Report

SMALL = (
    "--body",
    "small",
    "--training",
    "40",
    "--validation",
    "20",
    "--test",
    "20",
    "--examples",
    "10",
)


def test_sliders_writes_a_page(tmp_path: Path) -> None:
    result = CliRunner().invoke(app, ["sliders", "small", "--out", str(tmp_path)])
    assert result.exit_code == 0, result.output
    assert (tmp_path / "sliders-small.html").stat().st_size > 100_000
    assert "sliders-small.html" in result.output


def test_blendshapes_prints_the_table_and_writes_the_page(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What is compared is tested with the training; here, that it is asked for and written."""
    asked = []

    def compare(plan: PredictorPlan, mocap: Path | None, report: Report) -> PredictorStudy:
        asked.append((plan, mocap))
        report("LBS + [theta]")
        return STUDY

    monkeypatch.setattr(blendshapes, "predictor_study", compare)
    result = CliRunner().invoke(app, ["blendshapes", *SMALL, "--out", str(tmp_path)])
    assert result.exit_code == 0, result.output
    assert asked == [(PredictorPlan("small", 40, 20, 20, 10, 0), None)]
    assert "LBS + [theta]" in result.output
    assert "linear blending (LBS)" in result.output
    assert "tested on 519 real poses" in result.output
    folder = tmp_path / "blendshapes"
    found = json.loads((folder / "summary.json").read_text())
    assert found["n_test"] == 519
    assert [r["accuracy"]["mean"] for r in found["results"]] == [0.14, 0.78, 1.84, 68.4]
    assert (folder / "tables.txt").read_text().count("\n") == 5
    assert (folder / "index.html").exists()


@pytest.mark.parametrize(
    ("arguments", "error", "text"),
    [
        (("--examples", "99999"), BadArgument, "99999 examples cannot be taken from"),
        (("--body", "full"), BadFile, "there is no teacher for body 'full'"),
        (("--mocap", "nowhere.npz", *SMALL), BadFile, "there is no file nowhere.npz"),
    ],
)
def test_mistakes_are_said_in_a_sentence(
    arguments: tuple[str, ...], error: type[Exception], text: str, tmp_path: Path
) -> None:
    result = CliRunner().invoke(app, ["blendshapes", *arguments, "--out", str(tmp_path)])
    assert isinstance(result.exception, error)
    assert text in str(result.exception)
    assert not list(tmp_path.iterdir())
