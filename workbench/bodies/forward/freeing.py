"""Which arrays of a skinned body can be unknowns."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from workbench.errors import BadBody, UnknownName

if TYPE_CHECKING:
    from workbench.bodies.skinned import SkinnedBody

FREEABLE = {
    "template": "m",
    "shapedirs": "m",
    "posedirs": "m",
    "J_regressor": "1",
    "weights": "1",
    "joints": "m",  # at rest, (K, 3), in place of J_regressor (T + S betas)
}


def check_freeable(body: SkinnedBody, names: Sequence[object]) -> None:
    """Return if these arrays can be free together with those that are.

    Raises UnknownName, or BadBody for a regressor of joints that are free or given.
    """
    for name in names:
        if not isinstance(name, str) or name not in FREEABLE:
            raise UnknownName("array to free", str(name), FREEABLE)
    free = {*names, *body.free}
    if "J_regressor" in free and ("joints" in free or body.rest_joints is not None):
        raise BadBody(
            f"body {body.name!r}: nothing would read J_regressor where the joints are free or "
            "given; free one of the two, and take dataclasses.replace(body, rest_joints=None) "
            "for the joints that J_regressor finds"
        )
