"""Training finds the body that its registrations were made with.

What cannot be found, and is not asked for: the root joint (turning about another point is a
translation more), the frame that all rest shapes are drawn in (a rotation of all of them, with
posedirs turned along, changes no mesh), and a row of the joint regressor by itself (many rows give
the same joints on all bodies of a shape space; a held-out body of that space decides nothing).
"""

from dataclasses import dataclass, replace
from math import inf

import numpy as np
import pytest

from benchmarks.ablations.study import generalization_errors
from workbench import SkinnedBody, load_body
from workbench.geometry.rigid import procrustes
from workbench.synthetic.made_up import (
    CorruptedRegistrations,
    Truth,
    draw_registrations,
    jointed_tube,
    random_smpl,
)
from workbench.training.blocks import BLOCKS, BlockInput, BlockOptions, BlockResult
from workbench.training.estimate import TERMS, Estimate, Sigmas
from workbench.training.first_guess import MOST_WEIGHTS, Start
from workbench.training.objective import Objective
from workbench.training.plan import NO_LIMIT, Plan, Stage
from workbench.training.training import Trained, train

pytestmark = pytest.mark.thorough


FREE_ROUND = ("surfaces", "weights", "poses")
TO_THE_END = 3000  # products in a step: directions that hardly change the data need that many
EXACT = 1e-9  # m, rms of E_D: a thousandth of the accuracy that the model should have


def annealed(sigmas: Sigmas, factors: tuple[float, ...] = (1.0, 10.0, 1e2, 1e3, inf)) -> Plan:
    """A plan for registrations without noise, which switches every term but E_D off step by step.

    Each lambda falls with the square of its factor; the last stage fits the data alone. Only
    there the number of weights of a vertex is limited, because by then it is clear which of them
    are zero. Only the last steps are solved to the end: joints that move few vertices are found
    last.
    """
    free = BlockOptions(together_tolerance=1e-3, together_steps=12, most_weights=NO_LIMIT)
    first = Stage(sigmas, FREE_ROUND, 3, free)
    rest = [Stage(_loosened(sigmas, f), ("weights", "together"), options=free) for f in factors]
    limited = replace(free, most_weights=MOST_WEIGHTS, products=TO_THE_END, enough=EXACT)
    last = Stage(_loosened(sigmas, inf), ("cut", "weights", "together"), options=limited)
    return Plan((first, *rest, last))


def _loosened(sigmas: Sigmas, factor: float) -> Sigmas:
    """Every sigma but the data's multiplied by a factor."""
    return replace(sigmas, **{name: factor * getattr(sigmas, name) for name in TERMS})


FACTORS = (1.0, 10.0, 100.0)
TURN = 1.6  # rad, the largest
SIGMAS = Sigmas(
    data=0.001, symmetry=inf, joint_symmetry=inf, rings=0.02, posedirs=0.005, weights=0.3
)
FREE = replace(SIGMAS, rings=inf, posedirs=inf, weights=inf)  # of every term but E_D


@dataclass(frozen=True, eq=False)
class Recovery:
    """A truth, what it made, and what training made of that."""

    body: SkinnedBody
    truth: Truth
    trained: Trained

    def held_out(self) -> float:
        """The largest distance of other people in other poses, m."""
        others, _ = draw_registrations(self.body, 4, 2, seed=99, turn=TURN)
        return generalization_errors(self.trained.body, others).largest

    def joints(self) -> float:
        """How far joints of held-out bodies of the same shape space are off, but the root, m."""
        betas = np.random.default_rng(5).standard_normal((10, self.body.n_betas))
        gap = (self.trained.body.J_regressor - self.body.J_regressor).toarray()
        away = np.einsum("kn,sna->ska", gap, self.body.vertices(betas=betas))
        return float(np.linalg.norm(away, axis=2)[:, 1:].max())

    def weights(self) -> float:
        """The largest error."""
        return float(np.abs(self.trained.body.weights - self.body.weights).max())

    def posedirs(self) -> float:
        """The largest error, m, after the rest frames are turned onto each other."""
        found = self.trained.poses.estimate
        people = self.body.vertices(betas=self.truth.betas)
        R = procrustes(
            np.concatenate(found.templates - found.templates.mean(axis=1, keepdims=True)),
            np.concatenate(people - people.mean(axis=1, keepdims=True)),
        ).R
        P = found.posedirs.reshape(len(people[0]), 3, -1, 3, 3)
        turned = np.einsum("ab,nbkcd,ec,fd->nakef", R, P, R, R, optimize=True)
        return float(np.abs(turned.reshape(found.posedirs.shape) - self.body.posedirs).max())


def small_start() -> Start:
    """The mesh and tree of `small`, with ten vertices for each collar.

    Its own collars carry no vertex most, and what carries nothing is not seen to turn. The mesh is
    coarse: a ring reaches farther than the vertices that training takes a joint to be a mean of,
    so the generator's joints are means of those of its vertices that are nearest to its middle.
    """
    body = load_body("small")
    start = Start.of(body)
    mirror = start.mirror()
    assert mirror is not None
    left, right, *around = map(
        body.joint_names.index,
        ("left_collar", "right_collar", "spine2", "spine3", "neck", "left_shoulder"),
    )
    away = np.linalg.norm(body.template - body.joints()[left], axis=1)
    beside = np.isin(start.segmentation, (left, *around)) & (body.template[:, 0] > 0.02)  # m
    away[~beside] = inf
    segments, own = start.segmentation.copy(), np.argsort(away)[:10]
    segments[own], segments[mirror.vertices[own]] = left, right
    return replace(start, segmentation=segments)


def recover(start: Start, n_betas: int, subjects: int, poses: int, ring: int | None) -> Recovery:
    body = random_smpl(start, n_betas, seed=0, ring=ring)
    data, truth = draw_registrations(body, subjects, poses, seed=1, turn=TURN)
    plan = annealed(SIGMAS, FACTORS)
    return Recovery(body, truth, train(data, start, plan=plan, n_betas=n_betas))


@dataclass(frozen=True, eq=False)
class Near:
    """Steps of all names together on a small body, from the truth disturbed in every name."""

    objective: Objective
    start: Start
    estimate: Estimate

    def together(self, estimate: Estimate, **options: float) -> BlockResult:
        """The block with these options."""
        given = replace(BlockOptions(), **options)
        return BLOCKS["together"](BlockInput(self.objective, self.start.faces, given), estimate)


@pytest.fixture(scope="module")
def near() -> Near:
    """Off by 1 mm, 0.01 rad, weights by a fiftieth, blend shapes by half a mm."""
    start = jointed_tube(9, 6)
    body = random_smpl(start, 1, seed=0)
    data, truth = draw_registrations(body, 4, 20, seed=1, turn=TURN)
    exact, rng = at_the_truth(body, truth), np.random.default_rng(7)
    weights = np.where(body.weights > 0, body.weights + 0.02 * rng.random(body.weights.shape), 0)
    disturbed = replace(
        exact,
        templates=exact.templates + 0.001 * rng.standard_normal(exact.templates.shape),
        joints=exact.joints + 0.003 * rng.standard_normal(exact.joints.shape),
        posedirs=exact.posedirs + 0.0005 * rng.standard_normal(exact.posedirs.shape),
        weights=weights / weights.sum(axis=1, keepdims=True),
        poses=exact.poses + 0.01 * rng.standard_normal(exact.poses.shape),
    )
    return Near(Objective(data, start.rings(), start.weights(), None, FREE), start, disturbed)


def at_the_truth(body: SkinnedBody, truth: Truth) -> Estimate:
    """What made the registrations."""
    people = body.vertices(betas=truth.betas)
    joints = np.stack([body.J_regressor @ person for person in people])
    return Estimate(people, joints, body.posedirs, body.weights, truth.poses, body.parents)


def test_steps_in_all_names_converge_quadratically(near: Near) -> None:
    """Near the truth, off in every name, the residual falls faster and faster."""
    estimate, rms = near.estimate, [near.objective.rms(near.estimate)]
    for _ in range(4):
        found = near.together(estimate, together_tolerance=1e-4, together_steps=1, products=250)
        estimate = found.estimate
        rms.append(near.objective.rms(estimate))
    assert rms[-1] < 1e-6
    falls = np.array(rms[1:]) / rms[:-1]
    assert falls[1] < 0.1
    np.testing.assert_allclose(estimate.weights.sum(axis=1), 1, atol=1e-12)


@pytest.mark.parametrize(
    ("start", "n_betas", "subjects", "poses", "ring"),
    [
        (jointed_tube(9, 6), 2, 5, 16, None),
        (small_start(), 4, 6, 60, 12),
    ],
    ids=["54 vertices, 6 joints", "369 vertices, 24 joints"],
)
def test_generator_is_recovered_from_segments(
    start: Start, n_betas: int, subjects: int, poses: int, ring: int | None
) -> None:
    found = recover(start, n_betas, subjects, poses, ring)
    assert found.held_out() < 1e-6
    assert found.joints() < 1e-6
    assert found.weights() < 1e-5
    assert found.posedirs() < 1e-5


def template_error(start: Start, body: SkinnedBody, poses: int, noise: float = 0.001) -> float:
    """Rms of E_D's surplus over the noise: how far the fitted points are from the exact ones."""
    data, truth = draw_registrations(body, 4, poses, seed=3, turn=TURN)
    noisy = CorruptedRegistrations(data, seed=4, noise=noise)
    exact = Objective(data, start.rings(), start.weights(), None, FREE)
    fitted = Objective(noisy, start.rings(), start.weights(), None, FREE)
    at = at_the_truth(body, truth)
    found = BLOCKS["surfaces"](
        BlockInput(fitted, start.faces, BlockOptions(products=400)), at
    ).estimate
    return exact.rms(found)


def test_error_falls_with_registrations_as_predicted() -> None:
    """Linear least squares: rms error / noise = sqrt(unknowns / equations).

    The unknowns stay the same, so with four times the registrations it is half as large.
    """
    start = jointed_tube(7, 5)
    body = random_smpl(start, 2, seed=0)
    S, K, N = 4, 6, 35
    errors = []
    for poses in (20, 80):
        error = template_error(start, body, poses)
        errors.append(error)
        unknowns = S * 3 * (N + K) - 3 * S - 3 * S + N * 3 * 9 * (K - 1)
        equations = 3 * (N - 1) * S * poses
        predicted = 0.001 * np.sqrt(unknowns / equations * (N - 1) / N)
        assert error == pytest.approx(predicted, rel=0.1)
    assert errors[1] / errors[0] == pytest.approx(0.5, abs=0.05)
