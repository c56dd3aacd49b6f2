"""What each term of training does: the same training without it, and what then goes wrong."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from math import inf

import numpy as np

from workbench.arrays import Array, Index
from workbench.bodies import SkinnedBody
from workbench.bodies.forward.posing import Posing
from workbench.geometry.mirror import Mirror
from workbench.geometry.rotation import vector_from_matrix
from workbench.lectures.material.pose_in_shape import aligned, pose_share
from workbench.training.blocks import alternation
from workbench.training.estimate import Sigmas
from workbench.training.evaluation import VertexErrors
from workbench.training.execution import SILENT, Report
from workbench.training.first_guess import Start, first_estimate, first_poses
from workbench.training.poses import (
    DataTerm,
    EdgeTerm,
    PoseFit,
    VertexTerm,
    poses_of_segments,
)
from workbench.training.registrations import InMemory, Registrations, batches
from workbench.training.training import Trained, train

FIT_STEPS = 60  # of the fit of one registration in `generalization_errors`
FIT_TOLERANCE = 1e-13


@dataclass(frozen=True, eq=False)
class Ablated:
    """The numbers of one training.

    Attributes:
        name: what was switched off.
        training_rms: in metres per coordinate, the rms distance from the training meshes.
        held_out_rms: in metres per vertex, the same for other people in other poses.
        asymmetry: in metres, the rms distance of the subjects' templates from their mirror images.
        posedirs_rms: the rms of the pose directions, in metres per unit of a feature.
        pose_in_shape: the share of pose in each of the first shape directions, see `pose_share`.
    """

    name: str
    training_rms: float
    held_out_rms: float
    asymmetry: float
    posedirs_rms: float
    pose_in_shape: tuple[float, ...]


@dataclass(frozen=True, eq=False)
class Sets:
    """What a training takes, and what it is measured on.

    Attributes:
        poses: the multi-pose set.
        shapes: the multi-shape set.
        held_out: other people in other poses.
        start: where training starts.
    """

    poses: Registrations
    shapes: Registrations
    held_out: Registrations
    start: Start


def without(sigmas: Sigmas, *terms: str) -> Sigmas:
    """The sigmas with some terms switched off, given by the names of their sigmas."""
    return replace(sigmas, **dict.fromkeys(terms, inf))


def cases(sigmas: Sigmas) -> dict[str, Sigmas]:
    """The sigmas with every term on, and with each of two terms switched off, by name."""
    return {
        "all terms": sigmas,
        "no E_P": replace(without(sigmas, "posedirs"), posedirs=1e3 * sigmas.posedirs),
        "no E_Y": without(sigmas, "symmetry", "joint_symmetry"),
    }


def ablate(
    sets: Sets,
    sigmas: Sigmas,
    *,
    rounds: int = 2,
    n_betas: int = 10,
    report: Report = SILENT,
    done: Callable[[Ablated], None] = lambda _: None,
) -> list[Ablated]:
    """Train once for each case, and measure the first also without pose normalisation."""
    mirror = sets.start.mirror()
    found = []
    for name, held in cases(sigmas).items():
        plan = alternation(held, rounds=rounds)
        trained = train(
            sets.poses,
            sets.start,
            multi_shape=sets.shapes,
            plan=plan,
            n_betas=n_betas,
            report=report,
        )
        found.append(measured(name, trained, sets, mirror))
        done(found[-1])
        if name == "all terms":
            assert trained.shapes is not None  # there is a multi-shape set
            raw = aligned(sets.shapes)
            share = pose_share(raw, trained.shapes.poses)
            found.append(replace(found[0], name="not pose-normalised", pose_in_shape=share))
            done(found[-1])
    return found


def measured(name: str, trained: Trained, sets: Sets, mirror: Mirror | None) -> Ablated:
    """Measure one training."""
    estimate, asymmetry = trained.poses.estimate, 0.0
    if mirror is not None:
        away = estimate.templates - mirror.points(estimate.templates)
        away -= away.mean(axis=1, keepdims=True)
        asymmetry = float(np.sqrt((away**2).sum(axis=2).mean()))
    share: tuple[float, ...] = ()
    if trained.shapes is not None:
        share = pose_share(trained.shapes.people, trained.shapes.poses)
    return Ablated(
        name,
        trained.poses.objective.rms(estimate),
        generalization_errors(trained.body, sets.held_out, sigma=0.005, betas_sigma=1.0).rms,
        asymmetry,
        float(np.sqrt(np.mean(estimate.posedirs**2))),
        share,
    )


def generalization_errors(
    body: SkinnedBody,
    registrations: Registrations,
    *,
    sigma: float = 0.001,
    betas_sigma: float = 1e3,
) -> VertexErrors:
    """The errors after fitting pose, betas and trans of a body to each registration.

    `sigma` is the standard deviation of a vertex in metres, `betas_sigma` that of the prior on
    betas in standard deviations of the population.
    """
    fit = PoseFit(body, body.n_vertices, VertexTerm(), sigma, FIT_STEPS, betas_sigma, FIT_TOLERANCE)
    distances = []
    for batch in batches(registrations):
        each = zip(batch.vertices, batch.confidence, strict=True)
        first = [poses_of_segments(body.template, body.weights, body.parents, *one) for one in each]
        found = fit.fits(np.stack(first), batch.vertices, confidence=batch.confidence)
        distances.append(np.linalg.norm(found.surfaces - batch.vertices, axis=2))
    return VertexErrors(np.concatenate(distances))


def turn_errors(
    body: SkinnedBody, poses: Array, seed: int, spread: float = 2.0
) -> Mapping[str, Array]:
    """Errors of poses fitted with the template of another person: (J, K) rad, by what is fitted.

    People of the body's own shape space, whose betas have `spread` standard deviations, in poses
    (J, K, 3) rad are fitted with the mean template: to edges, and to vertices. The root is turned
    back first.
    """
    rng = np.random.default_rng(seed)
    betas = spread * rng.standard_normal((len(poses), body.n_betas))
    plain = replace(body, posedirs=0 * body.posedirs)
    meshes = InMemory(plain.vertices(poses, betas), np.arange(len(poses)))
    start = Start.of(body)
    first = first_estimate(meshes, start, weights=body.weights, rings=body.J_regressor)
    ways: dict[str, Callable[[Index], DataTerm]] = {
        "edges": EdgeTerm,
        "vertices": lambda faces: VertexTerm(),
    }
    true = Posing.of(poses, body.parents).local
    errors = {}
    for name, compared in ways.items():
        found = first_poses(first, meshes, start, compared).posing.local
        away = vector_from_matrix(found @ true.swapaxes(-1, -2))
        errors[name] = np.linalg.norm(away, axis=2)
    return errors
