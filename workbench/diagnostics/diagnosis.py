"""The diagnosis of a problem at one point: its rank, null directions, and what to do about them."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from workbench.arrays import Array, Mask
from workbench.blocks import Layout, Values
from workbench.blocks.checks import several, texts
from workbench.diagnostics import conditioning, data, null_space, remedies, report, structure
from workbench.diagnostics.active_set import (
    MANY_UNKNOWNS,
    ActiveSet,
    ConstrainedJacobian,
    active_set_at,
    linearized,
    not_finite,
    pattern_at,
    points_nearby,
)
from workbench.diagnostics.derivatives import DerivativeCheck, check_derivatives
from workbench.diagnostics.gauges import Gauge
from workbench.diagnostics.identifiability import (
    Contribution,
    Identifiability,
    contributions,
    identifiability,
    sigma_of_priors,
)
from workbench.diagnostics.null_space import Direction
from workbench.diagnostics.rank_law import law_of
from workbench.diagnostics.remedies import RankAndCondition, Suggestion, rank_and_condition
from workbench.diagnostics.report import Finding
from workbench.diagnostics.scales import Scales, checked, scales
from workbench.diagnostics.sparse_jacobian import SparseJacobian
from workbench.diagnostics.structure import Structure, TermBlock
from workbench.errors import BadArgument, WorkbenchError
from workbench.problem import Linearization, Problem
from workbench.problem.storage import check_wide, is_long
from workbench.threads import limited_threads

if TYPE_CHECKING:
    from workbench.diagnostics.sequences import SequenceDiagnosis


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
        given_scales: by block, the characteristic scales that a caller said.
    """

    problem: Problem = field(repr=False)
    values: Values = field(repr=False)
    here: Linearization = field(repr=False)
    priors: tuple[str, ...] = ()
    gauges: tuple[Gauge, ...] = field(default=(), repr=False)
    given_scales: Values = field(default_factory=dict, repr=False)

    @property
    def free(self) -> Layout:
        """The layout of the unknowns."""
        return self.problem.free

    @property
    def shape(self) -> tuple[int, int]:
        """(m, n), rows and unknowns."""
        return self.here.shape

    @cached_property
    def active(self) -> ActiveSet:
        """The bounds and constraints that are active here."""
        return active_set_at(self.problem, self.values)

    @cached_property
    def constrained(self) -> ConstrainedJacobian:
        """The Jacobian under the active bounds and constraints."""
        return ConstrainedJacobian(self.here, self.active.rows)

    @cached_property
    def scales(self) -> Scales:
        """The characteristic scale of each unknown."""
        return scales(
            self.free,
            self.problem.known.values(),
            self.values,
            self.prior_sigma,
            self.given_scales,
            of_people=bool(self.problem.trees),
        )

    @cached_property
    def measured(self) -> ConstrainedJacobian:
        """The constrained Jacobian with every unknown in units of its scale."""
        return self.constrained.measured(self.scales.sizes)

    @cached_property
    def sparse(self) -> SparseJacobian | None:
        """The same by a sparse factorization; None where there are singular values instead."""
        sparse = self.constrained.sparse
        return None if sparse is None else sparse.scaled(self.scales.sizes)

    @cached_property
    def is_prior(self) -> Mask:
        """Which rows are priors, (m,)."""
        return self.problem.rows_named(self.priors)

    @cached_property
    def prior_sigma(self) -> Array:
        """Standard deviations by the priors alone (n,), infinite where they say nothing."""
        if not self.here.finite:
            return np.full(self.shape[1], np.inf)
        return sigma_of_priors(self.here, self.is_prior)

    @cached_property
    def points_nearby(self) -> tuple[tuple[Array, ConstrainedJacobian], ...]:
        """Points x (n,) near this one, and the constrained Jacobian at each."""
        pattern, sizes = self.structure.pattern, self.scales.sizes
        return points_nearby(self.problem, self.values, self.active, pattern, sizes)

    @cached_property
    def structure(self) -> Structure:
        """The decomposition of the pattern; active bounds and constraints are part of it."""
        return structure.decomposed(pattern_at(self.problem), self.active.pattern(self.problem))

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
    def rows(self) -> dict[str, slice]:
        """The rows of each residual, followed by those of active bounds and constraints."""
        m, of_residuals = self.shape[0], dict(self.problem.rows)
        names = enumerate(self.active.names, m)
        return of_residuals | {name: slice(i, i + 1) for i, name in names}

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
    def singular_values(self) -> Array:
        """The singular values of the (reduced) Jacobian, (min(m, n),), falling.

        Of a `sparse` Jacobian nothing else asks for them. Raises TooLarge above 4,000 unknowns.
        """
        return self.constrained.reduced.spectrum.s

    @property
    def tolerance(self) -> float:
        """The singular value below which a direction counts as null."""
        if self.sparse is not None:
            return self.constrained.tolerance
        return self.constrained.reduced.spectrum.tolerance

    @property
    def rank(self) -> int:
        """How many independent directions change a residual or are forbidden by constraints."""
        return self.constrained.rank

    @property
    def reduced_rank(self) -> int:
        """How many singular values are above the tolerance: the rank without constraints' part."""
        return self.constrained.reduced.spectrum.rank

    @property
    def condition(self) -> float:
        """Largest over smallest singular value; infinite without full column rank."""
        return self.state.condition

    @cached_property
    def state(self) -> RankAndCondition:
        """Unknowns, rank and condition."""
        return rank_and_condition(self.constrained)

    @cached_property
    def ranks_nearby(self) -> tuple[int, ...]:
        """The rank at a few random points, a tenth of a scale away in each entry.

        None of a problem with many unknowns, or of a sparse Jacobian.
        """
        if self.here.estimated or self.free.size > MANY_UNKNOWNS:
            return ()
        return tuple(near.measured(self.scales.sizes).rank for _, near in self.points_nearby)

    @cached_property
    def null_directions(self) -> tuple[Direction, ...]:
        """The directions that change no residual, with their names."""
        return null_space.null_directions(self)

    @cached_property
    def weak_directions(self) -> tuple[Direction, ...]:
        """Directions along which a scale changes residuals by less than a sigma, weakest first.

        The vectors have length 1 once every unknown is measured by its own scale. Of a
        `sparse` Jacobian these are the weakest 12.
        """
        return null_space.weak_directions(self)

    @cached_property
    def weak_count(self) -> int:
        """How many directions change the residuals by less than a sigma per scale."""
        if self.sparse is not None:
            with limited_threads():
                return self.sparse.count_below(null_space.WEAK)
        s = self.measured.reduced.spectrum.s[: self.reduced_rank]
        return int(np.sum(s < null_space.WEAK))

    @cached_property
    def rank_law(self) -> tuple[int, str] | None:
        """The rank that the tree predicts, and why; None unless only joints are observed."""
        if self.active.any:
            return None
        return law_of(self.problem, self.values)

    @cached_property
    def parallel_columns(self) -> tuple[conditioning.ParallelPair, ...]:
        """Pairs of unknowns whose columns are nearly parallel."""
        return conditioning.parallel_columns(self.constrained.stacked)

    @cached_property
    def weakest(self) -> tuple[conditioning.WeakestDirection, ...]:
        """The directions of the smallest nonzero singular values, in scales."""
        return conditioning.weakest(self)

    @cached_property
    def identifiability(self) -> Identifiability:
        """Standard deviations, correlations, the data's share, and what is identified."""
        return identifiability(
            self.constrained,
            self.is_prior,
            self.prior_sigma,
            self.scales.sizes,
            self.structure.unread,
            self.structure.under.columns,
        )

    @cached_property
    def null_in_scales(self) -> Array:
        """(n, d) an orthonormal basis of the null space, with unknowns in characteristic scales.

        The dimension is that of the Jacobian in the unknowns' own units, which decides the rank.
        """
        if self.measured.rank == self.rank:
            return self.measured.null
        return np.asarray(np.linalg.qr(self.constrained.null / self.scales.sizes[:, None])[0])

    @cached_property
    def contributions(self) -> tuple[Contribution, ...]:
        """What each residual contributes, found by leaving it out."""
        if self.here.estimated or len(self.problem.rows) < 2:
            return ()
        sizes = self.scales.sizes
        return contributions(self.constrained, sizes, self.problem.rows, self.free)

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
            names = "; ".join(d.name for d in self.null_directions) or "none"
            raise Undiagnosed(f"the rank is {self.rank}, not {rank}; null directions: {names}")

    def assert_no_warnings(self) -> None:
        """Raise an AssertionError that lists the warnings, if there are any."""
        if self.warnings:
            raise Undiagnosed("; ".join(warning.text for warning in self.warnings))

    def __str__(self) -> str:
        return "\n".join(report.summary(self))

    def report(self) -> str:
        """Everything in words, section by section."""
        return report.report(self)

    def data(self) -> dict[str, Any]:
        """Everything as plain data, for JSON; `schema` and `version` say how to read it."""
        return data.as_data(self)


def diagnose(
    problem: Problem,
    at: Mapping[str, ArrayLike],
    *,
    priors: str | Iterable[str] = (),
    gauges: Iterable[Gauge] = (),
    scales: Mapping[str, ArrayLike] | None = None,
) -> "Diagnosis | SequenceDiagnosis":
    """Diagnose a problem by its whitened Jacobian at the values `at`.

    For a long sequence of frames, with more than 4,000 unknowns, the result is a SequenceDiagnosis:
    it answers the same questions about rank and null directions, frame after frame, and has no
    singular values. For any other problem it is a Diagnosis, which has none either where the
    Jacobian is large and sparse: it is factorized instead.

    Contacts with a scan, which are chosen anew at every point, are held as they are at `at`.

    `priors` are the names of the residuals that are priors and not data, or one such name; the
    diagnosis separates what they contribute. `gauges` are motions that the problem is invariant to
    if other unknowns undo them, and that the diagnosis does not find by itself; see `Gauge`.

    `scales` say how large a change of the unknowns of a block matters, in its unit and of its shape
    or as one number: `{"radius": 7e6}`. What is called weak or identified is compared with them,
    and suggested priors are as wide. Without them they are chosen as the module `scales` says.

    Raises UnknownName for a name that no residual has, or no free block, BadArgument for anything
    but a problem, TooLarge where the factor of a sparse Jacobian would have more than 5e7 entries,
    or its null space is too large, and whatever `Problem.split` raises for the values.
    """
    from workbench.diagnostics.sequences import SequenceDiagnosis  # which diagnoses frames

    d = _of(problem, at, priors, gauges, scales)
    if not is_long(d.here.jacobian):
        return _small_enough(d)
    if d.given_scales:
        raise BadArgument("a long sequence of frames chooses its own scales; leave them out")
    return SequenceDiagnosis(d.problem, d.values, d.here, d.priors, d.gauges)


def diagnose_whole(
    problem: Problem,
    at: Mapping[str, ArrayLike],
    *,
    priors: str | Iterable[str] = (),
    gauges: Iterable[Gauge] = (),
    scales: Mapping[str, ArrayLike] | None = None,
) -> Diagnosis:
    """A diagnosis with singular values. Raises TooLarge for a long sequence."""
    return _small_enough(_of(problem, at, priors, gauges, scales))


def _of(
    problem: Problem,
    at: Mapping[str, ArrayLike],
    priors: str | Iterable[str],
    gauges: Iterable[Gauge],
    scales: Mapping[str, ArrayLike] | None,
) -> Diagnosis:
    if not isinstance(problem, Problem):
        raise BadArgument(f"a Problem is diagnosed, not something of type {type(problem).__name__}")
    names = texts("the names of priors", priors)
    problem.rows_named(names)
    declared = several("gauges", gauges, Gauge, BadArgument)
    problem = problem.frozen(at)
    here = linearized(problem, at)  # looks at every value
    return Diagnosis(
        problem, problem.read(at), here, names, declared, checked(scales, problem.free)
    )


def _small_enough(d: Diagnosis) -> Diagnosis:
    if d.here.by_frames:
        check_wide(d.here.jacobian)
    if d.here.finite and d.here.estimated:
        _ = d.rank  # raises TooLarge at once, and not at the first question
    return d
