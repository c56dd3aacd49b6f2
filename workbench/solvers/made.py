"""A solver of CasADi that is made once and serves one run on a problem after the other.

To make IPOPT's takes about as long as two of its iterations on the pose of a body, and a problem is
often solved again with other fixed numbers, as for each frame of a video.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

import casadi as cs

from workbench.problem import Problem
from workbench.solvers.external import External, Recorder
from workbench.solvers.limits import Stop

MOST = 500  # unknowns: with more, what a solver keeps takes memory, and making it hardly matters


@dataclass
class Made:
    """A solver and the functions that it calls, which serve one run at a time.

    Attributes:
        options: what else the solver depends on, beside the problem.
        functions: those that Python computes, by their names.
        solver: the solver; None until it is made.
    """

    options: object
    functions: dict[str, External | Recorder] = field(default_factory=dict)
    solver: cs.Function | None = None


@contextmanager
def made_for(problem: Problem, options: object) -> Iterator[Made]:
    """The solver that a run before has left with the problem, or else an empty place for one.

    It is left there for the next run, unless something unexpected happens. The problem keeps one:
    a run within a run gets its own.
    """
    try:
        found = problem.solvers_made.pop()  # at once, whatever other threads do
    except IndexError:
        found = None
    if not isinstance(found, Made) or found.options != options:
        found = Made(options)
    expected = False
    try:
        yield found
        expected = True
    except Stop:
        expected = True
        raise
    finally:
        for function in found.functions.values():
            function.leave()  # so that nothing of the run is kept
        small = problem.free.size <= MOST and not problem.sparse
        if expected and small and found.solver is not None:
            problem.solvers_made[:] = [found]
