"""How fast and how accurate the workbench is, beside its peers: measured, kept, and written."""

import argparse
import sys
from collections.abc import Callable, Mapping, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

from benchmarks import accuracy, measuring

QUICK = Path("runs") / "quick"  # where numbers of --quick are kept: they are no results
PAGES = {  # page -> what has a place in it
    "README.md": ("performance", "performance_large"),
    "SOLVERS.md": ("solvers",),
    "ACCURACY.md": tuple(f"accuracy_{name}" for name in accuracy.NAMES),
    "POSTERIOR.md": ("posteriors",),
}
PINNED = ("performance", "performance_large")  # to one core


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure what is asked for, print its tables, and write the pages."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument(
        "what",
        nargs="*",
        help="performance, solvers, accuracy [NAME ...], posteriors or page, which writes the pages "
        f"from the numbers there are; without it all of them; NAME is of {', '.join(accuracy.NAMES)}",
    )
    parser.add_argument("--quick", action="store_true", help=f"small and rough; kept in {QUICK}")
    parser.add_argument("--check", action="store_true", help="exit code 1 if a target is missed")
    asked = parser.parse_args(arguments)
    try:
        names = wanted(asked.what)
    except ValueError as error:
        parser.error(str(error))
    folder = QUICK if asked.quick else measuring.RESULTS
    for name in names:
        measuring.one_thread(pinned=name in PINNED)
        try:
            found = module_of(name).measured(asked.quick)
        except measuring.MissingData as error:
            print(f"{name} is not measured: {error}", file=sys.stderr)
            continue
        measuring.keep(name, found, folder)
        print(module_of(name).tables(found), flush=True)
    if not asked.quick:
        write_pages()


def wanted(words: Sequence[str]) -> list[str]:
    """The results that are asked for, by the names of their files. Raises ValueError."""
    every = [name for names in PAGES.values() for name in names]
    if not words:
        return every
    first, *rest = words
    if first == "accuracy":
        unknown = sorted(set(rest) - set(accuracy.NAMES))
        if unknown:
            raise ValueError(
                f"no accuracy is called {', '.join(unknown)}; there are {', '.join(accuracy.NAMES)}"
            )
        return [f"accuracy_{name}" for name in rest or accuracy.NAMES]
    known = {"performance": PAGES["README.md"], "page": ()}
    known |= {name: (name,) for name in ("solvers", "posteriors")}
    if first not in known or rest:
        raise ValueError(
            f"{' '.join(words)!r} is none of performance, solvers, accuracy [NAME ...], posteriors "
            "and page"
        )
    return list(known[first])


def module_of(name: str) -> Any:
    """The module that measures a result, with `measured(quick)` and `tables(found)`."""
    return import_module(f"benchmarks.{name.replace('accuracy_', 'accuracy.')}")


def write_pages(
    pages: Mapping[str, Sequence[str]] = PAGES,
    here: Path = measuring.HERE,
    module: Callable[[str], Any] = module_of,
) -> None:
    """Put the tables of all kept numbers into their places."""
    for page, names in pages.items():
        for name in names:
            if data := measuring.kept(name, here / "results"):
                text = f"{module(name).tables(data['found'])}\n{measuring.measured_on(data['machine'])}"
                measuring.write_between(here / page, name, text)


if __name__ == "__main__":
    main()
