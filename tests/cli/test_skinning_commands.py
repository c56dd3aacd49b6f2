"""`workbench sliders` and `workbench blendshapes`, as typed."""

import json
from pathlib import Path

import numpy as np
import pytest

from tests.cli.conftest import Run

FEW = ("--training", "40", "--validation", "20", "--test", "20", "--examples", "10")
SMALL = ("--body", "small", *FEW)


@pytest.mark.thorough
def test_sliders_writes_a_page(workbench: Run) -> None:
    code, out, err = workbench("sliders", "small", "--out", "here")
    assert code == 0, err
    assert Path("here/sliders-small.html").stat().st_size > 100_000
    assert "sliders-small.html" in out


@pytest.mark.thorough
def test_blendshapes_prints_a_table_and_writes_a_page(workbench: Run) -> None:
    code, out, err = workbench("blendshapes", *SMALL)
    assert code == 0, err
    assert "linear blending (LBS)" in out
    folder = Path("runs/blendshapes")
    found = json.loads((folder / "summary.json").read_text())
    assert found["n_test"] == 20
    errors = [r["accuracy"]["mean"] for r in found["results"]]
    assert len(errors) > 3
    assert all(0 <= error < np.inf for error in errors)  # mm
    assert (folder / "tables.txt").is_file()
    assert (folder / "index.html").is_file()


def test_blendshapes_refuses_what_it_cannot_compare(workbench: Run) -> None:
    for arguments, said in (
        (("--examples", "99999"), "99999 examples cannot be taken from"),
        (("--body", "full"), "there is no teacher for body 'full'"),
        (("--mocap", "nowhere.npz", *SMALL), "there is no file nowhere.npz"),
    ):
        code, _, err = workbench("blendshapes", *arguments)
        assert code == 2
        assert said in " ".join(err.split())
    assert not list(Path().glob("runs/*"))
