"""Ends of a comparison that cost more than 1.01 times the least, kept as cases for solvers.

Run as `python -m benchmarks.ends FOLDER`, with the folder of a `workbench compare`; it writes
`results/ends.csv`. The comparison behind the file is named in benchmarks/README.md.
"""

import argparse
import csv
from collections.abc import Iterable, Mapping
from pathlib import Path

RESULTS = Path(__file__).parent / "results" / "ends.csv"
COLUMNS = (
    "problem",
    "start",
    "solver",
    "ending",
    "verdict",
    "cost",
    "times the least",
    "optimality",
)


def cases(rows: Iterable[Mapping[str, str]]) -> list[dict[str, str]]:
    """The rows of `results.csv` above 1.01 times the least cost, or whose run was killed."""
    found = []
    for row in rows:
        cost = float(row["cost"]) if row["cost"] else None
        least = float(row["best_known_cost"])
        if (cost is None or cost <= 1.01 * least) and row["ending"] != "KILLED":
            continue
        found.append(
            {
                "problem": row["problem"],
                "start": row["number"],
                "solver": row["solver"],
                "ending": row["ending"].lower(),
                "verdict": row["verdict"].lower().replace("_", " "),
                "cost": "" if cost is None else f"{cost:.8g}",
                "times the least": "" if cost is None else f"{cost / least:.4g}",
                "optimality": f"{float(row['optimality']):.1e}" if row["optimality"] else "",
            }
        )
    return found


def main() -> None:
    """Read a comparison's table and write its cases."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.ends", description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--out", type=Path, default=RESULTS)
    asked = parser.parse_args()
    with (asked.folder / "results.csv").open(newline="", encoding="utf-8") as file:
        found = cases(csv.DictReader(file))
    with asked.out.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, COLUMNS)
        writer.writeheader()
        writer.writerows(found)
    print(f"{len(found)} ends above 1.01 times the least cost: {asked.out}")


if __name__ == "__main__":
    main()
