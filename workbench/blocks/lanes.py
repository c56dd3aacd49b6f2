"""A CasADi function compiled so that one instruction serves several calls at once."""

import ctypes
import logging
from collections.abc import Mapping, Sequence
from importlib.resources import files

import casadi as cs
import numpy as np
from numpy.typing import NDArray

from workbench.blocks.many import Many, count, interpreted, scalar
from workbench.compiling import NoLibrary, library
from workbench.errors import NotSupported

Array = NDArray[np.float64]
LOG = logging.getLogger(__name__)
TRIED = 11  # calls: all lanes full at least once, and some that are left over
C_OF: Mapping[int, str] = {
    cs.OP_ASSIGN: "{0}", cs.OP_ADD: "{0} + {1}", cs.OP_SUB: "{0} - {1}", cs.OP_MUL: "{0} * {1}",
    cs.OP_DIV: "{0} / {1}", cs.OP_NEG: "-{0}", cs.OP_SQ: "{0} * {0}", cs.OP_TWICE: "{0} + {0}",
    cs.OP_INV: "all(1.0) / {0}", cs.OP_LT: "TRUE_WHERE({0} < {1})",
    cs.OP_LE: "TRUE_WHERE({0} <= {1})", cs.OP_EQ: "TRUE_WHERE({0} == {1})",
    cs.OP_NE: "TRUE_WHERE({0} != {1})", cs.OP_NOT: "TRUE_WHERE({0} == all(0.0))",
    cs.OP_AND: "TRUE_WHERE(({0} != all(0.0)) & ({1} != all(0.0)))",
    cs.OP_OR: "TRUE_WHERE(({0} != all(0.0)) | ({1} != all(0.0)))",
    cs.OP_IF_ELSE_ZERO: "IF({0}, {1})",
    **{
        getattr(cs, f"OP_{name.upper()}"): f"each_{name}({{0}})"
        for name in (
            "sqrt", "sin", "cos", "tan", "exp", "log", "asin", "acos", "atan", "fabs", "sinh",
            "cosh", "tanh", "floor", "ceil", "log1p", "expm1", "erf", "sign",
        )
    },
    **{
        getattr(cs, f"OP_{name.upper()}"): f"each_{name}({{0}}, {{1}})"
        for name in ("pow", "atan2", "fmin", "fmax", "hypot", "copysign", "fmod")
    },
    cs.OP_CONSTPOW: "each_pow({0}, {1})",
}  # fmt: skip


def compiled(function: cs.Function, shared: Sequence[bool]) -> Many:
    """By a library that is compiled once, where there is a compiler; else interpreted."""
    usual = interpreted(function, shared)
    scalars = scalar(function)
    if scalars is None:
        return usual
    try:
        source = lanes_code(scalars, shared)
        loaded = library(
            "lanes", source, lambda found: _agrees(Lanes(found, scalars, shared), usual, scalars)
        )
        return Lanes(loaded, scalars, shared)
    except (NoLibrary, NotSupported) as error:
        LOG.info("%s is interpreted: %s", function.name(), error)
        return usual


class Lanes:
    """The compiled function; see Many."""

    def __init__(self, loaded: ctypes.CDLL, function: cs.Function, shared: Sequence[bool]) -> None:
        self._shared = tuple(shared)
        self._wide = [function.nnz_in(i) for i in range(function.n_in())]
        self._outputs = [function.nnz_out(i) for i in range(function.n_out())]
        self._run = loaded.run
        self._run.restype = None

    def __call__(self, *arguments: Array) -> list[Array]:
        """See Many."""
        M = count(arguments, self._shared)
        plain = [np.ascontiguousarray(a, dtype=np.float64) for a in arguments]
        for array, wide, same in zip(plain, self._wide, self._shared, strict=True):
            assert array.size == (wide if same else M * wide)  # the library trusts it
        found = [np.empty((M, wide)) for wide in self._outputs]
        self._run(ctypes.c_ssize_t(M), *(ctypes.c_void_p(a.ctypes.data) for a in (*plain, *found)))
        return found


def lanes_code(function: cs.Function, shared: Sequence[bool]) -> str:
    """The whole source, for a function of scalar instructions.

    Raises NotSupported for an instruction that has no C here.
    """
    head = files(__package__).joinpath("lanes.h").read_text(encoding="utf-8")
    lines = [_line(function, i) for i in range(function.n_instructions())]
    inputs = [f"const v *restrict i{k}" for k in range(function.n_in())]
    outputs = [f"v *restrict o{k}" for k in range(function.n_out())]
    variables = ", ".join(f"w{i}" for i in range(max(1, function.sz_w())))
    arguments = [f"const double *x{k}" for k in range(function.n_in())]
    arguments += [f"double *y{k}" for k in range(function.n_out())]
    widths = [function.nnz_in(k) for k in range(function.n_in())]
    read = [
        f"v i{k}[{max(1, n)}]; {'' if same else 'if (0) '}"
        f"for (integer j = 0; j < {n}; ++j) i{k}[j] = all(x{k}[j]);"
        for k, (n, same) in enumerate(zip(widths, shared, strict=True))
    ]
    gather = [
        f"for (int l = 0; l < LANES; ++l) {{ const double *row = x{k} + {n} * "
        f"(first + l < M ? first + l : M - 1); for (integer j = 0; j < {n}; ++j) "
        f"i{k}[j][l] = row[j]; }}"
        for k, (n, same) in enumerate(zip(widths, shared, strict=True))
        if not same
    ]
    made = [f"v o{k}[{max(1, function.nnz_out(k))}];" for k in range(function.n_out())]
    scatter = [
        f"for (int l = 0; l < LANES && first + l < M; ++l) for (integer j = 0; j < {n}; ++j) "
        f"y{k}[{n} * (first + l) + j] = o{k}[j][l];"
        for k in range(function.n_out())
        if (n := function.nnz_out(k))
    ]
    zeros = [
        f"for (integer j = 0; j < {function.nnz_out(k)}; ++j) o{k}[j] = all(0.0);"
        for k in range(function.n_out())
    ]
    names = [f"i{k}" for k in range(function.n_in())] + [f"o{k}" for k in range(function.n_out())]
    return "\n".join(
        [
            head,
            f"static void kernel({', '.join([*inputs, *outputs])})",
            "{", f"v {variables};", *lines, "}",
            f"EXPORT void run(integer M, {', '.join(arguments)})",
            "{", *read, *made, *zeros,
            "for (integer first = 0; first < M; first += LANES) {",
            *gather, f"kernel({', '.join(names)});", *scatter, "}", "}", "",
        ]
    )  # fmt: skip


def _line(function: cs.Function, i: int) -> str:
    operation = function.instruction_id(i)
    to, of = function.instruction_output(i), function.instruction_input(i)
    if operation == cs.OP_INPUT:
        return f"w{to[0]} = i{of[0]}[{of[1]}];"
    if operation == cs.OP_OUTPUT:
        return f"o{to[0]}[{to[1]}] = w{of[0]};"
    if operation == cs.OP_CONST:
        return f"w{to[0]} = all({_number(float(function.instruction_constant(i)))});"
    if operation in C_OF:
        return f"w{to[0]} = {C_OF[operation].format(*(f'w{k}' for k in of))};"
    raise NotSupported(f"CasADi's operation {operation} in {function.name()!r} has no C here")


def _number(x: float) -> str:
    if np.isnan(x):
        return "NAN"
    if np.isinf(x):
        return "INFINITY" if x > 0 else "-INFINITY"
    return repr(x)


def _agrees(found: Lanes, usual: Many, function: cs.Function) -> bool:
    """Whether the library says what the interpreter says, about a few random numbers.

    Of random numbers some functions make NaN or infinity; then both must.
    """
    rng = np.random.default_rng(0)
    sizes = [function.nnz_in(i) for i in range(function.n_in())]
    arguments = [
        rng.uniform(0.1, 1.1, size if same else (TRIED, size))
        for size, same in zip(sizes, found._shared, strict=True)
    ]
    return all(
        np.allclose(got, right, rtol=1e-9, atol=1e-11, equal_nan=True)
        for got, right in zip(found(*arguments), usual(*arguments), strict=True)
    )
