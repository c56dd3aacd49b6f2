"""The diagnosis of a long sequence of frames, in time and memory in proportion to the frames."""

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from scipy.sparse import csc_array

from workbench.arrays import Array, Index, Mask
from workbench.blocks import Layout, Values
from workbench.diagnostics.diagnosis import Diagnosis
from workbench.diagnostics.diagnosis_of import diagnosis_of
from workbench.diagnostics.elimination import Elimination
from workbench.diagnostics.frame_rows import FrameRows, frames_of_rows
from workbench.diagnostics.gauges import Gauge
from workbench.diagnostics.identifiability import prior_sigma
from workbench.diagnostics.linearized import check_finite, linearized, not_finite
from workbench.diagnostics.null_space import WEAK
from workbench.diagnostics.scales import Scales as Yardsticks
from workbench.diagnostics.scales import scales as yardsticks
from workbench.diagnostics.sequence_names import NullDirections, named
from workbench.diagnostics.single_frames import SingleFrames
from workbench.diagnostics.sparse_bases import FRESH
from workbench.diagnostics.wording import Finding, Undiagnosed, Wording
from workbench.problem import Linearization, Problem
from workbench.problem.nonzeros import columns_of_nonzeros


@dataclass(frozen=True, eq=False)
class SharedUnknowns:
    """b unknowns, seen by T frames.

    The rows of frame t are J_t x_t + B_t s. What the frame's own unknowns x_t can undo is projected
    out of them by P_t, which is at right angles to the range of J_t. Unknown i is *seen* in frame t
    where the length of column i of P_t B_t is above the tolerance of the rank; it is seen *well*
    where a whole yardstick of it changes P_t B_t s by at least one sigma.

    Attributes:
        layout: the shared unknowns.
        yardsticks: what changes of them are compared with.
        seen: (T, b) in which frames each unknown is seen.
        well: (T, b) in which frames each unknown is seen well.
        sigma: (b,) posterior standard deviations by all residuals; infinite where not identified.
        ranks: by block, its rank once all other unknowns are eliminated.
    """

    layout: Layout
    yardsticks: Yardsticks
    seen: Mask
    well: Mask
    sigma: Array
    ranks: dict[str, int]

    @staticmethod
    def of(
        rows: FrameRows, layout: Layout, sizes: Yardsticks, sigma: Array, null_vectors: csc_array
    ) -> "SharedUnknowns":
        """The shared unknowns of a sequence's rows and its null vectors (n, d)."""
        lengths = np.array(
            [
                _beside(R, len(own), rows.tolerance)
                for own, R in zip(rows.own, rows.triangles, strict=True)
            ]
        ).reshape(rows.count, len(rows.shared))
        per_unit = lengths * rows.lengths[rows.shared] * sizes.sizes
        hidden = null_vectors.tocsr()[rows.shared].toarray()
        ranks = {name: at.stop - at.start - _rank(hidden[at]) for name, at in layout.slices.items()}
        seen = lengths > rows.tolerance
        return SharedUnknowns(layout, sizes, seen, seen & (per_unit >= WEAK), sigma, ranks)

    @property
    def frames_seen(self) -> Index:
        """In how many frames each unknown is seen, (b,)."""
        return np.asarray(self.seen.sum(axis=0), dtype=np.int64)

    @property
    def frames_well(self) -> Index:
        """In how many frames each unknown is seen well, (b,)."""
        return np.asarray(self.well.sum(axis=0), dtype=np.int64)


@dataclass(frozen=True, eq=False)
class SequenceDiagnosis:
    """A sequence at one point. Every part is computed when it is first asked for.

    The unknowns of one frame after another are eliminated (`Elimination`), so that nothing is as
    large as the square of the number of unknowns. The rank and the null space are those of the
    Jacobian with columns of length 1, whose singular values count as zero up to eps max(m, n) times
    the largest. Bounds and constraints are ignored: what they forbid counts as free.

    `str` gives a summary, `report()` everything in words, `data()` the same as JSON, and
    `frame(t)` the full diagnosis of one frame by itself.

    Attributes:
        problem: the sequence.
        values: the values of all blocks that it reads.
        here: its linearization at these values; columns that hold only rounding errors are zero.
        wording: the functions that put it into words.
        priors: the names of the residuals that are priors, not data.
        gauges: motions that were declared to be gauges.
    """

    problem: Problem = field(repr=False)
    values: Values = field(repr=False)
    here: Linearization = field(repr=False)
    wording: "Wording[SequenceDiagnosis]" = field(repr=False)
    priors: tuple[str, ...] = ()
    gauges: tuple[Gauge, ...] = field(default=(), repr=False)

    @property
    def free(self) -> Layout:
        """The layout of the unknowns."""
        return self.problem.free

    @property
    def shape(self) -> tuple[int, int]:
        """(m, n), rows and unknowns."""
        return self.here.shape

    @cached_property
    def frames(self) -> SingleFrames:
        """The frames one by one."""
        return SingleFrames(self.problem, self.values)

    @property
    def count(self) -> int:
        """T, the number of frames."""
        return self.frames.count

    def frame(self, t: int) -> Diagnosis:
        """Frame t by itself, with the shared unknowns free too.

        Raises BadArgument for a frame that is not there or has no residuals of its own.
        """
        problem, values = self.frames.alone(t)
        priors = tuple(name for name in self.priors if name in problem.rows)
        return diagnosis_of(problem, values, linearized(problem, values), priors)

    @cached_property
    def not_finite(self) -> tuple[tuple[int, int], ...]:
        """Rows and columns of entries that are NaN or infinite; column -1 means the residual."""
        return not_finite(self.here)

    # Rank and null directions.

    @cached_property
    def rows(self) -> FrameRows:
        """The rows of each frame, and those between frames, in columns of length 1.

        Raises NotFinite, and so does everything that is computed from them.
        """
        check_finite(self.here)
        return FrameRows.of(self.here, frames_of_rows(self.problem.residuals))

    @cached_property
    def eliminated(self) -> Elimination:
        """The unknowns eliminated frame after frame."""
        return Elimination.of(self.rows)

    @property
    def tolerance(self) -> float:
        """The tolerance for singular values of the Jacobian with columns of length 1."""
        return self.rows.tolerance

    @property
    def rank(self) -> int:
        """How many independent directions change a residual."""
        return self.eliminated.rank

    @cached_property
    def null_vectors(self) -> csc_array:
        """(n, n - rank): a basis of the null space, in the unknowns' own units.

        Each vector has length 1; most of them move a single frame.
        """
        found = self.eliminated.null_vectors
        columns = columns_of_nonzeros(found)
        numbers = found.data / self.rows.lengths[found.indices]
        sizes = np.sqrt(np.bincount(columns, numbers**2, minlength=found.shape[1]))
        return csc_array((numbers / sizes[columns], found.indices, found.indptr), found.shape)

    @cached_property
    def null_directions(self) -> tuple[NullDirections, ...]:
        """The null directions with names, gathered over the frames that share them."""
        return named(self.null_vectors, self.frames, self.gauges)

    # What is known about each unknown.

    @cached_property
    def sigma(self) -> Array:
        """Posterior standard deviations (n,), infinite for unknowns that a null direction moves."""
        return self.eliminated.deviations(self.rows.lengths)

    @cached_property
    def shared(self) -> SharedUnknowns:
        """What is known about the unknowns that all frames share, and in how many they are seen."""
        layout, border = self.frames.shared, self.rows.shared
        read = np.diff(self.rows.rest.indptr) > 0
        at = np.flatnonzero(self.problem.rows_named(self.priors) & read)
        part = self.rows.rest[at][:, border].toarray() * self.rows.lengths[border]
        reads = np.asarray(part.any(axis=1))
        prior = prior_sigma(Linearization(np.zeros(len(part)), part), reads)
        sizes = yardsticks(layout, self.problem.known.values(), self.values, prior)
        return SharedUnknowns.of(self.rows, layout, sizes, self.sigma[border], self.null_vectors)

    @cached_property
    def largest_sigma(self) -> dict[str, Array]:
        """By block, the largest sigma of its entries in each frame (T,), 0 where none is free."""
        return {name: np.maximum(most, 0.0) for name, most in self._largest(self.sigma).items()}

    def _largest(self, numbers: Array) -> dict[str, Array]:
        """By block, the largest of its numbers (n,) in each frame (T,), -1 where none is free."""
        frame_of, place = self.frames.places
        found = {}
        for name, at in self.frames.layout.slices.items():
            some = np.flatnonzero((frame_of >= 0) & (place >= at.start) & (place < at.stop))
            found[name] = np.full(self.count, -1.0)
            np.maximum.at(found[name], frame_of[some], numbers[some])
        return found

    @cached_property
    def blind(self) -> dict[str, tuple[int, ...]]:
        """By block, the frames where it is free but whose own residuals do not depend on it."""
        length = np.zeros(self.shape[1])
        for own, R in zip(self.rows.own, self.rows.triangles, strict=True):
            length[own] = np.linalg.norm(R[:, : len(own)], axis=0)
        return {
            name: tuple(np.flatnonzero((most >= 0) & (most <= self.tolerance)).tolist())
            for name, most in self._largest(length).items()
        }

    @cached_property
    def missing(self) -> dict[str, tuple[int, ...]]:
        """By name of a residual of single frames, the frames that have none of that name."""
        found = {}
        for residual in self.problem.residuals:
            absent = sorted(set(range(self.count)) - {t for t, _ in residual.by_frame})
            if residual.by_frame and absent:
                found[residual.name] = tuple(absent)
        return found

    @property
    def between(self) -> tuple[str, ...]:
        """The residuals that couple frames."""
        known = self.problem.known
        return tuple(
            r.name
            for r in self.problem.residuals
            if not r.by_frame and any(known[name].framed for name in r.reads)
        )

    # Conclusions.

    @cached_property
    def findings(self) -> tuple[Finding, ...]:
        """Warnings first, then what is worth knowing."""
        return self.wording.findings(self)

    @property
    def warnings(self) -> tuple[Finding, ...]:
        """The findings that are warnings."""
        return tuple(finding for finding in self.findings if finding.warning)

    def assert_rank(self, rank: int) -> None:
        """Raise an AssertionError that names what is not seen, unless the rank is `rank`."""
        if not self.here.finite:
            raise Undiagnosed(f"there is no rank: {self.findings[0].text}")
        if self.rank != rank:
            unseen = "; ".join(d.described(self.count) for d in self.null_directions) or "none"
            raise Undiagnosed(f"the rank is {self.rank}, not {rank}; null directions: {unseen}")

    def assert_no_warnings(self) -> None:
        """Raise an AssertionError that lists the warnings, if there are any."""
        if self.warnings:
            raise Undiagnosed("; ".join(warning.text for warning in self.warnings))

    def __str__(self) -> str:
        return self.wording.summary(self)

    def report(self) -> str:
        """Everything in words, section by section."""
        return self.wording.report(self)

    def data(self) -> dict[str, Any]:
        """Everything as plain data, for JSON; `schema` and `version` say how to read it."""
        return self.wording.data(self)


def _beside(R: Array, own: int, tolerance: float) -> Array:
    """The lengths of the columns of P B, R = [J B] with `own` columns in J."""
    U, s, _ = np.linalg.svd(R[:, :own], full_matrices=False)
    U = U[:, s > tolerance]
    B = R[:, own:]
    return np.asarray(np.linalg.norm(B - U @ (U.T @ B), axis=0))


def _rank(A: Array) -> int:
    """The rank of parts of vectors of length 1."""
    return int(np.sum(np.linalg.svd(A, compute_uv=False) > FRESH)) if A.size else 0
