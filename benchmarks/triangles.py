"""The README's table of SMPL beside SCAPE and BlendSCAPE, from the page's own numbers.

    workbench triangles WHEEL --mocap FILE
    python -m benchmarks.triangles runs/triangles

keeps the numbers in `results/triangles.json` and writes the table between the README's marks.
"""

import argparse
import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from benchmarks.keeping import keep, write_between

KEPT = Path(__file__).parent / "results" / "triangles.json"
README = Path(__file__).parents[1] / "README.md"
BEGIN, END = "<!-- written by `python -m benchmarks.triangles` -->", "<!-- up to here -->"
MODELS = ("SMPL", "SCAPE", "BlendSCAPE")
SHOWN, LEVELS = (1, 5, 10), (0.9, 0.95, 0.99)


def table(found: dict[str, Any]) -> str:
    """As Markdown."""
    by_name = {one["model"]: one for one in found["outcomes"]}
    full = {one["model"]: one for one in found["costs"] if one["mesh"] == "full"}
    alone = by_name["linear blend skinning"]["rms"]

    def outcome(say: Callable[[dict[str, Any]], str], ending: str = "") -> list[str]:
        return [say(by_name[name + (ending if name != "SMPL" else "")]) for name in MODELS]

    def cost(say: Callable[[dict[str, Any]], str]) -> list[str]:
        return [say(full[name]) for name in MODELS]

    def shares(who: str) -> list[str]:
        each = [found["explained"][f"{base}, {who}"]["share"] for base in ("vertices", "triangles")]
        return [", ".join(f"{100 * s[k]:.1f}" for k in SHOWN) + " %" for s in each] + ["the same"]

    def counts() -> list[str]:
        each = [found["explained"][f"{b}, learned"]["share"] for b in ("vertices", "triangles")]
        said = [", ".join(str(sum(x < level for x in s)) for level in LEVELS) for s in each]
        return [*said, "the same"]

    before = [by_name["linear blend skinning"], *(by_name[f"{m}, Q = I"] for m in MODELS[1:])]
    n = full["SMPL"]["n_faces"]
    rows = [
        ("shape and pose together less each alone, rms mm", outcome(lambda o: f"{o['gap']:.2g}")),
        ("numbers learned", outcome(lambda o: f"{o['parameters']:,}")),
        ("variance of shape in 1, 5, 10 directions, learned from", shares("learned")),
        ("the same, strangers", shares("strangers")),
        ("directions for 90, 95, 99 % of it, learned from", counts()),
        ("left of the meshes learned from, rms mm", outcome(lambda o: f"{o['learned']:.1f}")),
        ("strangers at rest, rms mm", outcome(lambda o: f"{o['rest']:.1f}")),
        (f"strangers in unseen poses, rms mm (linear blending alone {alone:.1f})",
         outcome(lambda o: f"{o['rms']:.1f}")),
        (f"jump of the deformation where parts meet (truth {found['true_jump']:.2f})",
         outcome(lambda o: f"{o['crease']:.2f}")),
        ("the same without what was learned of pose", [f"{o['crease']:.2f}" for o in before]),
        (f"surface of {n:,} triangles, ms", cost(lambda c: f"{c['vertices_ms']:.0f}")),
        ("its residual and Jacobian, ms", cost(lambda c: f"{c['jacobian_ms']:,.0f}")),
        ("of which is not zero", cost(lambda c: f"{100 * c['density']:.0f} %")),
        ("as a skinned glTF", ["yes", "no", "no"]),
    ]  # fmt: skip
    lines = ["| | " + " | ".join(MODELS) + " |", "| --- | ---: | ---: | ---: |"]
    return "\n".join([*lines, *(f"| {name} | {' | '.join(cells)} |" for name, cells in rows)])


def main(arguments: Sequence[str] | None = None) -> None:
    """Keep a page's numbers and write the table."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.triangles", description=__doc__)
    parser.add_argument("folder", type=Path, help="what `workbench triangles` wrote")
    folder = parser.parse_args(arguments).folder
    found = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    keep(KEPT, {name: part for name, part in found.items() if name != "files"}, digits=4)
    write_between(README, BEGIN, END, table(json.loads(KEPT.read_text(encoding="utf-8"))))


if __name__ == "__main__":
    main()
