"""How far joints turn: ranges that were measured on people, and ranges seen in motion capture.

Run as `python -m builder.joint_limits MOCAP.npz --out workbench/data/joint_limits`,
with the recording of `workbench.priors.poses`. Writes `anatomical.json` and
`recorded.json`: per joint and axis of its rotation vector the lower and the upper limit in degrees,
null where there is none; and `hand.json` (`builder.joint_limits`).
In the T-pose (y up, the body faces +z, its left is +x) a turn about one
axis is an anatomical motion with a name; a turn about several is not, and there a box of rotation
vectors is an approximation.
"""

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np

from builder.recordings import PoseRecording, read_recording
from workbench.bodies.hands import ABDUCTION, DEVIATION, FLEXION, TWIST
from workbench.geometry.mirror import AXIAL, opposite

AAOS, MERCK, ASSUMED = "AAOS", "Merck", "assumed"
HAND_SOURCES = {
    AAOS: "American Academy of Orthopaedic Surgeons, Joint Motion: Method of Measuring and "
    "Recording, 1965, as printed in Norkin and White, Measurement of Joint Motion: A Guide to "
    "Goniometry, F. A. Davis, appendix A, column AAOS",
    MERCK: "The Merck Manual, Normal Values for Range of Motion of Joints, table 1, 2010-2013; "
    "people of all ages",
    ASSUMED: "not measured: hinge joints turn about one axis, and the others give a little",
}
FOUR = ("index", "middle", "ring", "pinky")
ASIDE = {  # abduction 25 is away from the middle finger, adduction 20 towards it
    "index": (-20, 25, "abduction 25, adduction 20"),
    "middle": (-25, 25, "abduction 25 to either side"),
    "ring": (-25, 20, "abduction 25, adduction 20"),
    "pinky": (-25, 20, "abduction 25, adduction 20"),
}
GIVES, TURNS = 10, 20  # degrees to either side
AXES = "xyz"
AAOS = "AAOS"
MERCK = "Merck"
SOURCES = {
    AAOS: "American Academy of Orthopaedic Surgeons, Joint Motion: Method of Measuring and "
    "Recording, 1965, as printed in Norkin and White, Measurement of Joint Motion: A Guide to "
    "Goniometry, F. A. Davis, appendix A, table A.1, column AAOS",
    MERCK: "The Merck Manual, Normal Values for Range of Motion of Joints, table 1, 2010-2013; "
    "people of all ages",
}
# of the left side: joint, axis, lower and upper in degrees, what they are, source
LEFT: tuple[tuple[str, str, float | None, float | None, str, str], ...] = (
    ("left_hip", "x", -125, 15, "flexion 125, hyperextension 15", MERCK),
    ("left_hip", "y", -45, 45, "medial rotation 45, lateral rotation 45", MERCK),
    ("left_hip", "z", None, 45, "abduction 45", MERCK),
    ("left_knee", "x", 0, 130, "extension 0, flexion 130", MERCK),
    ("left_ankle", "x", -20, 50, "dorsiflexion 20, plantar flexion 50", MERCK),
    ("left_ankle", "z", -35, 25, "inversion 35, eversion 25", MERCK),
    ("left_shoulder", "x", -90, 70, "lateral rotation 90, medial rotation 70", AAOS),
    ("left_shoulder", "z", -90, 90, "abduction 0 to 180; the T-pose is at 90", AAOS),
    ("left_elbow", "y", -150, 0, "flexion 150, extension 0", AAOS),
    ("left_wrist", "x", -80, 80, "supination 80, pronation 80 of the forearm", AAOS),
    ("left_wrist", "y", -20, 30, "radial deviation 20, ulnar deviation 30", AAOS),
    ("left_wrist", "z", -80, 70, "flexion 80, extension 70", AAOS),
)


def hand_limits() -> dict[str, Any]:
    """The contents of `hand.json`."""
    rows: list[dict[str, Any]] = []

    def add(joint: str, motion: str, lower: float, upper: float, said: str, source: str) -> None:
        ends = {"lower": lower, "upper": upper, "motions": said, "source": source}
        rows.append({"joint": joint, "motion": motion} | ends)

    for finger in FOUR:
        add(f"{finger}1", FLEXION, -45, 90, "flexion 90, hyperextension 45", AAOS)
        add(f"{finger}2", FLEXION, 0, 100, "flexion 100, extension 0", AAOS)
        add(f"{finger}3", FLEXION, 0, 90, "flexion 90, extension 0", AAOS)
        add(f"{finger}1", DEVIATION, *ASIDE[finger], MERCK)
    add("thumb1", ABDUCTION, 0, 70, "abduction 70, adduction 0", AAOS)
    add("thumb2", FLEXION, 0, 50, "flexion 50, extension 0", AAOS)
    add("thumb3", FLEXION, -20, 80, "flexion 80, extension 20", AAOS)
    for joint in (*(f"{finger}1" for finger in FOUR), "thumb2"):
        add(joint, TWIST, -TURNS, TURNS, "twist to either side", ASSUMED)
    add("thumb2", DEVIATION, -TURNS, TURNS, "deviation to either side", ASSUMED)
    for joint in (*(f"{finger}{i}" for finger in FOUR for i in (2, 3)), "thumb3"):
        for motion in (DEVIATION, TWIST):
            add(joint, motion, -GIVES, GIVES, f"{motion} to either side", ASSUMED)
    return {"unit": "degree", "sources": HAND_SOURCES, "limits": rows}


def anatomical() -> dict[str, Any]:
    """Both sides: the right one is the left one in a mirror."""
    rows = []
    for joint, axis, lower, upper, motions, source in LEFT:
        left = {"joint": joint, "axis": axis, "lower": lower, "upper": upper}
        turned = AXIAL[AXES.index(axis)] < 0
        ends = (_minus(upper), _minus(lower)) if turned else (lower, upper)
        right = {"joint": opposite(joint), "axis": axis, "lower": ends[0], "upper": ends[1]}
        rows += [side | {"motions": motions, "source": source} for side in (left, right)]
    return {"unit": "degree", "sources": SOURCES, "limits": rows}


def _minus(limit: float | None) -> float | None:
    return None if limit is None else 0 - limit


def recorded(mocap: PoseRecording) -> dict[str, Any]:
    """The extremes of each joint below the pelvis, and the middle 98 % of its frames."""
    rows = []
    for j, joint in enumerate(mocap.joint_names):
        degrees = np.degrees(mocap.poses[:, j])
        if j == 0 or np.ptp(degrees, axis=0).max() < 1e-4:  # the place of the body; not recorded
            continue
        for i, axis in enumerate(AXES):
            lower, first, last, upper = np.percentile(degrees[:, i], (0, 1, 99, 100)).round(1)
            rows.append(
                {
                    "joint": joint,
                    "axis": axis,
                    "lower": float(lower),
                    "upper": float(upper),
                    "percentile_1": float(first),
                    "percentile_99": float(last),
                }
            )
    source = "CMU Graphics Lab Motion Capture Database, mocap.cs.cmu.edu; see PROVENANCE.md"
    frames = {"frames": len(mocap.poses), "clips": int(np.unique(mocap.clip).size)}
    return {"unit": "degree", "sources": {"CMU": source}, **frames, "limits": rows}


def main() -> None:
    """Write the files."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("mocap", type=Path)
    parser.add_argument("--out", type=Path, required=True)
    arguments = parser.parse_args()
    files = {
        "anatomical": anatomical(),
        "recorded": recorded(read_recording(arguments.mocap)),
        "hand": hand_limits(),
    }
    for name, content in files.items():
        text = json.dumps(content, indent=1)
        (arguments.out / f"{name}.json").write_text(text + "\n", encoding="utf-8")
        print(f"{name}: {len(content['limits'])} axes")


if __name__ == "__main__":
    main()
