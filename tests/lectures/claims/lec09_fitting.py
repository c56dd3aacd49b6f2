"""What lecture 9 says of its run."""

import numpy as np

from tests.lectures.prose import Run


def unknowns(run: Run) -> int:
    return sum(block.size for block in run["all_vertices"].free.blocks)


def joints(run: Run) -> list[float]:
    """The fit to joints alone: rank, 85, joints met to (mm), skin off by (mm), worst beta."""
    return run.line("joints alone")


def priors(run: Run) -> list[float]:
    """The same with priors."""
    return run.line("joints and priors")


def missed(run: Run) -> tuple[float, float]:
    """By how much the images are missed, px: begun facing the camera, and facing away."""
    return run.line("begun facing the camera")[2], run.line("begun facing away")[2]


def costs(run: Run) -> tuple[float, float]:
    return run["ends"]["facing the camera"].cost, run["ends"]["facing away"].cost


def too_far(run: Run, distance: str) -> float:
    """The guess of the depth at a lean of 30 degrees, % beyond the truth."""
    return float(100 * (run["wide"][distance][6] - 1))


def depth(run: Run, cameras: int) -> float:
    """How far joints are off in depth, mm."""
    found = run["body"].joints(**run["results"][cameras].values)
    return float(1e3 * np.sqrt(np.mean((found - run["joints"])[:, 2] ** 2)))


def place(run: Run) -> list[float]:
    """How well one camera tells the place: across, up and in depth, mm."""
    return [float(one) for one in run.line("1 camera ", "sigma of trans")[-3:]]


LEGS = [f"{side}_{joint}" for side in ("left", "right") for joint in ("hip", "knee", "ankle")]


def forwards(run: Run, joint: str) -> float:
    """How far the front of a joint faces the camera in the fit that began facing away, -1 to 1."""
    values = run["ends"]["facing away"].values
    G = run["body"].kinematics.motion(values["pose"], values["betas"]).G
    return float(G[run["names"].index(joint)][2, 2])


def unseen_turns(run: Run) -> float:
    """The share of the skin's error that turns make which the joints do not see, to first order."""
    wb = run["wb"]
    both = wb.Problem(
        [run["at_joints"], *run["priors"]], ["pose", "betas", "trans"], blocks=[run["seen_joints"]]
    )
    values = run["given"] | wb.solve(both, run["given"]).values
    by_pose = wb.Problem([run["at_joints"]], ["pose"], blocks=[run["seen_joints"]])
    here = by_pose.linearize(values)
    unseen = here.svd[2][here.rank :]
    turn = unseen.T @ (unseen @ (values["pose"] - run["truth"]["pose"]).ravel())
    pose = values["pose"] - turn.reshape(24, 3)
    moved = run["distances"](values | {"pose": pose})
    return float(1 - moved.mean() / run["distances"](values).mean())


SAYS = {
    "With every vertex known, the fit is closer to the truth than its data": lambda run: (
        run.line("noise 5 mm")[2] < 0.5 * 5
    ),
    "it is taken to be further away than it is": lambda run: all(
        (guesses[3:] > 1).all() for guesses in run["wide"].values()
    ),
    "This is as good as a fit can be": lambda run: (
        abs(run.line("noise 5 mm")[2] / run.line("5 mm times the root of")[-1] - 1) < 0.1
    ),
    "at $v_i$, with a noise of 5 mm.": lambda run: 1e3 * run["NOISE"],
    "The unknowns are 72 numbers of the pose $\\theta$, 10 of the shape $\\beta$ and 3 of the translation": (
        lambda run: tuple(run["truth"][name].size for name in ("pose", "betas", "trans"))
    ),
    "it takes six or seven iterations, and the fit is *closer to the truth* than its data": lambda run: (
        all(line[1] in {6, 7} for line in run.lines("noise ", "iterations")),
        run.line("noise 5 mm")[2] < 5,
    ),
    "It has $m = 1107$ equations for $p = 85$ unknowns": lambda run: (run["m"], run["p"]),
    "it can follow the noise only in the 85 directions": unknowns,
    "So the error per coordinate is $\\sigma \\sqrt{p/m}$, to first order.": lambda run: (
        abs(run.line("noise 5 mm")[2] / run.line("5 mm times the root of")[-1] - 1) < 0.1
    ),
    "we take only the 24 joints, seen with the same noise": lambda run: run["body"].n_joints,
    "Without priors, the joints are fitted to *less* than their noise. This is a bad sign: there are 72 "
    "equations for 85 unknowns": lambda run: (
        run["seen_joints"].size,
        unknowns(run),
        joints(run)[2] < 5,
    ),
    "the rank is 53 of 85": lambda run: (joints(run)[0], unknowns(run)),
    "one beta is off by 1.3 standard deviations": lambda run: joints(run)[4],
    "Among people each beta is 0 on average, with a standard deviation of 1; the angles of this lecture "
    "are 0 on average, with a standard deviation of 0.25 rad.": lambda run: (
        0,
        run["BETAS"],
        0,
        run["POSE"],
    ),
    "the rank is full. The worst beta is now off by half a standard deviation.": lambda run: (
        priors(run)[0] == unknowns(run),
        priors(run)[4] == 0.5,
    ),
    "The surface is hardly closer, 18 mm in place of 19 mm": lambda run: (
        priors(run)[3],
        joints(run)[3],
        priors(run)[3] < joints(run)[3],
    ),
    "nearly half of this error comes from turns of bones that move no joint": lambda run: (
        0.4 < unseen_turns(run) < 0.5
    ),
    "both reproduce the image to within the noise of the detector": lambda run: (
        max(missed(run)) < run["PIXELS"]
    ),
    "In the image the joints of all three agree. The fit that began facing away has turned its trunk "
    "towards the camera, but its lower legs still face away from it.": lambda run: (
        max(missed(run)) < 3 * run["PIXELS"],
        forwards(run, "spine3") > 0.9,
        max(forwards(run, "left_knee"), forwards(run, "right_knee")) < 0,
    ),
    "hips, knees and ankles are turned so that the legs meet a trunk that faces the other "
    "way": lambda run: all(
        np.linalg.norm(run["ends"]["facing away"].values["pose"][run["names"].index(name)]) > 0.7
        for name in LEGS
    ),
    "It ended in another minimum, at nearly five times the cost": lambda run: (
        4.5 < costs(run)[1] / costs(run)[0] < 5,
        run.line("begun facing away")[-1] > 1 > 2 * run.line("begun facing the camera")[-1],
        "left_ankle turned by" in run.printed,
    ),
    "How good is it when the person leans towards the camera?": lambda run: (
        run["wide"]["from 80 m"][12] > 1.5
    ),
    "by a factor of about 1 / cos, and by less if the camera is near": lambda run: (
        1,
        bool((run["wide"]["from 4 m"][1:] < run["wide"]["from 80 m"][1:]).all()),
        np.allclose(run["wide"]["from 4 m"] * np.cos(run["leans"]), 1, atol=0.15),
    ),
    "At 30 degrees the depth is 11 to 19 % too large.": lambda run: (
        float(np.degrees(run["leans"][6])),
        too_far(run, "from 4 m"),
        too_far(run, "from 80 m"),
    ),
    "In the image it agrees with the data to within the noise.": lambda run: (
        missed(run)[0] < run["PIXELS"]
    ),
    "The fit to one camera is at another depth, and its limbs are bent differently.": lambda run: (
        depth(run, 1) > 100
    ),
    "the standard deviation of the translation is 8 mm across the image, and 230 mm in depth": lambda run: (
        place(run)[0],
        place(run)[2],
    ),
    "$X / Z$ stays the same, and so does every pixel": lambda run: all(
        line[-1] < 1e-10 for line in run.lines("times as large and as far")
    ),
    "the joints, which were off by 190 mm in depth, are now off by 6 mm": lambda run: (
        depth(run, 1),
        depth(run, 2),
    ),
    "triangulation gives the start in closed form": lambda run: (
        run.line("triangulated joints")[0] < run.line("the body at rest, moved")[0] < 100
    ),
}

GIVEN = (
    "full red ones are 40 mm away or more",  # the scale of the colours
    "here $c = 1$",
    "$X - a Z = 0$ and $Y - b Z = 0$",
    "Left: what camera 0 sees",
)

GENERAL = (  # mathematics, definitions and advice
    "as near as possible to the triangulated ones",
    "A fit that is closer to its data than their noise is a warning.",
)
