"""The command `python -m benchmarks`: how fast the workbench is, against peers and hardware."""

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from benchmarks.keeping import keep
from benchmarks.timing import alone_on_one_core

HERE = Path(__file__).parent
DIGITS = 5  # of times in the files
PARTS = (
    "derivatives",
    "fits",
    "scaling",
    "overhead",
    "vertices",
    "sequences",
    "closest",
    "fingers",
)


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure the parts asked for, print their tables, write numbers, figure and README."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("parts", nargs="*", metavar="PART", help=f"of {', '.join(PARTS)}; or page")
    parser.add_argument("--bodies", nargs="+", metavar="NAME", help="numbers of vertices or names")
    parser.add_argument("--sizes", nargs="+", type=int, metavar="N", help="of scaling")
    parser.add_argument("--rounds", type=int, default=12)
    parser.add_argument("--out", type=Path, default=HERE, help="where results/ is written")
    parser.add_argument("--no-peers", action="store_true", help="the workbench and the floor only")
    parser.add_argument("--check", action="store_true", help="exit code 1 if a target is missed")
    asked = parser.parse_args(arguments)
    if asked.parts[:1] == ["memory"]:  # scaling asks this of processes of their own
        print(json.dumps(_memory(*asked.parts[1:3])))
        return
    unknown = set(asked.parts) - {*PARTS, "page"}
    if unknown:
        known = ", ".join(PARTS)
        parser.error(f"no part is called {', '.join(sorted(unknown))}; there are {known}")
    for part in asked.parts or PARTS:
        if part != "page":
            _measure(part, asked)
    missed = _write_page(asked.out)
    if asked.check and missed:
        sys.exit(1)


def _memory(what: str, way: str) -> dict[str, Any]:
    """What a process that does nothing else takes."""
    from benchmarks import scaling, sequences, vertices

    if way == "vertices":
        return vertices.memory_of(what)
    if way == "sequences":
        return sequences.memory_of(int(what))
    return scaling.memory_of(int(what), way)


def _measure(part: str, asked: argparse.Namespace) -> None:
    """One part, to `results/<part>.json`."""
    from benchmarks import (
        bodies_made_up,
        closest,
        derivatives,
        fingers,
        fits,
        machine,
        overhead,
        scaling,
        sequences,
        table,
        vertices,
    )

    names = asked.bodies or [*map(str, bodies_made_up.SIZES), *bodies_made_up.EMBEDDED]
    peers, rounds, facts = not asked.no_peers, asked.rounds, machine.description()
    found: dict[str, Any] = {}
    if part == "scaling":
        sizes = tuple(asked.sizes or scaling.UP_TO_100_000)
        found = scaling.measure(sizes, max(3, rounds // 2))
        print(table.scaling(found), flush=True)
    if part == "overhead":
        names = [asked.bodies[0]] if asked.bodies else [overhead.BODY]
        found = overhead.measure(max(3, rounds // 2), body=names[0])
        print(table.overhead(found), flush=True)
    if part == "vertices":
        found = vertices.measure(rounds, [name for name in vertices.BODIES if name in names])
        print(table.vertices(found), flush=True)
    if part == "sequences":
        wanted = sequences.BODY in names
        lengths = sequences.LENGTHS if wanted else ()
        seen = (sequences.JOINTS, sequences.COCO) if wanted else ()
        found = sequences.measure(max(3, rounds // 2), seen, lengths=lengths)
        print(table.sequences(found), flush=True)
    if part == "closest":
        found = closest.measure(rounds, peers) if closest.BODY in names else {}
        print(table.closest(found), flush=True)
    if part == "fingers":
        found = fingers.measure(rounds) if fingers.HANDS in names or not asked.bodies else {}
        print(table.fingers(found), flush=True)
    for name in names if part in ("derivatives", "fits") else ():
        if part == "derivatives":
            found[name] = derivatives.measure(name, rounds, peers)
            print(table.derivatives({name: found[name]}), flush=True)
        else:
            found[name] = fits.measure(name, max(3, rounds // 2), with_peers=peers)
            print(table.fits({name: found[name]}), flush=True)
    options = {"bodies": names, "rounds": rounds, "peers": peers}
    facts["load after"] = machine.load()
    data = {"machine": facts, "options": options, "found": found}
    keep(asked.out / "results" / f"{part}.json", data, DIGITS)


def _write_page(out: Path) -> bool:
    """Targets, README and figure from the numbers there are; whether a target is missed."""
    from benchmarks import figure, page, table, targets

    files = {part: out / "results" / f"{part}.json" for part in PARTS}
    results = {part: json.loads(f.read_text()) for part, f in files.items() if f.exists()}
    promised = targets.all_of(results)
    print(table.promises(promised))
    if set(PARTS) <= set(results) and figure.SIZE in results["derivatives"]["found"]:
        figure.draw(results, out / "results" / "performance.svg")
    if (out / "README.md").exists():
        page.rewrite(out / "README.md", results)
    return not all(target.holds for target in promised)


if __name__ == "__main__":
    alone_on_one_core()
    main()
