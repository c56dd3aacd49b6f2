"""CasADi functions as C in which one instruction of the processor serves several calls (SIMD)."""

import ctypes
import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import casadi as cs
import numpy as np

from workbench.arrays import Array
from workbench.blocks.functions import Batched, Mapped, count
from workbench.compiling import (
    NoLibrary,
    address,
    function_of_addresses,
    library,
    source_beside,
    vectors,
)
from workbench.errors import NotSupported

LOG = logging.getLogger(__name__)
MOST_ROWS = 8  # of a matrix, that are multiplied at once
TOO_LARGE = 2**15  # rows or columns of a matrix, whose numbers are a C short
PIECE = 500  # instructions in one piece of the source
LONG = 20_000  # instructions, from which on the compiler is asked to try less
CALLS_COMPARED = 11  # all lanes are used, and some calls are left over
UNARY = (
    "sqrt sin cos tan exp log asin acos atan fabs sinh cosh tanh floor ceil log1p expm1 erf sign"
)
BINARY = "pow atan2 hypot copysign fmod"  # functions of C of one argument, and of two
C_OF: Mapping[int, str] = {
    cs.OP_ASSIGN: "{0}",
    cs.OP_ADD: "{0} + {1}",
    cs.OP_SUB: "{0} - {1}",
    cs.OP_MUL: "{0} * {1}",
    cs.OP_DIV: "{0} / {1}",
    cs.OP_NEG: "-{0}",
    cs.OP_SQ: "{0} * {0}",
    cs.OP_TWICE: "{0} + {0}",
    cs.OP_INV: "BROADCAST(1.0) / {0}",
    cs.OP_LT: "TRUTH({0} < {1})",
    cs.OP_LE: "TRUTH({0} <= {1})",
    cs.OP_EQ: "TRUTH({0} == {1})",
    cs.OP_NE: "TRUTH({0} != {1})",
    cs.OP_NOT: "TRUTH({0} == BROADCAST(0.0))",
    cs.OP_AND: "TRUTH(({0} != BROADCAST(0.0)) & ({1} != BROADCAST(0.0)))",
    cs.OP_OR: "TRUTH(({0} != BROADCAST(0.0)) | ({1} != BROADCAST(0.0)))",
    cs.OP_IF_ELSE_ZERO: "IF({0}, {1})",
    cs.OP_FMIN: "CHOICE(({0} < {1}) | ({1} != {1}), {0}, {1})",
    cs.OP_FMAX: "CHOICE(({0} > {1}) | ({1} != {1}), {0}, {1})",
    cs.OP_CONSTPOW: "each_pow({0}, {1})",
    **{getattr(cs, f"OP_{name.upper()}"): f"each_{name}({{0}})" for name in UNARY.split()},
    **{getattr(cs, f"OP_{name.upper()}"): f"each_{name}({{0}}, {{1}})" for name in BINARY.split()},
}


@dataclass(frozen=True, eq=False)
class ConstantProduct:
    """What makes a function's last two arguments w and y = A u: another function and a matrix.

    Pose blend shapes, shape directions and Gaussian priors are such products. Written out in scalar
    instructions they are five sixths of the graph of a fit to keypoints; as matrices they are
    arrays, which a loop reads faster, and which no compiler has to read.
    """

    function: cs.Function  # of all other arguments, with two results u (n,) and w
    matrix: Array  # A (m, n)


def simd_function(
    function: cs.Function, shared: Sequence[bool], before: ConstantProduct | None = None
) -> Batched:
    """A function of scalar instructions as compiled code, which is kept in a library on disk.

    `shared` says which arguments are the same for all calls. With `before` the last two arguments
    are not given, but computed. Raises NoLibrary without a compiler, and NotSupported for an
    instruction that has no C here.
    """
    source = simd_code(function, shared, before)
    last = Mapped(function, shared if before is None else (*shared, False, False))

    def interpreted(*arguments: Array) -> list[Array]:
        if before is None:
            return last(*arguments)
        u, w = Mapped(before.function, shared)(*arguments)
        return last(*arguments, w, u @ before.matrix.T)

    def agrees(loaded: ctypes.CDLL) -> bool:
        return _agree(_loaded(loaded, function, shared), interpreted, function, shared)

    try:
        return _loaded(library("simd", source, agrees), function, shared)
    except NoLibrary as error:
        LOG.info("%s is interpreted: %s", function.name(), error)
        raise


def _loaded(loaded: ctypes.CDLL, function: cs.Function, shared: Sequence[bool]) -> Batched:
    inputs = [function.nnz_in(i) for i in range(len(shared))]
    outputs = [function.nnz_out(i) for i in range(function.n_out())]
    run = function_of_addresses(loaded, "run", 1 + len(inputs) + len(outputs))

    def call(*arguments: Array) -> list[Array]:
        M = count(arguments, shared)
        plain = [np.ascontiguousarray(a, dtype=np.float64) for a in arguments]
        for array, width, same in zip(plain, inputs, shared, strict=True):
            assert array.size == (width if same else M * width)  # the library trusts it
        results = [np.empty((M, width)) for width in outputs]
        run(M, *map(address, plain), *map(address, results))
        return results

    return call


def simd_code(
    function: cs.Function, shared: Sequence[bool], before: ConstantProduct | None = None
) -> str:
    """The C source of a function; raises NotSupported for an instruction that has no C here."""
    head = source_beside(__package__, "simd.h")
    inputs = [(k, function.nnz_in(k), same) for k, same in enumerate(shared)]
    outputs = [(k, function.nnz_out(k)) for k in range(function.n_out())]
    of_run = ["integer M", *(f"const double *x{k}" for k, _, _ in inputs)]
    of_run += [f"double *y{k}" for k, _ in outputs]
    taken = [f"x{k}" if same else f"i{k}" for k, _, same in inputs]
    results = [f"o{k}" for k, _ in outputs]
    kept = {f"i{k}": n for k, n, same in inputs if not same} | {f"o{k}": n for k, n in outputs}
    if before is None:
        parts, calls, between = _stage("part", function, shared, [*taken, *results])
    else:
        u, w, y = "u", f"i{len(inputs)}", f"i{len(inputs) + 1}"
        sizes = (*(before.function.nnz_out(k) for k in range(2)), len(before.matrix))
        kept |= dict(zip((u, w, y), sizes, strict=True))
        first, before_calls, before_between = _stage(
            "before", before.function, shared, [*taken, u, w]
        )
        then = _stage("part", function, (*shared, False, False), [*taken, w, y, *results])
        table, product = _product(before.matrix, u, y)
        parts, between = [*first, table, *then[0]], max(before_between, then[2])
        calls = [*before_calls, product, *then[1]]
    zeroed = [*results, *([] if before is None else [y])]
    return "\n".join(
        [
            vectors(),
            *(["#define LONG_CODE"] if len(parts) * PIECE > LONG else []),
            head,
            *parts,
            f"EXPORT void run({', '.join(of_run)})",
            "{",
            f"v t[{max(1, between)}];",
            *(f"v {name}[{max(1, n)}];" for name, n in kept.items()),
            *(f"for (integer j = 0; j < {kept[k]}; ++j) {k}[j] = BROADCAST(0.0);" for k in zeroed),
            "for (integer first = 0; first < M; first += LANES) {",
            *(f"GATHER(i{k}, x{k}, {n})" for k, n, same in inputs if not same),
            *calls,
            *(f"SCATTER(o{k}, y{k}, {n})" for k, n in outputs),
            "}",
            "}",
            "",
        ]
    )


def _stage(
    name: str, function: cs.Function, shared: Sequence[bool], arguments: Sequence[str]
) -> tuple[list[str], list[str], int]:
    """The C functions that a function is divided into, their calls, and the size of `t`."""
    parts, between = _parts(function, shared)
    takes = [f"const {'double' if same else 'v'} *i{k}" for k, same in enumerate(shared)]
    takes += [*(f"v *o{k}" for k in range(function.n_out())), "v *t"]
    written = [
        "\n".join([f"static PART void {name}{n}({', '.join(takes)})", "{", *lines, "}"])
        for n, lines in enumerate(parts)
    ]
    calls = [f"{name}{n}({', '.join(arguments)}, t);" for n in range(len(parts))]
    return written, calls, between


def _product(matrix: Array, u: str, y: str) -> tuple[str, str]:
    """The tables of a matrix in C, and the call that multiplies by it; see `product` in simd.h."""
    if max(matrix.shape) >= TOO_LARGE:
        raise NotSupported(f"a matrix of shape {matrix.shape} is too large for a product in C here")
    used_by = matrix != 0
    order = np.lexsort(used_by.T)  # rows with the same columns stand together
    order = order[used_by[order].any(axis=1)]
    rows_of, columns_of, rows, columns = [], [], [], []
    elements: list[float] = []
    for first in range(0, len(order), MOST_ROWS):
        group = order[first : first + MOST_ROWS]
        used = np.flatnonzero(matrix[group].any(axis=0))
        rows_of.append(len(group))
        columns_of.append(len(used))
        rows += group.tolist()
        columns += used.tolist()
        elements += matrix[np.ix_(group, used)].T.ravel().tolist()
    tables = "\n".join(
        f"static const {kind} {name}[] = {{{', '.join(map(str, numbers))}}};"
        for kind, name, numbers in (
            ("short", "rows_of", rows_of),
            ("short", "columns_of", columns_of),
            ("short", "rows", rows),
            ("short", "columns", columns),
            ("double", "element", [_number(x) for x in elements]),
        )
    )
    call = f"product({len(rows_of)}, rows_of, columns_of, rows, columns, element, {u}, {y});"
    return tables, call


def statements(
    function: cs.Function, shared: Sequence[bool], c_of: Mapping[int, str] = C_OF
) -> list[tuple[str, tuple[str, ...], str]]:
    """CasADi's instructions in order: what each sets, its operands, and the C of the operation.

    Results are called s0, s1, ..., the entries of input k are ik[...], and those of output k are
    ok[...]. `shared` says which inputs are the same for all calls, `c_of` how operations are
    written. Raises NotSupported for an operation that is not in `c_of`.
    """
    written: list[tuple[str, tuple[str, ...], str]] = []
    holds: dict[int, str] = {}  # what each place of CasADi's work vector holds now
    for i in range(function.n_instructions()):
        operation = function.instruction_id(i)
        to, of = function.instruction_output(i), function.instruction_input(i)
        if operation == cs.OP_CONST:
            holds[to[0]] = f"BROADCAST({_number(float(function.instruction_constant(i)))})"
        elif operation == cs.OP_INPUT:
            entry = f"i{of[0]}[{of[1]}]"
            holds[to[0]] = f"BROADCAST({entry})" if shared[of[0]] else entry
        elif operation == cs.OP_OUTPUT:
            written.append((f"o{to[0]}[{to[1]}]", (holds[of[0]],), "{0}"))
        elif operation in c_of:
            written.append((f"s{i}", tuple(holds[k] for k in of), c_of[operation]))
            holds[to[0]] = f"s{i}"
        else:
            raise NotSupported(
                f"CasADi's operation {operation} in {function.name()!r} has no C here"
            )
    return written


def _parts(function: cs.Function, shared: Sequence[bool]) -> tuple[list[list[str]], int]:
    """The instructions in pieces: a compiler's time grows faster than the length of a piece.

    The second result is the number of results that later pieces take from earlier ones; these go
    through an array in memory, `t`.
    """
    instructions = statements(function, shared)
    part_of = {name: n // PIECE for n, (name, _, _) in enumerate(instructions)}
    kept: dict[str, int] = {}
    for n, (_, operands, _) in enumerate(instructions):
        for name in operands:
            if name in part_of and part_of[name] != n // PIECE:
                kept.setdefault(name, len(kept))
    parts: list[list[str]] = []
    for n, (name, operands, text) in enumerate(instructions):
        if n % PIECE == 0:
            parts.append([])
        read = (f"t[{kept[o]}]" if o in kept and part_of[o] != n // PIECE else o for o in operands)
        typed = "" if name.startswith("o") else "const v "
        parts[-1].append(f"{typed}{name} = {text.format(*read)};")
        if name in kept:
            parts[-1].append(f"t[{kept[name]}] = {name};")
    return parts, len(kept)


def _number(x: float) -> str:
    if np.isnan(x):
        return "NAN"
    if np.isinf(x):
        return "INFINITY" if x > 0 else "-INFINITY"
    return repr(x)


def _agree(
    compiled: Batched, usual: Batched, function: cs.Function, shared: Sequence[bool]
) -> bool:
    """Whether two functions give the same numbers for a few random arguments; NaN equals NaN."""
    rng = np.random.default_rng(0)
    sizes = [function.nnz_in(i) for i in range(len(shared))]
    arguments = [
        rng.uniform(0.1, 1.1, size if same else (CALLS_COMPARED, size))
        for size, same in zip(sizes, shared, strict=True)
    ]
    return all(
        np.allclose(actual, expected, rtol=1e-9, atol=1e-11, equal_nan=True)
        for actual, expected in zip(compiled(*arguments), usual(*arguments), strict=True)
    )
