"""What is known about the answer of a problem before it is solved."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from workbench.blocks import Values
from workbench.errors import BadSetup, WorkbenchError, listed
from workbench.problem import Problem

CERTIFIED_DIGITS = 11  # of NIST's parameters: more cannot agree


@dataclass(frozen=True, eq=False)
class KnownAnswer:
    """The answer of a problem, or the lowest known cost, and its source.

    Raises BadSetup for an empty source, for a cost or a standard deviation of a residual that is no
    number from 0 on, and for deviations without values; `check` also compares values with a
    problem.

    Attributes:
        source: `NIST StRD, certified to 11 digits`, `best of 100 starts, polished`.
        cost: the certified or the best known cost.
        values: those of the free blocks, where the answer is known and there is only one.
        deviations: the standard deviations of the values, block by block.
        residual_deviation: that of one observation, as estimated from the residual.
    """

    source: str
    cost: float | None = None
    values: Values | None = None
    deviations: Values | None = None
    residual_deviation: float | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.source, str) or not self.source.strip():
            raise BadSetup(f"a known answer needs its source as a text, not {self.source!r:.80}")
        for name in ("cost", "residual_deviation"):
            number = getattr(self, name)
            if number is None:
                continue
            # a bool is a number to Python, and nothing that was meant
            real = isinstance(number, (int, float, np.number)) and not isinstance(number, bool)
            if not real or not 0 <= number < np.inf:
                raise BadSetup(f"the known {name} must be a number from 0 on, not {number!r:.80}")
            object.__setattr__(self, name, float(number))
        for name in ("values", "deviations"):
            given = getattr(self, name)
            if given is not None and not isinstance(given, Mapping):
                raise BadSetup(
                    f"the known {name} must be a dict of arrays by the names of free blocks, not "
                    f"{given!r:.80}"
                )
        if self.deviations is not None and self.values is None:
            raise BadSetup(
                "known deviations are those of known values, which are missing; give them too"
            )

    def check(self, problem: Problem) -> None:
        """Raise BadSetup unless values and deviations cover exactly the problem's free blocks."""
        for name in ("values", "deviations"):
            given = getattr(self, name)
            if given is None:
                continue
            foreign = set(given) - set(problem.free.names)
            if foreign:
                raise BadSetup(
                    f"the known {name} hold {', '.join(sorted(foreign))}, which is not free; the "
                    f"free blocks are {', '.join(problem.free.names)}"
                )
            try:
                flat = problem.free.pack(given)
            except WorkbenchError as error:
                raise BadSetup(f"the known {name} are not the problem's: {error}") from error
            if name == "deviations" and (flat < 0).any():
                raise BadSetup(
                    f"the known deviation of {problem.free.label(int(np.argmin(flat)))} "
                    f"is {flat.min():g}; it must be from 0 on"
                )


def digits(found: Mapping[str, ArrayLike], certified: Mapping[str, ArrayLike]) -> float:
    """How many digits agree, of the parameter that agrees worst: 0 to 11.

    The log relative error -log10 |found - certified| / |certified| (McCullough, The American
    Statistician 52, 1998), absolute where the certified number is 0. Raises BadSetup for a block
    that was not found.
    """
    fewest = float(CERTIFIED_DIGITS)
    for name, numbers in certified.items():
        if name not in found:
            raise BadSetup(f"no values of {name} to compare; there are {listed(found)}")
        c, x = np.asarray(numbers, dtype=float), np.asarray(found[name], dtype=float)
        error = np.abs(x - c) / np.where(c == 0, 1.0, np.abs(c))
        worst = float(np.max(np.where(np.isfinite(error), error, np.inf), initial=0.0))
        fewest = min(fewest, -np.log10(worst) if worst > 0 else np.inf)
    return max(0.0, float(fewest))
