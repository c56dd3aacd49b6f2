"""What the page on rigging says is what was measured."""

import json
from pathlib import Path

FOLDER = Path(__file__).parents[2] / "benchmarks"
KNOWN = json.loads((FOLDER / "results" / "rigging.json").read_text())
TEXT = " ".join((FOLDER / "RIGGING.md").read_text().split())


def test_the_table_is_what_was_measured() -> None:
    for name, one in KNOWN.items():
        ours = one["ours"]
        edges = f"{ours['edges']} of {ours['of_edges']}"
        assert f"| {name} | {ours['bones']} | {edges} | {ours['held_out_rms_m']:.0e} m |" in TEXT
        assert f"| {ours['cpu_s']:.0f} |" in TEXT
        assert f"{one['frames']} poses (seed {one['seed']})" in TEXT
        assert f"held out are {one['held_out_frames']} poses" in TEXT
    moved = KNOWN["moved"]["ours"]
    weights, joints = moved["largest_weight_error"], moved["largest_joint_error_m"]
    assert f"| {weights:.0e} | {joints:.0e} m |" in TEXT


def test_the_peer_leaves_more_in_the_same_run() -> None:
    left = {name: one["py_dem_bones"] for name, one in KNOWN.items()}
    assert {run["bones"] for runs in left.values() for run in runs} == {18}
    assert KNOWN["recorded"]["ours"]["bones"] == 18
    told = [1e3 * min(run["rms_m"] for run in left[name]) for name in ("moved", "recorded")]
    assert "leaves {:.1f} mm (`moved`) and {:.1f} mm".format(*told) in TEXT
    for name, runs in left.items():
        assert KNOWN[name]["ours"]["rms_m"] < 1e-6 * min(run["rms_m"] for run in runs)
