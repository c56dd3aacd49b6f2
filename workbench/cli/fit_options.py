"""What options of `workbench fit` mean: the recipe of an image, and its size."""

import re
from dataclasses import replace

from workbench.errors import BadArgument
from workbench.fitting.body_priors import checked_height
from workbench.fitting.images import ByHeight, WithStature


def recipe_of(height: float | None, sigma: float | None) -> ByHeight:
    """How one image is fitted, with a known stature, and with another sigma of keypoints."""
    recipe = ByHeight(sigma=sigma)
    if height is None:
        return recipe
    checked_height(height)
    return replace(recipe, priors=WithStature(height))


def size_of(text: str | None) -> tuple[int, int] | None:
    """Width and height in px of text such as 1920x1080. Raises BadArgument."""
    if text is None:
        return None
    found = re.fullmatch("([1-9][0-9]{0,5})x([1-9][0-9]{0,5})", text.strip().lower())
    if not found:
        raise BadArgument(f"--size takes WIDTHxHEIGHT in px, such as 1920x1080; not {text!r}")
    return int(found[1]), int(found[2])
