"""Findings about betas: how many there are, of which kind, and whether they do anything."""

from collections.abc import Iterator

import numpy as np

from workbench.bodies.checking.findings import FileFinding, counted
from workbench.bodies.checking.model_arrays import ModelArrays
from workbench.bodies.shape_space import COUNTS, WITH_FACE

RELEASED = {"SMPL": 300, "STAR": 300, "SMPL-X": 400, "FLAME": 400}  # directions, in the full files
DECLARED = ("num_betas", "n_betas", "num_shape_coeffs", "shape_dim")  # keys that say their number
NOTHING = 1e-9  # of the largest direction, below which a direction moves nothing


def model_of(model: ModelArrays) -> str:
    """The family, or STAR by its pose features."""
    P = 0 if model.posedirs is None else model.posedirs.shape[2]
    K = model.n_joints
    return "STAR" if K > 1 and P == 4 * (K - 1) + 1 else model.family


def about_spaces(model: ModelArrays) -> Iterator[FileFinding]:
    """The number of shape directions, against the file's own words and those of its release."""
    if model.shapedirs is None:
        return
    B, name = model.shapedirs.shape[2], model_of(model)
    if not B:
        yield FileFinding(
            "shapedirs", "There are no shape directions: everybody has the same shape.", False
        )
        return
    acting = _acting(model)
    if acting < B:
        yield FileFinding(
            "shapedirs",
            f"Only the first {acting} of {B} shape directions do anything; the others are zero, "
            "and their betas cannot be found by any fit. Take the file with all directions, or "
            f"keep shapedirs[:, :, :{acting}].",
        )
    for key in DECLARED:
        said = model.scalar(key)
        if said is not None and said != B:
            yield FileFinding(
                key,
                f"The file says {said} in {key}, but shapedirs has "
                f"{counted(B, 'direction', 'directions')}: {_which(said, B)}",
            )
    if "card" not in model.raw or name in WITH_FACE:  # the workbench's own bodies are no release
        yield from _cut(name, B)


def _which(said: int, B: int) -> str:
    if said > B:
        return (
            f"it was cut to {B} of {said}, and betas that were fitted with more do not belong to "
            f"it. Take the file with all {said}, or use the first {B} betas alone."
        )
    return f"it asks for the first {said}. Keep shapedirs[:, :, :{said}], or correct the number."


def _cut(name: str, B: int) -> Iterator[FileFinding]:
    full = RELEASED.get(name)
    if full is None or full == B:
        return
    if name not in WITH_FACE:
        yield FileFinding(
            "shapedirs",
            f"There are {B} shape directions, and {name} was released with up to {full} too. Betas "
            f"beyond the first {B} have no meaning here: take the larger file if you have them.",
            warning=False,
        )
    elif B in COUNTS:
        yield FileFinding(
            "shapedirs",
            f"There are {COUNTS[B][0]} directions of shape and {COUNTS[B][1]} of expression, of "
            f"300 and 100 in the full file of {name}. Expressions begin at beta {COUNTS[B][0]} "
            "here, and at beta 300 there: do not copy betas from one to the other.",
            warning=False,
        )
    else:
        yield FileFinding(
            "shapedirs",
            f"There are {B} shape directions, but files of {name} have 400 (300 of shape and 100 "
            "of expression) or 20 (10 of each). Here all of them count as shape, and the package "
            "smplx takes directions 10 to 19 for expressions. Take a file of 400 or 20.",
        )


def _acting(model: ModelArrays) -> int:
    """The number of the first directions up to the last one that is not zero."""
    if model.shapedirs is None:
        return 0
    largest = np.abs(model.shapedirs).max(axis=(0, 1), initial=0.0)
    acting = np.flatnonzero(largest > NOTHING * max(largest.max(initial=0.0), 1e-300))
    return int(acting[-1]) + 1 if len(acting) else 0
