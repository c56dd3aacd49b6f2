"""How far the joints of fingers turn: ranges that were measured on people, and what is assumed.

`python -m builder.joint_limits` writes them as `hand.json`, in degrees, by joint and anatomical
motion (`workbench.bodies.hands`).
"""

from typing import Any

from workbench.bodies.hands import ABDUCTION, DEVIATION, FLEXION, TWIST

AAOS, MERCK, ASSUMED = "AAOS", "Merck", "assumed"
SOURCES = {
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
    return {"unit": "degree", "sources": SOURCES, "limits": rows}
