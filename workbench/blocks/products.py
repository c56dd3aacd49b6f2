"""Products of a constant matrix with a column of numbers, taken out of a graph.

Pose blend shapes, shape directions and Gaussian priors are such products. Written out in scalar
instructions they are five sixths of the graph of a fit to keypoints; as matrices they are arrays,
which a loop reads faster than a processor reads instructions, and which no compiler has to read.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil

import casadi as cs
import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from workbench.arrays import Array, Index
from workbench.blocks.batched import Batched

LEAST = 200  # elements that are not zero, from which on a matrix is taken out
TOGETHER = 8  # rows at most that compiled code multiplies at once, if they have the same columns
ENOUGH = 4  # rows at least, also of unlike columns: a single sum would wait for its last term
DIGITS = 12  # by which rows are looked up that may be equal
ROUNDING = 1e-15  # of a row's largest element: by how much equal rows may differ


@dataclass(frozen=True, eq=False)
class Product:
    """Rows of y = A u + b that stand in a graph.

    Attributes:
        matrix: A (m, n).
        shift: b (m,).
        operand: u (n, 1), in symbols.
        result: (m, 1), the symbol that stands for y in what is left of the graph.
    """

    matrix: Array
    shift: Array
    operand: cs.MX
    result: cs.MX

    def of(self, u: Array) -> Array:
        """y (M, m) for operands u (M, n)."""
        return np.asarray(u @ self.matrix.T + self.shift)


@dataclass(frozen=True, eq=False)
class Before:
    """What a function's last two arguments are: of another function and a matrix.

    Attributes:
        function: of all other arguments, with two results u (n,) and w.
        matrix: A (m, n); the last two arguments are w and A u.
    """

    function: cs.Function
    matrix: Array

    def arguments(self, run: Batched, *arguments: Array) -> tuple[Array, Array]:
        """w (M, .) and A u (M, m) for many arguments, where `run` evaluates `function`."""
        u, w = run(*arguments)
        return w, u @ self.matrix.T


class AfterProduct:
    """A function of many arguments whose last two are made of the others; see `Before`."""

    def __init__(self, function: Batched, before: Before, operand: Batched) -> None:
        self._function, self._before, self._operand = function, before, operand

    def __call__(self, *arguments: Array) -> list[Array]:
        """The other arguments, (M, .), or (.) where they are shared; a list of outputs (M, .)."""
        return self._function(*arguments, *self._before.arguments(self._operand, *arguments))


def without_repeats(matrix: Array) -> tuple[Index, Index, Array]:
    """The rows of a matrix (m, n) that are no other row again, and of each row which and its sign.

    Row k is sign[k] (m,) times row once[stands_for[k]], up to rounding errors. The left and the
    right half of a symmetric body have such rows: their shape directions are mirror images.
    """
    once: list[int] = []
    stands_for, sign = np.zeros(len(matrix), dtype=np.int64), np.ones(len(matrix))
    known: dict[tuple[str, bytes], int] = {}
    for k, row in enumerate(matrix):
        largest = row[np.argmax(np.abs(row))] if row.size else 0.0
        shape = np.round(row / (largest or 1.0), DIGITS) + 0.0  # + 0.0: no -0.0
        key = f"{abs(largest):.{DIGITS}e}", shape.tobytes()
        place = known.get(key)
        if place is not None:
            first = matrix[once[place]]
            turned = row.size and (largest < 0) != (first[np.argmax(np.abs(first))] < 0)
            sign[k] = -1.0 if turned else 1.0
            if np.abs(row - sign[k] * first).max(initial=0) <= ROUNDING * abs(largest):
                stands_for[k] = place
                continue
        sign[k], stands_for[k], known[key] = 1.0, len(once), len(once)
        once.append(k)
    return np.array(once, dtype=np.int64), stands_for, sign


def blocks_of(matrix: Array) -> list[tuple[Index, Index]]:
    """The rows and columns of the blocks of a matrix, outside of which there are only zeros."""
    m = len(matrix)
    row, column = np.nonzero(matrix)
    pairs = coo_array((np.ones(len(row)), (row, m + column)), shape=(m + matrix.shape[1],) * 2)
    count, label = connected_components(pairs, directed=False)
    rows = [np.flatnonzero(label[:m] == k) for k in range(count)]
    columns = [np.flatnonzero(label[m:] == k) for k in range(count)]
    return [(r, c) for r, c in zip(rows, columns, strict=True) if len(r) and len(c)]


def taken_out(
    expression: cs.MX, inputs: Sequence[cs.MX], operands_of: Sequence[cs.MX] | None = None
) -> tuple[list[Product], cs.MX]:
    """The products in an expression of the inputs, and what is left of it in their results.

    A product with fewer than LEAST elements stays where it is, and so does one whose operand needs
    another product, or an input that is not among `operands_of` where these are given.
    """
    f = cs.Function("f", list(inputs), [expression])
    found: list[tuple[cs.MX, Product]] = []
    for k in range(f.n_instructions()):
        if f.instruction_id(k) == cs.OP_MTIMES:
            node = f.instruction_MX(k)
            shift, matrix, operand = (node.dep(i) for i in range(3))
            if matrix.is_constant() and shift.is_constant() and operand.shape[1] == 1:
                A = np.array(cs.evalf(matrix))
                if np.count_nonzero(A) >= LEAST:
                    b = np.array(cs.evalf(shift)).ravel()
                    y = cs.MX.sym(f"y{len(found)}", len(A))
                    found.append((node, Product(A, b, cs.densify(operand), y)))
    if not found:
        return [], expression
    nodes, products = zip(*found, strict=True)
    results = [one.result for one in products]
    operands = cs.graph_substitute([one.operand for one in products], list(nodes), results)
    others = [] if operands_of is None else [x for x in inputs if _absent(x, operands_of)]
    needs = cs.vertcat(*results, *(cs.vec(x) for x in others))
    free = [k for k, operand in enumerate(operands) if not cs.depends_on(operand, needs)]
    chosen = [products[k] for k in free]
    (left,) = cs.graph_substitute(
        [expression], [nodes[k] for k in free], [one.result for one in chosen]
    )
    return chosen, left


def _absent(x: cs.MX, among: Sequence[cs.MX]) -> bool:
    return not any(cs.is_equal(x, other) for other in among)


def rows_together(matrix: Array) -> list[Index]:
    """The rows of a matrix that are not zero, in groups of up to TOGETHER that share columns.

    Rows of the same columns are divided among groups of nearly equal size. Fewer than ENOUGH are
    joined by others, those that share most columns with them.
    """
    used = (matrix != 0).astype(np.float64)
    left = list(np.flatnonzero(used.any(axis=1)))
    groups = []
    while left:
        first, others = left[0], left[1:]
        shared = used[others] @ used[first]  # columns in common with the first row
        more = used[others].sum(axis=1) - shared  # columns that the first row does not have
        alike = 1 + np.count_nonzero((more == 0) & (shared == used[first].sum()))
        size = max(ENOUGH, ceil(alike / ceil(alike / TOGETHER)))
        nearest = [others[k] for k in np.lexsort((more, more - shared))[: size - 1]]
        groups.append(np.array([first, *nearest], dtype=np.int64))
        left = [row for row in others if row not in nearest]
    return groups
