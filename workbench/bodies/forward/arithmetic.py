"""The arithmetic behind points of a body; a surface's is compiled where that pays and works."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Protocol

from workbench.arrays import Array
from workbench.bodies.forward.arrays import SkinnedArrays, Vertices
from workbench.bodies.forward.kernels import CompiledArithmetic
from workbench.bodies.forward.motion import Slopes
from workbench.bodies.forward.numeric import Chunk, ChunkedArithmetic, chunks_of
from workbench.bodies.forward.rows import Target

WORTH_COMPILING = 1000  # vertices: with fewer NumPy needs at most two milliseconds
PART = 100  # vertices, from which on a part of a body with so many is compiled as well


class AtOrigin(Protocol):
    """Points of a body at one motion and shape; see `numeric`.

    They are before translation. What is found on the way to one answer is kept for the next.
    """

    @property
    def points(self) -> Array:
        """The posed points (N, 3) in metres, before translation."""

    def write_jacobian(
        self, slopes: Slopes, into: Mapping[str, Target], scale: Array | None
    ) -> None:
        """Write into `pose` (3 K, 3 N), `betas` and `trans`, each column times scale (3 N,)."""

    def vjp(self, cotangent: Array) -> tuple[Array, Array, Array]:
        """Gradients of cotangent (N, 3) . points by G (K, 3, 4), features and betas."""


class Displaced(Protocol):
    """What AtOrigin of landmarks with offsets provides in addition."""

    def pulled_by_offsets(self, cotangent: Array) -> Array:
        """The gradient of cotangent (N, 3) . points by the offsets, (N, 3)."""


class Arithmetic(Protocol):
    """How points of a body are computed: its surface, its joints, or landmarks on it."""

    @property
    def evaluate(self) -> Callable[..., AtOrigin]:
        """The points moved by a motion, of the person with these betas (B,).

        Landmarks take offsets (N, 3) m that displace them at rest as well; see `Displaced`.
        """


def arithmetic_of(
    body: SkinnedArrays, vertices: Vertices, chunks: Callable[[], list[Chunk]] | None = None
) -> Arithmetic:
    """For all of a body's vertices or some; compiles the first time that it pays.

    The library is that of the whole surface, so that a part of one is worth it sooner.

    `chunks` returns these vertices packed for NumPy, if they have been packed before.
    """
    chosen = vertices if isinstance(vertices, slice) else list(vertices)
    count = body.n_vertices if isinstance(chosen, slice) else len(chosen)
    if body.n_vertices >= WORTH_COMPILING and count >= min(PART, WORTH_COMPILING):
        compiled = CompiledArithmetic.of(body, body.parents, chosen)
        if compiled is not None:
            return compiled
    packed = chunks_of(body, chosen) if chunks is None else chunks()
    return ChunkedArithmetic(packed, body.parents)
