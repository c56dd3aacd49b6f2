"""The workbench as a candidate, by its public face, with and without the compiled kernel."""

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any, TypeVar

import workbench as wb
from benchmarks.bodies_made_up import Case, case_of
from benchmarks.candidates import Candidate
from workbench.arrays import Array
from workbench.bodies.forward.compiled import CompiledMesh, joint_library, mesh_library
from workbench.problem import gram

NUMPY, COMPILED = "workbench", "workbench, compiled"
SWITCH = "WORKBENCH_COMPILE"
T = TypeVar("T")


@contextmanager
def compiling(allowed: bool) -> Iterator[None]:
    """Allow the compiled kernel, or not, while a problem is built and first used."""
    before = os.environ.get(SWITCH)
    os.environ[SWITCH] = "1" if allowed else "0"
    _forget()  # what is remembered for the whole process
    try:
        yield
    finally:
        _forget()
        os.environ.pop(SWITCH)
        if before is not None:
            os.environ[SWITCH] = before


def _forget() -> None:
    mesh_library.cache_clear()
    joint_library.cache_clear()
    gram.compiled.cache_clear()


def ways(body: wb.SkinnedBody) -> dict[str, bool]:
    """How the workbench can compute a body here, and whether it may compile for that."""
    found = {NUMPY: False}
    with compiling(True):
        if isinstance(replace(body).numeric.mesh(), CompiledMesh):
            found[COMPILED] = True
    return found


def cases(name: str, body: wb.SkinnedBody) -> dict[str, Case]:
    """The problem of each way that the workbench can compute here, built and used once."""
    made = {}
    for way, allowed in ways(body).items():
        with compiling(allowed):
            case = case_of(name, body)
            case.problem.prepare()
            for x in case.people(2, seed=1):
                case.problem.linearize_at(x, case.fixed).step()
        made[way] = case
    return made


def as_built(way: str, run: Callable[..., T]) -> Callable[..., T]:
    """A function that gets no compiled linear algebra either, if `way` compiles nothing."""

    def plainly(*arguments: Any) -> T:
        before = gram.compiled
        vars(gram)["compiled"] = _nothing
        try:
            return run(*arguments)
        finally:
            vars(gram)["compiled"] = before

    return plainly if way == NUMPY else run


def _nothing() -> None:
    """What `gram.compiled` is without a compiler."""


def candidate(name: str, case: Case) -> Candidate:
    """Through Problem.residual, Problem.linearize_at and Linearization.step."""
    problem, fixed = case.problem, case.fixed

    def jacobian(x: Array) -> tuple[Array, Array]:
        here = problem.linearize_at(x, fixed)
        return here.residual, here.jacobian

    forward: Callable[[Array], Array] = lambda x: problem.residual(x, fixed)  # noqa: E731
    step = as_built(name, lambda x: problem.linearize_at(x, fixed).step())
    return Candidate(name, forward, jacobian, step)
