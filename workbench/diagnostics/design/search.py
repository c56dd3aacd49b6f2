"""Which candidates to choose: all combinations compared, or one after the other with exchanges."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from math import comb

import numpy as np

from workbench.arrays import Array
from workbench.diagnostics.design.criteria import Size
from workbench.diagnostics.design.uncertainty import Uncertainty

FEW = 3000  # combinations times points, up to which every one of them is looked at
GAINED = 1e-9  # of the logarithm of a standard deviation: less is rounding
PASSES = 20  # over all that is chosen, looking for exchanges
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
        return ahead < behind or (ahead == behind and self.log_sd < other.log_sd - GAINED)

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

    @property
    def count(self) -> int:
        """How many candidates there are."""
        return len(self.rows)

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
        found = [u.split(G) for u, G in zip(state, self.gradients, strict=True)]
        with np.errstate(divide="ignore"):
            logs = [np.log(self.size(half)) for _, half in found]
        open_ = sum(count for count, _ in found)
        return Score(open_, null(state) if open_ else 0, float(np.mean(logs)))

    def at(self, point: int) -> "Board":
        """The same at one point only."""
        rows = tuple((each[point],) for each in self.rows)
        return Board((self.before[point],), (self.gradients[point],), self.size, rows)


def null(state: State) -> int:
    """How many null directions there are, summed over the points."""
    return sum(u.null.shape[1] for u in state)


@dataclass(frozen=True)
class Chosen:
    """The candidates that a search chose, by number, and what it did in a sentence."""

    candidates: tuple[int, ...]
    how: str


Search = Callable[[Board, int, Progress], Chosen]


def automatic(board: Board, choose: int, progress: Progress) -> Chosen:
    """Every combination where there are few, and otherwise greedy with exchanges."""
    few = comb(board.count, choose) * len(board.before) <= FEW
    return (every_combination if few or choose == 1 else greedy_with_exchange)(
        board, choose, progress
    )


def every_combination(board: Board, choose: int, progress: Progress) -> Chosen:
    """The best of all combinations of that many candidates."""
    best: tuple[tuple[int, ...], Score] | None = None
    count = comb(board.count, choose)
    for done, (some, state) in enumerate(_combinations(board, choose, (), board.before), 1):
        score = board.score(state)
        if best is None or score.beats(best[1]):
            best = some, score
        progress(done, count)
    assert best is not None
    what = "candidates" if choose == 1 else f"combinations of {choose} candidates"
    return Chosen(in_order(board, best[0]), f"all {count:,} {what} were compared")


def _combinations(
    board: Board, choose: int, begun: tuple[int, ...], state: State
) -> Iterator[tuple[tuple[int, ...], State]]:
    """All that continue what is begun, each with what is known after it."""
    if len(begun) == choose:
        yield begun, state
        return
    first = begun[-1] + 1 if begun else 0
    for candidate in range(first, board.count - (choose - len(begun)) + 1):
        yield from _combinations(board, choose, (*begun, candidate), board.after(state, candidate))


def greedy(board: Board, choose: int, progress: Progress) -> Chosen:
    """One candidate after the other, each the best beside those before.

    By D-optimality the information of what is chosen is at least 1 - 1/e of the largest possible
    (Nemhauser, Wolsey and Fisher, An analysis of approximations for maximizing submodular set
    functions, 1978), because it is submodular. The other criteria are not.
    """
    chosen, state = list[int](), board.before
    for step in range(choose):
        left = [i for i in range(board.count) if i not in chosen]
        found, _ = _best(board, state, left)
        chosen.append(found)
        state = board.after(state, found)
        progress(step + 1, choose)
    return Chosen(tuple(chosen), "greedily, one candidate after the other")


def greedy_with_exchange(board: Board, choose: int, progress: Progress) -> Chosen:
    """Greedily, and then one is exchanged for one that was not chosen as long as that is better.

    No single exchange improves the end (Fedorov, Theory of Optimal Experiments, 1972), which need
    not be the best of all combinations.
    """
    chosen = list(greedy(board, choose, lambda done, of: None).candidates)
    score, exchanges = board.score(board.measuring(chosen)), 0
    for number in range(PASSES):
        before = exchanges
        for place in range(choose):
            progress(number * choose + place + 1, PASSES * choose)
            rest = chosen[:place] + chosen[place + 1 :]
            others = [i for i in range(board.count) if i not in chosen]
            if not others:
                break
            found, better = _best(board, board.measuring(rest), others)
            if better.beats(score):
                chosen[place], score, exchanges = found, better, exchanges + 1
        if exchanges == before:
            break
    times = {0: "no exchange", 1: "one exchange"}.get(exchanges, f"{exchanges} exchanges")
    how = f"greedily and with {times}; no single exchange improves the choice"
    return Chosen(in_order(board, chosen), how)


def in_order(board: Board, chosen: Sequence[int]) -> tuple[int, ...]:
    """The chosen ones, the one that is best alone first, and then the best beside it."""
    left, ordered, state = list(chosen), list[int](), board.before
    while left:
        found, _ = _best(board, state, left)
        ordered.append(found)
        left.remove(found)
        state = board.after(state, found)
    return tuple(ordered)


def _best(board: Board, state: State, among: Sequence[int]) -> tuple[int, Score]:
    """The first of the best among some candidates, and its score."""
    found = among[0], board.score(board.after(state, among[0]))
    for candidate in among[1:]:
        score = board.score(board.after(state, candidate))
        if score.beats(found[1]):
            found = candidate, score
    return found
