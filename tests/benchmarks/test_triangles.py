"""The table of triangle models is drawn from the numbers that are kept."""

import json

from benchmarks.triangles import BEGIN, END, KEPT, README, table
from workbench.studies.triangles.people import RECORDED, TrianglePlan


def kept() -> dict:  # type: ignore[type-arg]
    return dict(json.loads(KEPT.read_text()))


def test_the_table_says_what_the_kept_results_say() -> None:
    shown = README.read_text().partition(BEGIN)[2].partition(END)[0]
    assert shown.strip() == table(kept())


def test_the_kept_results_are_of_as_many_people_as_the_command_takes() -> None:
    found = kept()
    assert TrianglePlan(**found["plan"]) == TrianglePlan()
    assert found["test"] == RECORDED


def test_vertices_explain_at_least_as_much_for_every_k_that_was_kept() -> None:
    found = kept()["explained"]
    v, t = (found[f"{name}, training"]["share"] for name in ("vertices", "triangles"))
    assert all(a >= b - 1e-3 for a, b in zip(v, t, strict=True))  # four digits are kept
