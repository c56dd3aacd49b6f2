"""Strangers in poses of their own: how much of what skinning gets wrong a body puts right.

Half of a stranger's registrations show his rest shape, with the body's posedirs, weights and
regressor held; in the other half only poses are sought. What is left there is what counts. Beside
it, where it is known how the registrations were made: linear blend skinning told everything (rest
shape, joints, pose and the rig's weights), and the best linear predictor on the same features,
which was told the same of those trained on.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from workbench.bodies import SkinnedBody
from workbench.training.blocks import BLOCKS, Effort
from workbench.training.crew import ONE, Hands
from workbench.training.estimate import Estimate, Sigmas
from workbench.training.first_guess import Start
from workbench.training.held_out import Generalization
from workbench.training.mirror import Mirror, opposites
from workbench.training.objective import Objective
from workbench.training.pose_training import first_estimate, first_poses
from workbench.training.poses import SITTING, OnEdges, ShapePrior
from workbench.training.registrations import (
    Picked,
    Registrations,
    batches,
    held,
    kept_and_held_back,
)
from workbench.training.ridge import Pair, Sums, ridge_learned
from workbench.training.shape_training import Visit, unposed_people
from workbench.training.skinning_pass import SkinningPass
from workbench.training.truth import Truth

Array = NDArray[np.float64]
Index = NDArray[np.int64]
STEPS = 4  # of Gauss and Newton for a stranger's rest shape and poses
ROUNDS = 4  # of the poses that are asked about
REGRESSED = 0.0005  # m: joints are the regressor's
RIDGES = (1e-3, 3e-3, 1e-2, 3e-2)  # per pose


@dataclass(frozen=True, eq=False)
class Met:
    """Strangers as a body sees them."""

    left: Generalization  # m, of every second registration
    templates: Array  # (S, N, 3) m: their rest shapes
    shape_explained: float  # the share of how they differ from the template in its directions


def meet(body: SkinnedBody, registrations: Registrations, hands: Hands = ONE) -> Met:
    """Rest shapes from every other registration of each stranger; what is left of the rest.

    Every stranger needs two registrations or more.
    """
    mirror = None
    if body.mirror is not None:
        mirror = Mirror(body.mirror, opposites(body.joint_names))
    rows = np.arange(len(registrations.subject))
    place = np.concatenate([np.arange(n) for n in np.bincount(registrations.subject)])
    shown, asked = (held(Picked(registrations, rows[place % 2 == half])) for half in (0, 1))
    start = Start.of(body)
    sigmas = Sigmas(rings=REGRESSED)

    def begun(some: Registrations) -> Estimate:
        first = first_estimate(some, start, weights=body.weights, rings=body.J_regressor)
        posed = first_poses(first, some, start, crew=hands.crew)
        return replace(posed, posedirs=body.posedirs)

    def objective(some: Registrations) -> Objective:
        R, W = body.J_regressor, body.weights
        return Objective(some, R, W, mirror, sigmas, body.template)

    known = begun(shown)
    effort = Effort(
        linear_tolerance=1e-3, products=60, together_steps=STEPS, pose_vertices=body.n_vertices
    )
    for name in ("rest", "poses", "people"):
        known = BLOCKS[name](objective(shown), known, body.faces, effort, hands).estimate
    joints = np.stack([body.J_regressor @ T for T in known.templates])
    found = replace(begun(asked), templates=known.templates, joints=joints)
    for _ in range(ROUNDS):
        found = BLOCKS["poses"](objective(asked), found, body.faces, effort, hands).estimate
    left = _left(objective(asked), found)
    return Met(left, known.templates, shape_share(body, known.templates))


def shape_share(body: SkinnedBody, people: Array) -> float:
    """How much of the squared distance of people (S, N, 3) from the template shapedirs explain.

    Where they stand does not count.
    """
    away = people - body.template
    away = (away - away.mean(axis=1, keepdims=True)).reshape(len(people), -1)
    S = body.shapedirs - body.shapedirs.mean(axis=0, keepdims=True)
    Q, _ = np.linalg.qr(S.reshape(-1, body.n_betas))
    return float(np.sum((away @ Q) ** 2) / np.sum(away**2))


def shapes_explained(
    body: SkinnedBody, registrations: Registrations, hands: Hands = ONE
) -> dict[str, float]:
    """For a card: strangers in one pose, un-posed as those were that shapedirs are of."""
    J = len(registrations.subject)
    compared, prior = OnEdges(body.faces), ShapePrior()

    def visit(some: slice) -> Visit:
        batch = registrations.read(some)
        return Visit(body, compared, prior, None, batch.vertices, batch.seen)

    runs = [slice(at, min(at + SITTING, J)) for at in range(0, J, SITTING)]
    people = np.concatenate([rest for _, rest in hands.crew(unposed_people, map(visit, runs))])
    share = shape_share(body, people)
    return {"people_in_one_pose": J, "their_shape_variance_explained": round(share, 5)}


def standing(
    body: SkinnedBody, registrations: Registrations, hands: Hands = ONE
) -> dict[str, float]:
    """For a card: with blend shapes and without, mm."""
    with_them = meet(body, registrations, hands)
    without = meet(replace(body, posedirs=np.zeros_like(body.posedirs)), registrations, hands).left
    left = with_them.left
    return {
        "registrations": len(left.distances),
        "strangers": len(with_them.templates),
        "mean_mm": _mm(left.mean),
        "rms_mm": _mm(left.rms),
        "mean_without_posedirs_mm": _mm(without.mean),
        "rms_without_posedirs_mm": _mm(without.rms),
        "shape_variance_explained": round(with_them.shape_explained, 5),
    }


def standing_when_told(
    told_of: Truth, registrations: Registrations, start: Start, posedirs: Array | None
) -> dict[str, float]:
    """The same of skinning that knows all: alone, and with the best linear predictor."""
    alone = left_when_told(told_of, registrations, start)
    found = {"told_skinning_mean_mm": _mm(alone.mean), "told_skinning_rms_mm": _mm(alone.rms)}
    if posedirs is not None:
        best = left_when_told(told_of, registrations, start, posedirs)
        found |= {"told_linear_mean_mm": _mm(best.mean), "told_linear_rms_mm": _mm(best.rms)}
    return found


def _mm(metres: float) -> float:
    return round(1e3 * metres, 4)


def _left(objective: Objective, estimate: Estimate) -> Generalization:
    distances = [np.linalg.norm(r, axis=2) for _, _, r in objective.residuals(estimate)]
    return Generalization(np.concatenate(distances))


def told(truth: Truth, parents: tuple[int, ...], posedirs: Array | None = None) -> Estimate:
    """What registrations were made from, as linear blend skinning with blend shapes sees it."""
    K, N = len(parents), truth.rest.shape[1]
    P = np.zeros((N, 3, 9 * (K - 1))) if posedirs is None else posedirs
    return Estimate(truth.rest, truth.joints, P, truth.weights, truth.poses, parents)


def left_when_told(
    truth: Truth, registrations: Registrations, start: Start, posedirs: Array | None = None
) -> Generalization:
    """Of skinning that knows all, with no blend shapes or with those given."""
    estimate = told(truth, start.parents, posedirs)
    held = Objective(registrations, start.rings(), truth.weights, None, Sigmas())
    return _left(held, estimate)


def best_linear(truth: Truth, registrations: Registrations, start: Start) -> Array:
    """Posedirs (N, 3, F): ridge regression of true un-posed errors, its ridge chosen on a fifth.

    That fifth of the subjects is held back until the ridge is chosen.
    """
    learned, held_back = (
        Sums.of(_errors(truth, registrations, start, rows)).with_reflections(start.mirror())
        for rows in kept_and_held_back(truth.subject)
    )
    whole = np.ones_like(learned.products[:, 0], dtype=bool)
    return ridge_learned(learned, held_back, whole, RIDGES)[0]


def _errors(
    truth: Truth, registrations: Registrations, start: Start, rows: Index
) -> Iterator[Pair]:
    """Features, and what must be added at rest for skinning to be right."""
    estimate = replace(told(truth, start.parents), poses=truth.poses[rows])
    for batch in batches(Picked(registrations, rows)):
        passed = SkinningPass(estimate, batch.some, batch.subject)
        away = batch.vertices - truth.trans[rows[batch.some], None] - passed.points
        yield passed.features, passed.at_rest(away)
