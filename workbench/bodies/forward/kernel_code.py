"""The C source of compiled surfaces: functions of one vertex, written for several, and loops."""

from collections.abc import Mapping

import casadi as cs

from workbench.blocks.simd import C_OF, statements
from workbench.bodies.forward.exact_storage import Stored
from workbench.bodies.forward.vertex import ADDED, OF_JOINT
from workbench.compiling import source_beside, vectors

SUMS_AND_PRODUCTS = {op: C_OF[op] for op in (cs.OP_ADD, cs.OP_SUB, cs.OP_MUL, cs.OP_NEG)}
STORED = ("shapedirs", "posedirs")  # what is read in the type in which it is stored
WIDENED = {  # a number as it is stored, as a number to compute with
    Stored.STEPS: "DOUBLES(x)",
    Stored.SINGLE: "DOUBLES(x)",
    Stored.DOUBLE: "(x)",
}


def vertex_code(
    functions: Mapping[str, cs.Function],
    parents: tuple[int, ...],
    B: int,
    kind: Stored = Stored.DOUBLE,
) -> str:
    """The whole source, for this tree and B betas: the kernels, and loops around them.

    `kind` is the type in which directions are stored.
    """
    K = len(parents)
    sizes: dict[str, int | str] = {
        **tree_sizes(parents, B),
        "WEIGHTS": 3,
        "ROWS": 3 + K,
        "STORED": kind.in_c,
        "WIDENED(x)": WIDENED[kind],
        "FEATURES": B,
        "MOTIONS": B + 9 * (K - 1),
        "CENTRES": B + 9 * (K - 1) + 12 * K,
        "OF_JOINTS": B + 9 * (K - 1) + 15 * K,
        "OF_JOINT": OF_JOINT,
        "OF_BETAS": B + 9 * (K - 1) + (15 + OF_JOINT) * K,
    }
    head, *loops = (
        source_beside(__package__, name)
        for name in ("stored.h", "vertex_groups.c", "vertex_loops.c")
    )
    defines = [f"#define {name} {size}" for name, size in sizes.items()]
    kernels = [kernel(f, "+=" if name in ADDED else "=") for name, f in functions.items()]
    return "\n".join([vectors(), *defines, head, *kernels, *loops])


def tree_sizes(parents: tuple[int, ...], B: int) -> dict[str, int | str]:
    """What C code has to know of a tree of joints and B betas."""
    listed = "{" + ", ".join(map(str, parents)) + "}"
    return {"PARENTS": listed, "JOINTS": len(parents), "BETAS": B}


def kernel(
    function: cs.Function, put: str = "=", c_of: Mapping[int, str] = SUMS_AND_PRODUCTS
) -> str:
    """A function as C for several vertices; the input called `motion` is the same for all.

    Inputs that `STORED` names are read in the type in which they are stored. `put` says whether
    outputs are set or, with `+=`, added to what is there.
    Raises NotSupported for an operation that is not in `c_of`.
    """
    names = [function.name_in(i) for i in range(function.n_in())]
    shared = [name == "motion" for name in names]
    stored = tuple(f"i{i}[" for i, name in enumerate(names) if name in STORED)

    def read(operand: str) -> str:
        return f"WIDENED({operand})" if operand.startswith(stored) else operand

    lines = [
        f"{to} {put} {text.format(*map(read, of))};"
        if to.startswith("o")
        else f"const v {to} = {text.format(*map(read, of))};"
        for to, of, text in statements(function, shared, c_of)
    ]
    inputs = []
    for i, name in enumerate(names):
        kind = "double" if shared[i] else "stored" if name in STORED else "anywhere"
        inputs.append(f"const {kind} *restrict i{i}")
    head = f"static ALWAYS_INLINE void {function.name()}({', '.join(inputs)}, v *restrict o0)"
    return "\n".join([head, "{", *lines, "}", ""])
