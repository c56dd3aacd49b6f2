"""What lecture 15 says of its run."""

from itertools import pairwise

import numpy as np

from tests.lectures.numerals import above
from tests.lectures.prose import Run
from workbench.registration import FIT_STAGES

AT_ONCE = ("without strong", "weak at once, model free")


def off(run: Run, vertices: np.ndarray) -> tuple[float, float]:
    """How far seen and hidden vertices are off, mm."""
    seen, hidden = (
        float(run["mean_distance"](vertices[which], run["skin"][which]))
        for which in (run["seen"], run["hidden"])
    )
    return seen, hidden


def whole(run: Run, vertices: np.ndarray) -> float:
    """How far all vertices are off on average, mm."""
    return float(run["mean_distance"](vertices, run["skin"]))


def lengths(run: Run) -> list[float]:
    """The smallest shares of the lengths of edges after snapping."""
    faces, snapped = run["body"].faces, run["snapped"]
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    return np.linalg.norm(snapped[edges[:, 0]] - snapped[edges[:, 1]], axis=1)


def lost(run: Run) -> np.ndarray:
    """The rotation errors of the starts that did not end at the truth, degrees."""
    return np.concatenate([one.turned[~one.found] for one in run["maps"]])


def trunk_errors(run: Run, values: dict[str, np.ndarray]) -> tuple[float, float]:
    """How far the template's vertices are off across and along the skin, mm."""
    away = 1e3 * (values["template"] - run["trunk"])
    off = np.abs(np.sum(away * run["across"], axis=1))
    along = np.sqrt(np.maximum(np.sum(away**2, axis=1) - off**2, 0))
    return float(off.mean()), float(along.mean())


SAYS = {
    "because the bumps of the person are larger than that": lambda run: (
        np.median(np.linalg.norm(run["person"].template - run["body"].template, axis=1)) > 0.005
    ),
    "The person is wider than the first template, and forward and to the side of it": lambda run: (
        np.ptp(run["trunk"][:, 0]) > np.ptp(run["first"][:, 0]),
        (run["trunk"].mean(axis=0) > run["first"].mean(axis=0) + 0.005).all(),
    ),
    "A statue was scanned, 1000 points with a noise of 2 mm": lambda run: (
        len(run["points"]),
        1e3 * run["NOISE"],
        abs(1e3 * np.std(run["measured"] - run["places"]) - 2) < 0.1,
    ),
    "With the right pairs the only error left is the noise. For mirrored points the last line looks just "
    "as good. But its matrix has the determinant $-1$": lambda run: (
        abs(run.line("right pairs")[-1] - 2 * np.sqrt(8 / np.pi)) < 0.3,
        abs(run.line("mirrored, det free")[-1] - run.line("right pairs")[-1]) < 0.11,
        np.isclose(np.linalg.det(run["Q"]), -1),
    ),
    "insists on a rotation and therefore stays decimetres off": lambda run: (
        run.line("mirrored points")[-1] > 100,
        run.line("mirrored points")[0] == 1,
    ),
    "without labels, a closed form is of no use": lambda run: (
        run.line("order of arrival")[-1] > 200
    ),
    "neither half of a step can raise the sum of squared distances from the surface": lambda run: (
        bool((np.diff(run["to_surface"]) <= 1e-9).all())
    ),
    "It works although most of the first contacts are wrong.": lambda run: (
        np.mean(
            np.linalg.norm(run["tree"].closest(run["points"]).points - run["places"], axis=1) > 0.03
        )
        > 0.6
    ),
    "after 5 steps the points are still centimetres from their own places. (In the end they are 3 mm from "
    "them, which is the length of their own noise.)": lambda run: (
        run.lines("step  5")[0][0],
        run.line("step 60")[-1],
        run.line("step  5")[-1] > 20,
        abs(run.line("step 60")[-1] - run.line("right pairs")[-1]) < 0.2,
    ),
    "All three forms end at the same place, 0.3 mm off because of the noise. The two that let points slide "
    "are there after a few steps.": lambda run: (
        run["gone"]["point to point"][-1],
        max(gone[-1] for gone in run["gone"].values()) < 0.35,
        min(gone[-1] for gone in run["gone"].values()) > 0.25,
        max(run["rigid"][name].iterations for name in ("point to plane", "distance")) <= 12,
        run["rigid"]["point to point"].iterations > 25,
    ),
    "The motion is ten times as good as a single point: 1000 points average the noise away": lambda run: (
        run.line("right pairs")[-1] / run["gone"]["distance"][-1],
        len(run["points"]),
    ),
    "The rows of the distance are right. Those of the offset are off by more than half": lambda run: (
        run["wrong_by"]["distance"] < 1e-5,
        run["wrong_by"]["offset"] > 0.5,
    ),
    "both have the right slope of the *cost*": lambda run: all(
        abs(held / quotient - 1) < 1e-5 for held, quotient in run["slopes"].values()
    ),
    "Half of its sum of squares is the same cost.": lambda run: (
        abs(run["costs"]["offset"][0] / run["costs"]["distance"][0] - 1) < 1e-9
    ),
    "The start is off by 0.05 rad in each number of the pose.": lambda run: (
        run["STIRRED"],
        0.8 < np.std(run["begun"]["pose"] - run["truth"]["pose"]) / run["STIRRED"] < 1.2,
    ),
    "With the contacts held (squares: each is one round, solved to its end) and with the offset it creeps. "
    "Gauss-Newton on the distance needs a few iterations.": lambda run: (
        run["needed"]["distance"] <= 10,
        run["needed"]["offset"] > 3 * run["needed"]["distance"],
        run.line("rounds with the contacts held")[-1] > 1.3 * run["costs"]["distance"][-1],
    ),
    "We turn the right motion about each of three axes, in steps of 30 degrees": lambda run: float(
        np.diff(np.sort(run["maps"][0].angles[:, 0]))[0]
    ),
    "Most of those that fail end turned by more than 140 degrees.": lambda run: above(
        np.quantile(lost(run), 0.3)
    ),
    "Every start within 30 degrees ends at the truth": lambda run: min(
        one.reach for one in run["maps"]
    ),
    "We add 250 points, anywhere in a box around the statue, and register all 1250 twice": lambda run: (
        len(run["clutter"]),
        len(run["everything"]),
    ),
    "Least squares turn the statue, so that the clutter comes a little nearer to the surface; the loss that "
    "levels off gives it up.": lambda run: (
        run["stray"]["least squares"] > 50,
        run["stray"]["Geman-McClure"] < 1,
        np.abs(
            run["tree"]
            .closest(run["cluttered"]["least squares"].motion(run["everything"])[1000:])
            .distances
        ).mean()
        < np.abs(
            run["tree"]
            .closest(run["cluttered"]["Geman-McClure"].motion(run["everything"])[1000:])
            .distances
        ).mean(),
    ),
    "there is one length, the scale $c$, here 3 cm": lambda run: (
        100 * run["losses"]["Geman-McClure"].scale
    ),
    "with 2 mm of noise": lambda run: 1e3 * run["NOISE"],
    "with clutter, which is a fifth of the points": lambda run: (
        abs(run["simulated"].clutter.mean() - 0.2) < 0.01
    ),
    "smooth bumps of 1 cm, root mean square": lambda run: (
        100
        * float(
            np.sqrt(np.mean(np.sum((run["person"].template - run["body"].template) ** 2, axis=1)))
        )
    ),
    "proposes eight ways to face, 45 degrees apart": lambda run: (
        float(360 / len(run["facings"])),
        len(run["facings"]) == 8,
    ),
    "300 points, and a loss that levels off late, at 10 cm": lambda run: (
        run["coarse"][0].points,
        100 * run["coarse"][0].reach,
    ),
    "The fits with low costs are those near the truth.": lambda run: (
        run["apart"][np.argsort(run["prices"])[:3]].max() < 100,
        run["apart"][np.argsort(run["prices"])[-3:]].min() > 200,
    ),
    "Eight coarse fits of one scan. Their costs, which need no truth (left), tell those that found the body "
    "from those that face the wrong way (right).": lambda run: (
        run["prices"][run["apart"] < 100].max() < 0.9 * run["prices"][run["apart"] > 200].min(),
        len(run["prices"]) == 8,
    ),
    "and then only the best of them, with more points and a shorter scale": lambda run: all(
        one.points < other.points and one.reach > other.reach and one.starts > other.starts
        for one, other in pairwise(FIT_STAGES)
    ),
    "A large one believes the priors in place of the data, a small one takes good points for outliers.": lambda run: (
        run["as_one"][0] > 1.5 * run["as_two"],
        run["as_one"][-1] > 1.2 * run["as_two"],
        run["as_one"].min() < 0.8 * min(run["as_one"][0], run["as_one"][-1]),
    ),
    "sigma is 5 mm, and outliers begin at six sigmas": lambda run: (
        run.line("and a scale of")[0],
        run.line("and a scale of")[1] == 6 * run.line("and a scale of")[0],
    ),
    "The best fit of the model is off by about a centimetre, although the noise is 2 mm": lambda run: (
        1e3 * run["NOISE"],
        6 < whole(run, run["fit"].vertices()) < 15,
    ),
    "The answer is worse, and worst where nothing was seen": lambda run: (
        off(run, run["snapped"])[0] > 1.2 * off(run, run["fit"].vertices())[0],
        off(run, run["snapped"])[1] > 1.5 * off(run, run["fit"].vertices())[1],
        off(run, run["snapped"])[1] > 1.3 * off(run, run["snapped"])[0],
    ),
    "Several vertices have taken the same point, so that triangles between them have collapsed.": lambda run: (
        run.line("different points")[1] < 0.95 * run.line("different points")[0],
        lengths(run).min() == 0,
    ),
    "some of the numbers are read by no row of the Jacobian": lambda run: run["unread"] > 10,
    "| $R x + t$ | 6 |": lambda run: 6,
    "| $M(\\theta, \\beta) + t$ | 85 |": lambda run: sum(
        block.size for block in run["body"].blocks()
    ),
    "| all vertices $V$ | 1107 |": lambda run: run["skin"].size,
    "a strong coupling with a $\\sigma_C$ of 2 mm, a weak one with 10 mm": lambda run: tuple(
        1e3 * one.coupling for one in run["coupled"]
    ),
    "In the last two, vertices and model are free together": lambda run: all(
        len(one.free) == 4 for one in run["coupled"]
    ),
    "Every stage comes nearer to the truth, in what was seen and in what was not.": lambda run: (
        bool(
            (
                np.diff([off(run, vertices) for vertices in run["by_stage"].values()], axis=0) < 0
            ).all()
        )
    ),
    "seen vertices are off by less than two thirds of what they were off with the model alone": lambda run: (
        off(run, run["registered"].vertices)[0] < 2 / 3 * off(run, run["fitted"].vertices)[0]
    ),
    "the scale ends at 40 mm": lambda run: 40,
    "the vertices cannot leave a place that is centimetres off": lambda run: (
        whole(run, run["at_once"]["weak at once, model held"].vertices)
        > 2 * whole(run, run["registered"].vertices),
        whole(run, run["by_stage"]["start"]) > 20,
    ),
    "points beyond 5 cm have no contact": lambda run: 100 * run["model_held"][1].term.within,
    "With the model free, or without the strong stage alone, hardly anything is lost.": lambda run: (
        max(whole(run, run["at_once"][name].vertices) for name in AT_ONCE)
        < 1.1 * whole(run, run["registered"].vertices)
        < 0.5 * whole(run, run["at_once"]["weak at once, model held"].vertices)
    ),
    "By the scan's distance, vertices with 10 mm are the best, nearer to the scan than edges. Their error is "
    "more than a tenth larger.": lambda run: (
        1e3 * run["sigma"],
        run["table"]["vertices, 10 mm"][0] < run["table"]["edges, 10 mm"][0] - 0.03,
        run["table"]["vertices, 10 mm"][0] == min(a for a, _ in run["table"].values()),
        run["table"]["vertices, 10 mm"][1] > 1.1 * run["table"]["edges, 10 mm"][1],
    ),
    "The truth itself is 1.26 mm from its noisy scan": lambda run: run["table"]["the truth"][0],
    "Coupled vertices with 10 mm come nearest to the scan, and are farther from the truth than coupled "
    "edges.": lambda run: (
        run.lines("vertices, 10 mm")[0][0],
        run["table"]["vertices, 10 mm"][1] > run["table"]["edges, 10 mm"][1],
    ),
    "the outline of a trunk, seen from above, 40 vertices in a plane": lambda run: run["N"],
    "Each of five scans sees nearly half of the outline": lambda run: (
        run["SCANS"] == 5,
        0.4 < run["facing_it"].mean() < 0.5,
        run["facing_it"].any(axis=0).all(),
    ),
    "The data leave 40 directions open, one for each vertex": lambda run: (
        run.line("without E_T")[0] - run.line("without E_T")[1]
    ),
    "Apart, a hidden vertex stays on the first template, a centimetre off.": lambda run: (
        bool(
            np.allclose(
                run["by_itself"]["scan 2"][~run["facing_it"][2]], run["first"][~run["facing_it"][2]]
            )
        ),
        10 < run["off_by"](run["by_itself"])[1] < 15,
    ),
    "Then it hardly moves any more, whatever holds the template, and what is left is nearly all along the "
    "skin": lambda run: all(
        trunk_errors(run, values[-1])[0] < 0.2 * trunk_errors(run, values[-1])[1]
        and 0.9 < run["off_by"](values[-1])[1] / run["off_by"](values[-5])[1] < 1
        for values in run["turns"].values()
    ),
    "With vertices held, this is the minimum: nothing speaks for sliding. With edges held, the minimum is several "
    "times nearer to the truth.": lambda run: (
        run["off_by"](run["at_last"]["vertices held"])[1]
        > 0.99 * run["off_by"](run["turns"]["vertices held"][-1])[1],
        run["off_by"](run["at_last"]["edges held"])[1]
        < run["off_by"](run["turns"]["edges held"][-1])[1] / 4,
    ),
    "But twelve rounds have not got there.": lambda run: run["ROUNDS"],
    "In turn (orange, after 12 rounds) the outline is right": lambda run: (
        run["ROUNDS"],
        trunk_errors(run, run["turns"]["edges held"][-1])[0] < 1.5,
    ),
    "the standard deviation of what the scan does not support is more than five times as large, and so is its "
    "error": lambda run: (
        run.line("the others")[1] > 5 * run.line("supported ")[1],
        run.line("the others")[2] > 5 * run.line("supported ")[2],
    ),
    "`doubts` turns this into a sentence without the truth": lambda run: (
        "of the vertices were not seen and rest on the priors" in run.printed
    ),
    "where the scan *does* support the body, the error is larger than its standard deviation": lambda run: (
        run.line("supported ")[2] > run.line("supported ")[1]
    ),
    "Legs and feet rest on the prior alone.": lambda run: (
        not run["known"]
        .seen[
            run["body"]
            .weights[:, [run["body"].joint_names.index(f"{s}_ankle") for s in ("left", "right")]]
            .sum(axis=1)
            > 0.5
        ]
        .any()
    ),
    "within 20 mm on average, and empty ones elsewhere. All starts ended at the truth for angles up to 30 "
    "degrees about y; for angles up to 60 degrees about x; for angles up to 60 degrees about z.": lambda run: (
        1e3 * run["maps"][0].near,
        *(one.reach for one in run["maps"]),
    ),
}

GIVEN = (
    "so that $u^\\top du = 0$. The third term",
    "number 200 is the same place on everybody",
    "registration of 3-D shapes",
    "that ought to slide 1 cm along the back",
)

GENERAL = (
    "A point with $d$ much smaller than $c$ costs",  # mathematics, definitions and advice
    "What helps is to begin more than once",
    "along the surface as far as it likes",
    "Begin more than once",
)
