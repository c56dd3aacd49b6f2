"""Hands of a synthetic population, flat and at rest."""

from dataclasses import dataclass, replace

import numpy as np

from builder.base_mesh import BaseMesh
from builder.hands.anatomy import HandMesh
from builder.hands.rest import to_flat
from builder.population import Person, Report, ShapeTargets, draw_person
from workbench.arrays import Array, Mask

SPREAD = 0.3  # of the local changes of hands and arms, which every person has


@dataclass(frozen=True, eq=False)
class Hands:
    """Right hands of P adults, flat, palm down, the wrist joint at the origin.

    Attributes:
        female: (P,).
        vertices: (P, N, 3) m.
        joints: (P, 16, 3) m.
        ends: (P, 5, 3) m, of the last bones.
    """

    female: Mask
    vertices: Array
    joints: Array
    ends: Array


def draw_hands(
    mesh: BaseMesh, hand: HandMesh, targets: ShapeTargets, n: int, seed: int, report: Report
) -> Hands:
    """`n` hands, of women and men in turn."""
    rng = np.random.default_rng(seed)
    own = np.array([name.startswith(("hands/", "arms/")) for name in targets.local])
    vertices = np.empty((n, len(hand.vertices), 3))
    joints, ends = np.empty((n, 16, 3)), np.empty((n, 5, 3))
    for i in range(n):
        person = with_hands(draw_person(rng, i % 2 == 0, targets.girth), own, rng)
        drawn = targets.coefficients(person) @ targets.displacements
        body = mesh.vertices + drawn.reshape(-1, 3)
        rest, ends[i] = to_flat(
            body[hand.vertices], hand.joints @ body, hand.ends @ body, hand.weights
        )
        vertices[i], joints[i] = rest.vertices, rest.joints
        if (i + 1) % 100 == 0:
            report(f"  {i + 1} of {n} hands")
    return Hands(np.arange(n) % 2 == 0, vertices, joints, ends)


def with_hands(person: Person, own: Mask, rng: np.random.Generator) -> Person:
    """The person with local changes of hands and arms drawn anew; `own` (L,) says which are."""
    changes = np.where(own, rng.normal(0, SPREAD, len(own)).clip(-0.8, 0.8), person.local)
    return replace(person, local=tuple(changes))
