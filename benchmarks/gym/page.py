"""The page of the gym, written from the numbers that were kept."""

import json
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.gym.case import Case
from benchmarks.gym.runs import Kept
from workbench.arrays import Array
from workbench.comparison.statistics import performance_profile
from workbench.solvers import DEFAULT

HEADINGS = {"tuning": "Cases on which solvers may be tuned", "untouched": "Untouched cases"}
FACTORS = (1, 1.25, 1.5, 2, 3, 5, 10)
LEAST, PRICED = "evaluations", "effort"  # what a profile counts
TRF = ("peer trf", "peer trf, jac")
PROFILED = (  # of those that were run: a profile depends on who takes part
    DEFAULT,
    "levenberg-marquardt",
    "levenberg-marquardt-columns",
    "gauss-newton",
    "dogleg",
    *TRF,
    "peer dogbox",
    "peer dogbox, jac",
    "peer lm",
)
INTRODUCTION = """# The gym

`python -m benchmarks.gym` runs solvers on problems with known answers: regressions that NIST
certified; published sums of squares from their own starts and from starts 10 and 100 times as far
from the origin; curves and regressions with outliers that were drawn at random; bundle adjustment;
arms that have to reach a point; and bodies. `gym/cases.py` lists them, and each module beside it
names its sources. A hash of a problem's name decides whether solvers may be tuned on it
(`gym/split.py`). The others are left untouched: they are run only by
`python -m benchmarks.gym --untouched PURPOSE`, which records every such look in `gym/looks.md`.

A run has *solved* a case if it ends at a cost of at most (1 + 1e-6) f* + 1e-12 f_0, where f* is the
cost of the known answer and f_0 the least of the costs at all starts of the problem. Where NIST
certified the parameters, these must agree to four digits as well. *False claims* counts the runs
that say that they converged and have not solved the case. A run that converged to a minimum with a
higher cost is one of them. *Evaluations* is the median number of evaluations of all kinds until the
case was solved. It is a median over the cases that this solver solved, so a solver that solves only
easy cases has a small one. All runs are limited to 2,000 evaluations and 30 seconds, and have a
gradient tolerance of 1e-12. The row "as it comes" is the default solver with its own limits and its
own tolerance of 1e-6 instead. `peer` is `scipy.optimize.least_squares` without the workbench around
it, and `jac` says that its option `x_scale` is `"jac"`.

How many digits are right depends on the tolerance. On the 24 runs of the suite `nist`, the worst
parameter of each has 10.5 certified digits in the mean with a tolerance of 1e-12 (capped at 11; the
fewest are 7.9), but 7.0 with the default's own tolerance of 1e-6 (the fewest are 4.8). For ten
digits, ask for `TrustRegion(gradient_tolerance=1e-12)`. `tests/experiments/test_nist.py` holds
these numbers.

The untouched cases were looked at four times, and `gym/looks.md` lists every time. At the first
look the default solved 162 of them, and 266 of those for tuning. It missed three untouched ones
that SciPy's trf or MINPACK reach; all three are sums of exponentials, and the default ended at
other minima. On the cases for tuning, most such ends were reached slowly, and a shorter first step
led to the lower minimum. At the second and third look the default made up to three further
attempts from the same start where its end was doubtful. It no longer does: they changed nothing on
the suites `nist` and `more-wild`, and took 20 % more evaluations. On 300 other problems that were
drawn from the same families, it solved 267 with them and 256 without; `Starts` is the tool for the
others. At the fourth look, with one attempt and its own limits, it solved 161 of 172; the tables
are older than that. The later looks measured the default alone; the numbers of all others are those
of the first. After the third one, two of its runs were made once more, because the machine had
stopped their process until their time was over.

A performance profile (Dolan and Moré 2002) says for each factor which share of the cases a solver
solves with at most this factor times the evaluations of the solver in the table that needs the
fewest. A second table counts effort instead, which is evaluations of the residual at the prices of
`workbench.comparison.targets`.
"""


def kept(cases: Sequence[Case], runs: Sequence[Kept]) -> dict[str, Any]:
    """Cases, and by solver what is needed for the page, in the order of the cases."""
    by = {(one.case, one.solver): one for one in runs}
    names = dict.fromkeys(one.solver for one in runs)
    return {
        "cases": [[one.name, one.family] for one in cases],
        "solvers": {
            name: {
                "solved": [int(by[one.name, name].solved) for one in cases],
                "claimed": [int(by[one.name, name].claimed) for one in cases],
                "evaluations": [by[one.name, name].evaluations for one in cases],
                "effort": [by[one.name, name].effort for one in cases],
            }
            for name in names
        },
    }


def read(path: Path) -> dict[str, Any]:
    """The numbers as they were kept."""
    found: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return found


def renewed(before: Mapping[str, Any], found: Mapping[str, Any]) -> dict[str, Any]:
    """The numbers of before, with those of the solvers that were run again in their places.

    If all were run again, or the cases are others, nothing of before is left.
    """
    again = list(found["solvers"])
    if before["cases"] != found["cases"] or set(before["solvers"]) <= set(again):
        return dict(found)
    return {
        **before,
        "solvers": {**before["solvers"], **found["solvers"]},
        "again": {"solvers": again, "machine": found["machine"]},
    }


def efforts(found: Mapping[str, Any], solvers: Sequence[str], by: str) -> Array:
    """(P, S) evaluations or effort until the target, infinite where it was not met."""
    columns = [
        np.where(np.array(row["solved"], bool), row[by], np.inf)
        for row in (found["solvers"][name] for name in solvers)
    ]
    return np.column_stack(columns)


def profiled(found: Mapping[str, Any]) -> list[str]:
    """The solvers of the profile that were run."""
    return [name for name in PROFILED if name in found["solvers"]]


def profile(found: Mapping[str, Any], factors: Sequence[float] = FACTORS, by: str = LEAST) -> Array:
    """(len(factors), S) the performance profile of the `profiled` solvers."""
    return performance_profile(efforts(found, profiled(found), by), factors)


def lost(found: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Names and families of the cases that SciPy's trf solves, scaled or not, and we do not."""
    solvers = found["solvers"]
    ours = solvers[DEFAULT]["solved"]
    theirs = np.any([solvers[name]["solved"] for name in TRF if name in solvers], axis=0)
    return [
        (name, family)
        for (name, family), mine, other in zip(found["cases"], ours, theirs, strict=True)
        if other and not mine
    ]


def write(path: Path, parts: Mapping[str, Mapping[str, Any]]) -> None:
    """The whole page as Markdown; `parts` are by the name of the half."""
    path.write_text("\n".join(lines(parts)) + "\n", encoding="utf-8")


def lines(parts: Mapping[str, Mapping[str, Any]]) -> Iterator[str]:
    """Line by line."""
    yield INTRODUCTION
    for half, found in parts.items():
        yield f"## {HEADINGS[half]}\n"
        yield from _half(half, found)


def _half(half: str, found: Mapping[str, Any]) -> Iterator[str]:
    families = Counter(family for _, family in found["cases"])
    yield (
        f"{len(found['cases'])} cases: "
        + "; ".join(f"{count} {family}" for family, count in families.items())
        + ".\n"
    )
    yield "| solver | solved | false claims | evaluations |"
    yield "| --- | --: | --: | --: |"
    for name, row in sorted(found["solvers"].items(), key=lambda item: -sum(item[1]["solved"])):
        solved = np.array(row["solved"], bool)
        false = int(np.sum(np.array(row["claimed"], bool) & ~solved))
        median = np.median(np.array(row["evaluations"])[solved]) if solved.any() else np.nan
        yield f"| {name} | {solved.sum()} of {solved.size} | {false} | {median:,.0f} |"
    names = profiled(found)
    for by in (LEAST, PRICED):
        yield f"\nThe performance profile, by factors of the least {by}:\n"
        yield "| solver | " + " | ".join(f"{factor:g}" for factor in FACTORS) + " |"
        yield "| --- |" + " --: |" * len(FACTORS)
        for name, shares in zip(names, profile(found, by=by).T, strict=True):
            yield f"| {name} | " + " | ".join(f"{share:.1%}" for share in shares) + " |"
    yield f"\n![Performance profiles on the {half} cases](results/gym-{half}.svg)\n"
    missing = lost(found)
    if missing:
        yield (
            "Cases that SciPy's trf solves with at least one of its two scalings, and the default "
            "does not:\n"
        )
        for name, family in missing:
            yield f"- {name} ({family})"
        yield ""
    yield from _families(families, found, names)
    if found.get("machine"):
        yield f"Measured on {_where(found['machine'])}.\n"
    if "again" in found:
        *others, last = found["again"]["solvers"]
        which = f"{', '.join(others)} and {last} were" if others else f"{last} was"
        yield f"Of these, {which} measured again on {_where(found['again']['machine'])}.\n"


def _where(facts: Mapping[str, Any]) -> str:
    return f"{facts.get('processor', 'one machine')}, {facts.get('date', '')}"


def _families(
    families: Mapping[str, int], found: Mapping[str, Any], names: Sequence[str]
) -> Iterator[str]:
    """Solved cases by family, of the solvers of the profile."""
    of = np.array([family for _, family in found["cases"]])
    yield "Solved cases by family:\n"
    yield "| family | cases | " + " | ".join(names) + " |"
    yield "| --- |" + " --: |" * (1 + len(names))
    for family, count in families.items():
        solved = (
            int(np.array(found["solvers"][name]["solved"])[of == family].sum()) for name in names
        )
        yield f"| {family} | {count} | " + " | ".join(map(str, solved)) + " |"
    yield ""
