"""The part of README.md that is written from the numbers."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from benchmarks import table, targets
from benchmarks.keeping import write_between

BEGIN, END = "<!-- from here on written by `python -m benchmarks` -->", "<!-- up to here -->"


def rewrite(readme: Path, results: Mapping[str, Any]) -> None:
    """Put the numbers between the marks."""
    write_between(readme, BEGIN, END, f"\n{text(results)}")


def text(results: Mapping[str, Any]) -> str:
    """Machine, promises and tables, as Markdown."""
    parts = []
    if any(results.values()):
        parts += [f"Measured on {machine(next(iter(results.values()))['machine'])}.\n"]
    found = {name: part["found"] for name, part in results.items()}
    judged = targets.all_of(results)
    if judged:
        parts += ["## Targets\n", table.promises(judged)]
    if "derivatives" in found:
        parts += ["## Derivatives\n", "Milliseconds are minimum / median.\n"]
        parts += [table.derivatives(found["derivatives"])]
    if "fits" in found:
        parts += ["## Fits\n", table.fits(found["fits"])]
    if "scaling" in found:
        parts += ["## Cost and memory against the number of vertices\n"]
        parts += [table.scaling(found["scaling"])]
    if "overhead" in found:
        parts += ["## Overhead around NLopt and IPOPT\n", table.overhead(found["overhead"])]
    if "vertices" in found:
        parts += ["## A step of a registration with free vertices\n"]
        parts += [table.vertices(found["vertices"])]
    if "sequences" in found:
        parts += ["## A video as one problem\n", table.sequences(found["sequences"])]
    measured = found.get("closest")
    parts += ["## Closest places on a surface\n"]
    parts += [table.closest(measured) if measured else "This part has not been measured yet.\n"]
    return "\n".join(parts)


def machine(facts: Mapping[str, Any]) -> str:
    """One sentence's worth: `one of 2 cores of ..., with casadi 3.8.2, ..., on 2026-01-31`."""
    versions = ", ".join(f"{name} {v}" for name, v in facts["versions"].items() if v)
    return (
        f"{facts['cores used']} of {facts['cores']} cores of {facts['processor']} "
        f"({facts['system']}), Python {facts['python']}, {versions}, "
        f"on {facts['date'].partition('T')[0]}"
    )
