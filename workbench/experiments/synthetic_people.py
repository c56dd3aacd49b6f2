"""People drawn from the model itself, random starts, and the known answers of fits to them.

All of them are synthetic: nobody was measured.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from workbench.arrays import Array
from workbench.blocks import Values
from workbench.bodies import SkinnedBody
from workbench.bodies.body import Body
from workbench.bodies.catalogue import load_body
from workbench.bodies.triangles import TriangleBody
from workbench.errors import BadArgument
from workbench.fitting.setup import KnownAnswer, Setup
from workbench.geometry.rotation import matrix_from_vector, vector_from_matrix
from workbench.priors.poses import shipped_gaussian
from workbench.solvers import Ipopt, LevenbergMarquardt, Solver

SIZE, FOCAL, DISTANCE = 1000, 1200.0, 4.0  # px, px, m


def looking_in(angle: float) -> Mapping[str, Array]:
    """The calibration of an upright camera on a circle about the origin, in front at angle 0."""
    forward = -np.array([np.sin(angle), 0.0, np.cos(angle)])
    down = np.array([0.0, -1.0, 0.0])
    middle = (SIZE - 1) / 2
    return {
        "K": np.array([[FOCAL, 0, middle], [0, FOCAL, middle], [0, 0, 1]]),
        "R": np.array([np.cross(down, forward), down, forward]),
        "t": np.array([0.0, 0.0, DISTANCE]),
    }


TRANS_SIGMA = 0.2  # m
TIGHT = 1e-9  # gradient tolerance, with which costs have more digits than are ever compared
MADE_OF_THE_MODEL = (
    "the observed body is the model itself, in a pose and a shape drawn at random, with noise "
    "where the question names some; nobody was measured, and a real person is no body of the model"
)


def person_at_origin(body: Body, rng: np.random.Generator, pose_sigma: float) -> Values:
    """A random person at the origin: normal angles about the bind pose, and normal betas.

    The standard deviation of the angles is `pose_sigma` rad, that of the betas 1.
    """
    names = (block.name for block in body.blocks())
    pose = body.bind_pose + pose_sigma * rng.standard_normal((body.n_joints, 3))
    return dict(zip(names, (pose, rng.standard_normal(body.n_betas), np.zeros(3)), strict=True))


def bent_person(body: Body, rng: np.random.Generator, pose_sigma: float) -> Values:
    """A `person_at_origin`, moved by 0.2 m per axis."""
    trans = body.blocks()[2].name
    return person_at_origin(body, rng, pose_sigma) | {trans: TRANS_SIGMA * rng.standard_normal(3)}


def drawn_person(
    body: str, seed: int, drawn: Callable[..., Values], *others: float
) -> tuple[SkinnedBody | TriangleBody, np.random.Generator, Values]:
    """A body by its name, the source of its noise, and a person that `drawn` makes with these."""
    model, rng = load_body(body), np.random.default_rng(seed)
    return model, rng, drawn(model, rng, *others)


def likely_person(body: Body, rng: np.random.Generator) -> Values:
    """A person drawn from the priors of a keypoint fit, so that these priors are right.

    The root, which has no prior, is turned by 0.3 rad per axis.
    """
    person = bent_person(body, rng, 0.3)
    pose = body.blocks()[0].name
    if body.n_joints == 24:
        prior = shipped_gaussian()
        factor = np.linalg.cholesky(prior.covariance)
        below_root = prior.mean + factor @ rng.standard_normal(69)
        person[pose] = np.vstack([person[pose][:1], below_root.reshape(23, 3)])
    return person


def random_start(body: Body, seed: int, start: int, sigma: float = 0.3) -> Values:
    """Start 0 is the template at the origin; start k > 0 is a random person, `sigma` rad per axis.

    It depends on the person's `seed` and on `start` alone, so that all solvers begin there.
    Raises BadArgument for a negative number.
    """
    check_start(start)
    if start == 0:
        return body.start()
    return bent_person(body, np.random.default_rng((seed, start)), sigma)


def check_start(start: int) -> None:
    """Raise BadArgument for a number of a start below zero."""
    if start < 0:
        raise BadArgument(f"start must be from 0 on, not {start}")


def start_text(start: int, sigma: float = 0.3) -> str:
    """A phrase on the start that `random_start` returns, for the end of a question."""
    return f", from random start {start} ({sigma:g} rad)" if start else ", from the template"


def exact_answer(body: Body, truth: Values) -> KnownAnswer:
    """The known answer of data without noise: the person of whom they were made, at a cost of 0.

    Rotation vectors are shortened to at most half a turn, since a whole turn changes nothing.
    """
    pose = body.blocks()[0].name
    turns: Array = vector_from_matrix(matrix_from_vector(truth[pose]))
    return KnownAnswer(
        "the synthetic person that the data were made of", 0.0, truth | {pose: turns}
    )


def with_refined_answer(setup: Setup, truth: Values, begin: Values | None = None) -> Setup:
    """Add to a setup of noisy data, made of `truth`, the minimum that a solver finds from there.

    `begin` is where the solver begins if `truth` violates the bounds. It is IPOPT if there are
    bounds, and Levenberg and Marquardt's otherwise.
    """
    solver: Solver = LevenbergMarquardt(gradient_tolerance=TIGHT, max_iterations=500)
    if setup.problem.bounded:
        solver = Ipopt(gradient_tolerance=TIGHT)
    solution = solver.solve(setup.problem, setup.start | (begin or truth))
    source = (
        f"{solution.solver} from the synthetic person that the data were made of; no proof that "
        "there is none lower"
    )
    return replace(setup, known=KnownAnswer(source, solution.cost, solution.values), made_of=truth)
