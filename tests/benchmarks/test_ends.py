"""The stored ends of solvers above the least cost: what the page says of them."""

import csv
from collections import Counter
from pathlib import Path

from benchmarks.ends import RESULTS, cases

README = Path(__file__).parents[2] / "benchmarks" / "README.md"


def stored() -> list[dict[str, str]]:
    with RESULTS.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_the_page_counts_what_is_stored() -> None:
    causes = Counter(row["cause"] or row["ending"] for row in stored())
    assert causes == {"second basin": 16, "limit": 5, "killed": 5}
    of_smpl = [r for r in stored() if r["problem"] == "body-points-smpl"]
    assert Counter(r["cause"] for r in of_smpl)["second basin"] == 15
    text = " ".join(README.read_text(encoding="utf-8").split())
    assert "16 ended in a second basin (15 of them fits of SMPL" in text
    assert f"the file lists {len(stored())}: " in text
    assert "5 ended at the time limit, and 5 were stopped from outside" in text


def test_only_ends_with_a_cause_and_killed_runs_are_cases() -> None:
    row = {
        "problem": "p",
        "number": "1",
        "solver": "s",
        "ending": "RETURNED",
        "cause": "",
        "cost": "2.0",
        "best_known_cost": "1.0",
        "optimality": "1e-7",
    }
    assert not cases([row])
    (found,) = cases([row | {"cause": "SECOND_BASIN"}])
    assert found["cause"] == "second basin"
    assert found["times the least"] == "2"
    (killed,) = cases([row | {"ending": "KILLED", "cost": "", "optimality": ""}])
    assert killed["cost"] == killed["times the least"] == ""
