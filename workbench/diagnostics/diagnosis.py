"""The Jacobian of a fit at one point: what it sees, what it cannot see, and what to do about it."""

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from workbench.blocks import Layout, Values
from workbench.diagnostics import conditioning, null_space, structure
from workbench.diagnostics.advice import advise
from workbench.diagnostics.derivatives import DerivativeCheck, check_derivatives
from workbench.diagnostics.findings import Finding, findings
from workbench.diagnostics.identifiability import (
    Contribution,
    Identifiability,
    contributions,
    identifiability,
)
from workbench.diagnostics.looked_at import not_finite, pattern_at, thick
from workbench.diagnostics.neighbourhood import Neighbourhood
from workbench.diagnostics.null_space import Direction
from workbench.diagnostics.point import Point
from workbench.diagnostics.rank_law import law_of
from workbench.diagnostics.report import report
from workbench.diagnostics.schema import as_data
from workbench.diagnostics.structure import Structure, TermBlock
from workbench.diagnostics.suggestion import State, Suggestion, state_of
from workbench.diagnostics.summary import summary
from workbench.errors import WorkbenchError
from workbench.problem import Linearization, Problem

Array = NDArray[np.float64]


class Undiagnosed(WorkbenchError, AssertionError):
    """An assertion about a diagnosis that does not hold."""


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """A problem at one point. Every part is computed when it is first asked for.

    What bounds and constraints forbid here counts as noticed: in rank, null directions and sigmas.
    What is hardly noticed is so relative to yardsticks: see `point`.

    `str` of it is a summary, `report()` everything in words, `data()` the same as JSON."""

    problem: Problem = field(repr=False)
    at: Values = field(repr=False)
    here: Linearization = field(repr=False)
    priors: tuple[str, ...] = ()  # residuals that are no data

    # Size and structure.

    @property
    def free(self) -> Layout:
        """The unknowns."""
        return self.problem.free

    @property
    def shape(self) -> tuple[int, int]:
        """(m, n)."""
        return self.here.shape

    @cached_property
    def point(self) -> Point:
        """What constraints hold here, and what each unknown is held against."""
        return Point(self.problem, self.at, self.here, self.priors)

    @cached_property
    def structure(self) -> Structure:
        """The pattern, taken apart; what bounds and constraints hold is part of it."""
        return structure.taken_apart(pattern_at(self.problem), self.point.held_pattern)

    @property
    def pattern(self) -> NDArray[np.bool_]:
        """(m, n): structurally nonzero."""
        return np.asarray(self.structure.pattern.toarray())

    @property
    def nonzeros(self) -> int:
        """Structural nonzeros."""
        return int(self.structure.pattern.nnz)

    @property
    def density(self) -> float:
        """Nonzeros over entries, 0 to 1."""
        return self.nonzeros / max(1, self.shape[0] * self.shape[1])

    @property
    def structural_rank(self) -> int:
        """Of any matrix with this pattern, at most."""
        return self.structure.rank

    @cached_property
    def thick(self) -> int:
        """How many entries are above a thousandth of their column's largest."""
        return thick(self.here)

    @property
    def row_edges(self) -> tuple[int, ...]:
        """Where each residual's rows begin, and m."""
        return (*(rows.start for rows in self.problem.rows.values()), self.problem.size)

    @cached_property
    def terms(self) -> tuple[TermBlock, ...]:
        """Residuals by blocks."""
        return structure.term_blocks(self.problem, self.structure, self.here)

    @cached_property
    def duplicates(self) -> tuple[tuple[str, str], ...]:
        """Pairs of residuals that say the same."""
        return structure.duplicates(self.problem, self.here) if self.here.finite else ()

    @cached_property
    def not_finite(self) -> tuple[tuple[int, int], ...]:
        """Rows and columns of entries that are NaN or infinite; column -1: of the residual."""
        return not_finite(self.here)

    # Rank, and what is not seen.

    @property
    def singular_values(self) -> Array:
        """Of the Jacobian, (min(m, n),), falling; in fewer directions where constraints hold."""
        return self.point.tied.reduced.spectrum.s

    @property
    def tolerance(self) -> float:
        """The singular value below which a direction counts as null_space."""
        return self.point.tied.reduced.spectrum.tolerance

    @property
    def rank(self) -> int:
        """How many directions the residuals notice here, or constraints forbid."""
        return self.point.tied.rank

    @property
    def noticed(self) -> int:
        """How many of the singular values are above the tolerance: the rank but for constraints."""
        return self.point.tied.reduced.spectrum.rank

    @property
    def condition(self) -> float:
        """Largest over smallest singular value; infinite without full column rank."""
        return self.state.condition

    @cached_property
    def state(self) -> State:
        """Unknowns, rank and condition."""
        return state_of(self.point.tied)

    @cached_property
    def scaled_singular_values(self) -> Array:
        """With every column of length 1."""
        return self.point.tied.stacked.singular_values

    @cached_property
    def scaled_rank(self) -> int:
        """The rank of the same."""
        s = self.scaled_singular_values
        relative = self.tolerance / max(float(self.singular_values.max(initial=0.0)), 1e-300)
        return int(np.sum(s > relative * s.max(initial=0.0)))

    @cached_property
    def nearby(self) -> Neighbourhood:
        """Rank and singular values at a few points around."""
        return Neighbourhood(self.point)

    @cached_property
    def null_directions(self) -> tuple[Direction, ...]:
        """What no residual notices, in names."""
        return null_space.null_directions(self.point, self.structure.pattern)

    @cached_property
    def weak_directions(self) -> tuple[Direction, ...]:
        """What changes the residuals by less than one sigma for a whole yardstick; weakest first.

        The vectors have length 1 once every unknown is measured by its own yardstick.
        """
        return null_space.weak_directions(self.point, self.structure.pattern)

    @property
    def hardly_seen(self) -> int:
        """How many directions change the residuals by less than a sigma for a whole yardstick."""
        return null_space.hardly_seen(self.point)

    @cached_property
    def rank_law(self) -> tuple[int, str] | None:
        """The rank that the tree predicts, and why; None unless only joints are looked at."""
        if self.point.held.any:
            return None
        return law_of(self.problem, self.at)

    # Conditioning.

    @cached_property
    def parallel_columns(self) -> tuple[conditioning.Pair, ...]:
        """Pairs of unknowns that do nearly the same."""
        return conditioning.parallel_columns(self.point.tied.stacked)

    @cached_property
    def parallel_rows(self) -> tuple[conditioning.Pair, ...]:
        """Pairs of rows that ask the same."""
        return conditioning.parallel_rows(self.here)

    @cached_property
    def turns(self) -> tuple[conditioning.Turn, ...]:
        """Of each joint that is seen to turn, how well about its best two axes."""
        return conditioning.turns(self.here, self.free, self.problem.trees)

    @cached_property
    def weakest(self) -> tuple[conditioning.Weakest, ...]:
        """Which few columns and rows the smallest singular values come from, by yardsticks."""
        return conditioning.weakest(self.point.measured)

    @cached_property
    def leverage(self) -> Array | None:
        """(m,) how much each row decides by itself."""
        return conditioning.leverage(self.point.tied.reduced)

    # What is known of each number.

    @cached_property
    def identifiability(self) -> Identifiability:
        """Sigmas, correlations, the data's share, a verdict per entry."""
        return identifiability(
            self.point.tied, self.point.is_prior, self.point.prior_sigma,
            self.point.yardsticks.sizes, self.structure.unread, self.structure.under.columns,
        )  # fmt: skip

    @cached_property
    def contributions(self) -> tuple[Contribution, ...]:
        """What each residual adds."""
        if self.here.estimated or len(self.problem.rows) < 2:
            return ()
        return contributions(self.point.tied, self.problem.rows, self.free)

    @cached_property
    def derivatives(self) -> DerivativeCheck:
        """Whether the Jacobian is right."""
        return check_derivatives(self.problem, self.at, self.here)

    # What to make of it.

    @cached_property
    def suggestions(self) -> tuple[Suggestion, ...]:
        """What to do, each carried out already."""
        return advise(self)

    @cached_property
    def findings(self) -> tuple[Finding, ...]:
        """Warnings first, then what is worth knowing."""
        return findings(self)

    @property
    def warnings(self) -> tuple[Finding, ...]:
        """The findings that are warnings."""
        return tuple(finding for finding in self.findings if finding.warning)

    def assert_rank(self, rank: int) -> None:
        """Raise an AssertionError that names what is not seen, unless the rank is `rank`."""
        if not self.here.finite:
            raise Undiagnosed(f"there is no rank: {self.findings[0].text}")
        if self.rank != rank:
            unseen = "; ".join(d.name for d in self.null_directions) or "nothing"
            raise Undiagnosed(f"the rank is {self.rank}, not {rank}; not seen: {unseen}")

    def assert_no_warnings(self) -> None:
        """Raise an AssertionError that lists the warnings, if there are any."""
        if self.warnings:
            raise Undiagnosed("; ".join(warning.text for warning in self.warnings))

    def __str__(self) -> str:
        return summary(self)

    def report(self) -> str:
        """Everything in words, section by section."""
        return report(self, self.findings, self.suggestions)

    def data(self) -> dict[str, Any]:
        """Everything as plain data, for JSON; `schema` and `version` say how to read it."""
        return as_data(self, self.findings, self.suggestions)
