"""What lecture 14 says of its run."""

import numpy as np

from tests.lectures.prose import Run
from workbench.geometry.solids import volume


def model(run: Run, name: str) -> list[float]:
    """The largest step between neighbours, what stitching leaves (mm), and the least det."""
    return run.line(f"{name:11} largest step between neighbours")


def first_k(shares: np.ndarray, share: float) -> int:
    """How many directions explain this share."""
    return int(np.argmax(shares >= share))


def mean_error(run: Run, name: str) -> float:
    """Of the fit of a model, in m, over all vertices."""
    return float(run["off"][name].mean())


def iterations(run: Run, name: str) -> float:
    """Of the fit of a model."""
    return run.line(f"{name:11} CONVERGED")[0]


def error(run: Run, case: str, compared: str) -> float:
    """The median error of poses, in degrees, of a fit to edges or to vertices."""
    return float(np.median(run["degrees"][case, compared]))


def creased(run: Run, name: str) -> int:
    """How many triangles differ from a neighbour by more than a hundredth."""
    return int((run["bent_elbows"][name][1] > 0.01).sum())


def girth(run: Run, name: str) -> float:
    """The volume of the whole stitched body, m^3: bodies differ at the elbow alone."""
    return float(volume(run["bent_elbows"][name][0], run["faces"]))


OTHER, NOISY = "another person, exact", "the same person, 5 mm of noise"

SAYS = {
    "never explain less than any other directions": lambda run: bool(
        (run["by_vertices"].share >= run["by_triangles"].share - 1e-12).all()
    ),
    "We ask 12 made-up people whose poses are known.": lambda run: len(run["from_truth"]),
    "A fit to vertices also finds the translation, which edges do not have": lambda run: (
        list(run["by"]["edges"].free.names) == ["pose"],
        list(run["by"]["vertices"].free.names) == ["pose", "trans"],
        run["ends"] == {"CONVERGED"},
    ),
    "Each line is one of 12 made-up people, and a diamond is the median.": lambda run: len(
        run["degrees"][OTHER, "edges"]
    ),
    "With another person's template edges are better for everybody; with the right template and noise, "
    "vertices are.": lambda run: (
        bool((run["degrees"][OTHER, "edges"] < run["degrees"][OTHER, "vertices"]).all()),
        bool((run["degrees"][NOISY, "vertices"] < run["degrees"][NOISY, "edges"]).all()),
        run.line(OTHER, "by edges")[-2] < run.line(OTHER, "by vertices")[-3],
    ),
    "With another person's template the median error is 1.8 degrees by edges and 12 degrees by vertices": (
        lambda run: (error(run, OTHER, "edges"), error(run, OTHER, "vertices"))
    ),
    "the intervals above, which hold the median with a confidence of 96 %, lie far apart": lambda run: (
        run.line(OTHER, "by edges")[-1],
        run.line(OTHER, "by edges")[-2] < 0.5 * run.line(OTHER, "by vertices")[-3],
    ),
    "fits to vertices that begin at the true pose leave it and end at 12 degrees too": lambda run: (
        float(np.median(run["from_truth"]))
    ),
    "With the right template and noise, vertices give 3.2 degrees and edges 3.9.": lambda run: (
        error(run, NOISY, "vertices"),
        error(run, NOISY, "edges"),
    ),
    "| error of the pose, another person's template | 12 degrees | 1.8 degrees |": lambda run: (
        error(run, OTHER, "vertices"),
        error(run, OTHER, "edges"),
    ),
    "| error of the pose, the right template and 5 mm of noise | 3.2 degrees | 3.9 degrees |": lambda run: (
        round(1e3 * run["cases"][NOISY][1]),
        error(run, NOISY, "vertices"),
        error(run, NOISY, "edges"),
    ),
    "a mesh has far fewer: most deformations are those of no mesh at all": lambda run: (
        3 * len(run["template"]) < 9 * len(run["faces"]) / 2
    ),
    "Eight of SCAPE's directions explain 90 % of the variance of the vertices, but 90 % of the variance of "
    "the deformations takes 14.": lambda run: (
        first_k(run["by_triangles"].share, 0.9) == 8,
        90,
        90,
        first_k(run["by_gradients"], 0.9),
    ),
    "the same 123 vertices of one person, whom SMPL has made and who is seen with 5 mm of noise": (
        lambda run: (
            len(run["seen"]),
            round(1e3 * float(np.std(run["noisy"] - run["whole"][run["seen"]]))),
        )
    ),
    "On average it comes nearer than SCAPE, whose parts are rigid.": lambda run: (
        mean_error(run, "SMPL") < mean_error(run, "BlendSCAPE") < mean_error(run, "SCAPE")
    ),
    "both need more iterations": lambda run: (
        min(iterations(run, "SCAPE"), iterations(run, "BlendSCAPE")) > 2 * iterations(run, "SMPL")
    ),
    "Each of the 734 triangles belongs": lambda run: len(run["faces"]),
    "Every triangle is perfect and the surface is gone": lambda run: (
        run.line("rotations alone")[-1] < 1e-13,
        run.line("corners that were one vertex")[0] > 100,
    ),
    "They give six equations for nine unknowns": lambda run: (
        run["two_moved"].size == 6 and run["true"].size == 9
    ),
    "the one with the smallest norm flattens space": lambda run: (
        np.linalg.matrix_rank(run["by_edges"]) == 2,
        abs(np.linalg.det(run["by_edges"])) < 1e-9 < 0.9 < np.linalg.det(run["true"]),
    ),
    "Two edges do not determine a triangle's deformation; a third axis is needed.": lambda run: (
        np.abs(run["found"] - run["turn"]).max() < 1e-9
    ),
    "So $A$ leaves open where the mesh is as a whole: one direction for each coordinate": lambda run: (
        run.line("smallest singular values")[-1] == run["body"].n_vertices - 1
    ),
    "the arm has turned and has not moved": lambda run: np.allclose(
        run["torn"].mean(axis=1), run["template"][run["faces"]].mean(axis=1)
    ),
    "The forearm has moved to where it belongs, although nobody said where the elbow is": lambda run: (
        np.linalg.norm(run["stitched"] - run["template"], axis=1).max() > 0.1
    ),
    "on one side of the elbow all triangles turn by 1.6 rad, on the other none": lambda run: float(
        np.linalg.norm(run["pose"])
    ),
    "Left: with one rotation for each part, all of the bend is between two rows of triangles. Right: with "
    "blended rotations it is shared by more rows, and the arm has less volume.": lambda run: (
        creased(run, "SCAPE") < creased(run, "BlendSCAPE"),
        np.median(run["bent_elbows"]["SCAPE"][1]) < 1e-9,
        girth(run, "BlendSCAPE") < girth(run, "SCAPE"),
    ),
    "The crease is smaller, and something else has gone wrong": lambda run: (
        model(run, "BlendSCAPE")[0] < 0.5 * model(run, "SCAPE")[0],
        model(run, "BlendSCAPE")[2] < 0.9 < model(run, "SCAPE")[2],
    ),
    "The triangles that follow upper arm and forearm alike follow the law; at half a turn they would "
    "vanish.": lambda run: (
        np.allclose(run["mean_det"], np.cos(run["angles"] / 2) ** 2),
        np.allclose(run["least"], np.cos(run["angles"][::6] / 2) ** 2, atol=0.05),
        run["mean_det"][-1] < 1e-9,
    ),
    "So in SMPL the effect of shape and pose together is the sum of their single effects. In SCAPE it is not": lambda run: (
        run.line("SMPL        effect of both")[0] < 1e-9,
        run.line("BlendSCAPE  effect of both")[0] > 1,
    ),
    "We take 80 people drawn from our shape space": lambda run: len(run["people"]),
    "of 80 made-up people": lambda run: len(run["people"]),
    "an offset cancels in it": lambda run: (
        run.line("edges with the offset and without it")[0] < 1e-9,
        run.line("the offset in the matrix of the hand")[0] > 100,
    ),
    "| a matrix of the pose | $4 \\times 4$: it turns and shifts | $3 \\times 3$: it turns and stretches |": (
        lambda run: run["G"].shape == (24, 3, 4) and run["X"].shape == (len(run["faces"]), 3, 3)
    ),
    "Directions of vertices never explain less": lambda run: bool(
        (run["by_vertices"].share >= run["by_triangles"].share - 1e-12).all()
    ),
}

GIVEN = ("and along the axis it is 1",)

GENERAL = (  # mathematics, definitions and advice
    "The length of $n$ is twice the triangle's area, so the axis is as long as the root of that",
)
