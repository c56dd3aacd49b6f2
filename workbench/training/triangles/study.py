"""SMPL, SCAPE and BlendSCAPE on the same synthetic people, from seeds to numbers."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from workbench.bodies import SkinnedBody
from workbench.bodies.catalogue import load_skinned
from workbench.bodies.triangles import TriangleBody, blend_scape, scape
from workbench.geometry.triangles import soup
from workbench.training.triangles.choice import Choice
from workbench.training.triangles.comparison import (
    Explained,
    additivity_gap,
    explained_by_triangles,
    explained_by_vertices,
    explained_gradients,
    n_parameters,
)
from workbench.training.triangles.fitting import AnyBody
from workbench.training.triangles.measures import Cost, Held, cost, crease, n_seams
from workbench.training.triangles.models import (
    BLEND_SCAPE,
    SCAPE,
    SMPL,
    WHOLE,
    Learned,
    Teaching,
    learn_models,
)
from workbench.training.triangles.people import (
    People,
    Plan,
    Registrations,
    Report,
    draw_people,
    register,
)

Array = NDArray[np.float64]
SHOWN = (SMPL, SCAPE, BLEND_SCAPE)
HARD, APART = 5, 0.25  # poses that are drawn, and their least rms distance in rad per joint


@dataclass(frozen=True)
class Outcome:
    """One model in numbers; distances in mm, pose and shape sought in every mesh."""

    model: str
    parameters: int
    learned: float | None  # rms, of the meshes learned from; None: it was not learned by itself
    rest: float | None  # rms, of strangers at rest; None: not asked
    rms: float  # of strangers in poses that nobody has seen
    mean: float
    largest: float
    crease: float  # rms jump of the deformation where parts meet, in those poses
    gap: float  # mm, rms: shape and pose together less each alone, unposed


@dataclass(frozen=True, eq=False)
class Shapes:
    """What the first k shape directions explain, k = 0, 1, ..."""

    learned: Mapping[str, Explained]  # "vertices" and "triangles"; of the people learned from
    strangers: Mapping[str, Explained]
    gradients: Array  # shares of the variance of gradients, people learned from

    @property
    def leads(self) -> Array:
        """How much more of those learned from vertices explain than triangles: (k,), k = 1 ..."""
        v, t = (self.learned[name].share for name in ("vertices", "triangles"))
        return np.asarray((v - t)[1:])


@dataclass(frozen=True, eq=False)
class Study:
    """All that was measured."""

    plan: Plan
    said: str  # which poses were tested on
    faces: NDArray[np.int64]
    shapes: Shapes
    outcomes: tuple[Outcome, ...]
    true_crease: float  # of the test meshes themselves
    n_seams: int
    choices: Mapping[str, Choice]  # how strongly pose's part of each model was held
    costs: tuple[Cost, ...]
    smpl: SkinnedBody
    poses: Array  # (H, K, 3) rad: hard ones
    hard: Mapping[str, Held]  # by model, in those
    torn: Mapping[str, Array]  # stage -> corners (F, 3, 3) m

    def outcome(self, model: str) -> Outcome:
        """Of that name."""
        return next(one for one in self.outcomes if one.model == model)


def compare_triangles(plan: Plan, wheel: Path, mocap: Path | None, report: Report) -> Study:
    """Draw people, learn the models, measure them.

    Without a recording they are tested on further draws of the pose prior.
    """
    body = load_skinned(plan.body)
    people = draw_people(plan, wheel, body, report)
    given = register(plan, people, mocap)
    return study(plan, given, report)


def study(plan: Plan, given: Registrations, report: Report, teaching: Teaching = WHOLE) -> Study:
    """Learn and measure on what is given."""
    learned = learn_models(given, plan.betas, report, teaching)
    smpl, torn, test = learned.smpl, learned.rigid, given.test
    report("shape directions")
    shapes = explain(given.people)
    held = {}
    for name, model in learned.models.items():
        report(f"{name} in people and poses that nobody has seen")
        held[name] = Held.of(model, smpl, test.vertices)
    part = torn.weights.toarray().argmax(axis=1)
    outcomes = tuple(outcome(name, learned, given, held[name], part) for name in held)
    chosen = hard_poses(test.poses)
    report("time")
    return Study(
        plan,
        given.said,
        smpl.faces,
        shapes,
        outcomes,
        crease(smpl.template, smpl.faces, part, test.vertices),
        n_seams(smpl.faces, part),
        learned.choices,
        tuple(costs(plan.body, learned.models)),
        smpl,
        test.poses[chosen],
        {name: held[name].only(chosen) for name in SHOWN},
        stages(torn, test.poses[chosen[0]]),
    )


def explain(people: People) -> Shapes:
    """Both bases on those they were learned from, and on strangers about the same mean."""
    learned, others, faces = people.learned, people.strangers, people.body.faces
    most = len(learned) - 1
    by = [
        {"vertices": explained_by_vertices(learned, most, whom),
         "triangles": explained_by_triangles(learned, faces, most, whom)}
        for whom in (None, others)
    ]  # fmt: skip
    return Shapes(by[0], by[1], explained_gradients(learned, faces, most))


def outcome(
    name: str, learned: Learned, given: Registrations, held: Held, part: NDArray[np.int64]
) -> Outcome:
    """One model, measured; parts (F,) are those of SCAPE."""
    model, smpl = learned.models[name], learned.smpl
    gaps = [additivity_gap(model, *at) for at in zip(held.fits.poses, held.fits.betas, strict=True)]
    return Outcome(
        name,
        n_parameters(model),
        learned.left.get(name),
        Held.of(model, smpl, given.people.strangers).rms if name in SHOWN else None,
        held.rms,
        held.mean,
        held.largest,
        crease(smpl.template, smpl.faces, part, held.fits.surfaces),
        1e3 * float(np.sqrt(np.mean(np.sum(np.square(gaps), axis=-1)))),
    )


def hard_poses(poses: Array) -> list[int]:
    """Those of (M, K, 3) rad that turn joints most, no two of them alike; at most five."""
    chosen: list[int] = []
    for i in np.argsort(-np.linalg.norm(poses, axis=2).sum(axis=1)):
        away = [np.sqrt(np.mean(np.sum((poses[i] - poses[j]) ** 2, axis=1))) for j in chosen]
        if min(away, default=np.inf) > APART:
            chosen.append(int(i))
    return chosen[:HARD]


def stages(body: TriangleBody, pose: Array) -> dict[str, Array]:
    """The template's triangles, deformed one by one, and stitched: (F, 3, 3) m each."""
    X = body.deformations(pose, np.zeros(body.n_betas))
    return {
        "template": body.template[body.faces],
        "rigid parts, torn": soup(body.template, body.faces, X),
        "stitched": body.vertices(pose)[body.faces],
    }


def costs(mesh: str, models: Mapping[str, AnyBody]) -> list[Cost]:
    """Of the models that are shown, and of untrained ones on the full mesh."""
    found = [cost(mesh, name, models[name]) for name in SHOWN]
    full: SkinnedBody = load_skinned("full")
    made: dict[str, AnyBody] = {SMPL: full, SCAPE: scape(full), BLEND_SCAPE: blend_scape(full)}
    return found + [cost("full", name, made[name]) for name in SHOWN]
