"""A solver object of CasADi that is made once and then serves several runs on the same problem.

To make that of IPOPT takes about as long as two iterations of IPOPT on the pose of a body, and a
problem is often solved again with other fixed numbers, as for each frame of a video.
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
    """The solver that an earlier run left with the problem, or an empty `Made` to put one into.

    Afterwards it is left with the problem for the next run, unless something unexpected was raised,
    the problem is sparse, or it has more than 500 unknowns. A problem keeps one solver at a time,
    so that a run within a run makes its own.
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
