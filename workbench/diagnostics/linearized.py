"""The linearization that is diagnosed: without columns that are only rounding errors."""

from collections.abc import Mapping
from dataclasses import replace

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csc_array

from workbench.arrays import Array, Mask
from workbench.blocks import Layout
from workbench.errors import NotFinite
from workbench.problem import Linearization, Problem
from workbench.problem.steps import EPS

BY_GRAPH = 1e7  # entries up to which the graph of a Jacobian is asked for its pattern


def linearized(problem: Problem, at: Mapping[str, ArrayLike]) -> Linearization:
    """A problem's linearization at these values, of the residuals alone.

    Columns that are nothing but rounding errors are zero in it: see `only_rounding`.
    """
    here = replace(problem.linearize(at), constraints=None)
    if not here.finite:
        return here
    noise = only_rounding(here.column_norms, problem.split(at)[0], problem.free, problem.size)
    return here.scaled(np.where(noise, 0.0, 1.0)) if noise.any() else here


def check_finite(here: Linearization) -> None:
    """Raise NotFinite if there is NaN or infinity, of which there are no ranks and directions."""
    if not here.finite:
        raise NotFinite("the Jacobian holds NaN or infinity here; see `not_finite` for where")


def only_rounding(lengths: Array, x: Array, free: Layout, m: int) -> Mask:
    """Which columns, of these lengths (n,) in m rows at x, may be nothing but rounding, (n,).

    Entries of one unit can be compared: a column is, if it is below eps max(m, n) of the longest
    of its unit. Entries without a unit cannot; there, and everywhere, it is if a change by one, or
    by the size of x_i if that is more, changes the rows by less than the rounding error of one
    sigma, or of the longest column if that is shorter.
    """
    units = np.array([block.unit for block in free.blocks for _ in range(block.size)])
    longest = float(lengths.max(initial=0.0))
    least = np.full(lengths.shape, 10 * EPS * np.sqrt(m) * min(1.0, longest))
    for unit in set(units.tolist()) - {"1"}:
        alike = units == unit
        own = EPS * max(m, len(lengths)) * float(lengths[alike].max())
        least[alike] = np.maximum(least[alike], own)
    return np.asarray((lengths > 0) & (lengths * np.maximum(1.0, abs(x)) <= least))


def not_finite(here: Linearization) -> tuple[tuple[int, int], ...]:
    """Rows and columns of entries that are NaN or infinite; column -1 means the residual."""
    if here.finite:
        return ()
    r = [(int(i), -1) for i in np.flatnonzero(~np.isfinite(here.residual))]
    return (*r, *here.not_finite)


def pattern_at(problem: Problem) -> csc_array:
    """Where a problem's Jacobian can be nonzero, (m, n), by its whole graph.

    The graph of a very large mesh takes many times the memory of its Jacobian, and points that are
    computed by arithmetic alone are in no graph. There it is the pattern of the chain rule, in
    which each point reads all of its body's blocks.
    """
    if problem.size * problem.free.size > BY_GRAPH or not problem.has_graph:
        return problem.pattern
    return pattern_of(problem.function)


def pattern_of(function: cs.Function) -> csc_array:
    """Where the Jacobian of a function's first output by its first input can be nonzero."""
    sparsity = function.jac_sparsity(0, 0)
    starts, rows = sparsity.get_ccs()
    return csc_array((np.ones(len(rows), dtype=bool), rows, starts), shape=sparsity.shape)
