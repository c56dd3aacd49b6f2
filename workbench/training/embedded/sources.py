"""What every embedded body is made from: the base mesh, its rig, and people on it."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from workbench.training.embedded.base_mesh import N_BODY, BaseMesh, read_base_mesh
from workbench.training.embedded.population import Population, draw_population
from workbench.training.embedded.rig import at_most_four, read_rig
from workbench.training.embedded.shape_targets import read_shape_targets
from workbench.training.embedded.wheel import Wheel

Array = NDArray[np.float64]
Report = Callable[[str], None]

SEARCH_RADIUS = {"joints": 0.25, "keypoints": 0.15}  # m, of the vertices that may give a point


@dataclass(frozen=True, eq=False)
class Sources:
    """Everyone on the base mesh, whichever body's mesh they will be seen on."""

    wheel: Wheel
    mesh: BaseMesh
    population: Population
    weights: Array  # (13380, 24)
    fine_weights: Array  # (13380, 32)
    keypoint_names: tuple[str, ...]


def gather_sources(wheel: Wheel, people: int, seed: int, report: Report) -> Sources:
    """Read the wheel and draw so many people."""
    mesh = read_base_mesh(wheel)
    rig = read_rig(wheel, mesh)
    weights = at_most_four(rig.weights, mesh.mirror[:N_BODY])
    report("reading the shape targets")
    targets = read_shape_targets(wheel, len(mesh.vertices))
    keypoints = wheel.tensors("keypoints/coco.pth")
    report(f"drawing and un-posing {people} adults")
    population = draw_population(
        mesh,
        rig,
        weights,
        targets,
        csr_array(np.array([row / row.sum() for row in keypoints.values()])),
        n=people,
        seed=seed,
        report=report,
    )
    return Sources(wheel, mesh, population, weights, rig.fine_weights, tuple(keypoints))
