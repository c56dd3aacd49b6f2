"""The table of SMPL beside SCAPE and BlendSCAPE in `examples/studies/README.md`.

    python -m examples.studies.triangles WHEEL --mocap FILE
    python -m benchmarks.triangles runs/triangles

The second command keeps the study's numbers in `results/triangles.json` and writes the table
between the marks of that file.
"""

import argparse
import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from benchmarks.keeping import keep, write_between

KEPT = Path(__file__).parent / "results" / "triangles.json"
README = Path(__file__).parents[1] / "examples" / "studies" / "README.md"
BEGIN, END = "<!-- written by `python -m benchmarks.triangles` -->", "<!-- up to here -->"
MODELS = ("SMPL", "SCAPE", "BlendSCAPE")
SHOWN, LEVELS = (1, 5, 10), (0.9, 0.95, 0.99)


def table(found: dict[str, Any]) -> str:
    """As Markdown."""
    by_name = {one["model"]: one for one in found["results"]}
    full = {one["model"]: one for one in found["timings"] if one["mesh"] == "full"}
    alone = by_name["linear blend skinning"]["rms"]

    def result(say: Callable[[dict[str, Any]], str], ending: str = "") -> list[str]:
        return [say(by_name[name + (ending if name != "SMPL" else "")]) for name in MODELS]

    def cost(say: Callable[[dict[str, Any]], str]) -> list[str]:
        return [say(full[name]) for name in MODELS]

    def shares(who: str) -> list[str]:
        each = [found["explained"][f"{base}, {who}"]["share"] for base in ("vertices", "triangles")]
        return [", ".join(f"{100 * s[k]:.1f}" for k in SHOWN) + " %" for s in each] + ["the same"]

    def counts() -> list[str]:
        each = [found["explained"][f"{b}, training"]["share"] for b in ("vertices", "triangles")]
        said = [", ".join(str(sum(x < level for x in s)) for level in LEVELS) for s in each]
        return [*said, "the same"]

    before = [by_name["linear blend skinning"], *(by_name[f"{m}, Q = I"] for m in MODELS[1:])]
    n = full["SMPL"]["n_faces"]
    rows = [
        (
            "effect of shape and pose together minus the sum of their effects, rms mm",
            result(lambda o: f"{o['gap']:.2g}"),
        ),
        ("parameters", result(lambda o: f"{o['parameters']:,}")),
        ("training people: variance of shape in 1, 5, 10 directions", shares("training")),
        ("held-out people: the same", shares("held out")),
        ("training people: directions that explain 90, 95, 99 % of this variance", counts()),
        ("training meshes, rms mm", result(lambda o: f"{o['training_rms']:.1f}")),
        ("held-out people at rest, rms mm", result(lambda o: f"{o['rest_rms']:.1f}")),
        (
            f"held-out people in held-out poses, rms mm (linear blending alone {alone:.1f})",
            result(lambda o: f"{o['rms']:.1f}"),
        ),
        (
            f"jump where parts meet (test meshes: {found['true_seam_jump']:.2f})",
            result(lambda o: f"{o['seam_jump']:.2f}"),
        ),
        (
            "this jump before anything is learned about pose",
            [f"{o['seam_jump']:.2f}" for o in before],
        ),
        (f"surface of {n:,} triangles, ms", cost(lambda c: f"{c['vertices_ms']:.0f}")),
        ("residual and Jacobian of this surface, ms", cost(lambda c: f"{c['jacobian_ms']:,.0f}")),
        ("share of this Jacobian that is not zero", cost(lambda c: f"{100 * c['density']:.0f} %")),
        ("as a skinned glTF file", ["yes", "no", "no"]),
    ]
    lines = ["| | " + " | ".join(MODELS) + " |", "| --- | ---: | ---: | ---: |"]
    return "\n".join([*lines, *(f"| {name} | {' | '.join(cells)} |" for name, cells in rows)])


def main(arguments: Sequence[str] | None = None) -> None:
    """Keep the study's numbers and write the table."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.triangles", description=__doc__)
    parser.add_argument("folder", type=Path, help="what `examples.studies.triangles` wrote")
    folder = parser.parse_args(arguments).folder
    found = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    keep(KEPT, {name: part for name, part in found.items() if name != "files"}, digits=4)
    write_between(README, BEGIN, END, table(json.loads(KEPT.read_text(encoding="utf-8"))))


if __name__ == "__main__":
    main()
