"""What was promised, and what came out."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from benchmarks import closest, fingers, fits, ours, overhead, peers, sequences
from benchmarks.derivatives import KINDS
from benchmarks.timing import best

SIZE, LARGE = "6890", "100000"


@dataclass(frozen=True)
class Target:
    """A ratio of two times of one run, and its limit."""

    name: str
    measured: float
    limit: float
    at_most: bool  # else at least

    @property
    def holds(self) -> bool:
        """Whether the promise was kept."""
        within = self.measured <= self.limit
        return within if self.at_most else self.measured >= self.limit


def all_of(results: Mapping[str, Any]) -> list[Target]:
    """Those that can be judged from the parts that were run."""
    judges: tuple[Callable[[Mapping[str, Any]], Iterator[Target]], ...]
    judges = (
        *(_of_derivatives, _of_fits, _of_scaling, _of_overhead, _of_sequences, _of_closest),
        _of_fingers,
    )
    return [target for judge in judges for target in judge(results)]


def _of_derivatives(results: Mapping[str, Any]) -> Iterator[Target]:
    seconds = _part(results, "derivatives").get(SIZE, {}).get("seconds", {})
    if peers.JAX not in seconds.get("forward", {}):
        return
    limits = {ours.NUMPY: (1.5, 5, 5), ours.COMPILED: (1.2, 15, 9)}
    for way, (forward, jacobian, step) in limits.items():
        if way in seconds["forward"]:
            mine, jax, torch = (
                {kind: best(seconds[kind].get(who, [float("nan")])) for kind in KINDS}
                for who in (way, peers.JAX, peers.TORCH)
            )
            yield Target(f"{way}: forward / JAX", mine["forward"] / jax["forward"], forward, True)
            faster = jax["jacobian"] / mine["jacobian"]
            yield Target(f"{way}: JAX / Jacobian", faster, jacobian, False)
            if way == ours.NUMPY and peers.TORCH in seconds["jacobian"]:
                faster = torch["jacobian"] / mine["jacobian"]
                yield Target(f"{way}: torch / Jacobian", faster, 12, False)
            faster = jax["step"] / mine["step"]
            yield Target(f"{way}: JAX / Gauss-Newton step", faster, step, False)


def _of_fits(results: Mapping[str, Any]) -> Iterator[Target]:
    found = _part(results, "fits").get(SIZE, {})
    seconds = found.get("seconds", {})
    for way in (ours.NUMPY, ours.COMPILED):
        took = {
            label.partition(": ")[2]: best(t)
            for label, t in seconds.items()
            if label.startswith(way + ":")
        }
        if not took:
            continue
        LM = took[fits.LM]
        limit = 1.1 if way == ours.COMPILED else 1.5
        yield Target(f"{way}: LM / its own parts", LM / took[fits.ALONE], limit, True)
        if way == ours.COMPILED:
            for method, called in (
                (fits.LM, "LM"),
                (fits.TWO_STEPS, "LM, two steps with each Jacobian"),
            ):
                if runs := found["evaluations"].get(f"{way}: {method}"):
                    most = float(max(one["jacobian"] for one in runs))
                    yield Target(f"{way}: linearizations of {called}", most, 4, True)
        for scipy in (fits.SCIPY_LM, fits.SCIPY_TRF):
            if scipy in took:
                yield Target(f"{way}: {scipy} / LM", took[scipy] / LM, 4, False)
        yield Target(f"{way}: IPOPT / LM", took[fits.IPOPT] / LM, 3, True)


def _of_scaling(results: Mapping[str, Any]) -> Iterator[Target]:
    seconds = _part(results, "scaling").get("seconds", {})
    for way, limits in {ours.NUMPY: (2, 2, 1.5), ours.COMPILED: (2, 2.6, 1.5)}.items():
        for kind, limit in zip(KINDS, limits, strict=True):
            by_size = seconds.get(kind, {}).get(way, {})
            if SIZE in by_size and LARGE in by_size:
                each = {N: best(by_size[N]) / int(N) for N in (SIZE, LARGE)}
                name = f"{way}: {kind} per vertex, {int(LARGE):,} / {int(SIZE):,}"
                yield Target(name, each[LARGE] / each[SIZE], limit, True)


def _of_overhead(results: Mapping[str, Any]) -> Iterator[Target]:
    seconds = _part(results, "overhead").get("seconds", {})
    for label, how in overhead.pairs(seconds):
        ratio = best(seconds[label]) / best(seconds[label + how])
        yield Target(f"{label} /{how}", ratio, 1.1, True)


def _of_sequences(results: Mapping[str, Any]) -> Iterator[Target]:
    found = _part(results, "sequences")
    for name, one in found.get("seen", {}).items():
        taken = {way: best(one["seconds"][way]) for way in (sequences.ITERATION, sequences.APART)}
        within = taken[sequences.ITERATION] / taken[sequences.APART]
        label = f"{name}: LM iteration of {one['frames']} frames / these linearized one by one"
        yield Target(label, within, 1.2, True)
    each = {
        int(count): best(one["seconds"][sequences.ITERATION]) / int(count)
        for count, one in found.get("frames", {}).items()
    }
    if len(each) > 1:
        few, many = min(each), max(each)
        label = f"LM iteration per frame, {many:,} frames / {few:,}"
        yield Target(label, each[many] / each[few], 1.2, True)


def _of_closest(results: Mapping[str, Any]) -> Iterator[Target]:
    for kind, seconds in _part(results, "closest").get("seconds", {}).items():
        if closest.COMPILED not in seconds or kind not in closest.KINDS:
            continue
        ours, label = best(seconds[closest.COMPILED]), f"closest places, {closest.KINDS[kind]}"
        if closest.IGL in seconds:
            ratio = ours / best(seconds[closest.IGL])
            yield Target(f"{label}: compiled / libigl", ratio, 0.7, True)
        ratio = best(seconds[closest.NUMPY]) / ours
        yield Target(f"{label}: NumPy / compiled", ratio, 30, True)


def _of_fingers(results: Mapping[str, Any]) -> Iterator[Target]:
    for kind, seconds in _part(results, "fingers").get("seconds", {}).items():
        ratio = best(seconds[fingers.HANDS]) / best(seconds[fingers.PLAIN])
        if kind.endswith(fingers.JACOBIAN):
            yield Target(f"{kind}, 52 joints / 24", ratio, 2.2, True)
        if kind == fingers.FRAME:
            yield Target("fit of the same keypoints, 52 joints / 24", ratio, 2.5, True)


def _part(results: Mapping[str, Any], name: str) -> Mapping[str, Any]:
    found: Mapping[str, Any] = results.get(name, {}).get("found", {})
    return found
