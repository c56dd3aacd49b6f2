"""What each term of training does: the same training without it, and what then goes wrong.

People and poses are drawn by `builder.sets`; no body in them was measured. The held-out ones are
other people, in poses of clips that nothing was learned from.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from math import inf
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from benchmarks.accuracy import RECORDING, WHEEL, needed
from benchmarks.measuring import table
from builder.population import gather_sources
from builder.recordings import read_recording
from builder.sets import SetRecipe, make_sets
from builder.wheel import Wheel
from workbench import load_body
from workbench.arrays import Array
from workbench.bodies import SkinnedBody
from workbench.bodies.forward.posing import Posing
from workbench.geometry.rotation import vector_from_matrix
from workbench.lectures.material.pose_in_shape import aligned, pose_share
from workbench.priors.poses import draw_poses, shipped_mixture
from workbench.synthetic.made_up import draw_registrations, jointed_tube, random_smpl
from workbench.training.blocks import alternation
from workbench.training.estimate import Sigmas
from workbench.training.evaluation import evaluate_held_out
from workbench.training.first_guess import Start, first_estimate, first_poses, read_start
from workbench.training.folder import open_folder
from workbench.training.registrations import InMemory, Registrations
from workbench.training.training import Trained, train

RECIPE = SetRecipe(people=300, subjects=20, poses=15, held_out=6, others=10)
PEOPLE = 60  # whose poses are fitted to edges and to vertices


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


def tubes() -> Sets:
    """People that are bent tubes, which take a second."""
    start = jointed_tube(7, 5)
    body = random_smpl(start, 2, seed=3, shape=0.005)
    poses, shapes, held_out = (
        draw_registrations(body, *counts, seed=seed, turn=turn)[0]
        for counts, seed, turn in (((3, 8), 4, 0.5), ((60, 1), 6, 0.3), ((3, 2), 7, 0.5))
    )
    return Sets(poses, shapes, held_out, start)


def drawn(folder: Path) -> Sets:
    """People of the artists' shape targets, written to a folder."""
    sources = gather_sources(Wheel(needed(WHEEL)), RECIPE.everyone, RECIPE.seed, print)
    recorded = read_recording(needed(RECORDING)).split()[1].poses
    make_sets(sources, RECIPE, folder, print, recorded)
    start = read_start(folder / "train" / "start.npz")
    train_set, held_out = (
        open_folder(folder / name, len(start.template), start.faces)
        for name in ("train", "held_out")
    )
    return Sets(train_set.only("poses"), train_set.only("shapes"), held_out.only("poses"), start)


def without(sigmas: Sigmas, *terms: str) -> Sigmas:
    """The sigmas with some terms switched off, given by the names of their sigmas."""
    return replace(sigmas, **dict.fromkeys(terms, inf))


def ablated(sets: Sets, sigmas: Sigmas, rounds: int, n_betas: int) -> Iterator[dict[str, Any]]:
    """Train with all terms and without each of two, and measure the first also without pose
    normalisation.
    """
    for name, held in {
        "all terms": sigmas,
        "no E_P": replace(without(sigmas, "posedirs"), posedirs=1e3 * sigmas.posedirs),
        "no E_Y": without(sigmas, "symmetry", "joint_symmetry"),
    }.items():
        plan = alternation(held, rounds=rounds)
        trained = train(sets.poses, sets.start, multi_shape=sets.shapes, plan=plan, n_betas=n_betas)
        assert trained.shapes is not None  # there is a multi-shape set
        share = pose_share(trained.shapes.people, trained.shapes.poses)
        row = {"name": name} | numbers(trained, sets) | {"pose in shape": share}
        yield row
        if name == "all terms":
            raw = pose_share(aligned(sets.shapes), trained.shapes.poses)
            yield row | {"name": "not pose-normalised", "pose in shape": raw}


def numbers(trained: Trained, sets: Sets) -> dict[str, float]:
    """Of one training, in mm: the rms distance from the training meshes (a coordinate), the same
    for held-out people in other poses (a vertex), the rms distance of the subjects' templates from
    their mirror images, and the rms of the pose directions by unit of a feature.
    """
    estimate, mirror = trained.poses.estimate, sets.start.mirror()
    asymmetry = 0.0
    if mirror is not None:
        away = estimate.templates - mirror.points(estimate.templates)
        away -= away.mean(axis=1, keepdims=True)
        asymmetry = float(np.sqrt((away**2).sum(axis=2).mean()))
    found = {
        "training": trained.poses.objective.rms(estimate),
        "held out": float(
            np.sqrt(np.mean(evaluate_held_out(trained.body, sets.held_out).distances ** 2))
        ),
        "asymmetry": asymmetry,
        "posedirs": float(np.sqrt(np.mean(estimate.posedirs**2))),
    }
    return {name: 1e3 * metres for name, metres in found.items()}


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
    true = Posing.of(poses, body.parents).local
    errors = {}
    for name in ("edges", "vertices"):
        found = first_poses(first, meshes, start, by_edges=name == "edges").posing.local
        away = vector_from_matrix(found @ true.swapaxes(-1, -2))
        errors[name] = np.linalg.norm(away, axis=2)
    return errors


def measured(quick: bool) -> dict[str, object]:
    """Without each term, and poses by edges and by vertices; `quick` is of tubes."""
    with TemporaryDirectory() as folder:
        sets = tubes() if quick else drawn(Path(folder))
        sigmas = Sigmas(posedirs=0.005) if quick else Sigmas()
        rows = list(ablated(sets, sigmas, 1 if quick else 2, 2 if quick else 10))
    poses = draw_poses(shipped_mixture(), 6 if quick else PEOPLE, np.random.default_rng(0))
    turned = turn_errors(load_body("small"), poses, seed=1)
    degrees = {name: float(np.degrees(e[:, 1:].mean())) for name, e in turned.items()}
    return {"terms": rows, "mean error in degrees": degrees}


def tables(found: dict[str, Any]) -> str:
    """Both."""
    keys = "training", "held out", "asymmetry", "posedirs"
    rows = [
        (
            *(row["name"], *(f"{row[key]:.2f}" for key in keys)),
            ", ".join(f"{100 * share:.0f}" for share in row["pose in shape"][:3]) + " %",
        )
        for row in found["terms"]
    ]
    head = (
        *("mm", "training, a coordinate", "held out, a vertex", "asymmetry of templates"),
        *("posedirs, a unit of a feature", "pose in the first shape directions"),
    )
    degrees = found["mean error in degrees"]
    return (
        f"{table(head, rows)}\nPoses of people of other shapes, fitted with the mean template, are "
        f"off by {degrees['edges']:.1f} degrees a joint on average if edges are compared, and by "
        f"{degrees['vertices']:.1f} if vertices are.\n"
    )
