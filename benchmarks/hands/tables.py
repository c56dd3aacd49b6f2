"""The tables of HANDS.md."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from benchmarks.page import machine as on_machine
from workbench.comparison.statistics import rate


def tables(found: dict[str, Any]) -> str:
    """All tables, and on what they were measured."""
    parts = [_ranks(found), _points(found), _predicted(found), _limits(found), _scans(found)]
    if "modelled" in found:
        parts.append(_modelled(found["modelled"]))
    return "\n\n".join([*parts, on_machine(found["machine"])])


def _table(head: tuple[str, ...], rows: Sequence[tuple[str, ...]]) -> str:
    line = " | ".join(["---", *["--:"] * (len(head) - 1)])
    return "\n".join(f"| {' | '.join(row)} |" for row in [head, (line,), *rows])


def _ranks(found: dict[str, Any]) -> str:
    rows = [
        (what, f"{one['rank']} of {one['of']}", "; ".join(_grouped(one["open"])))
        for what, one in found["ranks"].items()
    ]
    return "Determined of the pose, without priors:\n\n" + _table(
        ("seen", "rank", "not determined"), rows
    )


def _grouped(names: list[str]) -> list[str]:
    """The names of directions, those of all fingers f counted together."""
    counts: dict[str, int] = {}
    for name in names:
        plain = name.partition(":")[0]  # without the shares of a mixture
        for finger in ("index", "middle", "pinky", "ring", "thumb"):
            plain = plain.replace(finger, "f")
        counts[plain] = counts.get(plain, 0) + 1
    return [f"{count} x {name}" for name, count in counts.items()]


def _points(found: dict[str, Any]) -> str:
    head = (
        *("seen, hands", "median", "worst hand, its median", "worst hand, its mean"),
        *("worst vertex", "worst before the wrist", "vertices beyond 6 mm"),
        *("CPU s, median", "CPU s, slowest"),
    )
    rows = [
        (
            f"{what} ({one['hands']})",
            *(f"{one[key]:.2f}" for key in ("median", "worst_median", "worst_mean")),
            f"{one['largest']:.1f}",
            f"{one['largest_before_the_wrist']:.1f}",
            f"{100 * one['share_beyond_6_mm']:.1f} %",
            f"{one['seconds']:.3f}",
            f"{one['slowest']:.3f}",
        )
        for what, one in found["points"].items()
    ]
    return "Errors in mm with 2 mm of noise along each axis:\n\n" + _table(head, rows)


def _predicted(found: dict[str, Any]) -> str:
    rows = [
        (what, *(f"{number:.2f}" for number in numbers))
        for what, numbers in found["predicted"].items()
    ]
    head = ("free", "behind the wrist", "elsewhere")
    return "Root mean squares in mm that Laplace's approximation expects of 21 points:\n\n" + (
        _table(head, rows)
    )


def _limits(found: dict[str, Any]) -> str:
    rows = [
        (
            what,
            f"{one['median']:.2f}",
            f"{one['worst_mean']:.2f}",
            f"{one['largest']:.1f}",
            f"{one['beyond_limits_degrees']:.1f}",
        )
        for what, one in found["limits"].items()
    ]
    head = ("prior on the pose", "median", "worst mean", "worst vertex", "most beyond a limit, deg")
    return "16 joints of strangers, in mm:\n\n" + _table(head, rows)


def _scans(found: dict[str, Any]) -> str:
    rows = []
    for what, one in found["scans"].items():
        share = rate(one["good"], one["hands"])
        rows.append(
            (
                what,
                f"{one['good']} of {one['hands']} ({100 * share.low:.0f} to "
                f"{100 * share.high:.0f} %)",
                *(_or_not(one[key], 2) for key in ("mean", "median", "seen", "free")),
                f"{one['worst']:.1f}",
                _or_not(one["seconds"], 1),
            )
        )
    head = (
        *("seen", "mean below 3 mm", "mean", "median", "mean where seen"),
        *("mean, vertices free", "worst mean", "CPU s"),
    )
    return "Strangers, simulated scans; medians over the hands, in mm:\n\n" + _table(head, rows)


def _or_not(number: float | None, digits: int) -> str:
    return "" if number is None else f"{number:.{digits}f}"


def _modelled(one: dict[str, Any]) -> str:
    rows = []
    for name in ("model", "vertices free", "model, with skeleton"):
        cells = [_range(one.get(f"{name}: {key}")) for key in ("median", "95 %", "joints", "betas")]
        rows.append((name, *cells))
    head = ("surface", "median", "95 %", "joints, median", "length of betas, sd")
    return (
        f"The artist's hand, {one['held_out']:,} held-out points, random turns: {one['turns']} "
        f"(smallest to largest), in mm:\n\n" + _table(head, rows)
    )


def _range(numbers: list[float] | None) -> str:
    return "" if numbers is None else f"{np.min(numbers):.2f} to {np.max(numbers):.2f}"
