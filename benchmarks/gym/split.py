"""Which problems solvers may be tuned on, and which are left untouched until a closing measurement.

All starts of a problem are on the same side. A problem on which something was tuned before there
was a gym is for tuning. NIST's regressions that the gym added are untouched. Everything else is
decided by the hash of the problem's name, which nobody chose for its effect.
"""

import hashlib
from collections.abc import Iterable

from benchmarks.gym.case import Case
from benchmarks.gym.cases import CASES

# the suites `nist` and `more-wild`, and functions that `benchmarks.choosing` has with more unknowns
TUNED_FAMILIES = ("nist, tuned", "more-wild, tuned")
TUNED_PROBLEMS = ("mgh-extended-rosenbrock", "mgh-broyden-tridiagonal")
UNTOUCHED_FAMILIES = ("nist",)


def is_even(name: str) -> bool:
    """Whether the last byte of the SHA-256 of a name is even."""
    return hashlib.sha256(name.encode()).digest()[-1] % 2 == 0


def is_for_tuning(case: Case) -> bool:
    """Whether solvers may be tuned on a case."""
    if case.family in TUNED_FAMILIES or case.problem in TUNED_PROBLEMS:
        return True
    return case.family not in UNTOUCHED_FAMILIES and is_even(case.problem)


def tuning(cases: Iterable[Case] = CASES) -> tuple[Case, ...]:
    """The cases that solvers may be tuned on."""
    return tuple(one for one in cases if is_for_tuning(one))


def untouched(cases: Iterable[Case] = CASES) -> tuple[Case, ...]:
    """The cases that are run only through `looks.looked`, which records it."""
    return tuple(one for one in cases if not is_for_tuning(one))
