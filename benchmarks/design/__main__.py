"""The command `python -m benchmarks.design`: predictions of a design beside what fits find.

Writes `results/design.json`, and the tables of DESIGN.md between the marks. It takes ten minutes on
one core. `--tables` writes the tables again from the numbers.
"""

import argparse
import json
from pathlib import Path
from typing import Any

from benchmarks import machine
from benchmarks.design import recorded, simulated
from benchmarks.keeping import keep, write_between
from benchmarks.page import machine as on_machine

RESULTS = Path(__file__).parent.parent / "results" / "design.json"
PAGE = Path(__file__).parent.parent / "DESIGN.md"
BEGIN, END = "<!-- written by `python -m benchmarks.design` -->", "<!-- up to here -->"


def tables(found: dict[str, Any]) -> str:
    """The tables of the page, and on what they were measured."""
    lines = [
        "Standard deviations, predicted and of repeated fits (with its 95 % bootstrap interval):",
        "",
        "| problem | unknowns | what matters | best candidate | when | predicted | simulated "
        "| predicted / simulated | fits |",
        "| --- | --: | --- | --- | --- | --: | --: | --: | --: |",
    ]
    for name, one in found["compared"].items():
        for when in ("before", "after"):
            row = one[when]
            cells = f"{row['predicted']:.4g} {one['unit']} | {row['simulated']:.4g} "
            cells += f"({row['low']:.4g} to {row['high']:.4g}) {one['unit']}"
            ratio = row["predicted"] / row["simulated"]
            head = (
                f"{name} | {one['unknowns']} | {one['quantity']} | {one['best']}, of {one['of']}"
                if when == "before"
                else " | | | "
            )
            lines.append(f"| {head} | {when} | {cells} | {ratio:.2f} | {one['fits']} |")
    two = found["against random"]
    factor = two["factor"]
    lines += [
        "",
        f"A second camera for `balance-monocular`, {two['fits']} fits each, errors of the distance "
        "in mm (root mean squares):",
        "",
        "| second camera | predicted | simulated |",
        "| --- | --: | --: |",
        f"| the best, {two['best']} | {1e3 * two['predicted']['best']:.2f} | "
        f"{1e3 * two['simulated']['best']:.2f} |",
        f"| a random one | {1e3 * two['predicted']['random']:.2f} | "
        f"{1e3 * two['simulated']['random']:.2f} |",
        f"| random / best | {factor['predicted']:.2f} | {factor['simulated']:.2f} "
        f"({factor['low']:.2f} to {factor['high']:.2f}) |",
    ]
    real = found["recorded"]
    lines += [
        "",
        f"The real cameras of `balance`, {real['frames']} frames (limbs, mm, root mean squares):",
        "",
        "| first camera | second camera | predicted sd | distance from the fit to four cameras |",
        "| --- | --- | --: | --: |",
    ]
    for row in real["pairs"]:
        lines.append(
            f"| {row['first']} | {row['second']} | {1e3 * row['predicted']:.1f} | "
            f"{1e3 * row['error']:.1f} |"
        )
    share, tau = real["best is best, interval"], real["tau, interval"]
    lines += [
        "",
        f"In {100 * real['best is best']:.0f} % ({100 * share[0]:.0f} to {100 * share[1]:.0f}) of "
        f"{real['cases']} cases (frames times first cameras) the predicted best of three is the "
        f"one with the smallest error, where chance has 33 %; Kendall's tau of the two orders is "
        f"{real['tau']:.2f} ({tau[0]:.2f} to {tau[1]:.2f}). Intervals are of 95 %, by a bootstrap "
        "over whole frames.",
        "",
        f"*Measured on {on_machine(found['machine'])}.*",
    ]
    return "\n".join(lines)


def main() -> None:
    """Measure, keep the numbers, and write the tables."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.design", description=__doc__)
    parser.add_argument("--tables", action="store_true", help="only write the tables again")
    if not parser.parse_args().tables:
        found: dict[str, Any] = {"compared": {}}
        for name in simulated.CASES:
            found["compared"][name] = simulated.compared(name)
            print(name, found["compared"][name], flush=True)
        found["against random"] = simulated.against_random()
        print(found["against random"], flush=True)
        found["recorded"] = recorded.run()
        found["machine"] = machine.description(("workbench", "casadi", "numpy", "scipy"))
        keep(RESULTS, found, 5)
    if PAGE.exists():
        write_between(PAGE, BEGIN, END, tables(json.loads(RESULTS.read_text())))


if __name__ == "__main__":
    main()
