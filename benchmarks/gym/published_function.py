"""A function from the literature with its published start, and the problem that it poses."""

from collections.abc import Callable
from dataclasses import dataclass

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike

from benchmarks.gym.case import setup
from workbench.blocks import Block
from workbench.fitting.setup import Setup


@dataclass(frozen=True, eq=False)
class PublishedFunction:
    """A sum of squares.

    Attributes:
        residual: from x (n, 1) to the residuals (m, 1).
        start: (n,) the published start.
        source: who published it.
        zero: (n,) a point where every residual is 0, where there is one in closed form.
    """

    residual: Callable[[cs.MX], cs.MX]
    start: ArrayLike
    source: str
    zero: ArrayLike | None = None

    def setup(self, name: str) -> Setup:
        """The problem in x1 to xn, under this name, begun at the published start."""
        start = np.array(self.start, dtype=float)
        x = Block("x", start.shape, labels=tuple(f"x{i + 1}" for i in range(start.size)))
        zero = None if self.zero is None else np.array(self.zero, dtype=float)
        return setup(name, self.residual(x.symbol), x, start, self.source, zero)
