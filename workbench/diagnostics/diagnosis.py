"""The diagnosis of a problem at one point: its rank, null directions, and what to do about them."""

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from workbench.arrays import Array, Mask
from workbench.blocks import Layout, Values
from workbench.diagnostics import conditioning, data, null_space, remedies, report, structure
from workbench.diagnostics.active_set import not_finite
from workbench.diagnostics.derivatives import DerivativeCheck, check_derivatives
from workbench.diagnostics.gauges import Gauge, exchanges
from workbench.diagnostics.identifiability import (
    Contribution,
    Identifiability,
    contributions,
    identifiability,
    widths_by_curvature,
)
from workbench.diagnostics.null_space import Direction
from workbench.diagnostics.point import Neighbourhood, Point
from workbench.diagnostics.rank_law import JointTurn, joint_turns, law_of
from workbench.diagnostics.remedies import RankAndCondition, Suggestion, rank_and_condition
from workbench.diagnostics.report import Finding
from workbench.diagnostics.sparse_jacobian import SparseJacobian
from workbench.diagnostics.structure import Structure, TermBlock
from workbench.errors import WorkbenchError
from workbench.problem import Linearization, Problem


class Undiagnosed(WorkbenchError, AssertionError):
    """An assertion about a diagnosis that does not hold."""


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """A problem at one point. Every part is computed when it is first asked for.

    Directions that bounds and constraints forbid at this point count as determined, in rank, null
    directions and sigmas. Whether a direction is weak is judged in characteristic scales; see the
    module `scales`.

    `str` gives a summary, `report()` everything in words, `data()` the same as JSON.

    Attributes:
        problem: the problem.
        values: the values of all blocks that it reads.
        here: its linearization at these values, without columns of rounding errors.
        priors: the names of the residuals that are priors, not data.
        gauges: motions that were declared to be gauges.
        scales: by block, the characteristic scales that were said.
    """

    problem: Problem = field(repr=False)
    values: Values = field(repr=False)
    here: Linearization = field(repr=False)
    priors: tuple[str, ...] = ()
    gauges: tuple[Gauge, ...] = field(default=(), repr=False)
    scales: Values = field(default_factory=dict, repr=False)

    @property
    def free(self) -> Layout:
        """The layout of the unknowns."""
        return self.problem.free

    @property
    def shape(self) -> tuple[int, int]:
        """(m, n), rows and unknowns."""
        return self.here.shape

    @cached_property
    def point(self) -> Point:
        """The active constraints at this point, and the characteristic scale of each unknown."""
        return Point(self.problem, self.values, self.here, self.priors, self.scales)

    @cached_property
    def structure(self) -> Structure:
        """The decomposition of the pattern; active bounds and constraints are part of it."""
        return structure.decomposed(self.point.pattern, self.point.active_pattern)

    @property
    def pattern(self) -> Mask:
        """(m, n): structurally nonzero."""
        return np.asarray(self.structure.pattern.toarray())

    @property
    def nonzeros(self) -> int:
        """How many entries of the Jacobian can be nonzero."""
        return int(self.structure.pattern.nnz)

    @property
    def density(self) -> float:
        """Nonzeros over entries, 0 to 1."""
        return self.nonzeros / max(1, self.shape[0] * self.shape[1])

    @property
    def structural_rank(self) -> int:
        """The largest rank that a matrix with this sparsity pattern can have."""
        return self.structure.rank

    @property
    def row_edges(self) -> tuple[int, ...]:
        """The first row of each residual, and m at the end."""
        return (*(rows.start for rows in self.problem.rows.values()), self.problem.size)

    @cached_property
    def terms(self) -> tuple[TermBlock, ...]:
        """The Jacobian's parts: each residual's rows in each block's columns."""
        return structure.term_blocks(self.problem, self.structure, self.here)

    @cached_property
    def duplicates(self) -> tuple[tuple[str, str], ...]:
        """Pairs of residuals whose rows repeat each other."""
        return structure.duplicates(self.problem, self.here) if self.here.finite else ()

    @cached_property
    def not_finite(self) -> tuple[tuple[int, int], ...]:
        """Rows and columns of entries that are NaN or infinite; column -1 means the residual."""
        return not_finite(self.here)

    @property
    def by_elimination(self) -> SparseJacobian | None:
        """By a sparse factorization, in scales; None where there are singular values instead."""
        return self.point.by_elimination

    @property
    def singular_values(self) -> Array:
        """The singular values of the (reduced) Jacobian, (min(m, n),), falling.

        With `by_elimination` nothing else asks for them. Raises TooLarge above 4,000 unknowns.
        """
        return self.point.constrained.reduced.spectrum.s

    @property
    def tolerance(self) -> float:
        """The singular value below which a direction counts as null."""
        if self.by_elimination is not None:
            return self.point.constrained.tolerance
        return self.point.constrained.reduced.spectrum.tolerance

    @property
    def rank(self) -> int:
        """How many independent directions change a residual or are forbidden by constraints."""
        return self.point.constrained.rank

    @property
    def reduced_rank(self) -> int:
        """How many singular values are above the tolerance: the rank without constraints' part."""
        return self.point.constrained.reduced.spectrum.rank

    @property
    def condition(self) -> float:
        """Largest over smallest singular value; infinite without full column rank."""
        return self.state.condition

    @cached_property
    def state(self) -> RankAndCondition:
        """Unknowns, rank and condition."""
        return rank_and_condition(self.point.constrained)

    @cached_property
    def scaled_singular_values(self) -> Array:
        """The singular values with every column scaled to length 1."""
        return self.point.constrained.stacked.singular_values

    @cached_property
    def scaled_rank(self) -> int:
        """The rank with every column scaled to length 1."""
        if self.by_elimination is not None:
            return self.rank  # in such columns
        s = self.scaled_singular_values
        relative = self.tolerance / max(float(self.singular_values.max(initial=0.0)), 1e-300)
        return int(np.sum(s > relative * s.max(initial=0.0)))

    @cached_property
    def nearby(self) -> Neighbourhood:
        """Rank and singular values at a few points around."""
        return Neighbourhood(self.point)

    @cached_property
    def null_directions(self) -> tuple[Direction, ...]:
        """The directions that change no residual, with their names."""
        return null_space.null_directions(self.point, self.structure.pattern, self.gauges)

    @cached_property
    def exchanges(self) -> tuple[tuple[str, ...], ...]:
        """Groups of blocks whose rows may be exchanged, together, without changing a residual."""
        return exchanges(self.problem, self.values, self.point.constrained)

    @cached_property
    def weak_directions(self) -> tuple[Direction, ...]:
        """Directions along which a scale changes residuals by less than a sigma, weakest first.

        The vectors have length 1 once every unknown is measured by its own scale. With
        `by_elimination` these are the weakest 12.
        """
        return null_space.weak_directions(self.point, self.structure.pattern)

    @cached_property
    def weak_count(self) -> int:
        """How many directions change the residuals by less than a sigma per scale."""
        return null_space.count_weak(self.point)

    @cached_property
    def rank_law(self) -> tuple[int, str] | None:
        """The rank that the tree predicts, and why; None unless only joints are observed."""
        if self.point.active.any:
            return None
        return law_of(self.problem, self.values)

    @cached_property
    def parallel_columns(self) -> tuple[conditioning.ParallelPair, ...]:
        """Pairs of unknowns whose columns are nearly parallel."""
        return conditioning.parallel_columns(self.point.constrained.stacked)

    @cached_property
    def joint_turns(self) -> tuple[JointTurn, ...]:
        """The strongest two turns of each joint that the residuals depend on."""
        return joint_turns(self.point)

    @cached_property
    def weakest(self) -> tuple[conditioning.WeakestDirection, ...]:
        """The directions of the smallest nonzero singular values, in scales."""
        return conditioning.weakest(self.point)

    @cached_property
    def leverage(self) -> Array | None:
        """(m,) the leverage of each row, 0 to 1; None for a large sparse Jacobian."""
        return conditioning.leverage(self.point.constrained.reduced)

    @cached_property
    def identifiability(self) -> Identifiability:
        """Standard deviations, correlations, the data's share, and what is identified."""
        return identifiability(
            self.point.constrained,
            self.point.is_prior,
            self.point.prior_sigma,
            self.point.scales.sizes,
            self.structure.unread,
            self.structure.under.columns,
        )

    @cached_property
    def widths(self) -> tuple[float, ...]:
        """Standard deviations, in characteristic scales, of null directions that the cost rises in.

        The Jacobian does not show them, the exact Hessian does; see `widths_by_curvature`.
        """
        if self.here.estimated or self.point.active.any or self.rank == self.shape[1]:
            return ()
        scales = self.point.scales.sizes
        null = self.point.null_in(self.point.measured, scales)
        return widths_by_curvature(self.problem, self.values, null, scales)

    @property
    def has_width(self) -> bool:
        """Whether the cost rises along every null direction, though no residual changes."""
        return 0 < self.shape[1] - self.rank == len(self.widths)

    @cached_property
    def contributions(self) -> tuple[Contribution, ...]:
        """What each residual contributes, found by leaving it out."""
        if self.here.estimated or len(self.problem.rows) < 2:
            return ()
        sizes = self.point.scales.sizes
        return contributions(self.point.constrained, sizes, self.problem.rows, self.free)

    @cached_property
    def derivatives(self) -> DerivativeCheck:
        """A check of the derivatives against finite differences."""
        return check_derivatives(self.problem, self.values, self.here)

    @cached_property
    def suggestions(self) -> tuple[Suggestion, ...]:
        """What to do; each suggestion was tried out."""
        return remedies.advise(self)

    @cached_property
    def findings(self) -> tuple[Finding, ...]:
        """All findings, warnings first."""
        return report.findings(self)

    @property
    def warnings(self) -> tuple[Finding, ...]:
        """The findings that are warnings."""
        return tuple(finding for finding in self.findings if finding.warning)

    def assert_rank(self, rank: int) -> None:
        """Raise an AssertionError that names the null directions, unless the rank is `rank`."""
        if not self.here.finite:
            raise Undiagnosed(f"there is no rank: {self.findings[0].text}")
        if self.rank != rank:
            unseen = "; ".join(d.name for d in self.null_directions) or "none"
            raise Undiagnosed(f"the rank is {self.rank}, not {rank}; null directions: {unseen}")

    def assert_no_warnings(self) -> None:
        """Raise an AssertionError that lists the warnings, if there are any."""
        if self.warnings:
            raise Undiagnosed("; ".join(warning.text for warning in self.warnings))

    def __str__(self) -> str:
        return report.summary(self)

    def report(self) -> str:
        """Everything in words, section by section."""
        return report.report(self)

    def data(self) -> dict[str, Any]:
        """Everything as plain data, for JSON; `schema` and `version` say how to read it."""
        return data.as_data(self)
