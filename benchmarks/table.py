"""A benchmark's numbers as text: Markdown tables of milliseconds and ratios."""

from collections.abc import Iterable, Mapping
from typing import Any

from benchmarks import closest as places
from benchmarks import fingers as with_fingers
from benchmarks import fits as whole_fits
from benchmarks import ours
from benchmarks import overhead as whole_overhead
from benchmarks import sequences as filmed
from benchmarks import vertices as free
from benchmarks.targets import Target
from benchmarks.timing import best, median

MEMORY = {
    "before": "imports alone",
    "arrays": "the arrays of the body",
    "body": "peak with the body",
    "forward": "peak with a forward",
    "peak": "peak with a step",
}
NAMES = {"forward": "forward", "jacobian": "Jacobian", "step": "Gauss-Newton step"}


def derivatives(bodies: Mapping[str, Any]) -> str:
    """Per body and candidate: least / median milliseconds, and how often the workbench's time."""
    lines = []
    for name, body in bodies.items():
        heads = [f"{head}, ms | × ours" for head in NAMES.values()]
        lines += [f"| {_called(name, body)} | {' | '.join(heads)} |", "| --- |" + " --: |" * 6]
        for candidate in body["seconds"]["forward"]:
            cells = []
            for kind in NAMES:
                timings = body["seconds"][kind]
                cells += [spent(timings[candidate]), ratio(timings, candidate, ours.NUMPY)]
            lines.append(f"| {candidate} | {' | '.join(cells)} |")
        lines.append("")
    return "\n".join(lines)


def fits(bodies: Mapping[str, Any]) -> str:
    """Per body and method: least / median milliseconds, and how often Levenberg-Marquardt's."""
    lines = []
    for name, body in bodies.items():
        timings = body["seconds"]
        lines += [
            f"| {_called(name, body)} | fit, ms | × LM | linearizations |",
            "| --- | --: | --: | --: |",
        ]
        for label, seconds in timings.items():
            way = label.partition(":")[0]
            mine = f"{way}: {whole_fits.LM}"
            counts = [one.get("jacobian") for one in body["evaluations"][label]]
            cells = spent(seconds), ratio(timings, label, mine), _range(counts)
            lines.append(f"| {label} | {' | '.join(cells)} |")
        lines.append("")
    return "\n".join(lines)


def scaling(found: Mapping[str, Any]) -> str:
    """Per size: microseconds per vertex by kind and candidate, and peak memory."""
    lines = []
    sizes = [str(N) for N in found["sizes"]]
    heads = " | ".join(f"N = {int(N):,}" for N in sizes)
    lines += [f"| µs per vertex | {heads} |", "| --- |" + " --: |" * len(sizes)]
    for kind, by_candidate in found["seconds"].items():
        for candidate, by_size in by_candidate.items():
            cells = [_three(1e6 * best(by_size[N]) / int(N)) if N in by_size else "" for N in sizes]
            lines.append(f"| {candidate}: {NAMES[kind]} | {' | '.join(cells)} |")
    lines += ["", f"| memory, MB | {heads} |", "| --- |" + " --: |" * len(sizes)]
    for way, by_size in found["bytes"].items():
        for what, title in MEMORY.items():
            cells = [_three(by_size[N][what] / 1e6) if N in by_size else "" for N in sizes]
            lines.append(f"| {way}: {title} | {' | '.join(cells)} |")
    return "\n".join([*lines, ""])


def overhead(found: Mapping[str, Any]) -> str:
    """Per way and solver: least / median milliseconds, and how often the time by hand."""
    seconds, size = found["seconds"], f"{found['body']}, N = {found['vertices']:,}"
    lines = [f"| {size} | fit, ms | by hand, ms | × by hand |", "| --- | --: | --: | --: |"]
    for label, how in whole_overhead.pairs(seconds):
        hand = label + how
        cells = spent(seconds[label]), spent(seconds[hand]), ratio(seconds, label, hand)
        lines.append(f"| {label} /{how} | {' | '.join(cells)} |")
    return "\n".join([*lines, ""])


def vertices(found: Mapping[str, Any]) -> str:
    """Per mesh: least / median milliseconds by candidate with ratios, and memory."""
    lines = [
        "| mesh | unknowns | rows | ours, ms | memory, MB | spsolve, ms | × ours | lsmr, ms "
        "| × ours |",
        "| --- |" + " --: |" * 8,
    ]
    for name, one in found.items():
        seconds, taken = one["seconds"], one["bytes"]["peak"] - one["bytes"]["before"]
        cells = [f"{one['unknowns']:,}", f"{one['rows']:,}", spent(seconds[free.OURS])]
        cells += [_three(taken / 1e6)]
        for by in (free.DIRECT, free.KRYLOV):
            cells += [spent(seconds[by]), ratio(seconds, by, free.OURS)]
        lines.append(f"| {name} | {' | '.join(cells)} |")
    return "\n".join([*lines, ""])


def sequences(found: Mapping[str, Any]) -> str:
    """Per kind of points: milliseconds and ratios; per number of frames: time and memory."""
    parts = (filmed.APART, filmed.WHOLE, filmed.ITERATION, filmed.STEP, filmed.DIRECT)
    lines = [
        "| seen | unknowns | " + ", ms | ".join(parts) + ", ms | iteration × one by one | "
        "distance from the dense solution of six frames |",
        "| --- |" + " --: |" * (len(parts) + 3),
    ]
    for name, one in found["seen"].items():
        cells = [f"{one['unknowns']:,}", *(spent(one["seconds"][part]) for part in parts)]
        cells += [ratio(one["seconds"], filmed.ITERATION, filmed.APART), f"{one['off']:.0e}"]
        lines.append(f"| {name}, {one['frames']} frames | {' | '.join(cells)} |")
    lines += [
        "",
        "| frames | unknowns | LM iteration, ms | a frame, ms | memory, MB | a frame, MB |",
        "| --: |" + " --: |" * 5,
    ]
    for count, one in found["frames"].items():
        seconds, taken = one["seconds"][filmed.ITERATION], (one["peak"] - one["before"]) / 1e6
        each = 1e3 * best(seconds) / int(count), taken / int(count)
        cells = [f"{one['unknowns']:,}", spent(seconds), _three(each[0])]
        lines.append(f"| {int(count):,} | {' | '.join([*cells, _three(taken), _three(each[1])])} |")
    return "\n".join([*lines, ""])


def closest(found: Mapping[str, Any]) -> str:
    """Per candidate: least / median milliseconds by kind of points with ratios, and of a refit."""
    if not found:
        return ""
    kinds = {**places.KINDS, places.REFIT: "refit"}
    head = " | ".join(f"{kind}, ms | × compiled" for kind in kinds.values())
    lines = [f"| {found['points']:,} points, {found['faces']:,} triangles | {head} |"]
    lines += ["| --- |" + " --: |" * 2 * len(kinds)]
    for name in found["seconds"][next(iter(kinds))]:
        cells: list[str] = []
        for kind in kinds:
            seconds = found["seconds"][kind]
            both = places.COMPILED in seconds and name in seconds
            cells += [spent(seconds[name]) if name in seconds else ""]
            cells += [ratio(seconds, name, places.COMPILED) if both else ""]
        lines.append(f"| {name} | {' | '.join(cells)} |")
    return "\n".join([*lines, ""])


def fingers(found: Mapping[str, Any]) -> str:
    """By kind: least / median milliseconds of both bodies, and the ratio."""
    if not found:
        return ""
    heads = [
        f"`{name}`: {size['vertices']:,} vertices, {size['unknowns']} unknowns, ms"
        for name, size in found["sizes"].items()
    ]
    lines = [f"| | {' | '.join(heads)} | × |", "| --- | --: | --: | --: |"]
    for kind, seconds in found["seconds"].items():
        cells = [spent(seconds[name]) for name in found["sizes"]]
        cells.append(ratio(seconds, with_fingers.HANDS, with_fingers.PLAIN))
        lines.append(f"| {kind} | {' | '.join(cells)} |")
    return "\n".join([*lines, ""])


def promises(judged: Iterable[Target]) -> str:
    """Promise, measurement, and whether it holds."""
    lines = ["| ratio of times | target | measured | |", "| --- | --: | --: | --- |"]
    for target in judged:
        promised = f"{'at most' if target.at_most else 'at least'} {target.limit:g}"
        verdict = "holds" if target.holds else "**missed**"
        lines.append(f"| {target.name} | {promised} | {target.measured:.2f} | {verdict} |")
    return "\n".join([*lines, ""])


def spent(seconds: list[float]) -> str:
    """Least / median, milliseconds."""
    return f"{_three(1e3 * best(seconds))} / {_three(1e3 * median(seconds))}"


def ratio(timings: Mapping[str, list[float]], candidate: str, to: str) -> str:
    """How often the time of another."""
    return _three(best(timings[candidate]) / best(timings[to]))


def _called(name: str, body: Mapping[str, Any]) -> str:
    N = f"N = {body['vertices']:,}"
    return N if name.isdigit() else f"{name}, {N}"


def _range(counts: list[int | None]) -> str:
    known = sorted({count for count in counts if count is not None})
    return "–".join(str(count) for count in {known[0]: 0, known[-1]: 0}) if known else ""


def _three(number: float) -> str:
    """Three digits."""
    return f"{number:.0f}" if number >= 100 else f"{number:.3g}"
