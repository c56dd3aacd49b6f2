"""A body in a mirror: a left hand from a right one."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from workbench.bodies.landmarks import Landmarks
from workbench.bodies.skinned import SkinnedBody
from workbench.errors import NotSupported
from workbench.geometry.mirror import AXIAL, REFLECTION, Mirror, opposite

TURNED = ("hands_mean", "hands_components")  # flat rotation vectors, one after another
OTHERS = ("hands_deviations", "hands_coeffs")  # numbers of the same components


def mirrored(body: SkinnedBody, name: str) -> SkinnedBody:
    """The body seen in a mirror, x -> -x, under another name: every vertex, joint and shape.

    Vertices and joints keep their numbers, and faces look outwards again. Where its pose is
    theta * (1, -1, -1) and trans is reflected, its vertices are those of the body reflected, for
    all betas. Names change sides (left_index1 becomes right_index1). What is a position or a
    direction in space (template, shapedirs, posedirs) turns its x; a file of a left MANO whose
    shapedirs were not turned puts vertices centimetres away.

    Raises NotSupported for a body that does not have SMPL's pose features, is bound in a pose, or
    has free arrays or capsules.
    """
    if not body.is_smpl or body.bound_in is not None or body.free or body.capsules is not None:
        raise NotSupported(
            f"body {body.name!r} cannot be mirrored: only bodies with SMPL's skinning and pose "
            "features, without free arrays, capsules and a pose that they are bound in, can"
        )
    mirror = Mirror(np.arange(body.n_vertices), np.arange(body.n_joints))
    joints = body.rest_joints
    return replace(
        body,
        template=mirror.points(body.template),
        shapedirs=mirror.directions(body.shapedirs),
        posedirs=mirror.posedirs(body.posedirs),
        faces=body.faces[:, [0, 2, 1]],
        joint_names=tuple(map(opposite, body.joint_names)),
        rest_joints=None if joints is None else joints * REFLECTION,
        landmarks={
            key: Landmarks(tuple(map(opposite, some.names)), csr_array(some.regressor))
            for key, some in body.landmarks.items()
        },
        extras=_other_hands(body.extras),
        name=name,
        card={**body.card, "name": name, "mirrored": f"{body.name} in a mirror, x -> -x"},
    )


def _other_hands(extras: Mapping[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
    """The pose space of a hand in the mirror; of two hands, each becomes that of the other."""
    found = dict(extras)
    for end, other in (("", ""), ("l", "r"), ("r", "l")):
        for key in (*TURNED, *OTHERS):
            if key + end in extras:
                own = extras[key + end]
                found[key + other] = _turned(own) if key in TURNED else own
    return found


def _turned(rows: NDArray[Any]) -> NDArray[Any]:
    turned = rows.reshape(*rows.shape[:-1], -1, 3) * AXIAL
    return np.asarray(turned.reshape(rows.shape))
