"""The instructions of a CasADi function in groups of one operation that do not need each other.

The keypoints of a camera and the joints of a body are computed by the same formula with other
numbers. Written out in scalar instructions, most of these therefore have many of their kind that
could be carried out at once.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from heapq import heapify, heappop, heappush

import casadi as cs
import numpy as np

from workbench.arrays import Array, Index

COMMUTE = cs.OP_ADD, cs.OP_MUL  # a + b is b + a to the last bit


@dataclass(frozen=True, eq=False)
class Group:
    """An operation that is carried out n times.

    Attributes:
        operation: CasADi's number of it.
        operands: (one or two, n) the values that it takes, by their numbers in the schedule.
        first: the number of the first result; the others follow.
    """

    operation: int
    operands: Index
    first: int


@dataclass(frozen=True, eq=False)
class Schedule:
    """What a function computes, as values that are numbered: inputs, constants, results of groups.

    Attributes:
        sizes: how many numbers each input has; their values come first.
        constants: the values after these.
        groups: in the order in which they are carried out.
        outputs: for each output, its values.
    """

    sizes: tuple[int, ...]
    constants: Array
    groups: list[Group]
    outputs: list[Index]

    @staticmethod
    def of(function: cs.Function) -> Schedule:
        """The schedule of a function of scalar instructions.

        Always next is the operation of which most instructions have all that they need. Sums of
        more than two numbers are added up in the order that takes the fewest steps.
        """
        sizes = tuple(function.nnz_in(i) for i in range(function.n_in()))
        read = _read(function, sizes)
        made = _balanced(read)
        waits: dict[int, int] = {}
        needed_by: dict[int, list[int]] = defaultdict(list)
        ready: dict[int, list[int]] = defaultdict(list)
        for value, (operation, of) in made.items():
            needs = {k for k in of if k in made}
            waits[value] = len(needs)
            for k in needs:
                needed_by[k].append(value)
            if not needs:
                ready[operation].append(value)
        at = {k: k for k in range(read.leaves)}
        groups = []
        while ready:
            operation = max(ready, key=lambda one: len(ready[one]))
            some = ready.pop(operation)
            places = np.array([[at[k] for k in made[value][1]] for value in some]).T
            places, order = _in_order(places, operation in COMMUTE)
            groups.append(Group(operation, places, len(at)))
            for k in order:
                at[some[k]] = len(at)
            for value in some:
                for later in needed_by[value]:
                    waits[later] -= 1
                    if not waits[later]:
                        ready[made[later][0]].append(later)
        outputs = [np.array([at[k] for k in one], dtype=np.int64) for one in read.outputs]
        return Schedule(sizes, np.array(read.constants), groups, outputs)

    def last_use(self) -> Index:
        """For each group, the last one that takes a result of it; outputs are taken at the end."""
        starts = np.array([group.first for group in self.groups], dtype=np.int64)
        last = np.arange(len(self.groups))
        for n, group in enumerate(self.groups):
            owners = np.searchsorted(starts, group.operands.ravel(), side="right") - 1
            last[owners[owners >= 0]] = n
        for values in self.outputs:
            owners = np.searchsorted(starts, values, side="right") - 1
            last[owners[owners >= 0]] = len(self.groups)
        return last


def _in_order(places: Index, commute: bool) -> tuple[Index, Index]:
    """Operands (one or two, n) sorted so that most stand in a row, and the order of these n.

    The operands of each instruction change places where they may, or all of them or none do.
    """
    if places.shape[1] == 1:  # a long chain has thousands of such
        return places, np.zeros(1, dtype=np.int64)
    tried: list[tuple[int, int, Index, Index]] = []
    ways = [places, np.sort(places, axis=0)] if commute and len(places) == 2 else [places]
    for way in ways:
        for first in range(len(way)):
            order = np.lexsort(np.roll(way, -first, axis=0)[::-1])
            tried.append((sum(not in_a_row(one) for one in way[:, order]), len(tried), way, order))
    _, _, way, order = min(tried, key=lambda one: one[:2])
    return way[:, order], order


def in_a_row(places: Index) -> bool:
    """Whether each place is as far from the last as the second from the first, upwards."""
    apart = np.diff(places)
    return bool((apart == apart[:1]).all() and (apart[:1] >= 0).all())


Made = dict[int, tuple[int, tuple[int, ...]]]  # a value, the operation, and what it takes


@dataclass(frozen=True, eq=False)
class _Read:
    leaves: int  # inputs and constants
    constants: list[float]
    made: Made
    outputs: list[list[int]]


def _read(function: cs.Function, sizes: Sequence[int]) -> _Read:
    """The instructions with a number for each value, in place of places in a work vector."""
    inputs = np.cumsum([0, *sizes]).tolist()
    numbers: dict[str, int] = {}  # of constants by their text, as 0.0 == -0.0 and NaN != NaN
    constants: list[float] = []
    holds: dict[int, int] = {}
    made: Made = {}
    outputs = [[0] * function.nnz_out(k) for k in range(function.n_out())]
    count = function.n_instructions()
    fixed = [k for k in range(count) if function.instruction_id(k) == cs.OP_CONST]
    for k in fixed:
        x = float(function.instruction_constant(k))
        if (key := repr(x)) not in numbers:
            numbers[key] = inputs[-1] + len(constants)
            constants.append(x)
    leaves = inputs[-1] + len(constants)
    for k in range(count):
        operation = function.instruction_id(k)
        to, of = function.instruction_output(k), function.instruction_input(k)
        if operation == cs.OP_CONST:
            holds[to[0]] = numbers[repr(float(function.instruction_constant(k)))]
        elif operation == cs.OP_INPUT:
            holds[to[0]] = inputs[of[0]] + of[1]
        elif operation == cs.OP_OUTPUT:
            outputs[to[0]][to[1]] = holds[of[0]]
        else:
            made[leaves + k] = operation, tuple(holds[j] for j in of)
            holds[to[0]] = leaves + k
    return _Read(leaves, constants, made, outputs)


def _balanced(read: _Read) -> Made:
    """The same values, with sums of sums as trees of the least depth."""
    made, found = read.made, Made()
    uses = Counter(k for _, of in made.values() for k in of)
    uses.update(k for one in read.outputs for k in one)
    added_once = {
        k
        for operation, of in made.values()
        if operation == cs.OP_ADD
        for k in of
        if uses[k] == 1 and k in made and made[k][0] == cs.OP_ADD
    }
    depth: dict[int, int] = defaultdict(int)
    terms: dict[int, list[int]] = {}
    new = max(made, default=0) + 1
    for value, (operation, of) in made.items():
        if operation != cs.OP_ADD:
            found[value] = operation, of
            depth[value] = 1 + max(depth[k] for k in of)
            continue
        added = [terms.pop(k) if k in added_once else [k] for k in of]
        parts, others = sorted(added, key=len, reverse=True)
        parts += others  # the longer one stays where it is: thousands of terms come one by one
        if value in added_once:
            terms[value] = parts
            continue
        heap = [(depth[k], n, k) for n, k in enumerate(parts)]
        heapify(heap)
        while len(heap) > 1:
            a, b = heappop(heap), heappop(heap)
            total = value if not heap else new
            new += 1
            found[total] = cs.OP_ADD, (a[2], b[2])
            depth[total] = 1 + max(a[0], b[0])
            heappush(heap, (depth[total], new, total))
    return found
