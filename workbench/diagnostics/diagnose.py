"""Diagnoses of a problem at a point: the public functions."""

from collections.abc import Iterable, Mapping

from numpy.typing import ArrayLike

from workbench.blocks.checks import texts
from workbench.diagnostics import sequence_words
from workbench.diagnostics.diagnosis import Diagnosis
from workbench.diagnostics.linearized import linearized
from workbench.diagnostics.sequences import SequenceDiagnosis
from workbench.diagnostics.words import diagnosis_of
from workbench.errors import BadArgument
from workbench.problem import Linearization, Problem
from workbench.problem.storage import check_wide, is_long


def diagnose(
    problem: Problem, at: Mapping[str, ArrayLike], *, priors: str | Iterable[str] = ()
) -> Diagnosis | SequenceDiagnosis:
    """Diagnose a problem by its whitened Jacobian at the values `at`.

    For a long sequence of frames, with more than 4,000 unknowns, the result is a SequenceDiagnosis:
    it answers the same questions about rank and null directions, frame after frame, and has no
    singular values. For any other problem it is a Diagnosis.

    `priors` are the names of the residuals that are priors and not data, or one such name; the
    diagnosis separates what they contribute. Raises UnknownName for a name that no residual has,
    BadArgument for anything but a problem, and whatever `Problem.split` raises for the values.
    """
    names = _checked(problem, priors)
    here = linearized(problem, at)  # looks at every value
    if is_long(here.jacobian):
        return SequenceDiagnosis(problem, problem.read(at), here, sequence_words.WORDING, names)
    return _whole(problem, at, here, names)


def diagnose_whole(
    problem: Problem, at: Mapping[str, ArrayLike], *, priors: str | Iterable[str] = ()
) -> Diagnosis:
    """A diagnosis with singular values. Raises TooLarge for a long sequence."""
    names = _checked(problem, priors)
    return _whole(problem, at, linearized(problem, at), names)


def _whole(
    problem: Problem, at: Mapping[str, ArrayLike], here: Linearization, priors: tuple[str, ...]
) -> Diagnosis:
    check_wide(here.jacobian)
    return diagnosis_of(problem, problem.read(at), here, priors)


def _checked(problem: Problem, priors: str | Iterable[str]) -> tuple[str, ...]:
    if not isinstance(problem, Problem):
        raise BadArgument(f"a Problem is diagnosed, not something of type {type(problem).__name__}")
    names = texts("the names of priors", priors)
    problem.rows_named(names)
    return names
