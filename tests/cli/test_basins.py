"""`workbench basins`, as typed."""

import csv
import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from tests.tiers import few
from workbench.cli.app import app
from workbench.errors import BadArgument, UnknownName, WorkbenchError

SMALL = ("--body", "small", "--points", "80", "--step", "90", "--noise", "0")


@pytest.mark.parametrize("method", few(["point-to-point", "distance", "point-to-plane"], 1))
def test_basins_writes_figures_starts_and_a_summary(tmp_path: Path, method: str) -> None:
    asked = ["basins", *SMALL, "--axis", "y", "--axis", "x,z", "--method", method]
    result = CliRunner().invoke(app, [*asked, "--out", str(tmp_path)])
    assert result.exit_code == 0, result.output
    assert f"20 registrations of 80 points to small, {method}" in result.output
    folder = tmp_path / "basins-small"
    for name in ("basins", "basins-x-z"):
        assert (folder / f"{name}.png").read_bytes().startswith(b"\x89PNG")
        assert (folder / f"{name}.svg").read_bytes().startswith(b"<?xml")
    with (folder / "starts-y.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [row["y_deg"] for row in rows] == ["-90", "0", "90", "180"]
    (at_truth,) = (row for row in rows if row["y_deg"] == "0")
    assert at_truth["found"] == "yes"
    assert float(at_truth["off_mm"]) < 0.1
    assert len((folder / "starts-x-z.csv").read_text().splitlines()) == 17
    summary = json.loads((folder / "summary.json").read_text())
    assert [one["axes"] for one in summary["maps"]] == [["y"], ["x", "z"]]
    assert summary["options"]["method"] == method
    assert set(summary["captions"]) == {"basins", "basins-x-z"}


@pytest.mark.thorough
def test_basins_of_a_seed_are_the_same_again(tmp_path: Path) -> None:
    texts = []
    for k, seed in enumerate(("3", "3", "4")):
        out = tmp_path / str(k)
        asked = ["basins", "--body", "small", "--points", "40", "--step", "180", "--axis", "x"]
        CliRunner().invoke(app, [*asked, "--seed", seed, "--out", str(out)])
        texts.append((out / "basins-small" / "starts-x.csv").read_text())
    assert texts[0] == texts[1] != texts[2]


@pytest.mark.parametrize(
    ("given", "kind", "said"),
    [
        (["--axis", "w"], UnknownName, "no axis is called 'w'; there are x, y, z"),
        (["--axis", "x,y,z"], BadArgument, "a figure has no third"),
        (["--step", "0"], BadArgument, "above 0 and at most 180 degrees, not 0"),
        (["--method", "nicp"], UnknownName, "no method is called 'nicp'"),
        (["--noise", "inf"], BadArgument, "--noise must be a finite number of mm"),
    ],
)
def test_basins_refuses_what_makes_no_map(
    tmp_path: Path, given: list[str], kind: type[WorkbenchError], said: str
) -> None:
    result = CliRunner().invoke(app, ["basins", *SMALL, *given, "--out", str(tmp_path)])
    assert isinstance(result.exception, kind)
    assert said in str(result.exception)
    assert not any(tmp_path.iterdir())
