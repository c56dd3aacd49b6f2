"""What lecture 5 says of its run."""

from dataclasses import replace

import numpy as np

from tests.lectures.prose import Run

ROUNDING = 1e-10  # mm: vertices of decimetres are rounded at 1e-13 mm


def error(run: Run, way: str, degrees: float) -> float:
    """Of one way to use the examples, at one angle, mm."""
    return float(run["errors"](run["ways"][way], [np.radians(degrees)])[0])


def at_examples(run: Run, way: str) -> np.ndarray:
    return run["errors"](run["ways"][way], run["at"])


def largest(run: Run, student: str, angles: np.ndarray) -> np.ndarray:
    """How far the blend shapes of a student move the rest surface, mm, by angle."""
    arm = run["arm"]
    still = replace(run["students"][student], weights=np.eye(2)[[0] * arm.n_vertices])
    moved = still.vertices(np.array([run["bent"](angle) for angle in angles])) - arm.template
    return 1e3 * np.linalg.norm(moved, axis=2).max(axis=1)


def shin(run: Run) -> np.ndarray:
    """How far it is off on the joints of the mean person, to the left, up and to the front, cm."""
    skin = run["body"].weights[:, run["body"].joint_names.index("left_knee")] > 0.9
    return 1e2 * (run["wrong"] - run["right"])[skin].mean(axis=0)


def tallest_and_shortest(run: Run) -> tuple[float, float]:
    heights = [float(np.ptp(v[:, 1])) for v in run["gallery"].values()]
    return max(heights), min(heights)


def at_a_knee(run: Run) -> bool:
    """Whether the vertex that pose blend shapes move most is within 15 cm of a knee."""
    moved = np.linalg.norm(run["prepared"] - run["shaped"], axis=1)
    there = run["shaped"][moved.argmax()]
    joints, names = run["body"].joints(betas=run["tall"]), run["body"].joint_names
    knees = joints[[names.index("left_knee"), names.index("right_knee")]]
    return bool(np.linalg.norm(knees - there, axis=1).min() < 0.15)


def away(run: Run, one: str, other: str) -> float:
    """How far two drawn ends of first directions are from each other, mm rms of a vertex."""
    return float(1e3 * np.sqrt(((run["ends"][one] - run["ends"][other]) ** 2).sum(axis=1).mean()))


def reach(run: Run, name: str) -> np.ndarray:
    """The height of the left hand above the feet at both ends of a first direction, m, low first."""
    hand = run["body"].template[:, 0].argmax()
    drawn = [one.vertices for one in run["ends_drawn"] if one.label.startswith(f"{name}, ")]
    return np.array([v[hand, 1] - v[:, 1].min() for v in drawn])


def pose(run: Run, name: str) -> list[int | float]:
    """The share of pose, %, and what five directions explain, %."""
    line = run.line(name, ": pose is")
    return [line[-3], line[-2]]


SAYS = {
    "We draw 200 of each, and take the components of the women, of the men, and of all 400": lambda run: (
        len(run["groups"]["women"]),
        len(run["groups"]["all"]),
    ),
    "In all three it is mostly stature. The common one is longer: it begins near the small end of the "
    "women, and ends near the tall end of the men.": lambda run: (
        all(
            np.ptp(run["ends"][f"{name}, +3 sd"][:, 1])
            > 1.3 * np.ptp(run["ends"][f"{name}, -3 sd"][:, 1])
            for name in run["groups"]
        ),
        run["found"]["all"][2][0]
        > 1.1 * max(run["found"][name][2][0] for name in ("women", "men")),
        away(run, "all, -3 sd", "women, -3 sd") < 0.5 * away(run, "all, -3 sd", "men, -3 sd"),
        away(run, "all, +3 sd", "men, +3 sd") < 0.5 * away(run, "all, +3 sd", "women, +3 sd"),
    ),
    "The three are nearly parallel: within each group people differ most in stature, and the groups differ "
    "in it too.": lambda run: (
        all(line[-1] > 0.97 for line in run.lines("|cosine|")),
        bool(run.line("variance of the common first coordinate")[0] > 10),
    ),
    "the two groups overlap, and their means differ": lambda run: (
        (
            run["groups"]["women"] @ run["first_of_all"] * np.sign(run["first_of_all"] @ run["d"])
        ).max()
        > (
            run["groups"]["men"] @ run["first_of_all"] * np.sign(run["first_of_all"] @ run["d"])
        ).min()
    ),
    "Far enough apart, the difference of the means becomes the second direction, and then the first.": (
        lambda run: (
            run["shares"][0].max() < 0.1,
            bool((run["shares"][:, 1] > 0.9).any()),
            bool(np.argmax(run["shares"][:, 1] > 0.9) < np.argmax(run["shares"][:, 0] > 0.9)),
            run["shares"][-1, 0] > 0.99,
            abs(run["taken"] - run["needed_step"]) < 0.1,
        )
    ),
    "It happens at 63 mm, the first of our steps that is beyond the 61 mm of the formula.": lambda run: (
        1e3 * run["taken"] / np.sqrt(run["body"].n_vertices),
        1e3 * run["needed_step"] / np.sqrt(run["body"].n_vertices),
    ),
    "expects most people between the groups, where there are none": lambda run: (
        run["needed_step"] / 2 > 5 * run["lengths"][3]
    ),
    "with 10 of our synthetic people in 36 poses each, drawn from a distribution of poses that was learned from motion capture": lambda run: (
        len(run["ten"]),
        int((run["who"] == 0).sum()),
    ),
    "then three of the ten people alone; and last 360 people, who are at rest": lambda run: (
        len(run["ten"]),
        len(run["sets"]["360 people at rest"]),
    ),
    "The first direction of the same 360 meshes. Left: of the meshes as they are posed, it goes from "
    "lowered hands to raised ones, and legs change their length on the way": lambda run: (
        len(run["posed"]),
        reach(run, "posed")[1] > reach(run, "posed")[0] + 0.4,
        pose(run, "10 people, posed")[0] > 90,
    ),
    "Right: of the un-posed meshes, it is mostly stature.": lambda run: (
        np.ptp(run["ends_drawn"][3].vertices[:, 1])
        > 1.2 * np.ptp(run["ends_drawn"][2].vertices[:, 1])
    ),
    "Here un-posing is exact": lambda run: (
        np.abs(
            run["sets"]["10 people, un-posed"] - run["body"].vertices(betas=run["ten"][run["who"]])
        ).max()
        < 1e-10
    ),
    "our synthetic people differ in ten directions, of which five hold nearly all of the variance": lambda run: (
        run["body"].n_betas,
        run["share"][4] > 0.95,
    ),
    "But the three people, in 36 poses each, have two directions, and these explain 71 % of how new people differ. "
    "Poses do not replace people.": lambda run: (
        int((run["who"] == 0).sum()),
        pose(run, "3 people, un-posed")[1],
        np.linalg.matrix_rank(
            run["sets"]["3 people, un-posed"].reshape(108, -1)
            - run["sets"]["3 people, un-posed"].reshape(108, -1).mean(axis=0),
            tol=1e-6,
        )
        == 2,
    ),
    "Even with exact un-posing, the meshes of ten people fill nine directions at most": lambda run: (
        len(run["ten"]),
        np.linalg.matrix_rank(
            (
                run["sets"]["10 people, un-posed"] - run["sets"]["10 people, un-posed"].mean(axis=0)
            ).reshape(360, -1),
            tol=1e-6,
        )
        == 9,
    ),
    "Shape directions are learned from many people, whose poses are undone first.": lambda run: (
        pose(run, "10 people, posed")[1] + 20
        < pose(run, "10 people, un-posed")[1]
        < pose(run, "360 people at rest")[1]
    ),
    "seen with 2 mm of noise. We learn two kinds. The first has all 207 features": lambda run: (
        float(1e3 * (run["noisy"] - run["wanted"]).std()),
        run["F_all"].shape[1],
    ),
    "is chosen on 50 further poses, and the error is measured on 50 others": lambda run: (
        210 - max(run["counts"]),
        len(run["lessons"]) - 210,
    ),
    "If a vertex may depend on near joints only, a quarter of the poses is enough for the same error.": lambda run: (
        all(
            run["scores"]["near joints"][k] < 1.05 * run["scores"]["all joints"][k + 2]
            for k in (0, 1)
        )
    ),
    "the embedded bodies are local": lambda run: run.line("embedded body:")[0] > 70,
    "the bodies of this lecture have one joint for all fingers of a hand": lambda run: (
        sum("hand" in name for name in run["body"].joint_names) == 2
    ),
    "If poses are few, let a vertex depend on near joints only.": lambda run: (
        run["scores"]["near joints"][0] < 0.9 * run["scores"]["all joints"][0]
    ),
    "Here is one for an elbow bent by 90 degrees": lambda run: run.line("bent by 90 degrees")[0],
    "In its own pose it is perfect, and at rest it does harm.": lambda run: (
        run.line("bent by 90 degrees")[2] < ROUNDING,
        run.line("the same at rest")[0] < run.line("the same at rest")[1],
    ),
    "Here $\\tau$, in rad², says": lambda run: np.isclose(run["examples"].width ** 2, run["tau"]),
    "Kernels that are divided by their sum reproduce no example, because its neighbours contribute as well": lambda run: (
        at_examples(run, "divided by the sum").min() > 0.5
    ),
    "kernels that are not divided add up to too much": lambda run: (
        error(run, "not divided", 40) > error(run, "none", 40)
    ),
    "with coefficients that are solved for (exact), kernels leave nothing at the examples.": lambda run: (
        at_examples(run, "exact").max() < 1e-6
    ),
    "Between inner examples 'exact' is nearer to the truth than 'divided by the sum'": lambda run: (
        all(
            error(run, "exact", angle) < error(run, "divided by the sum", angle)
            for angle in (-60, -20, 20, 60)
        )
    ),
    "between the last two on either side it is the other way round: at 105 degrees 'exact' leaves 2.7 mm, and 'divided by "
    "the sum' 0.6 mm.": lambda run: (
        int(105 in np.degrees(run["turns"]).round()) * 105,
        error(run, "exact", 105),
        error(run, "divided by the sum", 105),
    ),
    "Far from all examples, at 170 degrees (where the curves have left the figure at its top), the kernels have faded, and hardly anything is repaired. If they are divided by "
    "their sum, the nearest example is used instead": lambda run: (
        170,
        error(run, "not divided", 170) > 0.9 * error(run, "none", 170),
        error(run, "exact", 170) > 0.9 * error(run, "none", 170),
        error(run, "divided by the sum", 170) < 0.8 * error(run, "none", 170),
    ),
    "Seven examples will do for one angle.": lambda run: len(run["at"]) == 7,
    "Interpolation between examples works near them": lambda run: all(
        error(run, way, 60) < 0.5 * error(run, "none", 60)
        for way in ("divided by the sum", "exact")
    ),
    "three angles for each of 23 joints": lambda run: run["body"].n_joints - 1,
    "Examples cannot fill 69 dimensions.": lambda run: 3 * (run["body"].n_joints - 1),
    "Angles are of little use.": lambda run: (
        run.line("f = the angles", "where it was taught")[0] > 0.9 * run.line("none ", "taught")[0],
        run.line("f = rotation elements", "taught")[0] < 0.5 * run.line("none ", "taught")[0],
    ),
    "By rotation elements it is the same after each turn, and bounded, for no element of R - I leaves "
    "[-2, 2].": lambda run: (
        -2,
        2,
        bool(
            np.allclose(
                *(
                    largest(run, "f = rotation elements", np.linspace(0, 6, 20) + turn)
                    for turn in (0, -2 * np.pi)
                )
            )
        ),
    ),
    "By angles it grows and grows.": lambda run: bool(
        (np.diff(largest(run, "f = the angles", np.linspace(0, 2 * np.pi, 20))) > 0).all()
    ),
    "SMPL's body has 24 joints.": lambda run: run["body"].n_joints,
    "The other 23 have nine elements each, so there are $9 \\cdot 23 = 207$ features": lambda run: (
        run["body"].n_joints - 1,
        len(run["f"]),
    ),
    "A turn about $y$ changes four of the nine elements, the corners of the matrix.": lambda run: (
        (np.flatnonzero(np.abs(run["f"]) > 1e-12) - 9 * (run["elbow"] - 1)).tolist() == [0, 2, 6, 8]
    ),
    "The order of the features is part of the file format.": lambda run: (
        run.line("features that are not zero")[0] == 9 * (run["elbow"] - 1)
    ),
    "one person in twenty is beyond $\\pm 2$": lambda run: 20,
    "We learn the directions from 60 people that we draw": lambda run: len(run["people"]),
    "with it, $\\beta$ is in standard deviations": lambda run: np.allclose(
        run["betas"].std(axis=1, ddof=1), 1
    ),
    "The tallest body, 1, +3 sd, is 1.97 m tall, and the shortest, 1, -3 sd, 1.39 m.": lambda run: (
        1,
        +3,
        tallest_and_shortest(run)[0],
        1,
        -3,
        tallest_and_shortest(run)[1],
    ),
    "A longer thigh has its knee further down.": lambda run: (
        run["body"].joints(betas=run["tall"])[run["body"].joint_names.index("left_knee"), 1]
        < run["body"].joints()[run["body"].joint_names.index("left_knee"), 1] - 0.01
    ),
    "SMPL step by step, from the side": lambda run: (
        run.line("the steps end at the library's vertices")[0] < 1e-9,
        0 < run.line("pose blend shapes move the rest surface")[0] < 100,
    ),
    "(a change of the rest surface, largest at the knees)": lambda run: at_a_knee(run),
    "turn about the root joint": lambda run: run.line("the root turned, and R (M")[-1] < 1e-9,
    "both with the root turned by a quarter turn": lambda run: np.allclose(
        run["about_y"], [0, np.pi / 2, 0]
    ),
    "the shin sits 7 cm too high and 7 cm too far back": lambda run: (
        float(shin(run)[1]),
        float(-shin(run)[2]),
    ),
}

GIVEN = (
    "(*Body Models II* has the number of elements of $P$, and beside it the product $9 \\cdot 23 \\cdot 6890$, which is "
    "a third of it",
    "was learned from about 1000 scans of the hands of 31 people",
    "| 45 angles, more than an image tells |",
    "Osman, Bolkart and Black, *STAR*, 2020 |",
    "Loper and others, *SMPL*, 2015 |",
    "Hands and Bodies Together*, 2017)",
)

GENERAL = (  # mathematics, definitions and advice
    "are un-posed only as well as the model describes them",
)
