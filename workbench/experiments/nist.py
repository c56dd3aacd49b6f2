"""NIST's reference regressions: data, two starts, and answers certified to eleven digits.

Minimise 1/2 sum of (f(x; b) - y)^2 over b; the formulas are those of the files, in
`data/nist/nist_strd.json`, as PROVENANCE.md beside it describes them.

Eleven digits are found only by a solver that does not stop earlier: one with a gradient tolerance
of 1e-12, as in every comparison, and with the scaling of columns, because the parameters of
regressions have units of all sizes.
"""

import json
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from importlib.resources import files
from typing import Any

import casadi as cs
import numpy as np

from workbench.blocks import Block, Values
from workbench.errors import UnknownName, check_known
from workbench.experiments.experiment import Experiment
from workbench.fitting.setup import GRADED, KnownAnswer, Measure, Setup, digits
from workbench.problem import Problem
from workbench.residuals import Residual

Model = Callable[[Sequence[cs.MX], cs.DM], cs.MX]


def _peak(b: Sequence[cs.MX], x: cs.DM) -> cs.MX:
    height, centre, width = b
    return height * cs.exp(-((x - centre) ** 2) / width**2)


def _gauss(b: Sequence[cs.MX], x: cs.DM) -> cs.MX:
    b1, b2, *peaks = b
    return b1 * cs.exp(-b2 * x) + _peak(peaks[:3], x) + _peak(peaks[3:], x)


def _lanczos(b: Sequence[cs.MX], x: cs.DM) -> cs.MX:
    return sum(b[k] * cs.exp(-b[k + 1] * x) for k in (0, 2, 4))


MODELS: Mapping[str, Model] = {
    "Chwirut2": lambda b, x: cs.exp(-b[0] * x) / (b[1] + b[2] * x),
    "DanWood": lambda b, x: b[0] * x ** b[1],
    "Gauss1": _gauss,
    "Gauss3": _gauss,
    "Kirby2": lambda b, x: (b[0] + b[1] * x + b[2] * x**2) / (1 + b[3] * x + b[4] * x**2),
    "Lanczos1": _lanczos,
    "Lanczos3": _lanczos,
    "MGH09": lambda b, x: b[0] * (x**2 + x * b[1]) / (x**2 + x * b[2] + b[3]),
    "Misra1a": lambda b, x: b[0] * (1 - cs.exp(-b[1] * x)),
    "Misra1b": lambda b, x: b[0] * (1 - (1 + b[1] * x / 2) ** -2),
    "Misra1d": lambda b, x: b[0] * b[1] * x / (1 + b[1] * x),
    "Rat42": lambda b, x: b[0] / (1 + cs.exp(b[1] - b[2] * x)),
}


@cache
def certified() -> Mapping[str, Mapping[str, Any]]:
    """The contents of the file: the facts of each problem, by NIST's name of it."""
    text = (files("workbench") / "data" / "nist" / "nist_strd.json").read_text()
    facts: Mapping[str, Mapping[str, Any]] = json.loads(text)
    return facts


def nist(problem: str = "Misra1a", start: int = 1) -> Setup:
    """The regression with this name in NIST's collection, from NIST's start 1 (far) or 2 (near)."""
    check_known("NIST problem", problem, MODELS)
    if start not in (1, 2):
        raise UnknownName("start", str(start), hint="1 and 2")
    return regression(problem, certified()[problem], MODELS[problem], start)


def regression(name: str, facts: Mapping[str, Any], model: Model, start: int) -> Setup:
    """A regression of NIST's from what is certified of it, with the keys of the file, and its
    model: y (m, 1) from the parameters and the other columns of the data (m, k).
    """
    n, p = facts["n_obs"], facts["n_params"]
    y, *columns = np.array(facts["data"]).T
    b = Block("b", (p,), labels=tuple(f"b{i + 1}" for i in range(p)))
    fitted = model(cs.vertsplit(b.symbol), cs.DM(np.column_stack(columns)))
    answer = {"b": np.array(facts["certified"])}

    def measures(values: Values) -> tuple[Measure, ...]:
        agree = digits({"b": values["b"]}, answer)
        return (Measure("agreement with NIST, worst parameter", agree, "digits"),)

    return Setup(
        problem=Problem((Residual("regression", fitted - cs.DM(y), 1.0),), ("b",), blocks=(b,)),
        start={"b": np.array(facts["starts"][start - 1])},
        question=f"NIST's regression {name} ({facts['level']} difficulty, start {start} of 2): "
        f"do the {p} parameters come out of {n} observations as NIST certified them?",
        known=KnownAnswer(
            source="NIST StRD, certified to 11 digits",
            cost=facts["rss"] / 2,
            values=answer,
            deviations={"b": np.array(facts["certified_sd"])},
            residual_deviation=facts["rsd"],
        ),
        measures=measures,
        compared=GRADED,
    )


NIST = tuple(
    Experiment(
        f"nist-{name.lower()}",
        nist,
        f"NIST's regression {name}, answer certified",
        {"problem": name},
    )
    for name in MODELS
)
