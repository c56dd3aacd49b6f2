"""What lecture 8 says of its run."""

import numpy as np

from tests.lectures.numerals import above, below
from tests.lectures.prose import Run


def furthest_parts(run: Run) -> list[str]:
    """The parts of the body, the one first whose skin the answer from rest has furthest off."""
    off, body = run["off"]["from rest"], run["body"]
    part = body.weights.argmax(axis=1)
    most = {body.joint_names[k]: float(off[part == k].max()) for k in np.unique(part)}
    return sorted(most, key=lambda name: -most[name])


def crown(run: Run) -> bool:
    """Whether the vertex that is furthest off is in the uppermost quarter of the head."""
    body = run["body"]
    head = np.flatnonzero(body.weights.argmax(axis=1) == body.joint_names.index("head"))
    height = body.template[head, 1]
    return bool(body.template[run["off"]["from rest"].argmax(), 1] > np.quantile(height, 0.75))


def known_to(run: Run, name: str) -> float:
    """How well a joint is known from vertices, degrees."""
    return run.line(f"  {name:15} known to")[0]


def hanging(run: Run, name: str) -> int:
    body = run["body"]
    return int((body.weights.argmax(axis=1) == body.joint_names.index(name)).sum())


def by_pinv(run: Run, name: str) -> list[float]:
    return run.line(f"{name:11} by pinv")[:3]


def furthest(run: Run, answer: np.ndarray) -> int:
    """The number of the pose that is furthest from the truth."""
    return int(np.abs(answer - run["truth"]).argmax())


def prior_sigma(run: Run) -> float:
    """Of each number of the pose, rad."""
    whitened = run["with_prior"].linearize(run["there"]).residual[-run["truth"].size :]
    return float(np.linalg.norm(run["truth"]) / np.linalg.norm(whitened))


def step_of_ten(run: Run, which: int) -> np.ndarray:
    """By what ten times the step multiplies how far joints (1) or skin (2) move."""
    found = np.array([line[which] for line in run.lines("rad: joints by")])
    return found[1:] / found[:-1]


SAYS = {
    "All 24 joints are known exactly.": lambda run: len(run["truth"]),
    "The pose of a body is 24 rotation vectors, 72 numbers. Motion capture gives us the places of the "
    "24 joints, again 72 numbers. There are as many equations as unknowns": lambda run: (
        len(run["truth"]),
        run["truth"].size,
        run["body"].n_joints,
        run["observed"].symbol.numel(),
    ),
    "minus those that were seen, divided by 1 cm": lambda run: float(
        100 * run["problem"].residuals[0].sigma
    ),
    "Both fits converged, and both meet every joint. Yet both poses are wrong, and so is the "
    "skin": lambda run: (
        all(
            line[0] < 1e-6 and line[1] > 0.1 and line[2] > 10
            for line in run.lines("CONVERGED: joints off by")
        )
        and len(run.lines("CONVERGED: joints off by")) == 2
    ),
    "brightest is the crown of the head (seen from behind, because the head is bent back), then the left upper arm, "
    "which is turned about its bone, then "
    "both hands": lambda run: (
        furthest_parts(run)[:2] == ["head", "left_shoulder"],
        set(furthest_parts(run)[2:4]) == {"left_hand", "right_hand"},
        crown(run),
    ),
    "The 72 singular values, largest first": lambda run: len(run["s"]),
    "There are forty singular values, and then a cliff of more than twelve decades.": lambda run: (
        run["here"].rank,
        above(float(-np.diff(np.log10(run["s"][39:41]))[0])),
    ),
    "## Why forty": lambda run: run["here"].rank,
    "three points are seen, and each can be moved alone in all three directions by the joints above it: "
    "three times three": lambda run: (len(run["ends"]) == 3, run["rank"] == 9),
    "A step that is ten times as long moves the skin ten times as far, and the joints a "
    "hundred times": lambda run: (
        10,
        float(step_of_ten(run, 2).mean()),
        float(step_of_ten(run, 1).mean()),
        np.allclose(step_of_ten(run, 2), 10, rtol=0.1),
        np.allclose(step_of_ten(run, 1), 100, rtol=0.1),
    ),
    "An entry is blue where one of the 72 residuals depends on one of the 72 free numbers by structure: 16.5% of "
    "the entries.": lambda run: (
        run["here"].jacobian.shape[0],
        run["here"].jacobian.shape[1],
        100 * run["diagnosis"].density,
    ),
    "The five empty groups of columns are the leaves; the top three rows, the pelvis, move with "
    "nothing.": lambda run: (
        int((~run["here"].jacobian.any(axis=0)).sum()) == 15,
        not run["here"].jacobian[:3].any(),
    ),
    "most entries of this Jacobian are zero whatever the pose": lambda run: (
        run["diagnosis"].density < 0.5
    ),
    "15 columns are empty, so the rank is at most 57": lambda run: (
        int((~run["here"].jacobian.any(axis=0)).sum()),
        run["diagnosis"].structural_rank,
    ),
    "let every vertex depend on 23 rotations. But it has only 82 columns, and its 14 MB are"
    " easily kept as a dense matrix": (
        lambda run: (run["body"].n_joints - 1, 72 + 10, 8e-6 * run["largest"])
    ),
    "every one to 1 cm. With them everything is seen": lambda run: (
        float(100 * run["on_skin"].residuals[0].sigma),
        run["skin"].jacobian.shape[1] == 72 and "rank: 72   condition" in run.printed,
    ),
    "With this centimetre the pelvis is known to less than 1 degree": lambda run: below(
        known_to(run, "pelvis")
    ),
    "The feet are known to no better than 10 degrees: only 6 of the 369 vertices hang on a "
    "foot": lambda run: (
        above(min(known_to(run, "left_foot"), known_to(run, "right_foot"))),
        hanging(run, "left_foot"),
        run["body"].n_vertices,
        hanging(run, "right_foot") == hanging(run, "left_foot"),
    ),
    "Left: from vertices; the feet are known least.": lambda run: (
        {run["body"].joint_names[k] for k in np.argsort(run["sigma"])[-2:]}
        == {"left_foot", "right_foot"}
    ),
    "The five leaves, of which nothing is seen, get a standard deviation of zero, and so have no "
    "bar.": lambda run: (
        len(run["leaves"]) == 5,
        run["worst_naive"][run["leaves"]].max() < 1e-6,
        np.delete(run["worst_naive"], run["leaves"]).min() > 1,
    ),
    "Whatever is below this **tolerance** counts as zero": lambda run: (
        run.line("and", "are above it")[-1] == run["here"].rank
    ),
    "should move no joint, and yet move the skin of the forearm": lambda run: (
        run.line("0.001 rad: joints by")[2] > 1000 * run.line("0.001 rad: joints by")[1]
    ),
    "With the 24 joints alone it gives the smallest standard deviation to the rotations that "
    "nobody sees, those of the leaves.": lambda run: (
        run["body"].n_joints,
        max(by_pinv(run, "left_hand")) < min(by_pinv(run, "left_elbow") + by_pinv(run, "left_hip")),
    ),
    "each number of the pose is usually about 0.3 rad from zero": prior_sigma,
    "from the prior up to $\\sigma = 0.3$ rad": prior_sigma,
    "the rank is full, and the answer is unique": lambda run: run["regular"].rank == 72,
    "It is 35 and not 40": lambda run: (float(run["known"].effective), run["here"].rank),
    "(It is off by as much as the answer from rest was, for the same reason: the number "
    "that is furthest off is one that no joint depends on, and both leave it at zero.)": lambda run: (
        furthest(run, run["answers"]["from rest"]) == furthest(run, run["solution"].values["pose"]),
        run["body"].joint_names[furthest(run, run["answers"]["from rest"]) // 3] == "right_hand",
        abs(run["solution"].values["pose"].ravel()[furthest(run, run["answers"]["from rest"])])
        < 1e-9,
    ),
    "so that these turns change all numbers of a joint, and none of them is determined.": lambda run: (
        all(
            bool(np.isinf(run["honest"][run["body"].joint_names.index(name)]).all())
            for name in ("left_elbow", "left_hip")
        )
    ),
    "24 joints tell 40 of 72 numbers": lambda run: (
        run["body"].n_joints,
        run["here"].rank,
        run["truth"].size,
    ),
}

GIVEN = (
    "the diagonal of $D$ (1 for a column of zeros)",
    "it first scales every column to the length 1",
    "If $J p = 0$, no equation notices the step.",
    "because $\\omega \\times e = 0$ where",
    "between 0 and 1. The sum of all shares",
)

GENERAL = (  # mathematics, definitions and advice
    "the pattern is worth more for what it tells than for the zeros that it saves",
    "about as large as the largest one, times the machine's precision",
)
