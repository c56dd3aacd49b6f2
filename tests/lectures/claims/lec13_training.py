"""What lecture 13 says of its run."""

import numpy as np

from tests.lectures.prose import Run
from workbench.synthetic.made_up import draw_registrations


def turns(run: Run) -> tuple[float, float]:
    """By how much the people turned their joints, least and most, rad."""
    _, known = draw_registrations(run["true"], 200, 1, seed=3, turn=0.3)
    angles = np.linalg.norm(known.poses, axis=-1)
    return float(angles.min()), float(angles.max())


def by_pose(run: Run, words: str) -> list[int]:
    """What pose explains of the first three coordinates, %."""
    return [int(one) for one in run.line(words)[-3:]]


def costs(run: Run) -> np.ndarray:
    """Of training, before the first block and after each."""
    log = run["model"].log
    return np.array([sum(log[0].before.values()), *(sum(one.after.values()) for one in log)])


def drop(run: Run, block: int) -> float:
    return float(costs(run)[block] - costs(run)[block + 1])


def together(run: Run) -> int:
    return [one.block for one in run["model"].log].index("together")


def middle(run: Run, names: str) -> float:
    """How far points are from the middle, mm."""
    return run.line(f"{names:28} off by")[0]


def regression(run: Run, name: str) -> list[float]:
    """Known people and new ones, mm; one metre; the lag, mm; least entry; entries of 66."""
    return run.line(f"{name:13} known people")


def turn_about_the_tube(run: Run) -> float:
    """How well some null direction turns the template about its axis: what is missed, a share."""
    here, problem = run["here"], run["problem"]
    null = here.svd[2][here.rank :]
    template = problem.free.slices["template"]
    turn = np.cross([1.0, 0.0, 0.0], run["values"]["template"]).ravel()
    near = null[:, template].T
    missed = near @ np.linalg.lstsq(near, turn, rcond=None)[0] - turn
    return float(np.linalg.norm(missed) / np.linalg.norm(turn))


def still_open(run: Run, name: str) -> list[str]:
    """What the open directions of one of the lecture's diagnoses are called."""
    return [direction.name for direction in run[name].null_directions]


def counted(run: Run, name: str, words: str) -> int:
    return sum(words in one for one in still_open(run, name))


SAYS = {
    "with 66 vertices and 6 joints, so that training takes seconds": lambda run: (
        run["true"].n_vertices,
        run["true"].n_joints,
    ),
    "jointed tubes with six joints each": lambda run: run["true"].n_joints == 6,
    "In truth there are three such directions.": lambda run: run["true"].n_betas == 3,
    "and did, but for 0.06 to 0.3 rad in each joint": turns,
    "The first two directions are not shape: they are how people happened to bend.": lambda run: (
        min(by_pose(run, "a linear function of pose explains")[:2]) > 90,
        max(by_pose(run, "pose in the first coordinates")) < 10,
    ),
    "200 tubes with three directions of shape. Un-posed, three directions explain all; as they stand, the "
    "first two are pose, and many more are needed.": lambda run: (
        len(run["people"]),
        run.line("un-posed, variance explained by 3")[1] > 0.999999,
        run.line("variance explained by 3 directions: 0")[-1] > 15,
    ),
    "so that $\\beta$ has variance one": lambda run: np.allclose(
        run["space"].betas(run["people"]).var(axis=0, ddof=1), 1
    ),
    "Only the pose is really nonlinear; $\\mathcal W$ and $P$ are multiplied by each other, and the model "
    "is linear in each alone.": lambda run: (
        middle(run, "templates, joints, posedirs") < 1e-9,
        middle(run, "weights") < 1e-9,
        middle(run, "weights, posedirs") > 1,
        middle(run, "poses") > 1,
    ),
    "With one of the two alone, a perfectly symmetric body is called uneven": lambda run: (
        run.line("both  ", "|T - U(T)|")[0] == 0,
        run.line("x changes its sign", "|T - U(T)|")[0] > 1,
        run.line("left and right exchanged", "|T - U(T)|")[0] > 1,
    ),
    "The first block does most; then taking turns creeps, and the block `together`, a few Gauss-Newton "
    "steps in all unknowns, goes on. The sum never rises, though single terms may.": lambda run: (
        drop(run, 0) == -np.diff(costs(run)).min(),
        drop(run, together(run) - 1) < 2 < 20 < drop(run, together(run)),
        bool((np.diff(costs(run)) <= 1e-9 * costs(run)[0]).all()),
        run["model"].log[together(run)].after["E_D"]
        > run["model"].log[together(run) - 1].after["E_D"],
    ),
    "Each minimises the same cost over other unknowns, so none lets it rise.": lambda run: bool(
        (np.diff(costs(run)) <= 1e-9 * costs(run)[0]).all()
    ),
    "The fit is *better* than the noise.": lambda run: (
        run.line("registrations are met to")[0] < 0.5 * run.line("registrations are met to")[1]
    ),
    "Each coordinate of each vertex has 16 meshes to explain, and 45 pose blend shapes and two people's "
    "templates to do it with": lambda run: (
        len(run["few"].subject),
        run["true"].posedirs.shape[2],
        len(run["model"].estimate.templates) == 2,
    ),
    "for each of 40 meshes": lambda run: len(run["F"]),
    "40 poses teach 45 shapes. The training error only rises with lambda; the error in "
    "unseen poses has a minimum.": lambda run: (
        *run["F"].shape,
        bool((np.diff(run["learned"]) > 0).all()),
        0 < run["best"] < len(run["lambdas"]) - 1,
        "|P| falls all the way: True" in run.printed,
        run["unseen"][run["best"]] < 0.6 * min(run["unseen"][0], run["unseen"][-1]),
    ),
    "By the training error alone, $\\lambda$ should be zero.": lambda run: (
        np.argmin(run["learned"]) == 0
    ),
    "On people who stand where the others stood, the two are nearly alike.": lambda run: (
        abs(regression(run, "least squares")[1] / regression(run, "shares")[1] - 1) < 0.1
    ),
    "and leaves the joints behind. Shares go along, keep joints inside the hull of the skin, and most of "
    "their entries become zero": lambda run: (
        regression(run, "least squares")[3] > 500,
        regression(run, "shares")[3] < 0.05,
        regression(run, "shares")[4] == 0,
        regression(run, "shares")[5] < 66 / 2,
    ),
    "The meshes are met, and yet the template is not determined: if it moves, and everybody"
    " moves back, nothing changes. In the fifth direction the template turns about the "
    "tube's own axis": lambda run: (
        run["solution"].cost < 1e-12,
        len(run["here"].gradient) - run["here"].rank == 5,
        len(run["known"]) == 4,
        all(line[-1] < 1e-9 for line in run.lines("everybody back:")),
        turn_about_the_tube(run) < 1e-6,
    ),
    "For a body of 20 vertices, with a root and one joint": lambda run: (
        run["mold"].n_vertices,
        run["mold"].n_joints == 2,
    ),
    "Two synthetic people are registered in ten poses each, without noise, and we look at the Jacobian at "
    "the true values, where the registrations are met exactly.": lambda run: (
        len(run["twenty"].subject) // 2,
        len(run["bodies"]) == 2,
        abs(run["form"].problem(["E_D"]).linearize(run["at_truth"]).residual).max() < 1e-9,
    ),
    "Each registration reads its own pose and place, and its own person's template and joints; only the "
    "blend shapes and the weights, on the left, are read by all registrations. E_P and E_W are "
    "diagonal.": lambda run: (
        [
            set(one.reads)
            == {"posedirs", "weights"}
            | {f"subject {j // 10}/{name}" for name in ("template", "joints")}
            | {f"scan {j}/{name}" for name in ("pose", "trans")}
            for j, one in enumerate(run["form"].residuals("E_D"))
        ]
        == 20 * [True],
        run["whole"].free.names[:2] == ("posedirs", "weights"),
        all(
            np.count_nonzero(J - np.diag(np.diag(J))) == 0
            for term in ("E_P", "E_W")
            for J in [run["form"].problem([term]).linearize(run["at_truth"]).dense]
        ),
    ),
    "Most of it is zero: 3.2 % of the entries": lambda run: 100 * run["whole"].density,
    "Registrations alone leave 19 directions open": lambda run: (
        len(still_open(run, "data_alone")),
        run["data_alone"].shape[1] - run["data_alone"].rank == 19,
        all(
            one.kind in ("translation", "rotation", "mixed")
            for one in run["data_alone"].null_directions
        ),
    ),
    "- 6 **translations**, three for each person": lambda run: counted(
        run, "data_alone", "template and"
    ),
    "- 6 moves of a **root joint**": lambda run: counted(run, "data_alone", "joints[root]"),
    "- 3 **rotations** of everything at rest": lambda run: counted(
        run, "data_alone", "a rotation about"
    ),
    "- 4 in which **blend shapes** push the whole surface": lambda run: (
        len(still_open(run, "data_alone")) - 15
    ),
    "The diagnosis has no name for 3 of them": lambda run: sum(
        one.kind == "mixed" for one in run["data_alone"].null_directions
    ),
    "closes the last two kinds, since both change blend shapes, and leaves 12.": lambda run: (
        len(still_open(run, "small_shapes")),
        counted(run, "small_shapes", "template and") == 6,
        counted(run, "small_shapes", "joints[root]") == 6,
    ),
    "No term says where along $y$ and $z$ a person stands: 4 directions stay open with all "
    "five.": lambda run: (
        len(still_open(run, "whole")),
        all(
            one.startswith(("a translation along y of", "a translation along z of"))
            and "template and" in one
            for one in still_open(run, "whole")
        ),
    ),
    "The rank is full, and it is the rank from before": lambda run: (
        run["held"].rank == run["held"].shape[1] == run["whole"].rank
    ),
}

GIVEN = (
    "vertex 100 of one scan has nothing to do with vertex 100 of another",
    "In SMPL there are 207, and few poses",
    "with $r \\ge 0$ and $\\sum r = 1$",
)
