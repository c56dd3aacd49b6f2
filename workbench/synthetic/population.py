"""A synthetic population of adults at rest, from which shape directions are learned."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array

from workbench.arrays import Array, Mask
from workbench.geometry.solids import volume
from workbench.synthetic.base_mesh import N_BODY, BaseMesh
from workbench.synthetic.rig import Rig
from workbench.synthetic.shape_targets import Person, ShapeTargets
from workbench.synthetic.t_pose import to_t_pose

Report = Callable[[str], None]

DENSITY = 985.0  # kg / m^3, of a human body with air in the lungs
LOCAL_SHARE, LOCAL_SPREAD = 0.5, 0.18  # how many of the local changes a person has; how large
# Found by trial, so that both genders have a body mass index of about 25 +- 4 kg / m^2: the
# artists' bodies are thinner than people, and extending their weight much further looks wrong.
WEIGHT_MEAN, WEIGHT_SPREAD = 0.9, 0.2
GIRTH_MEANS, GIRTH_SPREAD = {"female": 0.15, "male": 0.02}, 0.14


@dataclass(frozen=True, eq=False)
class Population:
    """P adults in the T-pose, pelvis joint at the origin, alike on both sides.

    Attributes:
        female: (P,).
        vertices: (P, 13380, 3) m.
        joints: (P, 24, 3) m.
        keypoints: (P, M, 3) m, those that were asked for.
        masses: (P,) kg.
    """

    female: Mask
    vertices: Array
    joints: Array
    keypoints: Array
    masses: Array


def draw_person(rng: np.random.Generator, female: bool, thicker: Array) -> Person:
    """One adult at random; `thicker` (L,) says which local changes grow with girth."""
    lean = min(abs(rng.normal(0, 0.08)), 0.3)

    def trait(mean: float, std: float, low: float = 0.0, high: float = 1.0) -> float:
        return float(np.clip(rng.normal(mean, std), low, high))

    has = rng.random(len(thicker)) < LOCAL_SHARE
    girth = trait(GIRTH_MEANS["female" if female else "male"], GIRTH_SPREAD, -0.25, 0.45)
    changes = rng.normal(0, LOCAL_SPREAD, len(thicker)) * has + girth * thicker
    return Person(
        gender=1 - lean if female else lean,
        age=float(rng.beta(1.2, 2.0)),
        muscle=trait(0.5, 0.16, 0.05, 0.95),
        weight=trait(WEIGHT_MEAN, WEIGHT_SPREAD, 0.1, 1.2),
        height=trait(0.5, 0.055, 0.3, 0.7),
        proportions=trait(0.55, 0.2),
        cupsize=trait(0.5, 0.2),
        firmness=trait(0.5, 0.2),
        race=tuple(rng.dirichlet([0.6] * 3)),
        local=tuple(changes.clip(-0.5, 0.5)),
    )


def draw_population(
    mesh: BaseMesh,
    rig: Rig,
    weights: Array,
    targets: ShapeTargets,
    keypoints: csr_array,
    *,
    n: int,
    seed: int,
    report: Report,
) -> Population:
    """`n` adults, women and men in turn.

    With `weights` (13380, 24) they are brought into the rest pose; `keypoints` (M, 19158) are means
    of vertices of the base mesh.
    """
    rng = np.random.default_rng(seed)
    people = [draw_person(rng, i % 2 == 0, targets.girth) for i in range(n)]
    vertices, joints = np.empty((n, N_BODY, 3)), np.empty((n, 24, 3))
    marks, masses = np.empty((n, keypoints.shape[0], 3)), np.empty(n)
    for i, person in enumerate(people):
        drawn = targets.coefficients(person) @ targets.displacements
        a_pose = mesh.without_nipples(mesh.symmetrised(mesh.vertices + drawn.reshape(-1, 3)))
        standing = rig.joints @ a_pose
        rest = to_t_pose(a_pose[:N_BODY], standing, rig.knuckles @ a_pose, weights)
        # The head does not turn, so helpers (the eyes) move with the pelvis.
        all_vertices = np.concatenate([rest.vertices, a_pose[N_BODY:] - standing[0]])
        vertices[i], joints[i] = mesh.symmetrised(rest.vertices), rest.joints
        marks[i] = keypoints @ all_vertices
        masses[i] = DENSITY * volume(a_pose[:N_BODY], mesh.triangles)
        if (i + 1) % 100 == 0:
            report(f"  {i + 1} of {n} adults")
    return Population(np.array([p.female for p in people]), vertices, joints, marks, masses)
