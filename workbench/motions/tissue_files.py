"""Soft tissue in files, and the one that comes with the workbench."""

import json
from importlib.resources import as_file, files
from pathlib import Path

import numpy as np

from workbench.environment import expanded
from workbench.errors import BadArgument, BadFile
from workbench.motions.soft_tissue import SoftTissue
from workbench.reading.arrays import opened, read_expected, reals, texts, wholes
from workbench.writing import write_arrays

EMBEDDED = ("default",)
EXPECTED = {
    "directions": reals("N", 3, "C"),
    "first": reals("C", "C"),
    "second": reals("C", "C"),
    "response": reals("C", "X"),
    "part": wholes("N"),
    "fps": reals(),
    "power": reals(),
    "n_betas": wholes(),
    "joint_names": texts("K"),
    "card": texts(),
}


def save_tissue(path: str | Path, tissue: SoftTissue) -> None:
    """Write soft tissue as an .npz, in single precision. Raises BadFile."""
    reals_of = ("directions", "first", "second", "response", "fps", "power")
    arrays = {name: np.asarray(getattr(tissue, name), np.float32) for name in reals_of}
    others = {
        "part": tissue.part.astype(np.int16),
        "n_betas": np.array(tissue.n_betas),
        "joint_names": np.array(tissue.joint_names),
        "card": np.array(json.dumps(dict(tissue.card))),
    }
    write_arrays(path, {**arrays, **others})


def load_tissue(name_or_path: str | Path = "default") -> SoftTissue:
    """The embedded soft tissue of the body `default`, or that of a file of `save_tissue`.

    The embedded one was learned from simulated tissue (`data/tissue/PROVENANCE.md`). Raises BadFile
    if there is no such file, or it holds something else.
    """
    if isinstance(name_or_path, str) and name_or_path in EMBEDDED:
        with as_file(files("workbench") / "data" / "tissue" / f"{name_or_path}.npz") as path:
            return _read(path)
    path = expanded(name_or_path)
    if not path.exists():
        raise BadFile(
            f"no soft tissue is called {str(name_or_path)!r}, and there is no such file; there is "
            f"{EMBEDDED[0]!r}, or give an .npz that save_tissue wrote"
        )
    return _read(path)


def _read(path: Path) -> SoftTissue:
    with opened(path, "soft tissue", "give an .npz that save_tissue wrote") as archive:
        found = read_expected(archive, EXPECTED)
        try:
            card = json.loads(str(found["card"]))
            return SoftTissue(
                directions=found["directions"],
                first=found["first"],
                second=found["second"],
                response=found["response"],
                part=found["part"],
                fps=float(found["fps"]),
                joint_names=tuple(map(str, found["joint_names"])),
                n_betas=int(found["n_betas"]),
                power=float(found["power"]),
                card=card if isinstance(card, dict) else {},
            )
        except (BadArgument, ValueError) as error:
            raise BadFile(str(error)) from error
