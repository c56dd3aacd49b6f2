"""The C of a body's arithmetic: CasADi's own instructions, several vertices at a time."""

from collections.abc import Mapping
from importlib.resources import files

import casadi as cs

from workbench.blocks.simd import C_OF, statements
from workbench.bodies.forward.vertex import ADDED, OF_JOINT
from workbench.compiling import vectors

SUMS_AND_PRODUCTS = {op: C_OF[op] for op in (cs.OP_ADD, cs.OP_SUB, cs.OP_MUL, cs.OP_NEG)}


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
