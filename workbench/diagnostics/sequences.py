"""The diagnosis of a long sequence of frames, in time and memory in proportion to the frames."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from scipy.sparse import csc_array

from workbench.arrays import Array, Index
from workbench.blocks import Block, Layout, Tree, Values
from workbench.diagnostics.active_set import check_finite, linearized, not_finite
from workbench.diagnostics.data import plain
from workbench.diagnostics.diagnosis import Diagnosis, Undiagnosed
from workbench.diagnostics.elimination import Elimination, FrameRows, frames_of_rows
from workbench.diagnostics.gauges import Gauge
from workbench.diagnostics.report import Finding, listed
from workbench.diagnostics.sequence_names import NullDirections, named
from workbench.diagnostics.words import counted, sections, table
from workbench.errors import BadArgument, some_of
from workbench.problem import Linearization, Problem
from workbench.problem.sparsity import columns_of_nonzeros

SCHEMA = "workbench.sequence-diagnosis"
VERSION = 3  # raised when a key is removed or changes its meaning; new keys do not raise it
FEW_FRAMES = 0.1  # of all: a shared unknown that at most so many see causes a warning
MOST_RUNS = 5  # of frames that are listed


@dataclass(frozen=True, eq=False)
class SingleFrames:
    """The frames of a sequence, one by one.

    Attributes:
        problem: the sequence.
        values: the values of all blocks that it reads.
    """

    problem: Problem
    values: Values

    @cached_property
    def count(self) -> int:
        """T, the number of frames."""
        return max((b.shape[0] for b in self.problem.known.values() if b.framed), default=0)

    @cached_property
    def layout(self) -> Layout:
        """The blocks of one frame of which anything is free in any frame."""
        blocks = [block.base for block in self.problem.free.blocks if block.base.framed]
        return Layout(tuple(Block(b.name, b.shape[1:], b.unit, b.labels) for b in blocks))

    @cached_property
    def shared(self) -> Layout:
        """The unknowns that all frames share."""
        return Layout(tuple(b for b in self.problem.free.blocks if not b.base.framed))

    @cached_property
    def places(self) -> tuple[Index, Index]:
        """The frame of each unknown (n,), -1 if it is shared, and its place in that layout."""
        free = self.problem.free
        frame, place = np.full(free.size, -1), np.zeros(free.size, dtype=np.int64)
        for block in free.blocks:
            part, entries = free.slices[block.name], np.array(block.places, dtype=np.int64)
            if block.base.framed:
                size = block.base.size // block.base.shape[0]
                frame[part] = entries // size
                place[part] = self.layout.slices[block.name].start + entries % size
            else:
                start = self.shared.slices[block.name].start
                place[part] = np.arange(start, start + block.size)
        return frame, place

    @cached_property
    def trees(self) -> tuple[Tree, ...]:
        """The kinematic trees of the bodies whose points single frames read."""
        of_frames = {id(one): one for r in self.problem.residuals for _, one in r.by_frame}
        trees = (points.source.tree for one in of_frames.values() for points in one.points)
        return tuple({tree.places: tree for tree in trees if tree is not None}.values())

    def alone(self, t: int) -> tuple[Problem, Values]:
        """Frame t as a problem, with the shared unknowns free too, and its values.

        What is between frames is left out; what reads shared blocks alone is part of it. Raises
        BadArgument for a frame that is not there, or that has no residual of its own.
        """
        if not 0 <= t < self.count:
            raise BadArgument(f"there is no frame {t}: the {self.count} frames count from 0")
        own = [one for r in self.problem.residuals for s, one in r.by_frame if s == t]
        if not own:
            raise BadArgument(f"frame {t} has no residuals of its own, and so no diagnosis")
        known = self.problem.known
        others = [r for r in self.problem.residuals if not r.by_frame]
        of_shared = [r for r in others if not any(known[name].framed for name in r.reads)]
        whole = Problem([*own, *of_shared], ())
        frame, place = self.places
        spelled = (*self.layout.chosen(place[frame == t]).spelled(), *self.shared.spelled())
        names = [name for name in spelled if name.partition("[")[0] in whole.known]
        values = {
            name: self.values[name][t] if known[name].framed else self.values[name]
            for name in whole.known
        }
        return whole.freeing(*names), values


@dataclass(frozen=True, eq=False)
class SharedUnknowns:
    """b unknowns that T frames share.

    The rows of frame t are J_t x_t + B_t s. Unknown i is *seen* in frame t where column i of B_t is
    not in the range of J_t, so that the frame's own unknowns cannot undo it.

    Attributes:
        layout: the shared unknowns.
        frames_seen: (b,) in how many frames each unknown is seen.
        sigma: (b,) posterior standard deviations by all residuals; infinite where not identified.
    """

    layout: Layout
    frames_seen: Index
    sigma: Array


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
        priors: the names of the residuals that are priors, not data.
        gauges: motions that were declared to be gauges.
    """

    problem: Problem = field(repr=False)
    values: Values = field(repr=False)
    here: Linearization = field(repr=False)
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
        return Diagnosis(problem, values, linearized(problem, values), priors)

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
        V = self.eliminated.null_vectors
        columns = columns_of_nonzeros(V)
        entries = V.data / self.rows.lengths[V.indices]
        lengths = np.sqrt(np.bincount(columns, entries**2, minlength=V.shape[1]))
        return csc_array((entries / lengths[columns], V.indices, V.indptr), V.shape)

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
        layout, rows = self.frames.shared, self.rows
        lengths = [
            _lengths_not_undone(R, len(own), rows.tolerance)
            for own, R in zip(rows.own, rows.triangles, strict=True)
        ]
        seen = np.array(lengths).reshape(self.count, layout.size) > rows.tolerance
        return SharedUnknowns(layout, seen.sum(axis=0), self.sigma[rows.shared])

    @cached_property
    def largest_sigma(self) -> dict[str, Array]:
        """By block, the largest sigma of its entries in each frame (T,), 0 where none is free."""
        frame_of, place = self.frames.places
        largest = {}
        for name, part in self.frames.layout.slices.items():
            own = np.flatnonzero((frame_of >= 0) & (place >= part.start) & (place < part.stop))
            largest[name] = np.zeros(self.count)
            np.maximum.at(largest[name], frame_of[own], self.sigma[own])
        return largest

    @property
    def between(self) -> tuple[str, ...]:
        """The residuals that couple frames."""
        known = self.problem.known
        return tuple(
            r.name
            for r in self.problem.residuals
            if not r.by_frame and any(known[name].framed for name in r.reads)
        )

    # In words and as data.

    @cached_property
    def findings(self) -> tuple[Finding, ...]:
        """Warnings first, then what is worth knowing."""
        return tuple(sorted(self._unsorted_findings(), key=lambda finding: not finding.warning))

    def _unsorted_findings(self) -> Iterator[Finding]:
        n, T = self.shape[1], self.count
        if not self.here.finite:
            label = self.problem.row_label
            rows = [label(int(i)) for i in np.flatnonzero(~np.isfinite(self.here.residual))]
            entries = (f"{label(i)} by {self.free.label(j)}" for i, j in self.here.not_finite)
            yield Finding("values", f"not finite: {some_of([*rows, *entries])}")
            return
        if self.rank < n:
            yield Finding("rank", f"{n - self.rank} of {n} directions change no residual")
        for i, count in enumerate(self.shared.frames_seen):
            if count == T:
                continue
            text = f"{self.shared.layout.label(i)} is seen in {count} of {T} frames"
            if not count and np.isfinite(self.shared.sigma[i]):
                text += ": only residuals that belong to no single frame determine it"
            yield Finding("shared", text, bool(count <= FEW_FRAMES * T))
        if self.problem.bounded or self.problem.constraints:
            text = "bounds and constraints are ignored in a sequence of this size"
            yield Finding("rank", text, False)

    @property
    def warnings(self) -> tuple[Finding, ...]:
        """The findings that are warnings."""
        return tuple(finding for finding in self.findings if finding.warning)

    def assert_rank(self, rank: int) -> None:
        """Raise an AssertionError that names what is not seen, unless the rank is `rank`."""
        if not self.here.finite:
            raise Undiagnosed(f"there is no rank: {self.findings[0].text}")
        if self.rank != rank:
            names = [direction.described(self.count) for direction in self.null_directions]
            null = "; ".join(names) or "none"
            raise Undiagnosed(f"the rank is {self.rank}, not {rank}; null directions: {null}")

    def assert_no_warnings(self) -> None:
        """Raise an AssertionError that lists the warnings, if there are any."""
        if self.warnings:
            raise Undiagnosed("; ".join(warning.text for warning in self.warnings))

    def __str__(self) -> str:
        if not self.here.finite:
            return "\n".join([*self._size(), *(finding.text for finding in self.findings)])
        rank = f"numerical rank {self.rank} of {self.shape[1]}"
        others = [finding.text for finding in self.findings if finding.part != "rank"]
        return "\n".join([*self._size(), rank, *(self._null() or ["full rank"]), *others])

    def report(self) -> str:
        """Everything in words, section by section."""
        parts: list[tuple[str, Iterable[str]]] = [
            ("findings", listed(self.findings)),
            ("size", self._size()),
        ]
        if self.here.finite:
            parts += [
                ("rank", self._ranks()),
                ("null directions", self._null()),
                ("shared unknowns", self._shared_unknowns()),
                ("frames", self._frames()),
            ]
        return sections(parts)

    def _size(self) -> list[str]:
        m, n = self.shape
        shared = self.frames.shared.size
        each = f"{self.count} frames"
        each += f", {counted(shared, 'shared unknown')}" if shared else ""
        coupled = "frames are coupled by " if self.between else "nothing couples frames"
        return [f"Jacobian {m} x {n}: {each}", coupled + " and ".join(self.between)]

    def _ranks(self) -> Iterator[str]:
        columns = f"columns of length 1; tolerance {self.tolerance:.1e}"
        yield f"numerical rank {self.rank} of {self.shape[1]}, {columns}"

    def _null(self) -> list[str]:
        missing = self.shape[1] - self.rank
        if not missing:
            return []
        title = f"{counted(missing, 'null direction')} (no residual changes along them):"
        return [title, *(f"  {one.described(self.count)}" for one in self.null_directions)]

    def _shared_unknowns(self) -> Iterator[str]:
        known, T = self.shared, self.count
        if not known.layout.size:
            return
        yield "a frame sees an unknown if its own unknowns cannot undo a change of it"
        rows = [
            (
                known.layout.label(i),
                f"{known.frames_seen[i]} of {T}",
                f"{known.sigma[i]:.3g}",
                known.layout.unit(i),
            )
            for i in range(known.layout.size)
        ]
        yield from table(("unknown", "frames that see it", "sigma", "unit"), rows)

    def _frames(self) -> list[str]:
        rows = []
        for name, sigma in self.largest_sigma.items():
            known = np.where(np.isfinite(sigma), sigma, 0.0)
            largest = f"{known.max():.3g} ({int(np.argmax(known))})" if known.any() else "-"
            unknown = np.flatnonzero(np.isinf(sigma)).tolist()
            rows.append((name, largest, self.free[name].unit, frames_in_words(unknown, self.count)))
        header = ("block", "largest sigma (frame)", "unit", "not fully identified in")
        return table(header, rows, numbers=(1,))

    def data(self) -> dict[str, Any]:
        """Everything as plain data, for JSON; `schema` and `version` say how to read it."""
        data: dict[str, Any] = {
            "schema": SCHEMA,
            "version": VERSION,
            "finite": self.here.finite,
            "shape": self.shape,
            "frames": self.count,
            "blocks": [
                {"name": b.name, "shape": b.shape, "unit": b.unit, "shared": not b.base.framed}
                for b in self.free.blocks
            ],
            "residuals": [
                {
                    "name": r.name,
                    "rows": r.size,
                    "unit": r.unit,
                    "prior": r.name in self.priors,
                    "frames": len({t for t, _ in r.by_frame}),
                    "between": r.name in self.between,
                }
                for r in self.problem.residuals
            ],
            "findings": [vars(finding) for finding in self.findings],
        }
        if self.here.finite:
            data |= self._numbers()
        return plain(data)  # type: ignore[no-any-return]

    def _numbers(self) -> dict[str, Any]:
        known = self.shared
        return {
            "rank": self.rank,
            "tolerance": self.tolerance,
            "null_directions": [
                {"directions": one.count, **vars(one)} for one in self.null_directions
            ],
            "shared": [
                {
                    "name": known.layout.label(i),
                    "unit": known.layout.unit(i),
                    "frames_seen": known.frames_seen[i],
                    "sigma": known.sigma[i],
                }
                for i in range(known.layout.size)
            ],
            "largest_sigma": self.largest_sigma,
        }


def frames_in_words(frames: Iterable[int], total: int) -> str:
    """`3 of 40 frames (0 to 1, 7)`."""
    ts = np.array(list(frames), dtype=np.int64)
    if not ts.size:
        return "no frame"
    runs = np.split(ts, np.flatnonzero(np.diff(ts) > 1) + 1)
    named = [str(run[0]) if run.size == 1 else f"{run[0]} to {run[-1]}" for run in runs]
    more = ", ..." if len(named) > MOST_RUNS else ""
    where = f" ({', '.join(named[:MOST_RUNS])}{more})" if ts.size < total else ""
    return f"{ts.size} of {total} frames{where}"


def _lengths_not_undone(R: Array, own: int, tolerance: float) -> Array:
    """The lengths of what B lies outside of the range of J, R = [J B] with `own` columns in J."""
    U, s, _ = np.linalg.svd(R[:, :own], full_matrices=False)
    U = U[:, s > tolerance]
    B = R[:, own:]
    return np.asarray(np.linalg.norm(B - U @ (U.T @ B), axis=0))
