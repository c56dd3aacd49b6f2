"""Poses of some joints as a mean and principal components: hands by a few coefficients.

    theta = mean + sum over components c of z_c component_c

is an affine map of the coefficients z, so that it stands for a pose wherever a body takes one
(Romero, Tzionas and Black, Embodied Hands, 2017). In MANO's files the zero pose is a flat hand, and
not the mean; the mean is part of theta and is added nowhere else.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike, NDArray

from workbench.arrays import Array
from workbench.blocks import Block
from workbench.blocks.checks import reals, texts
from workbench.bodies.body import Body
from workbench.bodies.files.joint_names import FINGERS
from workbench.bodies.readonly import readonly
from workbench.errors import BadArgument, BadBody, UnknownName

HANDS = {side: tuple(f"{side}_{name}" for name in FINGERS) for side in ("left", "right")}


@dataclass(frozen=True, eq=False)
class PoseSpace:
    """Principal components of the poses of some joints of a body.

    The arrays are read-only copies. Raises NotNumbers, and BadBody if they do not fit together.

    Attributes:
        joints: the names of J joints.
        mean: (J, 3) rad, the pose where all coefficients are zero.
        components: (C, J, 3) rad per unit of a coefficient.
        deviations: (C,) the standard deviation of each coefficient.
    """

    joints: tuple[str, ...]
    mean: Array
    components: Array
    deviations: Array

    def __post_init__(self) -> None:
        self.__dict__["joints"] = texts("the joints of a pose space", self.joints, BadBody)
        for key in ("mean", "components", "deviations"):
            self.__dict__[key] = readonly(f"{key} of a pose space", getattr(self, key))
        J, C = len(self.joints), len(np.atleast_1d(self.deviations))
        for key, shape in (("mean", (J, 3)), ("components", (C, J, 3)), ("deviations", (C,))):
            if getattr(self, key).shape != shape:
                raise BadBody(
                    f"{key} of a pose space of {J} joints and {C} components have shape "
                    f"{getattr(self, key).shape}, but must be {shape}"
                )
        for key in ("mean", "components", "deviations"):
            if not np.isfinite(getattr(self, key)).all():
                raise BadBody(f"{key} of a pose space hold numbers that are not finite")
        if not (self.deviations > 0).all():
            raise BadBody("deviations of a pose space must be above zero")

    @property
    def n_components(self) -> int:
        """C, the number of components."""
        return len(self.deviations)

    def first(self, count: int) -> "PoseSpace":
        """The space of the first components alone. Raises BadArgument if there are fewer."""
        if not 0 <= count <= self.n_components:
            raise BadArgument(
                f"the pose space has {self.n_components} components; ask for 0 to so many, not "
                f"{count}"
            )
        return replace(self, components=self.components[:count], deviations=self.deviations[:count])

    def block(self, prefix: str = "") -> Block:
        """A new block `coefficients` (C,): list it among the `blocks` of a problem."""
        labels = tuple(f"component {i + 1}" for i in range(self.n_components))
        return Block(prefix + "coefficients", (self.n_components,), "1", labels)

    def pose(self, body: Body, coefficients: cs.MX, rest: cs.MX) -> cs.MX:
        """The pose (3, K) of a body whose joints in the space follow the coefficients (C, 1).

        `rest` (3, K - J) are the rotation vectors of the body's other joints, in its order: for a
        hand that of the wrist alone. Raises UnknownName for a joint that the body does not have.
        """
        rows = self._rows(body)
        others = [k for k in range(body.n_joints) if k not in rows]
        if rest.shape != (3, len(others)):
            raise BadArgument(
                f"body {body.name!r} has {len(others)} joints outside of the pose space; their "
                f"rotations are an expression (3, {len(others)}), not {rest.shape}"
            )
        flat = self.components.reshape(self.n_components, 3 * len(self.joints)).T
        own = cs.reshape(cs.MX(cs.DM(self.mean.ravel())) + cs.DM(flat) @ coefficients, 3, -1)
        order = np.argsort([*rows, *others])
        return cs.horzcat(own, rest)[:, order.tolist()]

    def poses(self, body: Body, coefficients: ArrayLike) -> Array:
        """Poses (..., K, 3) rad in numbers, of coefficients (..., C); the other joints are zero."""
        z = reals("coefficients", coefficients)
        if z.shape[-1:] != (self.n_components,):
            raise BadArgument(
                f"the pose space has {self.n_components} components, but the coefficients have "
                f"shape {z.shape}"
            )
        found = np.zeros((*z.shape[:-1], body.n_joints, 3))
        found[..., self._rows(body), :] = self.mean + np.tensordot(z, self.components, (-1, 0))
        return found

    def coefficients(self, body: Body, poses: ArrayLike) -> Array:
        """The coefficients (..., C) of the poses in the space closest to poses (..., K, 3) rad."""
        own = reals("poses", poses)[..., self._rows(body), :] - self.mean
        flat = own.reshape(*own.shape[:-2], -1)
        return np.asarray(
            flat @ np.linalg.pinv(self.components.reshape(self.n_components, 3 * len(self.joints)))
        )

    def _rows(self, body: Body) -> list[int]:
        for joint in self.joints:
            if joint not in body.joint_names:
                raise UnknownName("joint", joint, body.joint_names)
        return [body.joint_names.index(joint) for joint in self.joints]


def pose_space(body: Body, count: int | None = None, hand: str | None = None) -> PoseSpace:
    """The pose space in a body's file: `hands_mean` and `hands_components` of MANO's layout.

    Files of whole bodies (SMPL-H, SMPL-X) have one for each hand, under `hands_meanl` and
    `hands_meanr` and so on; `hand` is `left` or `right` then, and the joints are the 15 of its
    fingers. Components are rows. Their deviations are `hands_deviations`, or those of
    `hands_coeffs`, the coefficients of the poses that MANO was trained on, or else one. `count` is
    the number of components that are kept; None keeps all. Raises BadBody if the body has none.
    """
    extras, letter = body.extras, _letter(body, hand)
    mean_key, rows_key = (f"hands_{what}{letter}" for what in ("mean", "components"))
    if not {mean_key, rows_key} <= extras.keys():
        raise BadBody(
            f"body {body.name!r} has no pose space: there are no {mean_key} and {rows_key} "
            "among its extras; take the embedded body 'hand', or a file of MANO or SMPL-H"
        )
    names = body.joint_names
    joints = tuple(n for n in names if n in HANDS[hand]) if hand in HANDS and letter else names[1:]
    mean, rows = (reals(key, extras[key]) for key in (mean_key, rows_key))
    if mean.size != 3 * len(joints) or rows.ndim != 2 or rows.shape[1] != mean.size:
        raise BadBody(
            f"body {body.name!r} has {len(joints)} joints {_where(letter)}, but {mean_key} of "
            f"shape {mean.shape} and {rows_key} of shape {rows.shape}"
        )
    components = rows.reshape(len(rows), len(joints), 3)
    deviations = _deviations(extras, letter, len(rows))
    space = PoseSpace(joints, mean.reshape(-1, 3), components, deviations)
    return space if count is None else space.first(count)


def _letter(body: Body, hand: str | None) -> str:
    """What the keys of the hand's arrays end in: nothing in a file of a single hand, or l or r."""
    both = "hands_meanl" in body.extras or "hands_meanr" in body.extras
    if not both:
        return ""
    if hand not in HANDS:
        raise BadBody(
            f"body {body.name!r} has a pose space for each hand; ask for hand='left' or "
            f"hand='right', not for {hand!r}"
        )
    return hand[0]


def _where(letter: str) -> str:
    return {"": "below its root", "l": "in its left hand", "r": "in its right hand"}[letter]


def _deviations(extras: Mapping[str, NDArray[Any]], letter: str, count: int) -> Array:
    if f"hands_deviations{letter}" in extras:
        return reals("hands_deviations", extras[f"hands_deviations{letter}"])
    coefficients = extras.get(f"hands_coeffs{letter}")
    if coefficients is None or coefficients.ndim != 2:
        return np.ones(count)
    if coefficients.shape[1] == count and len(coefficients) > 1:
        with np.errstate(over="ignore", invalid="ignore"):
            spread = np.asarray(coefficients.std(axis=0), dtype=np.float64)
        return spread if ((spread > 0) & np.isfinite(spread)).all() else np.ones(count)
    return np.ones(count)
