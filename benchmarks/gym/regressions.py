"""NIST's other fifteen regressions, from both published starts, certified to eleven digits.

The suite `nist` of the workbench has the first twelve. Data, starts and certified answers are in
`data/nist.json`, as PROVENANCE.md beside it describes them.
"""

import json
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import casadi as cs
import numpy as np

from benchmarks.gym.case import Case, case
from workbench.blocks import Block
from workbench.fitting.setup import KnownAnswer, Setup
from workbench.problem import Problem
from workbench.residuals import Residual

FILE = Path(__file__).parent / "data" / "nist.json"
Model = Callable[[Sequence[cs.MX], cs.DM], cs.MX]
YEAR = 2 * np.pi / 12


def _wave(even: cs.MX, odd: cs.MX, angle: cs.MX) -> cs.MX:
    return even * cs.cos(angle) + odd * cs.sin(angle)


def _enso(b: Sequence[cs.MX], x: cs.DM) -> cs.MX:
    long, short = (2 * np.pi * x / b[k] for k in (3, 6))
    return b[0] + _wave(b[1], b[2], YEAR * x) + _wave(b[4], b[5], long) + _wave(b[7], b[8], short)


def _peak(b: Sequence[cs.MX], x: cs.DM) -> cs.MX:
    return b[0] * cs.exp(-((x - b[1]) ** 2) / b[2] ** 2)


def _cubics(b: Sequence[cs.MX], x: cs.DM) -> cs.MX:
    above = b[0] + b[1] * x + b[2] * x**2 + b[3] * x**3
    return above / (1 + b[4] * x + b[5] * x**2 + b[6] * x**3)


MODELS: Mapping[str, Model] = {
    "Bennett5": lambda b, x: b[0] * (b[1] + x) ** (-1 / b[2]),
    "BoxBOD": lambda b, x: b[0] * (1 - cs.exp(-b[1] * x)),
    "Chwirut1": lambda b, x: cs.exp(-b[0] * x) / (b[1] + b[2] * x),
    "ENSO": _enso,
    "Eckerle4": lambda b, x: b[0] / b[1] * cs.exp(-(((x - b[2]) / b[1]) ** 2) / 2),
    "Gauss2": lambda b, x: b[0] * cs.exp(-b[1] * x) + _peak(b[2:5], x) + _peak(b[5:], x),
    "Hahn1": _cubics,
    "Lanczos2": lambda b, x: sum(b[k] * cs.exp(-b[k + 1] * x) for k in (0, 2, 4)),
    "MGH10": lambda b, x: b[0] * cs.exp(b[1] / (x + b[2])),
    "MGH17": lambda b, x: b[0] + b[1] * cs.exp(-x * b[3]) + b[2] * cs.exp(-x * b[4]),
    "Misra1c": lambda b, x: b[0] * (1 - 1 / cs.sqrt(1 + 2 * b[1] * x)),
    "Nelson": lambda b, x: b[0] - b[1] * x[:, 0] * cs.exp(-b[2] * x[:, 1]),  # of log y
    "Rat43": lambda b, x: b[0] / (1 + cs.exp(b[1] - b[2] * x)) ** (1 / b[3]),
    "Roszman1": lambda b, x: b[0] - b[1] * x - cs.atan(b[2] / (x - b[3])) / np.pi,
    "Thurber": _cubics,
}


@cache
def certified() -> Mapping[str, Mapping[str, Any]]:
    """The contents of the file: the facts of each problem, by NIST's name of it."""
    found: Mapping[str, Mapping[str, Any]] = json.loads(FILE.read_text())
    return found


def regression(problem: str = "MGH17", start: int = 1) -> Setup:
    """The regression of this name in NIST's list, from NIST's start 1 (far) or 2 (near)."""
    facts = certified()[problem]
    y, *columns = np.array(facts["data"]).T
    if problem == "Nelson":
        y = np.log(y)
    p = facts["n_params"]
    b = Block("b", (p,), labels=tuple(f"b{i + 1}" for i in range(p)))
    model = MODELS[problem](cs.vertsplit(b.symbol), cs.DM(np.column_stack(columns)))
    return Setup(
        Problem((Residual("regression", model - cs.DM(y), 1.0),), ("b",), blocks=(b,)),
        {"b": np.array(facts["starts"][start - 1])},
        f"NIST's regression {problem} ({facts['level']} difficulty, start {start} of 2): do the "
        f"{p} parameters come out of {facts['n_obs']} observations as NIST certified them?",
        known=KnownAnswer(
            "NIST StRD, certified to 11 digits",
            facts["rss"] / 2,
            {"b": np.array(facts["certified"])},
            {"b": np.array(facts["certified_sd"])},
            facts["rsd"],
        ),
    )


REGRESSIONS: tuple[Case, ...] = tuple(
    case(
        f"nist-{name.lower()}",
        "nist",
        regression,
        {"problem": name, "start": start},
        f"start {start}",
    )
    for name in MODELS
    for start in (1, 2)
)
