"""What lecture 16 says of its run."""

import json
from pathlib import Path

import numpy as np

from tests.lectures.numerals import below
from tests.lectures.prose import Run
from workbench.fitting.images import LAMBDA_POSE, ByHeight
from workbench.fitting.keypoints import height_in_view
from workbench.lectures.material.photographs import Shot

KINDS = ("balance", "made up")
RESULTS = Path(__file__).parents[3] / "benchmarks" / "results" / "images.json"
MEASURED = json.loads(RESULTS.read_text())  # what benchmarks/IMAGES.md is written from


def off(run: Run, name: str, kind: str) -> np.ndarray:
    """How far the poses of these fits are off, mm."""
    return run["mean_errors"](run["found"][name, kind], run["SHOTS"][kind])


def away(run: Run, name: str, kind: str) -> float:
    """How far their limbs are off in space on average, mm."""
    ends = zip(run["found"][name, kind], run["SHOTS"][kind], strict=True)
    return float(np.mean([run["in_space"](end[0], one.truth) for end, one in ends]))


def backwards(run: Run, name: str, kinds: tuple[str, ...] = KINDS) -> int:
    """How many of their knees and elbows are bent backwards."""
    return sum(run["bent_back"](end[0]) for kind in kinds for end in run["found"][name, kind])


def failed(run: Run, name: str, kind: str) -> int:
    """How many of them are off by more than 150 mm."""
    return int((off(run, name, kind) > 150).sum())


def barrier(run: Run, name: str) -> float:
    """How far one has to climb from the minima of a bent-back knee to reach the truth."""
    angles, curve = run["angles"], run["curves"][name]
    at, costs = run["minima"][name]
    back = at < 0
    between = (angles > at[back].max()) & (angles < 0.8)
    return float(curve[between].max() - costs[back].min())


def near(run: Run) -> list[float]:
    """How far the fits with known stature are behind the truth along the line of sight, m."""
    return [
        float(
            run["matrix_from_vector"](values["camera/rotation"])[2]
            @ (values["trans"] - one.truth["trans"])
        )
        for (values, *_), one in zip(run["found"]["stature", "balance"], run["real"], strict=True)
    ]


def tall(run: Run) -> float:
    """How high the person of `balance` would be in the image, upright: the mean, in px."""
    setups = [(run["keypoint_setup"](run["usual"], one.observed, ""), one) for one in run["real"]]
    heights = [
        height_in_view(setup.body, setup.views[0], setup.start | one.truth) for setup, one in setups
    ]
    return float(np.mean(heights))


SAYS = {
    "Twelve real images and sixteen made-up people": lambda run: (
        len(run["real"]),
        len(run["people"]),
    ),
    "their keypoints have an error of 5 px": lambda run: float(
        np.mean(
            [
                np.std(shot.observed.photographs[0].pixels - seen(run, shot))
                for shot in run["people"]
            ]
        )
    ),
    "The problem is solved, exactly, and the answer is worthless. Each of the landmarks gives two equations, 46 in "
    "all, and there are 85 unknowns": (
        lambda run: (
            run["m"],
            run["p"],
            run["missed"](run["exact"], run["begun"]) < 0.1,
            run["mpjpe"](run["exact"], run["shot"].truth) > 250,
        )
    ),
    "at least 39 directions of the unknowns are seen by no keypoint": lambda run: (
        run["p"] - run["here"].rank
    ),
    "In the image (left) the fitted landmarks lie in the middle of the observed ones.": lambda run: (
        run["missed"](run["exact"], run["begun"]) < 0.1
    ),
    "The keypoints are met less well, and the pose is several times better.": lambda run: (
        run["missed"](run["with_priors"], run["begun"]) > 1,
        3 * run["mpjpe"](run["with_priors"], run["shot"].truth)
        < run["mpjpe"](run["exact"], run["shot"].truth),
    ),
    "If the shoulders are nearer together than 25 px": lambda run: 25,
    "The person on the beam stands upright, and the start is good to a fifth. Other people bend, and their "
    "starts are worse.": lambda run: (
        max(abs(one - 1) for one in run.line("balance  depth of the start")[:2]) < 0.2,
        run.line("made up  depth of the start")[1] > run.line("balance  depth of the start")[1],
    ),
    "wrist in four real images by up to 200 px to the right": lambda run: max(run["AWAY"]),
    "takes with $\\sigma = 100$ px": lambda run: 100,
    "We try 4 px, the accuracy of good keypoints, and 40 px, which is about 5 % of": lambda run: (
        run["SIGMA"],
        run["SCALE"],
        100 * run["SCALE"] / tall(run),
    ),
    "The square lets the wrist drag the whole body along.": lambda run: (
        run["off_by"]["squares"][-1] > 2 * run["off_by"]["squares"][0]
    ),
    "The loss with two numbers gives up the keypoint and keeps the others.": lambda run: (
        abs(run["off_by"]["4 px, and 40 px"][-1] - run["off_by"]["4 px, and 40 px"][0]) < 5,
        run["off_by"]["4 px, and 40 px"][-1] < run["off_by"]["squares"][-1] / 2,
    ),
    "With one number the priors win, wrong keypoint or not.": lambda run: all(
        one > 1.5 * other
        for name in ("one number, 4 px", "one number, 40 px")
        for one, other in zip(run["off_by"][name], run["off_by"]["4 px, and 40 px"], strict=True)
    ),
    "With 4 px as the only number, a coordinate costs at most one half": lambda run: (
        run["SIGMA"],
        run["losses"]["one number, 4 px"].max() < 0.5,
    ),
    "With 40 px, good keypoints are believed as little as if they were measured to 40 px": lambda run: (
        run["LOSSES"]["one number, 40 px"][0],
        run["SCALE"],
    ),
    "A doubtful keypoint that is 200 px off costs 0.5 with the weight outside, a hundredth of a sure one. "
    "Inside it costs twenty times as much": lambda run: (
        run["SIGMA"] * float(np.sqrt(run["s"])),
        float(run["w"] * run["robust"](run["s"])),
        round(1 / run["w"]) == 100,
        float(run["robust"](run["w"] * run["s"]) / (run["w"] * run["robust"](run["s"]))),
    ),
    "Without the sign a natural knee costs more than one that is bent backwards.": lambda run: (
        run.line("1.5 rad, natural")[-1] > run.line("-0.5 rad, backwards")[-1],
        run.line("1.5 rad, natural")[-2] < run.line("-0.5 rad, backwards")[-2],
    ),
    "It hardly helps.": lambda run: (
        backwards(run, "rest") > 4,
        sum(run.line(kind, "without E_a:")[0] for kind in KINDS) - backwards(run, "rest") <= 3,
    ),
    "with the left knee bent by 0.8 rad": lambda run: run["stand"][run["knee"], 0],
    "With keypoints to 4 px there is a hill between it and minima at knees that are bent backwards. The term "
    "raises these, but the hill remains. With keypoints to 41 px there is a single minimum.": lambda run: (
        run["SIGMA"],
        LAMBDA_POSE[2] / np.sqrt(2),
        barrier(run, "keypoints to 4 px, without E_a") > 2,
        barrier(run, "keypoints to 4 px, with E_a") > 2,
        run["curves"]["keypoints to 4 px, with E_a"][0]
        > run["curves"]["keypoints to 4 px, without E_a"][0] + 1,
        len(run["minima"]["keypoints to 41 px, with E_a"][0]) == 1,
    ),
    "of the priors fall from 404 to 4.78": lambda run: (LAMBDA_POSE[0], LAMBDA_POSE[-1]),
    "What does a weight of 404 mean?": lambda run: LAMBDA_POSE[0],
    "This is 286 px in the first two of the four stages, then 41 px, and 3.4 px at last. We take a single "
    "stage before the last one, with 41 px": lambda run: (
        *(LAMBDA_POSE[k] / np.sqrt(2) for k in (0, 2, 3, 2)),
        LAMBDA_POSE[0] == LAMBDA_POSE[1],
        len(LAMBDA_POSE) == 4,
    ),
    "Nearly all of the wrong knees are gone, and half of the failures among the made-up people; but one of the "
    "fits that still fail is worse than any was before.": lambda run: (
        backwards(run, "staged") <= 0.25 * backwards(run, "rest"),
        failed(run, "staged", "made up") <= 0.5 * failed(run, "rest", "made up") + 0.5,
        off(run, "staged", "made up").max() > off(run, "rest", "made up").max() + 20,
    ),
    "has 200 people in recorded poses that it never saw, and the order is the same: 139.7 mm with squares and "
    "from rest, 59.2 mm with the robust loss and the learned start, 55.6 mm with it and from the truth. With four "
    "wrong keypoints these are 404.4, 97.3 and 87.8 mm.": lambda run: (
        len(MEASURED["people"]["regressed start"]["MPJPE"]),
        *(
            float(np.mean(MEASURED[scene][name]["MPJPE"]))
            for scene in ("people", "outliers")
            for name in ("as before", "regressed start", "from the truth")
        ),
    ),
    "Four starts rescue most of the failures. The network alone is off by 107 mm": lambda run: (
        float(run["alone"]),
        failed(run, "four turned", "made up") <= 0.5 * failed(run, "rest", "made up"),
    ),
    "But as a *start* it is the best that we have, and needs no stages.": lambda run: all(
        off(run, "learned", "made up").mean() < off(run, other, "made up").mean()
        for other in ("rest", "four turned", "staged")
    ),
    "The learned start comes within a few millimetres of it.": lambda run: all(
        off(run, "learned", kind).mean() < off(run, "from truth", kind).mean() + 10
        for kind in KINDS
    ),
    "The failures, above the dashed line, are a matter of the start.": lambda run: (
        failed(run, "rest", "made up") >= 3,
        failed(run, "learned", "made up") <= 1,
        failed(run, "from truth", "made up") == 0,
    ),
    "For the made-up people it is as good as the nearest one. For the real person another end is nearer, by "
    "several millimetres on average.": lambda run: (
        np.diff(run.line("made up  the lowest of four")[-2:])[0] > -3,
        np.diff(run.line("balance  the lowest of four")[-2:])[0] <= -3,
    ),
    "The cost believes in independent errors of 4 px": lambda run: run["SIGMA"],
    "the gap is a small part of the 2.08 that the bound allows": lambda run: (
        float(np.log(len(run["mixture"].shares))),
        min(run["gaps"]) >= 0,
        max(run["gaps"]) < 0.3,
    ),
    "But the answers are *not better* than with one Gaussian, on the real images or on the made-up ones": (
        lambda run: all(
            off(run, "mixture", kind).mean() > off(run, "learned", kind).mean() - 4
            for kind in KINDS
        )
    ),
    "the place is still off by about two decimetres": lambda run: all(
        150 < away(run, "learned", kind) < 250 for kind in KINDS
    ),
    "From 15 % too near to 15 % too far the cost rises by less than 6, and the person grows by almost half a "
    "metre": lambda run: (
        100 * (1 - run["factors"][0]),
        100 * (run["factors"][-1] - 1),
        below(np.ptp(run["profiles"]["stature unknown"][:, 0])),
        0.4 < np.diff(run["tallest"])[0] < 0.5,
    ),
    "A stature $h$ that is known to 1 cm is one more residual, the stature of the model less $h$, over 1 cm": (
        lambda run: (100 * run["of_tall"].priors.sigma,) * 2
    ),
    "the person grows with the distance and the cost hardly rises": lambda run: (
        bool((np.diff(run["profiles"]["stature unknown"][:, 1]) > 0).all()),
        np.ptp(run["profiles"]["stature unknown"][:, 0])
        < np.ptp(run["profiles"]["stature known"][:, 0]) / 4,
    ),
    "The error in space falls by about a third, and the pose hardly changes.": lambda run: (
        0.6 < away(run, "stature", "balance") / away(run, "learned", "balance") < 0.75,
        abs(off(run, "stature", "balance").mean() - off(run, "learned", "balance").mean()) < 5,
    ),
    "standard deviation of the depth is a good deal smaller than the error, and nearly all fits are too near.": (
        lambda run: (
            run.line("stature  depth off")[2] < 0.8 * run.line("stature  depth off")[0],
            np.mean(np.array(near(run)) < 0) > 0.7,
        )
    ),
    "Spheres leave an overlap of centimetres, and capsules leave none, at the price of less than a pixel in the image.": (
        lambda run: (
            min(run["overlaps"]["spheres"]) > 20,
            max(run["overlaps"]["capsules"]) < 2,
            run.line("capsules: deepest")[-1] < run.line("nothing : deepest")[-1] + 1,
        )
    ),
    "they touch at the thin line. Spheres push only when the axes are near, and not at all where they meet.": (
        lambda run: (
            run["push"]["spheres"][0] == 0,
            run["push"]["spheres"][-1] < 1e-6 * run["push"]["spheres"].max(),
            run["push"]["capsules"].argmax() == 0,
        )
    ),
    "two parts with radii of 5 cm": lambda run: 5,
    "our made-up people go through themselves": lambda run: (
        np.mean([run["deepest"](one.truth) > 10 for one in run["people"]]) > 0.5
    ),
    "as 80 random cameras would see it": lambda run: run["taught"].__defaults__[0],
    "One round repairs nearly all of the failed fits.": lambda run: (
        run.line("round 0:")[2] >= 3,
        run.line("round 1:")[2] <= 1,
    ),
    "no cost can ever rise": lambda run: bool(
        (np.diff([cost for _, cost in run["rounds"]]) <= 0).all()
    ),
    "After that the loop gains next to nothing": lambda run: (
        run["rounds"][1][0] - run["rounds"][2][0]
        < 0.2 * (run["rounds"][0][0] - run["rounds"][1][0])
    ),
    "The regressor alone is still about twice as far off as the fits that it begins.": lambda run: (
        1.6 < run["alone_now"] / run["rounds"][-1][0] < 2.6
    ),
    "the loss with a scale of 8 % of the person's height in the image": lambda run: (
        100 * ByHeight().outlier
    ),
}


def seen(run: Run, shot: Shot) -> np.ndarray:
    """Where the landmarks of a made-up person are in the image, px."""
    setup = run["keypoint_setup"](run["of_images"], shot.observed, "")
    return setup.views[0].camera.pixels(run["places"](shot.truth), setup.start)


GIVEN = ("two spheres that touch, with $d = r_i + r_j$, have a $d^2 / S$ of more than twenty",)

GENERAL = (  # mathematics, definitions and advice
    "bent backwards by more than a tenth of a radian",
    "is half of a squared distance",
    "If $r$ is much smaller than $c\\, \\sigma$, the denominator is one",
    "Since $s$ is only a third of the radius",
    "is no more than their sum, and no less than a $C$-th of it",
    "is only as good as the model of the errors",
)
