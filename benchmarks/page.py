"""The part of README.md that is written from the numbers."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from benchmarks import table, targets
from benchmarks.keeping import write_between

BEGIN, END = "<!-- from here on written by `python -m benchmarks` -->", "<!-- up to here -->"

SECTIONS: dict[str, tuple[str, Callable[[Any], str]]] = {
    "derivatives": ("Derivatives", table.derivatives),
    "fits": ("Fits", table.fits),
    "scaling": ("Cost and memory against the number of vertices", table.scaling),
    "overhead": ("Overhead around NLopt and IPOPT", table.overhead),
    "vertices": ("A step of a registration with free vertices", table.vertices),
    "sequences": ("A video as one problem", table.sequences),
    "closest": ("Closest places on a surface", table.closest),
    "fingers": ("What fingers cost", table.fingers),
}


def rewrite(readme: Path, results: Mapping[str, Any]) -> None:
    """Put the numbers between the marks."""
    write_between(readme, BEGIN, END, f"\n{text(results)}")


def text(results: Mapping[str, Any]) -> str:
    """Machine, promises and tables, as Markdown."""
    parts = []
    if any(results.values()):
        parts += [f"Measured on {_usual(results)}, unless a table names another machine or day.\n"]
    judged = targets.all_of(results)
    if judged:
        parts += ["## Targets\n", table.promises(judged)]
    for name, (heading, lines) in SECTIONS.items():
        if not results.get(name, {}).get("found"):
            continue
        parts += [f"## {heading}\n"]
        if (where := machine(results[name]["machine"])) != _usual(results):
            parts += [f"Measured on {where}.\n"]
        if name == "derivatives":
            parts += ["Milliseconds are minimum / median.\n"]
        parts += [lines(results[name]["found"])]
    return "\n".join(parts)


def _usual(results: Mapping[str, Any]) -> str:
    """Where the first of the parts was measured."""
    return machine(next(iter(results.values()))["machine"])


def machine(facts: Mapping[str, Any]) -> str:
    """One sentence's worth: `one of 2 cores of ..., with casadi 3.8.2, ..., on 2026-01-31`."""
    versions = ", ".join(f"{name} {v}" for name, v in facts["versions"].items() if v)
    return (
        f"{facts['cores used']} of {facts['cores']} cores of {facts['processor']} "
        f"({facts['system']}), Python {facts['python']}, {versions}, "
        f"on {facts['date'].partition('T')[0]}"
    )
