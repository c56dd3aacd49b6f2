"""How fast and how accurate the workbench is, beside its peers: measured, kept, and written."""

import argparse
import sys
from collections.abc import Sequence
from contextlib import nullcontext
from importlib import import_module
from pathlib import Path
from typing import Any

from benchmarks import accuracy, measuring, page

QUICK = Path("runs") / "quick"  # where numbers of --quick are kept: they are no results
PAGES = {  # page -> what has a place in it
    "README.md": ("performance",),
    "SOLVERS.md": ("solvers",),
    "ACCURACY.md": tuple(f"accuracy_{name}" for name in accuracy.NAMES),
    "POSTERIOR.md": ("posteriors",),
}
EVERY = tuple(name for names in PAGES.values() for name in names)


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure what is asked for, print its tables, and write the pages."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    words = "performance [PART ...], solvers [PART ...], accuracy [NAME ...], posteriors, or page"
    parser.add_argument(
        "what", nargs="*", help=f"{words}, which only writes; all of them, if nothing is named"
    )
    parser.add_argument("--quick", action="store_true", help=f"small and rough; kept in {QUICK}")
    parser.add_argument("--check", action="store_true", help="exit code 1 if a target is missed")
    parser.add_argument("--purpose", default="", help="of a look at `solvers held-out`")
    parser.add_argument("--workers", type=int, default=1, help="runs of solvers, side by side")
    asked = parser.parse_args(arguments)
    try:
        wanted = chosen(asked.what)
    except ValueError as error:
        parser.error(str(error))
    if "held-out" in wanted.get("solvers", ()) and (asked.quick or not asked.purpose.strip()):
        parser.error("a look at the held-out cases needs --purpose WORDS, and is never --quick")
    folder = QUICK if asked.quick else measuring.RESULTS
    for name, parts in wanted.items():
        module = module_of(name)
        options: dict[str, Any] = {"parts": parts} if hasattr(module, "PARTS") else {}
        if name == "solvers":
            options |= {"purpose": asked.purpose, "workers": asked.workers}
        with measuring.on_one_core() if name == "performance" else nullcontext():
            try:
                found = module.measured(asked.quick, **options)
            except measuring.MissingData as error:
                print(f"{name} is not measured: {error}", file=sys.stderr)
                continue
            if hasattr(module, "PARTS"):
                found = measuring.beside_kept(name, found, folder)
            measuring.keep(name, found, folder, getattr(module, "PACKAGES", ()))
        print(module.tables(found), flush=True)
    if not asked.quick:
        write_pages()
    if asked.check:
        kept = measuring.kept("performance", folder)
        sys.exit(any(not target.holds for target in page.targets(kept["found"])) if kept else 1)


def chosen(words: Sequence[str]) -> dict[str, tuple[str, ...]]:
    """The results that are asked for, by the names of their files, with the parts of them.

    Raises ValueError for words that nothing is called.
    """
    if not words:
        return dict.fromkeys(EVERY, ())
    first, *rest = words
    if first == "accuracy":
        _known("accuracy", rest, accuracy.NAMES)
        return {f"accuracy_{name}": () for name in rest or accuracy.NAMES}
    _known("measurement", [first], ("performance", "solvers", "accuracy", "posteriors", "page"))
    if first == "page":
        _known("part of page", rest, ())
        return {}
    _known(f"part of {first}", rest, getattr(module_of(first), "PARTS", ()))
    return {first: tuple(rest)}


def _known(what: str, words: Sequence[str], there: Sequence[str]) -> None:
    unknown = [word for word in words if word not in there]
    if unknown:
        instead = f"there are {', '.join(there)}" if there else "there is none"
        raise ValueError(f"no {what} is called {', '.join(unknown)}; {instead}")


def module_of(name: str) -> Any:
    """The module that measures a result, with `measured(quick)` and `tables(found)`."""
    return import_module(f"benchmarks.{name.replace('accuracy_', 'accuracy.')}")


def write_pages(here: Path = measuring.HERE) -> None:
    """Put the tables of all kept numbers into their places, and draw the figure."""
    for file, names in PAGES.items():
        for name in names:
            if data := measuring.kept(name, here / "results"):
                where = measuring.measured_on(data["machine"])
                text = f"{module_of(name).tables(data['found'])}\n{where}"
                measuring.write_between(here / file, name, text)
    if data := measuring.kept("performance", here / "results"):
        measuring.write_between(here / "README.md", "targets", page.table_of_targets(data["found"]))
        page.draw(data["found"], here / "results" / "performance.svg")


if __name__ == "__main__":
    measuring.one_thread()
    main()
