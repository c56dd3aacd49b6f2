"""What an instance is, before anybody solves it: its size, its start, what an evaluation costs."""

import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from workbench.arrays import Array
from workbench.comparison.record import Stored, array_of, finite_array_of
from workbench.comparison.running import look
from workbench.errors import BadFile, listed
from workbench.experiments.running import warm
from workbench.fitting.setup import Setup
from workbench.reading.facts import Facts, amount
from workbench.threads import limited_threads

PROBES = (0.0, 1e-3, 0.1, 1.0)  # sizes of the points at which two problems are told apart
TIMED = ("residual", "gradient", "jacobian")
SAME = 1e-9  # relative difference of costs there, for problems that are the same
BATCHES, BATCH = 6, 0.01  # s: the quickest of some batches is what an evaluation takes
STEP = 1e-7  # between the points of a batch


@dataclass(frozen=True, eq=False)
class Description:
    """An instance as a worker process found it.

    Attributes:
        instance: its name.
        rows: m, the number of residual rows.
        unknowns: n, the number of free numbers.
        bounded: whether there are bounds.
        start: (n,) the free numbers at the start.
        start_cost: the cost at the start.
        probes: (4,) the costs at points that do not depend on the start.
        seconds: the time of one evaluation of the residual, the gradient and the Jacobian.
        known_cost: the cost of the known answer; NaN if none is known.
        known_source: where the known answer comes from.
        certified: whether the values of the known answer are known.
        question: the question that the experiment asks.
    """

    instance: str
    rows: int
    unknowns: int
    bounded: bool
    start: Array
    start_cost: float
    probes: Array
    seconds: dict[str, float]
    known_cost: float
    known_source: str
    certified: bool
    question: str

    def same_problem(self, other: "Description") -> bool:
        """Whether only the starts differ: sizes are equal, and costs wherever one looked."""
        if (self.rows, self.unknowns, self.bounded) != (other.rows, other.unknowns, other.bounded):
            return False
        a, b = self.probes, other.probes
        if not np.isfinite(a).any():
            return self.instance == other.instance
        return bool(np.allclose(a, b, rtol=SAME, atol=0, equal_nan=True))

    def stored(self) -> Stored:
        """The description as facts and arrays; `of` reads them."""
        facts = asdict(self)
        return facts, {"start": facts.pop("start"), "probes": facts.pop("probes")}

    @staticmethod
    def of(stored: Stored) -> "Description":
        """The description that `stored` gave. Raises BadFile for anything else."""
        facts, arrays = Facts(stored[0]), stored[1]
        start, probes = finite_array_of(arrays, "start", 1), array_of(arrays, "probes", 1)
        found = Description(
            instance=facts.text("instance"),
            rows=facts.whole("rows"),
            unknowns=facts.whole("unknowns"),
            bounded=facts.truth("bounded"),
            start=start,
            start_cost=facts.amount("start_cost"),
            probes=probes,
            seconds=facts.named("seconds", amount),
            known_cost=facts.number("known_cost"),
            known_source=facts.text("known_source"),
            certified=facts.truth("certified"),
            question=facts.text("question"),
        )
        if len(start) != found.unknowns or len(probes) != len(PROBES):
            raise BadFile(f"{len(start)} numbers at the start, {len(probes)} costs elsewhere")
        if found.seconds.keys() != set(TIMED):
            raise BadFile(f"seconds are of {listed(found.seconds)}, not of {listed(TIMED)}")
        return found


def describe(instance: str, setup: Setup) -> Description:
    """Evaluate an instance at its start and elsewhere, timed, in a worker process."""
    problem = setup.problem
    warm(problem, setup.start)
    x, fixed = problem.split(setup.start)
    known = setup.known
    rng = np.random.default_rng(0)
    draws = rng.standard_normal((len(PROBES), problem.free.size))
    points = [
        np.clip(s * d, problem.lower, problem.upper) for s, d in zip(PROBES, draws, strict=True)
    ]
    near = [x + k * STEP * (1 + abs(x)) for k in range(8)]
    with limited_threads():
        seconds = {
            "residual": _quickest(lambda at: problem.residual(at, fixed), near),
            "gradient": _quickest(lambda at: problem.cost_and_gradient(at, fixed), near),
            "jacobian": _quickest(lambda at: problem.linearize_at(at, fixed), near),
        }
    return Description(
        instance=instance,
        rows=problem.size,
        unknowns=problem.free.size,
        bounded=problem.bounded,
        start=x,
        start_cost=look(problem, x, fixed)[0],
        probes=np.array([look(problem, point, fixed)[0] for point in points]),
        seconds=seconds,
        known_cost=np.nan if known is None or known.cost is None else float(known.cost),
        known_source="" if known is None else str(known.source),
        certified=known is not None and known.values is not None,
        question=setup.question,
    )


def _quickest(evaluate: Callable[[Array], Any], points: list[Array]) -> float:
    """Seconds of one evaluation, in the quickest of a few batches. No two in a row are at the same
    point: a problem remembers the last one.
    """
    found, times = np.inf, 1
    for _ in range(BATCHES):
        before = time.perf_counter()
        for k in range(times):
            evaluate(points[k % len(points)])
        taken = time.perf_counter() - before
        if times > 1 or taken > BATCH:
            found = min(found, taken / times)
        times = int(np.clip(BATCH * times / max(taken, 1e-9), 2, 1000))
    return found
