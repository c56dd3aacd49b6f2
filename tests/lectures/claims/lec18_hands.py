"""What lecture 18 says of its run."""

import numpy as np

from tests.lectures.prose import Run


def many(run: Run, name: str) -> float:
    """How many hands are more than 5 degrees beyond a limit, %."""
    return float(100 * np.mean(run["beyond"][name] > 5))


def median(run: Run, name: str) -> float:
    """The median of what half of the skin is within, mm."""
    return float(np.median(run["median"][name]))


def names(run: Run, points: str) -> str:
    """The null directions, as they are named."""
    return str(run["diagnoses"][points])


SAYS = {
    "with the joints of a hand, and SMPL-H is a body with 52 joints of which 30 are in the fingers": (
        lambda run: (run["whole"].n_joints, run["whole"].n_joints - 22)
    ),
    "each by itself, 45 % are more than 5 degrees beyond a limit": lambda run: (
        many(run, "each by itself"),
        5,
    ),
    "and 6 % of those whose angles were drawn together": lambda run: many(run, "together"),
    "Each single angle varies by the same amount in both pictures.": lambda run: (
        abs(
            np.std(run["alone"][:, 1:], axis=0)[run["spread"] > 0.2]
            / np.std(run["together"][:, 1:], axis=0)[run["spread"] > 0.2]
            - 1
        ).mean()
        < 0.1
    ),
    "One component holds 63 % of the variance, two hold 85 %, and ten hold 99 %.": lambda run: (
        100 * run["held"][0],
        100 * run["held"][1],
        10,
        100 * run["held"][9],
    ),
    "So ten numbers stand for forty-five.": lambda run: (10, run["space"].n_components),
    "Only 19 components vary at all": lambda run: run["moving"],
    "Who leaves the mean out is off by 95 mm at a finger tip, and who adds it twice by 78.1 mm.": (
        lambda run: (run["off"]["the mean left out"], run["off"]["the mean added twice"])
    ),
    "The rule is exact.": lambda run: run["wrong"]["the rule"] < 1e-9,
    "With pose directions that were mirrored as positions alone, it is off by 3.4 mm, and at rest it would be right.": (
        lambda run: (
            run["wrong"]["pose directions mirrored as positions alone"],
            np.abs(run["positions_alone"].vertices() - run["left"].vertices()).max() == 0,
        )
    ),
    "All of the 622 are in the left hand": lambda run: int(run["moved"].sum()),
    "Most of these, 475, are no part of the finger: pose blend shapes move them, by less than a millimetre": (
        lambda run: (
            int((run["moved"] & ~run["follows"]).sum()),
            2 * (run["moved"] & ~run["follows"]).sum() > run["moved"].sum(),
            run["shift"][run["moved"] & ~run["follows"]].max() < 1,
        )
    ),
    "the hand of this person is off by 16 mm; for the mean person it would be right.": lambda run: (
        run["wrong"]["shape directions not mirrored"],
        np.abs(run["forgotten"].vertices() - run["left"].vertices()).max() == 0,
    ),
    "are off by 130 mm, and with all three signs of the rotation vector changed by 37 mm": lambda run: (
        run["wrong"]["the pose of the right hand"],
        run["wrong"]["all of the rotation vector with its sign changed"],
    ),
    "Detectors find 21 points": lambda run: len(run["HAND_POINTS"]),
    "The joints alone are 16. How many of the 48 angles": lambda run: (
        run["hand"].n_joints,
        3 * run["hand"].n_joints,
    ),
    "From 16 joints, 23 of 48 numbers are seen: 3 of the wrist, and 4 of each finger.": lambda run: (
        run["hand"].n_joints,
        run["diagnoses"]["16 joints"].rank,
        48,
        3,
        (run["diagnoses"]["16 joints"].rank - 3) / 5,
    ),
    "The last joint of a finger moves no joint at all, and so its 3 numbers are open": lambda run: (
        3,
        all(f"pose[{f}3, x y z]" in names(run, "16 joints") for f in ("index", "middle", "thumb")),
    ),
    "the first two may twist about their own bones": lambda run: (
        "a turn of pose[index2] alone" in names(run, "16 joints")
        and "a turn of pose[index1], undone at index2" in names(run, "16 joints")
    ),
    "With the tips the rank is 38: each tip adds the 3 numbers of its last joint, and 23 + 5 · 3 = 38.": (
        lambda run: (
            run["diagnoses"]["21 points"].rank,
            3,
            run["diagnoses"]["16 joints"].rank,
            5,
            3,
            run["diagnoses"]["16 joints"].rank + 5 * 3,
        )
    ),
    "The 10 directions that are still open are two for each finger: twists of one bone that the next one "
    "undoes.": lambda run: (
        48 - run["diagnoses"]["21 points"].rank,
        "a turn of pose[index2], undone at index3" in names(run, "21 points"),
    ),
    "What 21 points leave open, people's poses decide.": lambda run: len(run["HAND_POINTS"]),
    "with errors of 2 mm in each coordinate": lambda run: run["NOISE"],
    "With priors, half of the skin is within 1.9 mm of the truth, in the median of 12 hands, although "
    "the points themselves are off by 2 mm": lambda run: (
        median(run, "priors"),
        run["HANDS"],
        run["NOISE"],
    ),
    "Without them it is about five times as far, in the median of 4 hands": lambda run: (
        len(run["median"]["no priors"]),
        4 < median(run, "no priors") / median(run, "priors") < 6,
    ),
    "the `mean` (15, 3) and the `components` (45, 15, 3)": lambda run: (
        *run["space"].mean.shape,
        *run["space"].components.shape,
    ),
    "now 459 instead of 207": lambda run: (
        run["whole"].posedirs.shape[2],
        run["body"].posedirs.shape[2],
    ),
    "`full-hands` is a body with the 52 joints of SMPL-H": lambda run: run["whole"].n_joints,
    "22 joints of the body, 15 of the left hand, 15 of the right hand": lambda run: (
        sum(not n.split("_")[-1][-1].isdigit() or "spine" in n for n in run["whole"].joint_names),
        sum(n.startswith("left") and n[-1].isdigit() for n in run["whole"].joint_names),
        sum(n.startswith("right") and n[-1].isdigit() for n in run["whole"].joint_names),
    ),
    "The last two joints of SMPL's 24, the hands, are gone.": lambda run: (
        run["body"].n_joints,
        "left_hand" not in run["whole"].joint_names,
    ),
    "One joint of a finger moves 622 of 10490 vertices.": lambda run: (
        int(run["moved"].sum()),
        run["whole"].n_vertices,
    ),
    "in the left hand or at most 38 mm behind its wrist, and the farthest one is 175 mm away": (
        lambda run: (run["behind"], run["from_wrist"][run["moved"]].max())
    ),
    "The hands of a body with 52 joints, cut out for the picture.": lambda run: (
        run["whole"].n_joints
    ),
    "the other 22 joints do not turn": lambda run: 22 * bool((run["both"][:22] == 0).all()),
    "A hand is a body of 16 joints.": lambda run: run["hand"].n_joints,
}

GIVEN = (
    "for which more than 80 % are reported by Santello, Flanders and Soechting, 1998",
    "# Forty-five angles by themselves",
)

GENERAL = (  # how a pose space was chosen, before this lecture
    "until two components held about as much as those of measured hands",
    "a vertex of the skin, which follows more than one joint and their pose blend shapes",
)
