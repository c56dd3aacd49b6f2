"""Loading compiled arithmetic for a kind of body, after trying it out."""

import ctypes
import logging
from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from typing import NamedTuple

import casadi as cs
import numpy as np

from workbench.arrays import Array
from workbench.blocks.simd import C_OF, statements
from workbench.bodies.forward.compiled import CompiledArithmetic, CompiledSurface
from workbench.bodies.forward.motion import Motion, Slopes
from workbench.bodies.forward.numeric import ChunkedArithmetic, ChunkedSurface, chunks_of
from workbench.bodies.forward.vertex import ADDED, OF_JOINT, vertex_functions
from workbench.compiling import NoLibrary, library, vectors
from workbench.errors import NotSupported

LOG = logging.getLogger(__name__)
NAME = "vertex-kernels"
TRIED = 11  # vertices: all lanes full at least once, and some that are left over
SUMS_AND_PRODUCTS = {op: C_OF[op] for op in (cs.OP_ADD, cs.OP_SUB, cs.OP_MUL, cs.OP_NEG)}


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


def vertex_code(functions: Mapping[str, cs.Function], K: int, B: int) -> str:
    """The whole source, for K joints and B betas: the kernels, and loops around them."""
    sizes = {
        "JOINTS": K,
        "BETAS": B,
        "SHAPEDIRS": 3,
        "WEIGHTS": 3 + 3 * B,
        "POSEDIRS": 3 + 3 * B + K,
        "ROWS": 3 + 3 * B + K + 27 * (K - 1),
        "FEATURES": B,
        "MOTIONS": B + 9 * (K - 1),
        "CENTRES": B + 9 * (K - 1) + 12 * K,
        "OF_JOINTS": B + 9 * (K - 1) + 15 * K,
        "OF_JOINT": OF_JOINT,
        "OF_BETAS": B + 9 * (K - 1) + (15 + OF_JOINT) * K,
    }
    loops = files(__package__).joinpath("vertex_loops.c").read_text(encoding="utf-8")
    defines = [f"#define {name} {size}" for name, size in sizes.items()]
    kernels = [kernel(f, "+=" if name in ADDED else "=") for name, f in functions.items()]
    return "\n".join([vectors(), *defines, *kernels, loops])


def kernel(function: cs.Function, put: str = "=") -> str:
    """A function as C for several vertices; the input called `motion` is the same for all.

    `put` says whether outputs are set or, with `+=`, added to what is there.
    Raises NotSupported for any operation but sums and products.
    """
    shared = [function.name_in(i) == "motion" for i in range(function.n_in())]
    lines = [
        f"{to} {put} {text.format(*of)};"
        if to.startswith("o")
        else f"const v {to} = {text.format(*of)};"
        for to, of, text in statements(function, shared, SUMS_AND_PRODUCTS)
    ]
    inputs = [
        f"const {'double' if same else 'anywhere'} *restrict i{i}" for i, same in enumerate(shared)
    ]
    head = f"static ALWAYS_INLINE void {function.name()}({', '.join(inputs)}, v *restrict o0)"
    return "\n".join([head, "{", *lines, "}", ""])
