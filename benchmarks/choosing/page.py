"""The page that helps to choose a solver, written from the numbers that were kept."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from workbench.comparison.statistics import rate

INTRODUCTION = """# Choosing a solver

`workbench solvers --for FILE.py` looks at a problem and recommends solvers with reasons. This page
has the comparisons on which the advice rests. Each section is about one kind of problem. All
solvers began at the same starts, and each run had at most 5,000 evaluations and 20 seconds. A
start is *solved* if the run visited a point with f - f* <= tau (f0 - f*), where f is the cost at
that point, f0 the cost at the start and f* the lowest cost known. *Effort* is counted in
evaluations of the residual. Other evaluations are converted to these by the prices in
`workbench.comparison.targets`; a Jacobian of n unknowns, for example, counts as 1 + 1.5 n
evaluations. The table shows the median over all starts, those that were not solved counted as
infinite; a dash means that at most half of the starts were solved. The intervals are exact 95 %
intervals (Clopper and Pearson) for independent starts. Starts of the same problem are not
independent, so where a problem has several starts correct intervals would be wider.

`python -m benchmarks.choosing` measures all of this and writes this page.
"""
ADVICE = {
    "well-behaved": "Use trust-region, which is the default: no solver needs less effort. "
    "Gauss-Newton needs little more. Solvers that use only the gradient need nearly four times the "
    "effort, or more.",
    "far start": "Use trust-region or Levenberg-Marquardt: no solver solves more starts, and "
    "Levenberg-Marquardt needs the least effort.",
    "noisy": "Noise of this size does not stop solvers that use the Jacobian. No solver solves "
    "more starts than IPOPT, and it needs less than half the effort of BOBYQA, which needs no "
    "derivatives.",
    "bounds": "Trust-region and Levenberg-Marquardt keep their steps between the bounds and solve "
    "all starts. So do SLSQP, SQP, NLopt's L-BFGS, SciPy's trf and IPOPT. SLSQP needs the least "
    "effort here.",
    "constraints": "Use IPOPT with the exact Hessian. With a Hessian that is approximated from "
    "gradients (ipopt-lbfgs), IPOPT solves none of these starts.",
    "many unknowns": "Gauss-Newton, Levenberg-Marquardt and IPOPT use the Jacobian's sparsity. "
    "NLopt's L-BFGS needs the least effort, and Gauss-Newton solves the most starts. SLSQP, which "
    "stores dense matrices, solves no start.",
    "no derivatives": "Trust-region with finite differences solves more starts than BOBYQA, with "
    "less than a quarter of the effort.",
    "several minima": "No solver reaches the lowest known minimum from more than a quarter of the "
    "starts. Start from several places and keep the best result.",
}


def read(path: Path) -> dict[str, Any]:
    """The numbers as they were kept."""
    found: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return found


def write(path: Path, kept: dict[str, Any]) -> None:
    """The whole page as Markdown."""
    path.write_text("\n".join(lines(kept)) + "\n", encoding="utf-8")


def lines(kept: dict[str, Any]) -> Iterator[str]:
    """Line by line."""
    yield INTRODUCTION
    for name, one in kept["found"].items():
        yield f"## {name.capitalize()}\n"
        yield f"{one['meaning'][0].upper()}{one['meaning'][1:]}. {ADVICE[name]}\n"
        count = len(one["problems"])
        starts = f"{one['seeds']} starts" if one["seeds"] > 1 else "one start"
        each = f"{count} problems, {starts} each" if count > 1 else f"1 problem, {starts}"
        yield f"{each}; tau = {one['tau']:g}.\n"
        yield "| solver | solved | 95 % interval | effort |"
        yield "| --- | --: | --: | --: |"
        for solver, row in ordered(one["solvers"]):
            share = rate(row["solved"], row["starts"])
            between = f"{share.low:.0%} to {share.high:.0%}"
            effort = "–" if row["effort"] is None else f"{row['effort']:,.0f}"
            yield f"| {solver} | {row['solved']} of {row['starts']} | {between} | {effort} |"
        facts = one["machine"]
        yield f"\nMeasured on {facts.get('processor', 'one machine')}, {facts.get('date', '')}.\n"


def ordered(rows: dict[str, dict[str, Any]]) -> list[tuple[str, dict[str, Any]]]:
    """The solvers that solved most first; among equals the one with the least effort."""
    return sorted(
        rows.items(), key=lambda item: (-item[1]["solved"], item[1]["effort"] or float("inf"))
    )
