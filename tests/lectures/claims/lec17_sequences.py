"""What lecture 17 says of its run, and what it quotes from the benchmark of videos."""

import json
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from tests.lectures.numerals import above
from tests.lectures.prose import Run
from workbench.fitting.markers import OFFSET_SIGMA

RESULTS = Path(__file__).parents[3] / "benchmarks" / "results" / "images-video.json"


@cache
def report() -> list[dict[str, Any]]:
    """The four cameras on the frames that were not looked at before."""
    found: list[dict[str, Any]] = json.loads(RESULTS.read_text())["report"]
    return found


def mean(way: str) -> float:
    """The mean distance of the benchmark, mm."""
    return float(np.mean([one[way]["mpjpe"] for one in report()]))


def better_together() -> int:
    """In how many cameras."""
    return sum(one["together"]["mpjpe"] < one["apart"]["mpjpe"] for one in report())


def shape(run: Run, kind: str) -> np.ndarray:
    """The shape off by, mm: frame by frame, every frame counts, counted rightly."""
    return np.asarray(np.mean(run["shape_errors"][kind], axis=0))


def least_seen(run: Run) -> set[str]:
    """The markers that the least known direction moves most."""
    first = run["directions"][:, 0]
    return {run["labels"][i].split()[0] for i in np.argsort(-np.abs(first))[:6]}


SAYS = {
    "the same problem gives a worse body than single frames do": lambda run: (
        shape(run, "alike")[1] > 1.5 * shape(run, "alike")[0]
    ),
    "Second differences are better than first ones here": lambda run: (
        run["marks"]["order 2"][1, 1] < 0.5 * run["marks"]["order 1"][1, 1]
    ),
    "If it counts as 45, the shape is worse than from single frames, and surer of itself.": lambda run: (
        run["F"],
        shape(run, "alike")[1] > 1.5 * shape(run, "alike")[0],
    ),
    "in front of one camera for a second, 24 frames": lambda run: run["T"],
    "with errors of 4 px that are independent of each other": lambda run: (
        float(run["SIGMA"]),
        abs(np.corrcoef(run["white"][:-1].ravel(), run["white"][1:].ravel())[0, 1]) < 0.1,
        abs(np.std(run["white"]) / run["SIGMA"] - 1) < 0.1,
    ),
    "it is off by 19 mm in place of 21 mm": lambda run: (
        run["table"]["one shape"][2],
        run["table"]["frame by frame"][2],
    ),
    "That is not much for 24 times as many keypoints": lambda run: (
        run["T"],
        run["table"]["one shape"][2] > 0.8 * run["table"]["frame by frame"][2],
    ),
    "it does not see in 24 frames either": lambda run: (
        run["T"],
        run["tall"]["order 2"][-1] - run["real_stature"] < -30,
    ),
    "changes of speed that are more than eight times those of the person": lambda run: all(
        run["table"][name][1] > 8 * run["table"]["the truth"][1]
        for name in ("one shape", "frame by frame")
    ),
    "The left wrist in 24 frames.": lambda run: run["T"],
    "In depth, which it hardly sees, they jump by decimetres": lambda run: all(
        np.abs(
            np.diff(run["body"].joints(one["pose"], one["betas"], one["trans"])[:, run["wrist"], 2])
        ).max()
        > 0.2
        for one in run["fits"].values()
    ),
    "sigma is 1, 3, 10 and 30 times the true differences": lambda run: run["TIMES"],
    "bring joints nearer to the truth, if they are not too strong": lambda run: (
        (run["marks"]["order 2"][1:, 0] < run["table"]["one shape"][0]).all(),
        run["marks"]["order 2"][0, 0] > run["table"]["one shape"][0],
    ),
    "the stronger they are, the smaller the person becomes": lambda run: all(
        (np.diff(run["tall"][name]) > 0).all() for name in ("order 1", "order 2")
    ),
    "at three times the true size they leave a jitter of 25 mm a frame squared in place of 66, and "
    "joints are nearer to the truth": lambda run: (
        run["marks"]["order 2"][1, 1],
        run["marks"]["order 1"][1, 1],
        run["marks"]["order 2"][1, 0] < run["marks"]["order 1"][1, 0],
    ),
    "Without smoothness the person is about 4 cm too small": lambda run: (
        (run["real_stature"] - 1e3 * run["stature"](run["body"], run["fits"]["one shape"]["betas"]))
        / 10
    ),
    "Set sigma to exactly the size of the person's own differences, and it is 20 cm": lambda run: (
        (run["real_stature"] - run["tall"]["order 2"][0]) / 10
    ),
    "at three times the true differences the person loses 46 cm": lambda run: (
        (run["real_stature"] - run["tall"]["joints"][0]) / 10
    ),
    "we take second differences and ten times": lambda run: (
        run["TIMES"][2],
        run["marks"]["order 2"][2, 1] < 0.3 * run["table"]["one shape"][1],
    ),
    "This problem has 75 unknowns a frame, and 10 that all frames share": lambda run: (
        run["own"].shape[1],
        len(run["of_all"]),
    ),
    "with the shape first it fills up": lambda run: (
        run["factors"]["shared first"].sum() > 1.5 * run["factors"]["shared last"].sum()
    ),
    "It is small, 10 by 10 here": lambda run: run["S"].shape,
    "that is $S^{-1} g$ (lecture 12)": lambda run: (
        run["off_cov"] < 1e-7,
        run["off_step"] < 1e-7,
    ),
    "dotted lines grow with the cube of the frames, and in proportion to them": lambda run: (
        run["seconds"]["dense"][20] / run["seconds"]["dense"][5]
        > run["seconds"]["by blocks"][160] / run["seconds"]["by blocks"][40]
    ),
    "At 20 frames the blocks are already quicker than the dense solution alone, and with 160 frames, where $J$ "
    "would take gigabytes, they need megabytes.": lambda run: (
        min(run["seconds"]["by blocks"]),
        max(run["seconds"]["by blocks"]),
        run["seconds"]["dense"][20] > 1.5 * run["seconds"]["by blocks"][20],
        8 * np.prod(run["longest"].shape) > 2e9,
        run["stored"] < 3e7,
    ),
    "a detector found in real images, 45 frames at 60 a second": lambda run: (
        run["F"],
        run["clip"].fps,
    ),
    "the third, with which it will go worst": lambda run: (
        max(report(), key=lambda one: one["independent"]["mpjpe"] / one["apart"]["mpjpe"])["camera"]
        == "cam03"
    ),
    "by `worth=45`: every frame counts": lambda run: run["F"] == 45,
    "The jitter is gone, and everything else is worse than frame by frame. Limbs are off by a third more. The "
    "person is more than 30 cm too small": lambda run: (
        above(-run["real_table"]["every frame counts"][2] / 10),
        run["real_table"]["every frame counts"][1] < 0.1 * run["real_table"]["frame by frame"][1],
        1.28
        < run["real_table"]["every frame counts"][0] / run["real_table"]["frame by frame"][0]
        < 1.4,
        run["real_table"]["every frame counts"][2] < 2 * run["real_table"]["frame by frame"][2],
    ),
    "one beta is larger than 6, where 3 is rare": lambda run: (
        above(np.abs(run["real"]["every frame counts"][1]["betas"]).max()),
        3,
        int((np.abs(run["real"]["every frame counts"][1]["betas"]) > 6).sum()) == 1,
    ),
    "Laplace's standard deviation of the stature is 60 mm, so that the fit is wrong by more than five of its "
    "own standard deviations": lambda run: (
        run["sd_full"],
        -run["real_table"]["every frame counts"][2] > 5 * run["sd_full"],
    ),
    "More data made the answer worse, and surer of itself": lambda run: (
        run["sd_full"] < 0.8 * run["sd_right"]
    ),
    "More than a third of the mean square error is constant, and what is left over is still alike in "
    "neighbouring frames": lambda run: (run["constant"] > 1 / 3, run["moving_part"][1] > 0.4),
    "The real ones are often on the same side for many frames": lambda run: (
        (np.sign(run["errors"][:, run["names"].index("left_knee"), 0]) > 0).mean() > 0.9
    ),
    "so that $n$ is about $T (1 - \\rho) / (1 + \\rho)$": lambda run: (
        abs(run["by_formula"](1000, 0.0, 0.8) / (1000 * 0.2 / 1.8) - 1) < 0.01
    ),
    "and $n < 1 / b$: *no film, however long*": lambda run: all(
        run["by_formula"](frames, bias, 0.8) < 1 / bias
        for frames in (45, 1000, 10**6)
        for bias in (0.2, 0.35)
    ),
    "The 45 frames are worth less than three. Independent errors are worth what they should be, and errors that "
    "are alike are worth about two.": lambda run: (
        run["F"],
        run["true_worth"] < 3,
        abs(run["effective_frames"](run["made_white"]) / 45 - 1) < 0.1,
        1.7 < run["effective_frames"](run["made"]) < 2.5,
    ),
    "By the formula, 1000 frames whose errors only change slowly are worth more than a hundred, but with a bias of 35 % they are "
    "still worth less than three": lambda run: (
        1000,
        above(run["by_formula"](1000, 0.0, 0.8)),
        100 * run["bias"],
        run["by_formula"](1000, run["bias"], 0.8) < 3,
    ),
    "so its answer of 4.4 is too large; but it is near 3, and far from 45": lambda run: (
        run["left_over"],
        round(float(run["true_worth"])),
        run["F"],
        run["left_over"] > run["true_worth"],
    ),
    "For $n$ we take the 4.4, which needs no other camera": lambda run: run["left_over"],
    "Limbs are as near as frame by frame, without the jitter. The stature is off by 10 cm, a little more than "
    "frame by frame, and by little more than one standard deviation": lambda run: (
        -run["real_table"]["counted rightly"][2] / 10,
        abs(run["real_table"]["counted rightly"][0] / run["real_table"]["frame by frame"][0] - 1)
        < 0.05,
        run["real_table"]["counted rightly"][1] < 0.1 * run["real_table"]["frame by frame"][1],
        1 < run["real_table"]["counted rightly"][2] / run["real_table"]["frame by frame"][2] < 1.6,
        1 < -run["real_table"]["counted rightly"][2] / run["sd_right"] < 1.5,
    ),
    "the film of one camera has made a child of an adult": lambda run: (
        run["real_tall"] + run["real_table"]["every frame counts"][2] < 1400
    ),
    "On these 45 frames, which were not looked at when the smoothness was chosen, limbs are off by 108.0 mm "
    "together and by 106.0 mm apart, as a mean over the four cameras taken one by one, and by 131.1 mm if every "
    "frame counts": lambda run: (
        len(run["FRAMES"]),
        mean("together"),
        mean("apart"),
        mean("independent"),
        run["FRAMES"] == range(55, 100),
        len(report()) == 4,
    ),
    "With two of the four cameras, fitting together is better than apart, with two it is worse.": lambda run: (
        better_together() == 2
    ),
    "the shape is off by 23 mm in place of 26 mm. With errors that are alike, the same problem gives 46 mm, worse "
    "than frame by frame, and counted rightly 21 mm.": lambda run: (
        shape(run, "independent")[1],
        shape(run, "independent")[0],
        shape(run, "alike")[1],
        shape(run, "alike")[2],
        shape(run, "alike")[1] > 1.5 * shape(run, "alike")[0],
        shape(run, "alike")[2] < shape(run, "alike")[0],
    ),
    "with independent errors, counting every frame is right. Right: with errors that are alike, of the same size, "
    "it is worse than single frames": lambda run: (
        abs(shape(run, "independent")[1] - shape(run, "independent")[2]) < 1,
        all(one[1] > one[0] for one in run["shape_errors"]["alike"]),
        abs(np.std(run["made"]) / np.std(run["made_white"]) - 1) < 0.1,
    ),
    "exchanged for independent ones of 4 px": lambda run: float(
        np.std(run["innocent"] - run["view"].camera.pixels(run["places"], run["four"].start))
    ),
    "With independent errors it is the prior that does the damage: limbs are off by 74 mm if everything counts "
    "fully, and by 46 mm if only the pose prior has the weight": lambda run: (
        run["blamed"]["independent errors", "nothing"][0],
        run["blamed"]["independent errors", "the pose prior"][0],
        run["blamed"]["independent errors", "keypoints and smoothness"][0]
        > run["blamed"]["independent errors", "nothing"][0],
    ),
    "The prior takes this for 45 unusual poses": lambda run: run["F"],
    "With the detector's errors, both do damage: limbs are off by 16 cm if everything counts, by 14 cm and 13 cm "
    "if one of the two is weighed, and by 11 cm if both are.": lambda run: tuple(
        run["blamed"]["the detector's errors", name][0] / 10  # in cm
        for name in ("nothing", "the pose prior", "keypoints and smoothness", "both")
    ),
    "finds 7 frames, where the errors alone are worth 45": lambda run: (
        run["counts"]["independent errors"],
        run["F"],
        run["effective_frames"](
            run["innocent"] - run["view"].camera.pixels(run["places"], run["four"].start)
        )
        > 40,
    ),
    "If the detector's hip is 2 cm beside ours in every frame, why not estimate the 2 cm?": lambda run: (
        100 * run["sigma"],
        100 * run["sigma"],
    ),
    "The fitted cameras agree better, and the largest beta falls from 3.6 to 1.2": lambda run: (
        run.line("without offsets")[-1],
        run.line("with offsets")[-1],
        run.line("with offsets")[0] < run.line("without offsets")[0],
    ),
    "But a new camera is not predicted any better; it is even a little worse.": lambda run: (
        1
        < run["judges"]["with offsets"][:, 1].mean() / run["judges"]["without offsets"][:, 1].mean()
        < 1.1
    ),
    "The offset is known beforehand to 9.5 mm.": lambda run: 1e3 * OFFSET_SIGMA * np.sqrt(3),
    "which MoSh finds from 12 frames": lambda run: len(run["marked"]),
    "With the markers held at their nominal places, they are missed by 5.5 mm, although their noise is 1 mm along "
    "each axis; the shape is off by 4 mm.": lambda run: (
        run["mosh_table"]["nominal places, 12 frames"][0],
        1e3 * run["NOISE"],
        run["mosh_table"]["nominal places, 12 frames"][1],
    ),
    "a single frame can be fitted to a fraction of its noise, a bad sign that we know from lecture 9, and the "
    "shape is no better. With 12 frames it is off by less than half of that.": lambda run: (
        len(run["marked"]),
        run["mosh_table"]["free offsets, 1 frame"][0] < 0.3,
        run["mosh_table"]["free offsets, 1 frame"][1]
        >= run["mosh_table"]["nominal places, 12 frames"][1],
        run["mosh_table"]["free offsets, 12 frames"][1]
        < 0.5 * run["mosh_table"]["free offsets, 1 frame"][1],
    ),
    "In one frame, 19 of the 133 directions are not seen. Nine of them are the offsets of the three markers that "
    "were hidden in this frame. The other ten are the betas": lambda run: (
        int(133 - run.line("numerical rank 114")[0]),
        len(run["border"]),
        run["body"].n_betas,
        np.isnan(run["marked"][0]).any(axis=1).sum() == 3,
        "9 single entries: offsets[LSHO" in run.printed,
    ),
    "A second pose ends this, and the rank is full.": lambda run: (
        run.line("numerical rank 133")[:2] == [133, 133] and run["diagnosis"].rank == 133
    ),
    "With 12 frames, 115 of 133 directions are known better than by the prior, and the last frames add hardly "
    "any.": lambda run: (
        len(run["known_better"]),
        run["known_better"][-1],
        len(run["border"]),
        run["known_better"][-1] - run["known_better"][-5] < 6,
    ),
    "The first poses add most": lambda run: (
        all(b >= a for a, b in pairwise(run["known_better"]))
        and run["known_better"][1] - run["known_better"][0]
        > run["known_better"][-1] - run["known_better"][5]
    ),
    "The offset that is known worst is known to 3.7 mm only, where the noise is 1 mm.": lambda run: (
        run["offset_sd"].max(),
        1e3 * run["NOISE"],
    ),
    "it turns the four markers of the head together": lambda run: (
        least_seen(run) == {"LFHD", "RFHD", "LBHD", "RBHD"}
    ),
    "A formal rank would have called all of it seen.": lambda run: (
        np.linalg.matrix_rank(run["informed"] * np.outer(run["prior_sd"], run["prior_sd"])) == 133
    ),
    "rotations of forearm and hand that move nothing but hidden markers are not seen, in just these frames, and "
    "the diagnosis names them": lambda run: (
        run["gaps"].rank < run["each"].free.size == run["bridged"].rank,
        "turns from 4, left_elbow down" in run.printed,
    ),
    "The pose prior puts a likely arm there, which is not this one. Smoothness carries over what was seen before "
    "and after, and is off by less than half as much.": lambda run: (
        run["missed"]["each frame by itself"][run["HIDDEN"]].mean() > 50,
        run["missed"]["smooth"][run["HIDDEN"]].mean()
        < 0.5 * run["missed"]["each frame by itself"][run["HIDDEN"]].mean(),
    ),
    "A film of 45 frames was worth less than three independent ones. If it counts as 45": lambda run: (
        run["F"],
        run["F"],
        run["true_worth"] < 3,
    ),
}

GIVEN = ("answer to a right-hand side with $f = 0$",)

GENERAL = (  # mathematics, definitions and advice
    "So a film should tell more than a photograph",
    "as long as the shape is unknown",
    "as much as $n$ frames",
    "So we count the directions in which the frames say more than the priors",
    "Here is half of the dance of the beginning",
    "In how many directions of shape and offsets the frames say more than the prior.",
)
