"""What lecture 1 says of its run."""

from math import comb, pi

import numpy as np

from tests.lectures.prose import Run


def mean_error(run: Run, name: str) -> float:
    """Of a prediction for the unseen poses, mm."""
    off = np.linalg.norm(run["predictions"][name] - run["test_surfaces"], axis=2)
    return float(1e3 * off.mean())


def polynomials(run: Run) -> list[float]:
    return [mean_error(run, name) for name in ("linear in theta", "cubes of theta")]


def with_one_coefficient_twice(run: Run) -> tuple[float, float]:
    """What is missed with four coefficients, and with one of them used twice, mm."""
    return run.line("w3, w2, w1, w0")[-1], run.line("w1, w2, w1, w0")[-1]


SAYS = {
    "Ten examples are given: ten angles, with the distance that belongs to each.": lambda run: (
        len(run["given"]),
        len(run["given"]),
        3 in run["fits"],
    ),
    "The cubic follows the examples, but leaves the true curve where they end.": lambda run: (
        run.line("degree 3")[1] < 5,
        run.line("degree 3")[2] > 1000,
    ),
    "The body comes back after a full turn (2 pi = 6.28); a polynomial never does.": lambda run: (
        2,
        2 * pi,
        np.allclose(run["tip"](run["given"] + 2 * pi), run["tip"](run["given"])),
        all(line[2] > 1000 for line in run.lines("one turn further")),
    ),
    "the largest error of the best fit is six times as large": lambda run: (
        5.5 < with_one_coefficient_twice(run)[1] / with_one_coefficient_twice(run)[0] < 6.8
    ),
    "Now we take the whole body: 72 numbers in, 369 vertices out.": lambda run: (
        run["poses"][0].size,
        run["body"].n_vertices,
    ),
    "a linear function of the 72 numbers": lambda run: run["poses"][0].size,
    "The polynomial has 217 parameters for every coordinate, and four hundred examples": lambda run: (
        run["powers"](run["poses"][:1], 3).shape[1],
        len(run["poses"]),
    ),
    "are learned from the same four hundred examples. All of them are tried on sixty other poses: Four "
    "hundred examples do not teach": lambda run: (
        len(run["poses"]),
        len(run["test_poses"]),
        len(run["poses"]),
        min(polynomials(run)) > 20 * mean_error(run, "bones and skin"),
    ),
    "both polynomials are off by centimetres on average, and SMPL by less than a millimetre": (
        lambda run: (min(polynomials(run)) > 20, mean_error(run, "SMPL") < 1)
    ),
    "A full cubic in 72 numbers has $\\binom{75}{3}$ = 67,525 coefficients": lambda run: (
        run["poses"][0].size,
        comb(72 + 3, 3),
    ),
    "this mean makes it shorter": lambda run: all(
        line[1] == line[-1] < 1 for line in run.lines("rad apart")
    ),
    "pose $\\theta$ (24 rotation vectors)": lambda run: run["body"].n_joints,
    "has 6,890 vertices, 23 joints and a root, and 10 shape directions": lambda run: (
        run["N"],
        run["K"] - 1,
        run["B"],
    ),
    "SMPL is not linear in the pose. It is linear in each of the other arguments alone, but not in two arguments together that are multiplied with each other": lambda run: (
        {line[:24].strip() for line in run.printed.splitlines() if line.endswith("not linear")}
        == {"weights and posedirs", "shapedirs and betas", "pose"}
    ),
    "the template and the pose directions are the solution of *one* linear least-squares problem": lambda run: (
        run["linear_in"](run["body"], ("template", "posedirs"), (10, 200))
    ),
    "Taken one at a time, all arguments of SMPL but the pose enter linearly.": lambda run: all(
        run["linear_in"](run["body"], (name,), (10, 200)) == (name != "pose")
        for name in ("template", "shapedirs", "posedirs", "weights", "betas", "trans", "pose")
    ),
}

GIVEN = (
    "(The table in *Body Models II* adds up to 6,014,970.",
    "the four weights of a vertex as twelve",
)
