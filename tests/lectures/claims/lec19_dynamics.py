"""What lecture 19 says of its run, and what it quotes from the benchmark of soft tissue."""

import json
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from tests.lectures.prose import Run
from workbench.motions import load_tissue
from workbench.synthetic.tissue import TissueLaw

RESULTS = Path(__file__).parents[3] / "benchmarks" / "results" / "soft-tissue.json"


@cache
def report() -> dict[str, Any]:
    """What was measured on clips that were held out."""
    found: dict[str, Any] = json.loads(RESULTS.read_text())
    return found


def left_over(run: Run) -> list[float]:
    """What is left of a push after 10 s, for ascending spectral radii."""
    return [float(size[-1] / size[0]) for _, size in sorted(run["sizes"].items())]


def indices(run: Run) -> list[float]:
    """The body mass indices of the hops, ascending."""
    return sorted(run["moves"])


def curves(run: Run) -> tuple[np.ndarray, np.ndarray]:
    """The displacement upwards of the drawn vertex, simulated and by the second model, m."""
    clip, tissue = run["unseen"], run["tissues"]["with forces on parts"]
    driven = tissue.coefficients(run["body"], clip.motion)
    found = tissue.displacements(run["body"], driven, clip.motion.betas)
    return clip.displacements[:, run["softest"], 1], found[:, run["softest"], 1]


def explained_of_the_curve(run: Run) -> float:
    """The share of the variance of the drawn curve that the second model explains."""
    true, found = curves(run)
    return float(1 - np.sum((true - found) ** 2) / np.sum((true - true.mean()) ** 2))


SAYS = {
    "It explains 73 % of a clip that it was learned from.": lambda run: (
        100 * run["by_pose"]["a clip it was learned from"]
    ),
    "In the unseen clip it is worse than a tissue that stays in its mean place": lambda run: (
        run["by_pose"]["an unseen clip"] < -0.3
    ),
    "A function of the pose does not follow it.": lambda run: (
        np.corrcoef(
            run["guess"][:, run["softest"], 1], run["unseen"].displacements[:, run["softest"], 1]
        )[0, 1]
        < 0.6
    ),
    "Our springs have 15 % of the damping at which nothing swings any more. Those of a layer of 6 cm have 5 Hz; "
    "thicker layers are softer.": lambda run: (
        100 * run["DAMPING"],
        1e2 * TissueLaw().thickness,
        run["HZ"],
        (run["DAMPING"], run["HZ"]) == (TissueLaw().damping, TissueLaw().frequency),
    ),
    "Such a mass swings 4.94 times a second, and its swing halves in 147 ms.": lambda run: (
        run["swings"],
        1e3 * run["halves"],
    ),
    "Half a second after a push, less than a tenth is left.": lambda run: (
        abs(run["pole"]) ** 30 < 0.1
    ),
    "they are off by 7.3 % and 5.5 %": lambda run: (
        100 * run["ahead"]["Dyna's inputs"],
        100 * run["ahead"]["with forces on parts"],
    ),
    "the guess that nothing changes is off by no more than 15 %, since at 60 frames a second": (
        lambda run: (100 * run["ahead"]["as in the frame before"], run["FPS"])
    ),
    "with Dyna's inputs it is worse than a tissue that keeps its place": lambda run: (
        run["free"]["Dyna's inputs"] < -0.5
    ),
    "with the further inputs of the next section it explains 77 %": lambda run: (
        100 * run["free"]["with forces on parts"]
    ),
    "With Dyna's inputs it goes astray; with what each soft part feels as further inputs it "
    "follows in the main, and is off by up to 4.9 mm.": lambda run: (
        run["free"]["Dyna's inputs"] < 0 < 0.3 < explained_of_the_curve(run),
        1e3 * np.abs(np.subtract(*curves(run))).max(),
    ),
    "(That is of all vertices. Of the curve in the figure it explains 34 %.)": lambda run: (
        100 * explained_of_the_curve(run)
    ),
    "In the first frames, where the three curves lie nearly on each other, it grows in all of them: a push also gives "
    "the coefficients a velocity, and they swing on before they turn back. On the circle the peaks grow for some seconds "
    "more, because the coefficients of different shapes push each other. In the long run it dies away where the largest "
    "pole is inside of the circle, stays where it is on it, and grows where it is outside.": lambda run: (
        all(sizes[:4].max() > 1.5 * sizes[0] for sizes in run["sizes"].values())
        and run["sizes"][1.0].argmax() > 2 * run["FPS"]
        and run["sizes"][1.0].max() > 2 * run["sizes"][1.0][:30].max()
        and np.ptp([np.log(sizes[:4]) for sizes in run["sizes"].values()], axis=0).max() < 0.3,
        left_over(run)[0] < 1e-6,
        0.5 < left_over(run)[1] < 50,
        left_over(run)[2] > 1e4,
    ),
    "the poles of the model that was learned, inside of the circle of size 1": lambda run: (
        1,
        bool((np.abs(run["tissue"].poles) < 1).all()),
    ),
    "with 32 dynamic blend shapes": lambda run: load_tissue().n_coefficients,
    "a free run explains 87.9 % of the variance, with a 95 % interval from 81.1 % to 90.8 %.": (
        lambda run: (
            100 * report()["as embedded"]["together"]["explained"],
            95,
            100 * report()["as embedded"]["together"]["interval_95"][0],
            100 * report()["as embedded"]["together"]["interval_95"][1],
        )
    ),
    "With Dyna's inputs alone it explains 33.5 %.": lambda run: (
        100 * report()["no forces on parts"]["together"]["explained"]
    ),
    "Coefficients of zero give SMPL, to the last bit.": lambda run: run["untouched"],
    "With a body mass index of 20 the skin moves by up to 25 mm in this hop, and with 29 by up to "
    "30 mm.": lambda run: (
        indices(run)[0],
        run["moves"][indices(run)[0]],
        indices(run)[-1],
        run["moves"][indices(run)[-1]],
    ),
    "An exaggeration of 3 makes 90 mm of these.": lambda run: (
        3,
        3 * run["moves"][indices(run)[-1]],
    ),
    "Both limbs are explained to rounding.": lambda run: all(
        one.rms < 1e-9 for one in run["rigged"].values()
    ),
    "The shoulder is found to rounding too, since its equations have rank 3.": lambda run: (
        run["rank"]["shoulder"],
        run.line("shoulder: meshes")[-1] == 0,
    ),
    "Those of the hinge have rank 2: its joint is 14 mm away": lambda run: (
        run["rank"]["hinge"],
        run["off"],
    ),
    "along the axis z, and no mesh contradicts": lambda run: (
        abs(run["rigged"]["hinge"].joints[0].free[0, 2]) > 0.999
    ),
    "root mean square over 20 meshes": lambda run: len(run["meshes"]),
}
GIVEN = (
    "when nothing drives the model any more, so that $x_t = 0$?",
    r"it holds if $\lambda^2 + 2 \zeta \omega \lambda + \omega^2 = 0$",
    "so that inputs stay between -1 and 1 in every motion",
    "to $v / \\sqrt{m^2 + |v|^2}$, with",
    "an input that is half as large needs twice the factor for the same effect, and its `size` is a quarter",
    "`HARDLY` is a hundredth, and",
    "where the mean square of an input is much smaller than `HARDLY**2`",
    "w\\, z + r^2 = 0$, which gives",
    "(Pons-Moll et al., 2015; Loper et al., 2015)",
    "1 is perfect, 0 is as good as a tissue that keeps its mean place, and below 0 is worse.",
    "because of lecture 4's blending",
)
