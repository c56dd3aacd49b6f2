"""Which candidates to choose: what is known at each point, and the searches.

With C = (J'J)^-1 = H H' and the whitened rows A of a measurement, Woodbury's formula says

    (J'J + A'A)^-1 = H (I + H'A'A H)^-1 H' = H' H'',   H' = H (I - V diag(1 - 1 / sqrt(1 + s^2)) V')

with A H = U diag(s) V'. The half H is updated and not C, because a difference of covariances would
lose digits where a measurement says much (Potter's square root filter; Bierman, Factorization
Methods for Discrete Sequential Estimation, 1977). By the determinant lemma the information grows by
the sum of log(1 + s^2) / 2, in nats.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from math import comb

import numpy as np

from workbench.arrays import Array
from workbench.diagnostics.bases import tangent_space
from workbench.diagnostics.design.candidates import Size
from workbench.diagnostics.diagnosis import Diagnosis
from workbench.problem import Linearization

MOST_COMBINATIONS = 3000  # times points, up to which every one of them is looked at
LEAST_GAIN = 1e-9  # of the logarithm of a standard deviation: less is rounding
MOST_PASSES = 20  # over all that is chosen, looking for exchanges
NEGLIGIBLE = 1e-7  # of a quantity's gradient along null directions: rounding
NOTHING = 1e-10  # of gradients, along what equations leave free


@dataclass(frozen=True, eq=False)
class Uncertainty:
    """The covariance of n unknowns, each in its characteristic scale.

    Along null directions the variance has no limit; elsewhere it is that of a prior along them that
    becomes ever wider, the same in every direction.

    Attributes:
        half: (n, r) H, with H H' the covariance of what is determined.
        null: (n, d) an orthonormal basis of the directions that nothing determines.
        triangle: (k, n) R with R'R = J'J; without rows where everything is determined.
        left: (n, p) an orthonormal basis of the directions that equations leave free; None where
            there are no equations. In all others everything is known exactly.
    """

    half: Array
    null: Array
    triangle: Array
    left: Array | None = None

    @staticmethod
    def of(here: Linearization, left: Array | None = None) -> "Uncertainty":
        """By the singular values of a linearization. Raises NotFinite, TooLarge."""
        spectrum = (here if left is None else here.along_columns(left)).spectrum
        s, Vt = spectrum.determined
        half, null = Vt.T / s, spectrum.Vt[spectrum.rank :].T
        if left is not None:
            half, null = left @ half, left @ null
        R = here.R if null.shape[1] else np.zeros((0, here.shape[1]))
        return Uncertainty(half, null, R, left)

    def seeing(self, rows: Array) -> "Uncertainty":
        """What is known after whitened rows (m, n) were measured as well."""
        if self.null.shape[1]:
            stacked = np.vstack([self.triangle, rows])
            return Uncertainty.of(Linearization(np.zeros(len(stacked)), stacked), self.left)
        _, s, Vt = np.linalg.svd(rows @ self.half, full_matrices=False)
        root = np.sqrt(1 + s**2)
        shrunk = s**2 / (root * (1 + root))  # 1 - 1 / root, without its rounding errors
        return replace(self, half=self.half - (self.half @ Vt.T * shrunk) @ Vt)

    def nats(self, rows: Array) -> float:
        """The information that rows (m, n) add on what is determined, 1/2 log det(I + A C A')."""
        s = np.linalg.svd(rows @ self.half, compute_uv=False)
        return 0.5 * float(np.sum(np.log1p(s**2)))

    @property
    def sds(self) -> Array:
        """The standard deviation (n,) of each unknown; infinite where a null direction moves it."""
        open_ = np.linalg.norm(self.null, axis=1) > NEGLIGIBLE
        return np.where(open_, np.inf, np.linalg.norm(self.half, axis=1))

    def split(self, gradients: Array) -> tuple[int, Array]:
        """Of quantities with gradients (n, q): how many are open, and a half of the others.

        Combinations of the quantities count, so q - open of them are determined; their covariance
        is K'K, and K (r, q - open) is returned.
        """
        if not self.null.shape[1]:
            return 0, self.half.T @ gradients
        size = np.linalg.norm(gradients)
        _, s, Vt = np.linalg.svd(self.null.T @ gradients)
        rank = int(np.sum(s > NEGLIGIBLE * size))
        return rank, self.half.T @ gradients @ Vt[rank:].T


def directions_left(d: Diagnosis, scales: Array) -> Array | None:
    """An orthonormal basis (n, p), in these scales, of what equations leave free; None without any.

    Equations are those among the constraints, and equal bounds of an unknown.
    """
    problem, active = d.problem, d.active
    constraints = problem.stacked_constraints
    equations = np.zeros(0, dtype=bool)
    if constraints is not None:
        equations = constraints.equal[active.active]
    equal = np.append(equations, (problem.lower == problem.upper)[active.bounded])
    return tangent_space(active.rows[equal] * scales) if equal.any() else None


def combinations_left(gradients: Array, left: Array) -> Array:
    """Of quantities with gradients (n, q), the combinations that equations do not determine.

    They are orthonormal combinations, so that sums of variances and the largest one stay the same.
    """
    along = left.T @ gradients
    _, s, Vt = np.linalg.svd(along, full_matrices=False)
    return np.asarray(gradients @ Vt[s > NOTHING * np.linalg.norm(gradients)].T)


State = tuple[Uncertainty, ...]  # one for each point
Progress = Callable[[int, int], object]  # called with the number that is done, and of all


@dataclass(frozen=True, order=True)
class Score:
    """How good a choice is, the smaller the better; what comes first counts first.

    Attributes:
        open: how many combinations of what matters nothing determines, summed over the points.
        null: how many directions of the unknowns nothing determines, summed over the points; 0
            where all that matters is determined, because others do not matter then.
        log_sd: the mean over the points of the logarithm of the criterion.
    """

    open: int
    null: int
    log_sd: float

    def beats(self, other: "Score") -> bool:
        """Whether it is smaller by more than rounding."""
        ahead, behind = (self.open, self.null), (other.open, other.null)
        return ahead < behind or (ahead == behind and self.log_sd < other.log_sd - LEAST_GAIN)

    @property
    def sd(self) -> float:
        """The criterion, a geometric mean over the points; infinite if what matters is open."""
        return float("inf") if self.open else float(np.exp(self.log_sd))


@dataclass(frozen=True, eq=False)
class Board:
    """What a search looks at: T points, and rows for each candidate at each of them.

    Attributes:
        before: what is known at each point.
        gradients: (n, q) of what matters, at each point.
        size: the criterion's number for a half of a covariance.
        rows: by candidate and point, the whitened rows (m, n).
    """

    before: State
    gradients: tuple[Array, ...]
    size: Size
    rows: tuple[tuple[Array, ...], ...]

    def after(self, state: State, candidate: int) -> State:
        """What is known once a candidate has been measured."""
        return tuple(u.seeing(A) for u, A in zip(state, self.rows[candidate], strict=True))

    def measuring(self, chosen: Sequence[int]) -> State:
        """What is known once several have been measured."""
        state = self.before
        for candidate in chosen:
            state = self.after(state, candidate)
        return state

    def score(self, state: State) -> Score:
        """How good that is."""
        parts = [u.split(G) for u, G in zip(state, self.gradients, strict=True)]
        with np.errstate(divide="ignore"):
            logs = [np.log(self.size(half)) for _, half in parts]
        open_ = sum(count for count, _ in parts)
        return Score(open_, null(state) if open_ else 0, float(np.mean(logs)))


def null(state: State) -> int:
    """How many null directions there are, summed over the points."""
    return sum(u.null.shape[1] for u in state)


def searched(board: Board, choose: int, progress: Progress) -> tuple[tuple[int, ...], str]:
    """The candidates to choose, by number, the best first, and what was done in a sentence."""
    few = choose == 1 or comb(len(board.rows), choose) * len(board.before) <= MOST_COMBINATIONS
    chosen, how = (every_combination if few else greedy_with_exchange)(board, choose, progress)
    return in_order(board, chosen), how


def every_combination(board: Board, choose: int, progress: Progress) -> tuple[tuple[int, ...], str]:
    """The best of all combinations of that many candidates."""
    best: tuple[tuple[int, ...], Score] | None = None
    count = comb(len(board.rows), choose)
    for done, (some, state) in enumerate(_combinations(board, choose, (), board.before), 1):
        score = board.score(state)
        if best is None or score.beats(best[1]):
            best = some, score
        progress(done, count)
    assert best is not None
    what = "candidates" if choose == 1 else f"combinations of {choose} candidates"
    return best[0], f"all {count:,} {what} were compared"


def _combinations(
    board: Board, choose: int, begun: tuple[int, ...], state: State
) -> Iterator[tuple[tuple[int, ...], State]]:
    """All that continue what is begun, each with what is known after it."""
    if len(begun) == choose:
        yield begun, state
        return
    first = begun[-1] + 1 if begun else 0
    for candidate in range(first, len(board.rows) - (choose - len(begun)) + 1):
        yield from _combinations(board, choose, (*begun, candidate), board.after(state, candidate))


def greedy_with_exchange(
    board: Board, choose: int, progress: Progress
) -> tuple[tuple[int, ...], str]:
    """One after the other, each the best beside those before; then one is exchanged for another.

    By D-optimality the information of the greedy choice is at least 1 - 1/e of the largest possible
    (Nemhauser, Wolsey and Fisher, An analysis of approximations for maximizing submodular set
    functions, 1978), because it is submodular; the other criteria are not. Exchanges go on as long
    as they are better: no single one improves the end (Fedorov, Theory of Optimal Experiments,
    1972), which need not be the best of all combinations.
    """
    chosen, every = list[int](), set(range(len(board.rows)))
    for step in range(choose):
        best, score = _best(board, board.measuring(chosen), sorted(every - {*chosen}))
        chosen.append(best)
        progress(step + 1, (MOST_PASSES + 1) * choose)
    exchanges, tried = 0, 0  # tried since the last exchange
    for number in range(MOST_PASSES * choose if choose < len(board.rows) else 0):
        place = number % choose
        rest = board.measuring(chosen[:place] + chosen[place + 1 :])
        best, better = _best(board, rest, sorted(every - {*chosen}))
        tried += 1
        if better.beats(score):
            chosen[place], score, exchanges, tried = best, better, exchanges + 1, 0
        progress(choose + number + 1, (MOST_PASSES + 1) * choose)
        if tried == choose:
            break
    times = {0: "no exchange", 1: "one exchange"}.get(exchanges, f"{exchanges} exchanges")
    return tuple(chosen), f"greedily and with {times}; no single exchange improves the choice"


def in_order(board: Board, chosen: Sequence[int]) -> tuple[int, ...]:
    """The chosen ones, the one that is best alone first, and then the best beside it."""
    left, ordered = list(chosen), list[int]()
    while left:
        best, _ = _best(board, board.measuring(ordered), left)
        ordered.append(best)
        left.remove(best)
    return tuple(ordered)


def _best(board: Board, state: State, among: Sequence[int]) -> tuple[int, Score]:
    """The first of the best among some candidates, and its score."""
    best = among[0], board.score(board.after(state, among[0]))
    for candidate in among[1:]:
        score = board.score(board.after(state, candidate))
        if score.beats(best[1]):
            best = candidate, score
    return best
