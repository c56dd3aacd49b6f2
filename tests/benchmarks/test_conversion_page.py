"""The page of conversions is written from the numbers that are kept, and its sentences hold."""

import json
from pathlib import Path

import numpy as np

from benchmarks import conversion
from benchmarks.conversion_page import written

FOUND = json.loads((conversion.HERE / "results" / "conversion.json").read_text())


def test_the_page_is_that_of_the_numbers() -> None:
    assert (Path(conversion.HERE) / "CONVERSION.md").read_text() == written(FOUND)


def test_24_joints_become_52_and_back_as_well_as_the_page_says() -> None:
    there, back = FOUND["pairs"][:2]
    assert (there["from"], there["to"]) == ("default", "full-hands") == (back["to"], back["from"])
    for row in (there, back):
        assert len(row["mean"]) == len(conversion.SEEDS)
        assert max(row["mean"]) < 3.5
        assert np.mean(row["body"]) < 3
        assert max(np.array(row["mean"]) / row["copied"]) < 0.25
        assert row["found"] + max(row["seconds"]) < 60


def test_files_are_shown_as_the_page_says() -> None:
    exact = [row for row in FOUND["glb"] if row["asked"] == "exact"]
    few = [row for row in FOUND["glb"] if row["asked"] == 32]
    assert len(exact) == len(few) == len(conversion.GLB)
    assert max(row["three"] for row in exact) < 1e-3  # mm
    assert max(row["three"] for row in few) < 0.5
    assert {row["issues"] for row in FOUND["glb"]} == {0}
    (full,) = (row for row in few if row["body"] == "full")
    assert full["megabytes"] < 8
