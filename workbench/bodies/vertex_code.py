"""The C of a body's arithmetic: CasADi's own instructions, several vertices at a time."""

from importlib.resources import files

import casadi as cs

from workbench.bodies.vertex import OF_JOINT, VertexFunctions
from workbench.compiling import vectors
from workbench.errors import NotSupported

BINARY = {cs.OP_ADD: "+", cs.OP_SUB: "-", cs.OP_MUL: "*"}


def vertex_code(functions: VertexFunctions, K: int, B: int) -> str:
    """The whole source, for K joints and B betas: the kernels, and loops around them."""
    sizes = {
        "JOINTS": K, "BETAS": B, "SHAPEDIRS": 3, "WEIGHTS": 3 + 3 * B, "POSEDIRS": 3 + 3 * B + K,
        "ROWS": 3 + 3 * B + K + 27 * (K - 1), "FEATURES": B, "MOTIONS": B + 9 * (K - 1),
        "CENTRES": B + 9 * (K - 1) + 12 * K, "OF_JOINTS": B + 9 * (K - 1) + 15 * K,
        "OF_JOINT": OF_JOINT, "OF_BETAS": B + 9 * (K - 1) + (15 + OF_JOINT) * K,
    }  # fmt: skip
    loops = files(__package__).joinpath("vertex_loops.c").read_text(encoding="utf-8")
    defines = [f"#define {name} {size}" for name, size in sizes.items()]
    added = {f.name() for f in functions.added}
    kernels = [kernel(f, "+=" if f.name() in added else "=") for f in functions.all]
    return "\n".join([vectors(), *defines, *kernels, loops])


def kernel(function: cs.Function, put: str = "=") -> str:
    """A function as C for several vertices; the input called `motion` is the same for all.

    `put` says whether outputs are set or, with `+=`, added to what is there.
    Raises NotSupported for any operation but sums and products.
    """
    shared = [function.name_in(i) == "motion" for i in range(function.n_in())]
    lines = []
    for i in range(function.n_instructions()):
        operation = function.instruction_id(i)
        to, of = function.instruction_output(i), function.instruction_input(i)
        if operation == cs.OP_INPUT:
            entry = f"i{of[0]}[{of[1]}]"
            lines.append(f"w{to[0]} = {f'BROADCAST({entry})' if shared[of[0]] else entry};")
        elif operation == cs.OP_OUTPUT:
            lines.append(f"out[{to[1]}] {put} w{of[0]};")
        elif operation == cs.OP_CONST:
            number = function.instruction_constant(i)
            lines.append(f"w{to[0]} = BROADCAST({float(number)!r});")
        elif operation == cs.OP_NEG:
            lines.append(f"w{to[0]} = -w{of[0]};")
        elif operation in BINARY:
            lines.append(f"w{to[0]} = w{of[0]} {BINARY[operation]} w{of[1]};")
        else:
            raise NotSupported(
                f"CasADi's operation {operation} in {function.name()!r} has no C here; "
                "write the function with sums and products"
            )
    inputs = [
        f"const {'double' if same else 'anywhere'} *restrict i{i}" for i, same in enumerate(shared)
    ]
    variables = ", ".join(f"w{i}" for i in range(max(1, function.sz_w())))
    head = f"static ALWAYS_INLINE void {function.name()}({', '.join(inputs)}, v *restrict out)"
    return "\n".join([head, "{", f"v {variables};", *lines, "}", ""])
