"""Loading compiled arithmetic for a kind of body, after trying it out."""

import ctypes
import logging
from functools import cache
from typing import NamedTuple

import numpy as np

from workbench.arrays import Array
from workbench.bodies.forward.compiled import CompiledArithmetic, CompiledSurface
from workbench.bodies.forward.motion import Motion, Slopes
from workbench.bodies.forward.numeric import ChunkedArithmetic, ChunkedSurface, chunks_of
from workbench.bodies.forward.vertex import vertex_functions
from workbench.bodies.forward.vertex_code import vertex_code
from workbench.compiling import NoLibrary, library
from workbench.errors import NotSupported

LOG = logging.getLogger(__name__)
NAME = "vertex-kernels"
TRIED = 11  # vertices: all lanes full at least once, and some that are left over


@cache
def kernels(parents: tuple[int, ...], B: int) -> tuple[ctypes.CDLL | None, str]:
    """The library for bodies with B betas on this tree, once per process; or None, and why."""
    try:
        source = vertex_code(vertex_functions(parents, B), len(parents), B)
        return library(NAME, source, lambda loaded: _agrees(loaded, parents, B)), ""
    except (NoLibrary, NotSupported) as error:
        LOG.info("surfaces are computed by NumPy: %s", error)
        return None, str(error)


class _Arrays(NamedTuple):
    template: Array
    shapedirs: Array
    posedirs: Array
    weights: Array


def _agrees(loaded: ctypes.CDLL, parents: tuple[int, ...], B: int) -> bool:
    """Whether the library says what NumPy says, about a few random vertices."""
    rng, K, N = np.random.default_rng(0), len(parents), TRIED
    arrays = _Arrays(
        rng.standard_normal((N, 3)),
        rng.standard_normal((N, 3, B)),
        rng.standard_normal((N, 3, 9 * (K - 1))),
        rng.standard_normal((N, K)),
    )
    axes = rng.standard_normal((K, 3, 1, 3))
    motion = Motion(
        G=rng.standard_normal((K, 3, 4)),
        features=rng.standard_normal(9 * (K - 1)),
        joints=rng.standard_normal((K, 3)),
    )
    slopes = Slopes(
        turns=np.cross(np.eye(3), axes).reshape(K, 9, 3),  # antisymmetric, as of rotations
        d_features=rng.standard_normal((K - 1, 3, 9)),
        d_shift=rng.standard_normal((3 * B, K)),
    )
    betas, scale = rng.standard_normal(B), rng.standard_normal(3 * N)
    answers = [
        _answers(way.evaluate(motion, betas), slopes, betas, scale)
        for way in (
            CompiledArithmetic.of(loaded, arrays, slice(None)),
            ChunkedArithmetic(chunks_of(arrays, slice(None)), parents),
        )
    ]
    return all(
        np.allclose(got, expected, rtol=0, atol=1e-12 * (1 + np.abs(expected).max(initial=0)))
        for got, expected in zip(*answers, strict=True)
    )


def _answers(
    surface: CompiledSurface | ChunkedSurface, slopes: Slopes, betas: Array, scale: Array
) -> list[Array]:
    K = len(surface.motion.G)
    into = {
        name: np.zeros((size, len(scale)))
        for name, size in (("pose", 3 * K), ("betas", len(betas)), ("trans", 3))
    }
    surface.tangent(slopes, into, scale)
    alone = surface.of.evaluate(surface.motion, betas).points
    return [surface.points, alone, *into.values(), *surface.adjoint(scale.reshape(-1, 3))]
