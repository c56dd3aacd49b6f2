"""People whom the shape spaces were not learned from, to be registered."""

from pathlib import Path
from typing import Any

import numpy as np

from workbench.training.embedded.sources import Sources
from workbench.training.embedded.topology import read_topology
from workbench.writing import replacing

BODIES = ("default", "small")
PEOPLE, SEED = 4, 1000  # how many, and a seed that nobody else was drawn with


def write_strangers(sources: Sources, folder: Path) -> Path:
    """`strangers.npz`: per body the rest vertices (4, N, 3) m of new draws.

    `sources` must hold a population of its own, drawn with another seed.
    """
    people = sources.population.vertices[:PEOPLE]
    arrays: dict[str, Any] = {}
    for name in BODIES:
        follows = read_topology(sources.wheel, name, sources.mesh).follows
        arrays[name] = np.stack([follows @ person for person in people]).astype(np.float32)
    path = folder / "strangers.npz"
    with replacing(path) as temporary, temporary.open("wb") as file:
        np.savez_compressed(file, **arrays)
    return path
