"""`workbench sliders` and `workbench blendshapes`, as typed."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from workbench.cli.app import app
from workbench.errors import BadArgument, BadFile

SMALL = ("--body", "small", "--lesson", "40", "--trial", "20", "--test", "20", "--examples", "10")


def test_sliders_writes_a_page(tmp_path: Path) -> None:
    result = CliRunner().invoke(app, ["sliders", "small", "--out", str(tmp_path)])
    assert result.exit_code == 0, result.output
    assert (tmp_path / "sliders-small.html").stat().st_size > 100_000
    assert "sliders-small.html" in result.output


def test_blendshapes_prints_the_table_and_writes_the_page(tmp_path: Path) -> None:
    result = CliRunner().invoke(app, ["blendshapes", *SMALL, "--out", str(tmp_path)])
    assert result.exit_code == 0, result.output
    assert "linear blending (LBS)" in result.output
    assert "further draws from the shipped pose prior" in result.output
    folder = tmp_path / "blendshapes"
    found = json.loads((folder / "summary.json").read_text())
    assert found["n_test"] == 20
    assert len(found["results"]) == 15
    assert [r["mean"] for r in found["results"]] == sorted(r["mean"] for r in found["results"])
    assert (folder / "table.txt").read_text().count("\n") == 16
    assert (folder / "index.html").exists()


@pytest.mark.parametrize(
    ("arguments", "error", "text"),
    [
        (("--examples", "99999"), BadArgument, "99999 examples cannot be taken from a lesson"),
        (("--body", "full"), BadFile, "there is no teacher for body 'full'"),
        (("--mocap", "nowhere.npz", *SMALL), BadFile, "nowhere.npz is no recording"),
    ],
)
def test_mistakes_are_said_in_a_sentence(
    arguments: tuple[str, ...], error: type[Exception], text: str, tmp_path: Path
) -> None:
    result = CliRunner().invoke(app, ["blendshapes", *arguments, "--out", str(tmp_path)])
    assert isinstance(result.exception, error)
    assert text in str(result.exception)
    assert not list(tmp_path.iterdir())
