"""What lecture 12 says of its run."""

import numpy as np
import scipy.special

from tests.lectures.prose import Run
from workbench.sampling.ensembles import BURNT, BURNT_TIMES
from workbench.sampling.mixing import LEAST, MARGIN, TIMES, WINDOW
from workbench.sampling.modes import REACH


def posterior(run: Run, truth: float) -> tuple[int, float, float]:
    """Of the angle, without noise: how many peaks, its standard deviation, and Laplace's, rad."""
    grid = run["grid"]
    p = np.exp(-run["cost"](grid, run["pixel"](truth)))
    p /= p.sum()
    peaks = int(((p[1:-1] > p[:-2]) & (p[1:-1] > p[2:])).sum())
    sd = np.sqrt(p @ grid**2 - (p @ grid) ** 2)
    return peaks, float(sd), float(run["bar"](grid[p.argmax()]))


def bones(run: Run) -> tuple[float, float]:
    """The lengths of upper arm and forearm in the lecture's arm, m."""
    arm, elbow, wrist = run["arm"].symbol, run["elbow"], run["wrist"]
    places = run["cs"].Function("places", [arm], [elbow, wrist])(np.zeros(2))
    at_elbow, at_wrist = (np.asarray(one).ravel() for one in places)
    return float(at_elbow[0]), float(at_wrist[0] - at_elbow[0])


def modes(run: Run) -> np.ndarray:
    """Shares of the draws with each of the four signs of the two angles."""
    signs = run["draws"].flat > 0
    return np.array([np.mean((signs == (a, b)).all(axis=1)) for a in (0, 1) for b in (0, 1)])


def deviations(run: Run) -> tuple[float, float]:
    """By the stretch move with the density that its factor is made for, and with a uniform one."""
    return run.line("z with a density of")[-1], run.line("z uniform, the same factor")[-1]


def way_back(run: Run) -> bool:
    """Whether g(1/z) = z g(z) for g = 1 / sqrt z, and the lecture's way to draw z has that density."""
    z = np.linspace(0.5, 2, 7)
    u = np.sqrt(2 * z) - 1  # the lecture draws z = (1 + u)^2 / 2: this is the share below z
    return bool(np.allclose(np.sqrt(z), z / np.sqrt(z)) and np.allclose((1 + u) ** 2 / 2, z))


def tall(run: Run, beta: float) -> float:
    """The height of the body with this first shape coefficient, m."""
    body = run["setup"].body
    return float(np.ptp(body.vertices(betas=np.eye(body.n_betas)[0] * beta)[:, 1]))


SAYS = {
    "up to 1,000 of Laplace's standard deviations away": lambda run: round(REACH[1]),
    "it asks for $1.3 \\cdot 50\\, \\tau$ steps, because a short chain makes $\\tau$ look short, and for as many "
    "again, because half of this chain was left out": lambda run: (
        (MARGIN, TIMES) == (1.3, 50),
        abs(2 * MARGIN * TIMES * run["short"].mixing.times.max() / run.line("100 steps: ")[6] - 1)
        < 0.03,
    ),
    "A forearm of the length $l = 0.25$ m hangs on an elbow whose place is known, $D = 5$ m in front of a camera "
    "with a focal length of $F = 1000$ px.": lambda run: (run["LENGTH"], run["D"], run["F"]),
    "with an error of $\\sigma = 3$ px. Before we see the image, we know that $\\varphi$ is 0 on average, with a "
    "standard deviation of $\\sigma_0 = 0.6$ rad": lambda run: (run["SIGMA"], 0, run["PRIOR"]),
    "A 90 % interval should hold the truth nine times out of ten.": lambda run: (
        90,
        10,
        run.line("90 % intervals by Laplace")[1] < 80,
    ),
    "We do so a thousand times.": lambda run: len(run["angles"]),
    "find that the bar is wrong": lambda run: run.line("90 % intervals by Laplace")[1] < 80,
    "Left, near the image plane: one broad answer, and Laplace too wide.": lambda run: (
        posterior(run, 0.1)[0] == 1,
        posterior(run, 0.1)[2] > 1.3 * posterior(run, 0.1)[1],
    ),
    "Middle and right, further out: two answers, and Laplace knows the higher one only.": lambda run: (
        all(
            posterior(run, truth)[0] == 2
            and posterior(run, truth)[2] < 0.3 * posterior(run, truth)[1]
            for truth in (0.6, 1.1)
        )
    ),
    "the images differ by perspective alone, less than the detector's error": lambda run: (
        abs(run["pixel"](0.5) - run["pixel"](-0.5)) < run["SIGMA"]
    ),
    "an arm, whose upper arm of 0.30 m and forearm of 0.25 m": bones,
    "Least squares has found a forearm that points away from the camera, although it points"
    " towards it, *at a lower cost than the right one*": lambda run: (
        run["found"].values["angles"][1] > 0 > run["true_angles"][1],
        run["other"].values["angles"][1] < 0,
        run["found"].cost < run["other"].cost,
    ),
    "Laplace's standard deviation is too small by a factor of more than five for the upper arm, and of "
    "more than two for the forearm": lambda run: (
        run["exact_sd"][0] > 5 * run["approximation"].sd[0],
        run["exact_sd"][1] > 2 * run["approximation"].sd[1],
    ),
    "With 121 points to an axis, a grid for the 82 numbers of a body's pose and shape": lambda run: (
        len(run["axis"]),
        72 + 10,
    ),
    "With short steps the chain has not left the mode in which it began: none of its 4000 "
    "draws is in the other one.": lambda run: (
        len(run["chain"]),
        run.line("steps of 0.05 rad")[1] == 100,
        abs(run.line("steps of  1.5 rad")[1] - run.line("steps of  1.5 rad")[2]) <= 3,
    ),
    "The first thousand steps of both chains.": lambda run: (
        1000,
        all(len(chain) >= 1000 for chain in run["chains"].values()),
    ),
    "The chain with short steps never crosses the line": lambda run: bool(
        (run["chains"][0.05] > 0).all()
    ),
    "The other one crosses it many times.": lambda run: (
        np.sum(np.diff(np.sign(run["chains"][1.5][:1000])) != 0) > 20
    ),
    "with a uniform z and the same factor they are too wide": lambda run: (
        run["wrong_z"].std() > 1.1
    ),
    "in 82 dimensions": lambda run: 72 + 10,
    "For the density above $g(1/z) = z\\, g(z)$": way_back,
    "on a Gaussian in two dimensions whose standard deviation is 1": lambda run: (
        1,
        run["right_z"].shape[1] == 2,
    ),
    "With the wrong density the draws are too wide, and nothing warns.": lambda run: (
        abs(deviations(run)[0] - 1) < 0.03,
        deviations(run)[1] > 1.1,
    ),
    "Here they have found two more, so that three of the four are known. In the figure below the draws of one camera "
    "lie on a ring, and its four thick places are the modes.": lambda run: (
        modes(run).min() > 0.05,
        run.line("usable:", "modes in all")[-1] == 3,
        np.mean(np.hypot(*(run["draws"].flat / [0.6, 0.7]).T) < 0.4) < 0.02,
    ),
    "We let four ensembles of 32 walkers go for our two angles, 3000 steps each": lambda run: (
        run["draws"].draws.shape[2],
        run["draws"].mixing.steps + run["draws"].mixing.discarded,
        run["draws"].draws.shape[0] == 4,
    ),
    "at least five times the sum up to there": lambda run: WINDOW == 5,
    "each bone may point towards it or away": lambda run: modes(run).min() > 0.05,
    "Right, with a second camera from the side: there is one mode, and Laplace's "
    "approximation suffices": lambda run: (
        np.allclose(run["better"].sd, run["exact"], rtol=0.05),
        np.allclose(run["clear"].values["angles"], run["true_angles"], atol=0.1),
    ),
    "Draws answer every question, once they have mixed.": lambda run: (
        run["draws"].usable,
        np.allclose(run["draws"].mean, run["exact_mean"], atol=0.05),
        np.allclose(run["draws"].sd, run["exact_sd"], rtol=0.05),
    ),
    "within 1.645 standard deviations of its mean with a probability of 90 %": lambda run: (
        float(scipy.special.ndtri(0.95)),
        90,
    ),
    "they are a tenth of all steps, or $5 \\tau$ if that is more, but never more than half. Of the 3000 steps 2700 "
    "are left. Four ensembles of 32 walkers have $N = 4 \\cdot 32 \\cdot 2700 = 345600$ draws in them": lambda run: (
        3000,
        run["draws"].mixing.steps,
        run["draws"].draws.shape[2],
        int(run["draws"].draws[..., 0].size),
        (BURNT, BURNT_TIMES, run["draws"].draws.shape[0]) == (0.1, 5, 4),
    ),
    "with the $\\tau$ of 38 steps of the slower angle. Of the 100 steps only half is left.": lambda run: (
        round(run["draws"].mixing.times.max()),
        100,
        run["short"].mixing.discarded == 50,
    ),
    "at least 50 $\\tau$ long (Sokal, *Monte Carlo Methods in Statistical Mechanics*, 1997), or, with "
    "several ensembles of walkers, 20 $\\tau$ if the estimate no longer grows": (
        lambda run: (TIMES, LEAST)
    ),
    "and refuses an interval if the verdict is bad. We ask a chain of 100 steps for an interval, and then "
    "the 3000 steps from above. (The first steps, which still depend on the start, do not count": lambda run: (
        100,
        3000,
        "100 steps: there is no interval: NOT CONVERGED" in run.printed,
        "3000 steps: 90 % of the draws lie from" in run.printed,
    ),
    "it spans the middle, where there is little": lambda run: (
        np.mean(np.abs(run["draws"].flat[:, 0]) < 0.2) < 0.05
    ),
    "The least cost is the highest point of the posterior.": lambda run: (
        abs(run["best"] - run.line("seen at")[1]) < 0.01
    ),
}

SAYS |= {
    "A synthetic person stands in front of one camera, or among four.": lambda run: (
        set(run["people"]) == {"one-camera", "four-cameras"}
    ),
    "Free are the first two shape coefficients, the place and the left elbow: eight numbers": (
        lambda run: run["problem"].free.size == 8
    ),
    "All others are held at the truth": lambda run: (
        np.sum(run["answer"]["pose"] != run["setup"].made_of["pose"]) == 3
        and np.sum(run["answer"]["betas"] != run["setup"].made_of["betas"]) == 2
    ),
    "the larger it is, the taller the person": lambda run: tall(run, 1.0) > tall(run, -1.0) + 0.02,
    "a tall person far away looks like a short one nearby, so the draws lie along a line": (
        lambda run: np.corrcoef(run["drawn"].flat[:, [0, 4]].T)[0, 1] < -0.95
    ),
    "One camera leaves the distance open by a standard deviation of 16 cm, and with it the height; four "
    "know it to 2 mm.": lambda run: (
        round(100 * run["drawn"].sd[4]),
        round(1e3 * run["people"]["four-cameras"][2].sd[4]),
    ),
    "so Laplace's numbers agree with the draws": lambda run: (
        run["drawn"].usable and np.allclose(run["drawn"].sd, run["straight"].sd, rtol=0.1)
    ),
}

GIVEN = (
    "is made of a number $q$ that is uniform from 0 to 1",
    "If $A$ is below 1, there are too many that want to go to $y$",
    "If it is above 1, we take all of the first",
)

GENERAL = (  # mathematics, definitions and advice
    "further away than the elbow",
    "minus half of the sum of squares",
    "The cost is half of its square",
    "At each step half of the walkers move",
    "a proposal is taken with the probability $\\min(1, A)$",
    "if the chain is much longer than its memory",
)
