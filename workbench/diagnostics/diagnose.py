"""Diagnoses of a problem at a point: the public functions."""

from collections.abc import Iterable, Mapping

from numpy.typing import ArrayLike

from workbench.blocks import Values
from workbench.blocks.checks import several, texts
from workbench.diagnostics.active_set import linearized
from workbench.diagnostics.diagnosis import Diagnosis
from workbench.diagnostics.gauges import Gauge
from workbench.diagnostics.scales import checked
from workbench.diagnostics.sequences import SequenceDiagnosis
from workbench.errors import BadArgument
from workbench.problem import Linearization, Problem
from workbench.problem.storage import check_wide, is_long


def diagnose(
    problem: Problem,
    at: Mapping[str, ArrayLike],
    *,
    priors: str | Iterable[str] = (),
    gauges: Iterable[Gauge] = (),
    scales: Mapping[str, ArrayLike] | None = None,
) -> Diagnosis | SequenceDiagnosis:
    """Diagnose a problem by its whitened Jacobian at the values `at`.

    For a long sequence of frames, with more than 4,000 unknowns, the result is a SequenceDiagnosis:
    it answers the same questions about rank and null directions, frame after frame, and has no
    singular values. For any other problem it is a Diagnosis, which has none either where the
    Jacobian is large and sparse: it is factorized instead.

    Contacts with a scan, which are chosen anew at every point, are held as they are at `at`.

    `priors` are the names of the residuals that are priors and not data, or one such name; the
    diagnosis separates what they contribute. `gauges` are motions that the problem is invariant to
    if other unknowns undo them, and that the diagnosis does not find by itself; see `Gauge`.

    `scales` say how large a change of the unknowns of a block matters, in its unit and of its shape
    or as one number: `{"radius": 7e6}`. What is called weak or identified is compared with them,
    and suggested priors are as wide. Without them they are chosen as the module `scales` says.

    Raises UnknownName for a name that no residual has, or no free block, BadArgument for anything
    but a problem, TooLarge where the factor of a sparse Jacobian would have more than 5e7 entries,
    or its null space is too large, and whatever `Problem.split` raises for the values.
    """
    names = _checked(problem, priors)
    declared = several("gauges", gauges, Gauge, BadArgument)
    problem = problem.frozen(at)
    here = linearized(problem, at)  # looks at every value
    given = checked(scales, problem.free)
    if is_long(here.jacobian):
        if given:
            raise BadArgument("a long sequence of frames chooses its own scales; leave them out")
        return SequenceDiagnosis(problem, problem.read(at), here, names, declared)
    return _whole(problem, at, here, names, declared, given)


def diagnose_whole(
    problem: Problem,
    at: Mapping[str, ArrayLike],
    *,
    priors: str | Iterable[str] = (),
    gauges: Iterable[Gauge] = (),
    scales: Mapping[str, ArrayLike] | None = None,
) -> Diagnosis:
    """A diagnosis with singular values. Raises TooLarge for a long sequence."""
    names = _checked(problem, priors)
    declared = several("gauges", gauges, Gauge, BadArgument)
    problem = problem.frozen(at)
    given = checked(scales, problem.free)
    return _whole(problem, at, linearized(problem, at), names, declared, given)


def _whole(
    problem: Problem,
    at: Mapping[str, ArrayLike],
    here: Linearization,
    priors: tuple[str, ...],
    gauges: tuple[Gauge, ...],
    scales: Values,
) -> Diagnosis:
    found = Diagnosis(problem, problem.read(at), here, priors, gauges, scales)
    if here.by_frames:
        check_wide(here.jacobian)
    if here.finite and here.estimated:
        _ = found.rank  # what is too large is said at once
    return found


def _checked(problem: Problem, priors: str | Iterable[str]) -> tuple[str, ...]:
    if not isinstance(problem, Problem):
        raise BadArgument(f"a Problem is diagnosed, not something of type {type(problem).__name__}")
    names = texts("the names of priors", priors)
    problem.rows_named(names)
    return names
