"""The base mesh, its rig, and people on it, from which embedded bodies and sets are made."""

from dataclasses import dataclass

from scipy.sparse import csr_array

from workbench.arrays import Array
from workbench.synthetic.base_mesh import N_BODY, BaseMesh, read_base_mesh
from workbench.synthetic.population import Population, Report, draw_population
from workbench.synthetic.rig import at_most_four, read_rig
from workbench.synthetic.shape_targets import read_shape_targets
from workbench.synthetic.wheel import Wheel

JITTER = 0.05  # rad, of every joint about every axis: no two people at rest stand alike
SEARCH_RADIUS = {"joints": 0.25, "keypoints": 0.15}  # m, of the vertices that may give a point


@dataclass(frozen=True, eq=False)
class Sources:
    """Everyone on the base mesh, before any body's own mesh is chosen.

    Attributes:
        weights: (13380, 24), for linear blend skinning.
        fine_weights: (13380, 32), for the teacher.
    """

    wheel: Wheel
    mesh: BaseMesh
    population: Population
    weights: Array
    fine_weights: Array


def gather_sources(
    wheel: Wheel, people: int, seed: int, report: Report, keypoints: csr_array | None = None
) -> Sources:
    """Read the wheel and draw so many people.

    `keypoints` (M, 19158) are weighted means of base vertices that are wanted of every person.
    """
    mesh = read_base_mesh(wheel)
    rig = read_rig(wheel, mesh)
    weights = at_most_four(rig.weights, mesh.mirror[:N_BODY])
    report("reading the shape targets")
    targets = read_shape_targets(wheel, len(mesh.vertices))
    report(f"drawing and un-posing {people} adults")
    population = draw_population(
        mesh,
        rig,
        weights,
        targets,
        csr_array((0, len(mesh.vertices))) if keypoints is None else keypoints,
        n=people,
        seed=seed,
        report=report,
    )
    return Sources(wheel, mesh, population, weights, rig.fine_weights)
