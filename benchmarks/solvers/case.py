"""A case: a problem whose answer is known, and one start of it."""

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import casadi as cs
import numpy as np

from workbench.arrays import Array
from workbench.blocks import Block, Values
from workbench.experiments import Experiment
from workbench.fitting.setup import KnownAnswer, Setup
from workbench.problem import Problem
from workbench.residuals import Residual

DATA = Path(__file__).parent / "data"  # PROVENANCE.md there says where its numbers are from


@cache
def data(name: str) -> dict[str, Any]:
    """The contents of `data/name.json`."""
    found: dict[str, Any] = json.loads((DATA / f"{name}.json").read_text(encoding="utf-8"))
    return found


@dataclass(frozen=True)
class Case:
    """One problem with one start.

    Attributes:
        problem: the problem's name, by whose hash it is for tuning or untouched.
        family: what it belongs to: `nist`, `bundle adjustment`.
        experiment: builds the setup; its name is the problem's and the start's.
    """

    problem: str
    family: str
    experiment: Experiment

    @property
    def name(self) -> str:
        """`mgh-wood, start x 10`."""
        return self.experiment.name


def case(
    problem: str,
    family: str,
    build: Callable[..., Setup],
    arguments: Mapping[str, Any],
    start: str = "",
) -> Case:
    """A case; `start` is what its name says of the start, where the problem has several."""
    name = f"{problem}, {start}" if start else problem
    return Case(problem, family, Experiment(name, build, family, dict(arguments)))


def posed(
    name: str,
    problem: Problem,
    start: Values,
    source: str,
    exact: Values | None = None,
    made_of: Values | None = None,
) -> Setup:
    """The setup of a problem, with its known answer.

    `exact` is a point where every residual is zero up to rounding. Without it the answer is the
    cost that `data/answers.json` has for a problem of this name; only the cost, because the same
    minimum may have several points. `made_of` is what noisy data were made of, and `source` says
    where the problem and its answer are from.
    """
    cost = 0.0 if exact is not None else data("answers")[name]["cost"]
    return Setup(
        problem,
        start,
        f"{name}: is the least sum of squares found?",
        known=KnownAnswer(source, cost),
        made_of=exact if made_of is None else made_of,
    )


def one_block(
    name: str,
    residual: cs.MX | Residual,
    unknowns: Block,
    start: Array,
    source: str,
    exact: Array | None = None,
    made_of: Array | None = None,
) -> Setup:
    """`posed` for a problem of one residual and one block."""
    one = residual if isinstance(residual, Residual) else Residual("residual", residual, 1.0)

    def values(numbers: Array | None) -> Values | None:
        return None if numbers is None else {unknowns.name: np.asarray(numbers, dtype=float)}

    return posed(
        name,
        Problem((one,), (unknowns.name,), blocks=(unknowns,)),
        {unknowns.name: np.asarray(start, dtype=float)},
        source,
        values(exact),
        values(made_of),
    )


def entries(name: str, count: int) -> Block:
    """A block `b` of entries b1, b2, ..."""
    return Block(name, (count,), labels=tuple(f"{name}{i + 1}" for i in range(count)))
