"""Held-out people at rest, from whom no shape space was learned."""

from pathlib import Path

import numpy as np

from builder.base_mesh import read_topology
from builder.packing import write_arrays
from builder.population import Sources
from workbench.synthetic.teacher import BODIES

PEOPLE, SEED = 4, 1000  # how many, and a seed with which nobody else was drawn


def write_held_out_people(sources: Sources, folder: Path) -> Path:
    """Write `held_out_people.npz`: for each body the rest vertices (4, N, 3) m of new people.

    `sources` must hold a population of its own, drawn with another seed.
    """
    people = sources.population.vertices[:PEOPLE]
    arrays = {
        name: read_topology(sources.wheel, name, sources.mesh).vertices(people).astype(np.float32)
        for name in BODIES
    }
    path = folder / "held_out_people.npz"
    write_arrays(path, arrays)
    return path
