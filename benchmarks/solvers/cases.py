"""All cases, and which of them solvers may be tuned on.

All starts of a problem are on the same side. A problem on which something was tuned before there
were these cases is for tuning. NIST's regressions that were added are held out. Everything else is
decided by the hash of the problem's name, which nobody chose for its effect.
"""

import hashlib
from collections.abc import Iterable
from datetime import UTC, datetime
from pathlib import Path

from benchmarks.measuring import commit
from benchmarks.solvers.case import Case, case
from benchmarks.solvers.curves import ADDED, CURVES, FARTHER, ROBUST
from benchmarks.solvers.geometry import ARMS, BUNDLES, FAR_BODIES
from benchmarks.solvers.sums import SUMS
from workbench.experiments import SUITES
from workbench.experiments.more_wild import FAMILIES, MORE_WILD, more_wild
from workbench.experiments.nist import nist
from workbench.identity import code_version

TUNED_NIST: tuple[Case, ...] = tuple(
    case(one.name, "nist, tuned", nist, {**one.arguments, "start": start}, f"start {start}")
    for one in SUITES["nist"]
    for start in (1, 2)
)
SCALED = (
    *((str(one.arguments["function"]), one.arguments) for one in MORE_WILD),
    *(
        (function, {"function": function, "n": n, "scale": 100.0})
        for function, family in FAMILIES.items()
        for n in family.sizes
        if function != "mancino"  # whose start is nearly its answer, in units of its own
    ),
)
TUNED_SUMS: tuple[Case, ...] = tuple(
    case(
        f"more-wild-{function}-{arguments['n']}",
        "more-wild, tuned",
        more_wild,
        arguments,
        f"start x {arguments['scale']:g}",
    )
    for function, arguments in SCALED
)
NEW: tuple[Case, ...] = (*ADDED, *SUMS, *CURVES, *ROBUST, *BUNDLES, *ARMS, *FAR_BODIES)
CASES: tuple[Case, ...] = (*TUNED_NIST, *FARTHER, *TUNED_SUMS, *NEW)
# the suites `nist` and `more-wild`, and functions that `kinds` has with more unknowns
TUNED_FAMILIES = ("nist, tuned", "more-wild, tuned")
TUNED_PROBLEMS = ("mgh-extended-rosenbrock", "mgh-broyden-tridiagonal")
HELD_OUT_FAMILIES = ("nist",)
LOG = Path(__file__).parent / "looks.md"  # of looks at the cases that are held out


def is_for_tuning(case: Case) -> bool:
    """Whether solvers may be tuned on a case."""
    if case.family in TUNED_FAMILIES or case.problem in TUNED_PROBLEMS:
        return True
    even = hashlib.sha256(case.problem.encode()).digest()[-1] % 2 == 0
    return case.family not in HELD_OUT_FAMILIES and even


def tuning(cases: Iterable[Case] = CASES) -> tuple[Case, ...]:
    """The cases that solvers may be tuned on."""
    return tuple(one for one in cases if is_for_tuning(one))


def held_out(cases: Iterable[Case] = CASES) -> tuple[Case, ...]:
    """The others, which are run only through `look`."""
    return tuple(one for one in cases if not is_for_tuning(one))


def look(purpose: str, log: Path = LOG) -> tuple[Case, ...]:
    """The cases that are held out, after this look at them has been written down.

    The log belongs into the repository: a look that is not committed has still been taken. Raises
    ValueError for an empty purpose, and OSError if the log cannot be written.
    """
    said = " ".join(purpose.split()).replace("|", "/")
    if not said:
        raise ValueError("say what the look at the held-out cases is for: --purpose WORDS")
    text = log.read_text(encoding="utf-8")
    date = datetime.now(UTC).isoformat(timespec="seconds")
    log.write_text(f"{text}| {date} | {commit()} | {code_version()} | {said} |\n", "utf-8")
    return held_out()
