"""A case of the gym: a problem of known answer and one start of it."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import casadi as cs
import numpy as np

from benchmarks.gym import answers
from workbench.arrays import Array
from workbench.blocks import Block, Values
from workbench.experiments import Experiment
from workbench.fitting.setup import KnownAnswer, Setup
from workbench.problem import Problem
from workbench.residuals import Residual


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
        """`wood, start 10`."""
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


def setup(
    name: str,
    expression: cs.MX,
    unknowns: Block,
    start: Array,
    source: str,
    exact: Array | None = None,
    made_of: Array | None = None,
) -> Setup:
    """The setup of a plain sum of squares of one block.

    `exact` is a point where every residual is zero up to rounding; without it the answer is the
    stored one of the problem of this name. `made_of` are the numbers of which noisy data were made.
    `source` says where the problem and its answer are from.
    """

    def values(numbers: Array | None) -> Values | None:
        return None if numbers is None else {unknowns.name: np.asarray(numbers, dtype=float)}

    return posed(
        name,
        Problem((Residual("residual", expression, 1.0),), (unknowns.name,), blocks=(unknowns,)),
        {unknowns.name: np.asarray(start, dtype=float)},
        source,
        values(exact),
        values(made_of),
    )


def posed(
    name: str,
    problem: Problem,
    start: Values,
    source: str,
    exact: Values | None = None,
    made_of: Values | None = None,
) -> Setup:
    """The setup of any problem; `exact` has cost 0, `made_of` is where noisy data were made."""
    answer = answers.known(name, source) if exact is None else KnownAnswer(source, 0.0)
    return Setup(
        problem,
        start,
        f"{name}: is the least sum of squares found?",
        known=answer,
        made_of=exact if made_of is None else made_of,
    )
