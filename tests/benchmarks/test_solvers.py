"""The cases with known answers: what was published, which are held out, and how runs are judged."""

import hashlib

import numpy as np
import pytest

from benchmarks import measuring
from benchmarks.solvers import comparing
from benchmarks.solvers.case import data
from benchmarks.solvers.cases import CASES, NEW, held_out, is_for_tuning, tuning
from benchmarks.solvers.kinds import KINDS
from workbench.comparison import Budget, compare
from workbench.fitting.setup import Setup
from workbench.solvers import DEFAULT

pytestmark = pytest.mark.thorough

FIRST = {one.problem: one for one in reversed(NEW)}
STORED = sorted(data("answers"))
PUBLISHED = {  # the least sum of squares, as published
    "chain-singular-broyden": "0",
    "el-attar": "1.712780",
    "exponential-growth": "0.240511",
    "hatfield-d": "6.615114e-08",
    "himmelblau-32": "318.572",
    "judge": "16.0817",
    "mgh-broyden-banded": "0",
    "mgh-discrete-boundary": "0",
    "mgh-discrete-integral": "0",
    "mgh-gaussian": "1.12793e-08",
    "mgh-penalty-1": "7.08765e-05",
    "mgh-penalty-2": "2.93661e-04",
    "mgh-powell-badly-scaled": "0",
    "schittkowski-308": "0.773199",
    "vibrating-beam": "0.156446",
}
STARTS = {  # sums of squares there, which the edition of CUTEst in sif2jax has as well
    "mgh-beale": 14.203125,
    "mgh-biggs-exp6": 0.77907007565597,
    "mgh-brown-badly-scaled": 999998000003.0,
    "mgh-gaussian": 3.88810699e-06,
    "mgh-powell-badly-scaled": 1.13526171734838,
    "cluster": 1.0,
    "dennis-schnabel-d": 83210000.0,
    "devilliers-glasser-1": 105127.0,
    "devilliers-glasser-2": 10940.1,
    "engvall": 629.0,
    "exponential-growth": 24.0625,
    "gottfried": 5.78993,
    "heart-6": 564.813,
    "pole-fit": 946.568,
    "vibrating-beam": 8231.28,
}
SMALL = tuple(
    one for one in tuning() if one.name in ("arm-planar-3-0", "more-wild-rosenbrock-2, start x 1")
)


def built(problem: str) -> Setup:
    return FIRST[problem].experiment.setup()


def told(problems: set[str]) -> str:
    return hashlib.sha256("\n".join(sorted(problems)).encode()).hexdigest()[:16]


def test_split_is_the_committed_one() -> None:
    """A problem that is added belongs where its hash says; none may change sides."""
    assert len(CASES) == len({one.name for one in CASES}) == 469
    assert told({one.problem for one in held_out()}) == "c5f26e28fc1f135f"
    assert told({one.problem for one in tuning(NEW)}) == "a4734a7e15d25739"
    sides: dict[str, set[bool]] = {}
    for one in CASES:
        sides.setdefault(one.problem, set()).add(is_for_tuning(one))
    assert all(len(side) == 1 for side in sides.values())


def test_certified_answers_are_minima() -> None:
    for name in data("nist"):
        setup = built(f"nist-{name.lower()}")
        known = setup.known
        assert known is not None
        assert known.values is not None
        here = setup.problem.linearize(known.values)
        assert here.cost == pytest.approx(known.cost, rel=2e-10), name
        dof = setup.problem.size - setup.problem.free.size
        deviation = np.sqrt(2 * here.cost / dof)
        assert known.residual_deviation == pytest.approx(deviation, rel=2e-10), name
        step = here.step() / setup.problem.free.pack(known.values)
        assert np.abs(step).max() < 1e-6, name


def test_stored_answers_are_minima() -> None:
    """The cost is the stored one, and nothing leads down; a singular answer costs nothing."""
    for name in STORED:
        setup, stored = built(name), data("answers")[name]
        x, fixed = np.array(stored["x"], dtype=float), np.zeros(setup.problem.fixed.size)
        here = setup.problem.linearize_at(x, fixed)
        start = setup.problem.linearize(setup.start).cost
        assert here.cost == pytest.approx(stored["cost"], rel=1e-9, abs=1e-20 * start), name
        if not stored["how"].endswith("singular"):
            cosines = here.gradient / here.column_norms
            assert np.abs(cosines).max() <= 1e-9 * np.sqrt(2 * start), name


def test_published_costs_come_out_in_all_their_digits() -> None:
    for name, published in PUBLISHED.items():
        found = 2 * data("answers")[name]["cost"]
        if published == "0":
            assert found == 0, name
            continue
        digits = len(published.partition("e")[0].replace(".", "").lstrip("0"))
        assert found == pytest.approx(float(published), rel=2 * 10.0 ** (1 - digits)), name
    for name, cost in STARTS.items():
        setup = built(name)
        assert 2 * setup.problem.linearize(setup.start).cost == pytest.approx(cost, rel=1e-5), name


def test_runs_are_judged_by_known_answers() -> None:
    entrants = {name: comparing.ENTRANTS[name] for name in (DEFAULT, "peer trf", "peer lm")}
    experiments = [one.experiment for one in SMALL]
    found = comparing.counted(SMALL, compare(experiments, entrants))
    assert found["families"] == {"more-wild, tuned": 1, "kinematics": 1}
    for row in found["solvers"].values():
        assert (row["solved"], row["false claims"], row["by family"]) == (2, 0, [1, 1])
    assert found["missed"] == []
    assert all(shares[-1] == 1 for shares in found["profiles"]["effort"].values())
    text = comparing.tables({"tuning": found})
    assert f"| {DEFAULT} | 2 of 2 | 0 |" in text
    short = compare(experiments, entrants, budget=Budget(max_evaluations=2))
    assert comparing.counted(SMALL, short)["solvers"][DEFAULT]["solved"] == 0


def test_kept_numbers_are_of_the_present_plan() -> None:
    kept = measuring.kept("solvers")
    assert kept is not None
    found = kept["found"]
    assert set(found["kinds"]) - {"machine"} == set(KINDS)
    for half, cases in (("tuning", tuning()), ("held-out", held_out())):
        assert sum(found[half]["families"].values()) == len(cases)
        for profile in found[half]["profiles"].values():
            best = np.max(list(profile.values()), axis=0)
            assert (np.array(profile[DEFAULT]) >= best - 0.02).all()
    position = list(found["held-out"]["families"]).index("nist")
    assert found["held-out"]["solvers"][DEFAULT]["by family"][position] == 30
