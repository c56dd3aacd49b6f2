"""The command `python -m benchmarks.posterior`: what is claimed of posteriors, measured.

    python -m benchmarks.posterior nuts          # ten minutes; needs nutpie
    python -m benchmarks.posterior throughput    # two minutes
    python -m benchmarks.posterior known         # forty minutes
    python -m benchmarks.posterior coverage      # five minutes
    python -m benchmarks.posterior page          # the page from the numbers that there are

Each writes its numbers to results/posterior-PART.json, and POSTERIOR.md from all of them. `known`
with `--pieces FILE` keeps every run in a file and continues where it was stopped.
"""

import argparse
import json
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from benchmarks import machine
from benchmarks.keeping import keep
from benchmarks.posterior import page
from benchmarks.posterior.fitted import BLOCKS
from workbench.environment import DISTRIBUTION

DIGITS = 6  # in the files
PACKAGES = (DISTRIBUTION, "casadi", "numpy", "scipy", "emcee", "nutpie", "arviz")
HERE = Path(__file__).parents[1]


def _nuts(asked: argparse.Namespace) -> dict[str, Any]:
    from benchmarks.posterior import nuts

    return nuts.compared(asked.blocks, nuts.NutsSettings(asked.draws), asked.steps)


def _throughput(asked: argparse.Namespace) -> dict[str, Any]:
    from benchmarks.posterior import throughput

    return throughput.measured()


def _known(asked: argparse.Namespace) -> dict[str, Any]:
    from benchmarks.posterior import known
    from benchmarks.posterior.pieces import Pieces

    names = [name for name in known.DENSITIES if name not in known.TUNING]
    pieces, seeds = Pieces(asked.pieces), range(200, 200 + asked.seeds)
    return {"densities": known.of_densities(names, seeds, pieces)}


def _coverage(asked: argparse.Namespace) -> dict[str, Any]:
    from benchmarks.posterior import coverage

    return coverage.of_problems(asked.fits, seed=1)


PARTS: dict[str, Callable[[argparse.Namespace], dict[str, Any]]] = {
    "nuts": _nuts,
    "throughput": _throughput,
    "known": _known,
    "coverage": _coverage,
}


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure a part, keep its numbers, and write the page."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.posterior", description=__doc__)
    parser.add_argument("part", choices=(*PARTS, "page"))
    parser.add_argument("--blocks", nargs="+", default=list(BLOCKS), choices=list(BLOCKS))
    parser.add_argument("--draws", type=int, default=6000, help="of NUTS, for each of 4 chains")
    parser.add_argument("--steps", type=int, default=40_000, help="of emcee's walkers, at most")
    parser.add_argument("--seeds", type=int, default=20, help="of each density, for known")
    parser.add_argument("--fits", type=int, default=200, help="of each problem, for coverage")
    parser.add_argument("--pieces", type=Path, help="of known: where its runs are kept")
    parser.add_argument("--out", type=Path, default=HERE, help="where results/ is written")
    asked = parser.parse_args(arguments)
    if asked.part != "page":
        facts = machine.description(PACKAGES)
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", r"\s*ArviZ is undergoing", FutureWarning)
            found = PARTS[asked.part](asked)
        facts["load after"] = machine.load()
        file = asked.out / "results" / f"posterior-{asked.part}.json"
        keep(file, {"machine": facts, "found": found}, DIGITS)
    kept = {part: asked.out / "results" / f"posterior-{part}.json" for part in PARTS}
    found = {part: json.loads(file.read_text()) for part, file in kept.items() if file.exists()}
    (asked.out / "POSTERIOR.md").write_text(page.text(found))


if __name__ == "__main__":
    main()
