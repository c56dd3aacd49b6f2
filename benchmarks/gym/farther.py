"""The suite `nist` from farther starts: regressions to tune on that begin where curves are flat.

NIST's first start is far from the answer; these are twice and three times as far in the logarithm
of each parameter: b (s / b)^k for the certified b and NIST's first start s.
"""

from dataclasses import replace

import numpy as np

from benchmarks.gym.case import Case, case
from workbench.errors import BadSetup
from workbench.experiments.nist import MODELS, nist
from workbench.fitting.setup import Setup

POWERS = (2, 3)


def farther(problem: str = "Misra1a", power: int = 2) -> Setup:
    """A regression of the suite, begun `power` times as far off as NIST's first start."""
    setup = nist(problem)
    if setup.known is None or setup.known.values is None:
        raise BadSetup(f"no certified answer of {problem}")
    b, s = setup.known.values["b"], setup.start["b"]
    return replace(setup, start={"b": np.array([float(f"{x:.12g}") for x in b * (s / b) ** power])})


FARTHER: tuple[Case, ...] = tuple(
    case(
        f"nist-{name.lower()}",
        "nist, tuned",
        farther,
        {"problem": name, "power": power},
        f"{power} times as far",
    )
    for name in MODELS
    for power in POWERS
)
