"""The instructions of a function in groups, and the memory that they work on."""

import time

import casadi as cs
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from tests.blocks.operations import every_operation
from workbench.blocks.programs import Program, as_slice, places_of
from workbench.blocks.schedule import Group, Schedule

RNG = np.random.default_rng(5)


def groups_of(schedule: Schedule, operation: int) -> list[Group]:
    return [group for group in schedule.groups if group.operation == operation]


def test_what_is_alike_is_one_step() -> None:
    """The lengths of seven differences: one step for each operation, whatever their number."""
    a, b = cs.SX.sym("a", 3, 7), cs.SX.sym("b", 3, 7)
    f = cs.Function("f", [a, b], [cs.sqrt(cs.sum1((a - b) ** 2)).T])
    schedule = Schedule.of(f)
    assert f.n_instructions() > 100
    assert [group.operands.shape[1] for group in schedule.groups] == [21, 21, 7, 7, 7]
    assert [len(values) for values in schedule.outputs] == [7]


def test_no_instruction_comes_before_what_it_needs() -> None:
    schedule = Schedule.of(every_operation())
    known = sum(schedule.sizes) + len(schedule.constants)
    for group in schedule.groups:
        assert group.operands.max() < group.first == known
        known += group.operands.shape[1]


def test_long_sums_take_few_steps() -> None:
    x = cs.SX.sym("x", 100)
    total = x[0]
    for k in range(1, 100):
        total = total + x[k]
    f = cs.Function("f", [x], [total, total * x[0]])  # needed twice
    schedule = Schedule.of(f)
    added = groups_of(schedule, cs.OP_ADD)
    assert len(added) == 7  # 2^7 > 100
    assert sum(group.operands.shape[1] for group in added) == 99
    X = RNG.standard_normal((100, 3))
    program = Program.of(schedule, 3)
    program.given[0][:] = X
    program.run()
    assert_allclose(program.found[0][0], X.sum(axis=0), rtol=1e-13)
    assert_allclose(program.found[1][0], X.sum(axis=0) * X[0], rtol=1e-13)


def seconds_of_a_sum(terms: int) -> float:
    """How long the schedule of a sum takes that is written one term after the other."""
    x = cs.SX.sym("x", terms)
    total = x[0]
    for k in range(1, terms):
        total = x[k] + total
    f = cs.Function("f", [x], [total])
    began = time.process_time()
    Schedule.of(f)
    return time.process_time() - began


def test_time_grows_with_the_terms_of_a_sum_and_not_with_their_square() -> None:
    short = min(seconds_of_a_sum(2000) for _ in range(3))
    assert seconds_of_a_sum(20_000) < 25 * short


def test_a_chain_is_not_sorted(monkeypatch: pytest.MonkeyPatch) -> None:
    """It has thousands of groups of one instruction, and each sort takes half a millisecond."""
    x = cs.SX.sym("x", 2)
    last = x[0]
    for _ in range(10):
        last = cs.sin(last) * x[1]

    def never(_: object) -> None:
        raise AssertionError("sorted")

    f = cs.Function("f", [x], [last])
    monkeypatch.setattr(np, "lexsort", never)
    assert [group.operands.shape[1] for group in Schedule.of(f).groups] == [1] * 20


def test_a_sum_that_others_need_is_kept() -> None:
    x = cs.SX.sym("x", 4)
    early = x[0] + x[1]
    f = cs.Function("f", [x], [early + x[2] + x[3], early, cs.sin(early)])
    X = RNG.standard_normal((4, 2))
    program = Program.of(Schedule.of(f), 2)
    program.given[0][:] = X
    program.run()
    assert_allclose(program.found[0][0], X.sum(axis=0), rtol=1e-14)
    assert_array_equal(program.found[1][0], X[0] + X[1])
    assert_array_equal(program.found[2][0], np.sin(X[0] + X[1]))


def test_memory_is_used_again_and_not_too_early() -> None:
    """A chain of steps on all of its numbers, and the first results once more at the end."""
    x = cs.SX.sym("x", 20)
    first = cs.sin(x)
    last = first
    for _ in range(30):
        last = cs.cos(last)
    f = cs.Function("f", [x], [last - first])
    program = Program.of(Schedule.of(f), 2)
    memory = program.given[0].base
    assert memory is not None
    assert len(memory) <= 5 * 20
    X = RNG.standard_normal((20, 2))
    program.given[0][:] = X
    program.run()
    right = np.sin(X)
    for _ in range(30):
        right = np.cos(right)
    assert_array_equal(program.found[0], right - np.sin(X))


def test_no_result_takes_the_place_of_what_is_still_needed() -> None:
    schedule = Schedule.of(every_operation())
    leaves = sum(schedule.sizes) + len(schedule.constants)
    place, size = places_of(schedule, leaves)
    needed: set[int] = {int(value) for values in schedule.outputs for value in values}
    assert size < len(place)  # some memory is used again
    for group in reversed(schedule.groups):
        made = set(range(group.first, group.first + group.operands.shape[1]))
        needed |= set(group.operands.ravel().tolist())  # also while this group is carried out
        others = {int(place[value]) for value in needed - made}
        assert not others & {int(place[value]) for value in made}
        needed -= made


def test_places_in_a_row_are_a_slice() -> None:
    at = np.arange(50)
    for places in ([3], [4, 5, 6], [2, 5, 8, 11]):
        found = as_slice(np.array(places))
        assert isinstance(found, slice)
        assert_array_equal(at[found], places)
    for places in ([3, 3], [5, 4], [1, 2, 4]):
        assert not isinstance(as_slice(np.array(places)), slice)
