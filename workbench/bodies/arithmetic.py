"""The arithmetic behind a body's surface: compiled where that pays and works, else by NumPy."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

from workbench.bodies.compiled import CompiledArithmetic
from workbench.bodies.kernels import kernels
from workbench.bodies.motion import Motion, Slopes
from workbench.bodies.numeric import ChunkedArithmetic, chunks_of

if TYPE_CHECKING:
    from workbench.bodies.skinned import SkinnedBody
    from workbench.bodies.surface import Vertices

Array = NDArray[np.float64]
WORTH_COMPILING = 1000  # vertices: with fewer NumPy needs at most two milliseconds


class Surface(Protocol):
    """The points of a surface at one motion and shape, before translation; see `numeric`.

    What is found on the way to one answer is kept for the next.
    """

    @property
    def points(self) -> Array:
        """The posed points (N, 3) in metres, before translation."""

    def tangent(self, slopes: Slopes, into: Mapping[str, Array], scale: Array | None) -> None:
        """Write into `pose` (3 K, 3 N), `betas` and `trans`, each column times scale (3 N,)."""

    def adjoint(self, pull: Array) -> tuple[Array, Array, Array]:
        """Gradients of sum(pull * points), pull (N, 3), by G (K, 3, 4), features and betas."""


class Arithmetic(Protocol):
    """How the surface of a body is computed."""

    def at(self, motion: Motion, betas: Array) -> Surface:
        """Moved like this, and shaped by betas (B,)."""


def arithmetic_of(body: SkinnedBody, vertices: Vertices) -> Arithmetic:
    """For all of a body's vertices or some; compiles the first time that it pays."""
    chosen = vertices if isinstance(vertices, slice) else list(vertices)
    count = body.n_vertices if isinstance(chosen, slice) else len(chosen)
    if count >= WORTH_COMPILING:
        library, _ = kernels(body.parents, body.n_betas)
        if library is not None:
            return CompiledArithmetic.of(library, body, chosen)
    chunks = body.chunks if isinstance(chosen, slice) else chunks_of(body, chosen)
    return ChunkedArithmetic(chunks, body.parents)
