"""`python -m benchmarks.gym`: solvers on the gym's cases for tuning, with a table and a profile.

With `--untouched PURPOSE` the untouched cases are run instead, after the look has been written down
in `looks.md`. Finished runs are kept in a folder under the version of the code, so that an
interrupted run continues where it stopped; `--again` forgets them. With `--solvers` only some are
run, and the numbers of the others stay as they were.
"""

import argparse
from pathlib import Path

from benchmarks import machine
from benchmarks.gym import figure, page
from benchmarks.gym.case import Case
from benchmarks.gym.looks import looked
from benchmarks.gym.peers import ALL
from benchmarks.gym.runs import BUDGET, run
from benchmarks.gym.split import tuning
from benchmarks.keeping import keep
from workbench.identity import code_version

HERE = Path(__file__).parent.parent
HALVES = ("tuning", "untouched")
DIGITS = 6


def main() -> None:
    """Run what is asked for, keep the numbers, and write the page."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.gym", description=__doc__)
    parser.add_argument("--untouched", metavar="PURPOSE", help="what the look is for")
    parser.add_argument("--solvers", nargs="*", choices=list(ALL), default=list(ALL))
    parser.add_argument("--families", nargs="*", help="only these, and nothing is kept of them")
    parser.add_argument("--workers", type=int, default=1, help="processes side by side")
    parser.add_argument("--again", action="store_true", help="forget the runs that are kept")
    parser.add_argument("--out", type=Path, default=HERE, help="where results/ and GYM.md are")
    parser.add_argument("--runs", type=Path, default=Path("runs") / "gym")
    asked = parser.parse_args()
    half = HALVES[asked.untouched is not None]
    cases = tuning() if asked.untouched is None else looked(asked.untouched)
    if asked.families:
        cases = tuple(one for one in cases if one.family in asked.families)
    _run(asked, half, cases)


def _run(asked: argparse.Namespace, half: str, cases: tuple[Case, ...]) -> None:
    """Solvers on cases, judged by known answers."""
    file = asked.runs / f"{half}-{code_version()}.jsonl"
    if asked.again:
        file.unlink(missing_ok=True)
    solvers = {name: ALL[name] for name in asked.solvers}
    runs = run(cases, solvers, file, asked.workers, BUDGET, print)
    found = {"machine": machine.description(), **page.kept(cases, runs)}
    if asked.families:
        print("\n".join(page.lines({half: found})))
        return
    results = asked.out / "results"
    before = results / f"gym-{half}.json"
    if before.exists():
        found = page.renewed(page.read(before), found)
    keep(before, found, DIGITS)
    figure.draw(found, results / f"gym-{half}.svg")
    _write_page(asked.out)


def _write_page(out: Path) -> None:
    """The page from all numbers that are kept."""
    results = out / "results"
    there = [one for one in HALVES if (results / f"gym-{one}.json").exists()]
    found = {one: page.read(results / f"gym-{one}.json") for one in there}
    page.write(out / "GYM.md", found)


if __name__ == "__main__":
    main()
