"""Poses by principal components, betas of shape and of expression, and the body mass index."""

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
from workbench.bodies.files.joint_names import FINGER_JOINTS, family
from workbench.bodies.readonly import readonly
from workbench.bodies.skinned import SkinnedBody
from workbench.errors import BadArgument, BadBody, UnknownName
from workbench.geometry.solids import volume


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
            if (actual := getattr(self, key).shape) != shape:
                raise BadBody(f"{key} of a pose space has shape {actual}, but must be {shape}")
        if not (self.deviations > 0).all():
            raise BadBody("deviations of a pose space must be above zero")

    @property
    def n_components(self) -> int:
        """C, the number of components."""
        return len(self.deviations)

    def first(self, count: int) -> "PoseSpace":
        """The space of the first components alone. Raises BadArgument if there are fewer."""
        _check_count("components", count, self.n_components)
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
        flat = self.components.reshape(self.n_components, -1).T
        in_space = cs.reshape(cs.MX(cs.DM(self.mean.ravel())) + cs.DM(flat) @ coefficients, 3, -1)
        order = np.argsort([*rows, *others])
        return cs.horzcat(in_space, rest)[:, order.tolist()]

    def poses(self, body: Body, coefficients: ArrayLike) -> Array:
        """Poses (..., K, 3) rad in numbers, of coefficients (..., C); the other joints are zero."""
        z = reals("coefficients", coefficients)
        if z.shape[-1:] != (self.n_components,):
            raise BadArgument(
                f"the pose space has {self.n_components} components, but the coefficients have "
                f"shape {z.shape}"
            )
        poses = np.zeros((*z.shape[:-1], body.n_joints, 3))
        poses[..., self._rows(body), :] = self.mixed(z)
        return poses

    def mixed(self, z: Array) -> Array:
        """The rotation vectors (..., J, 3) rad of the space's own joints: mean + sum z_c comp_c."""
        return np.asarray(self.mean + np.tensordot(z, self.components, (-1, 0)))

    def coefficients(self, body: Body, poses: ArrayLike) -> Array:
        """The coefficients (..., C) of the poses in the space closest to poses (..., K, 3) rad."""
        offsets = reals("poses", poses)[..., self._rows(body), :] - self.mean
        flat = offsets.reshape(*offsets.shape[:-2], -1)
        return np.asarray(flat @ np.linalg.pinv(self.components.reshape(self.n_components, -1)))

    def _rows(self, body: Body) -> list[int]:
        for joint in self.joints:
            if joint not in body.joint_names:
                raise UnknownName("joint", joint, body.joint_names)
        return [body.joint_names.index(joint) for joint in self.joints]


def _check_count(what: str, count: int, available: int) -> None:
    if not 0 <= count <= available:
        raise BadArgument(f"there are {available} {what}; ask for 0 to so many, not {count}")


SIDE_LETTERS = {"left": "l", "right": "r"}  # how keys of SMPL-H's files end


def has_pose_space(body: Body) -> bool:
    """Whether a body's file holds a pose space of all joints below its root."""
    mean = body.extras.get("hands_mean")
    whole = mean is not None and mean.size == 3 * (body.n_joints - 1)
    return whole and "hands_components" in body.extras


def pose_space(body: Body, count: int | None = None, side: str | None = None) -> PoseSpace:
    """The pose space in a body's file: `hands_mean` and `hands_components` of MANO's layout.

    In the layout of SMPL-H there are two, whose keys end in l and r. With `side`, which is `left`
    or `right`, it is that of one hand; without it, that of both hands at once, whose coefficients
    are those of the left hand followed by those of the right one.

    Components are rows. Their deviations are `hands_deviations`, or those of `hands_coeffs`, the
    coefficients of the poses that MANO was trained on, or else one. `count` is the number of
    components of a hand that are kept; None keeps all. Raises BadBody if the body has none, and
    UnknownName for another side.
    """
    if side is not None and side not in SIDE_LETTERS:
        raise UnknownName("side", str(side), SIDE_LETTERS)
    if {"hands_meanl", "hands_meanr"} <= body.extras.keys():
        spaces = []
        for hand in [side] if side is not None else list(SIDE_LETTERS):
            fingers = {f"{hand}_{finger}" for finger in FINGER_JOINTS}
            joints = tuple(name for name in body.joint_names if name in fingers)
            spaces.append(_space(body, SIDE_LETTERS[hand], joints, count))
        return _beside(spaces)
    if side is not None:
        raise BadBody(f"body {body.name!r} has one hand; ask for its pose space without a side")
    return _space(body, "", body.joint_names[1:], count)


def _beside(spaces: list[PoseSpace]) -> PoseSpace:
    """The space of the joints of several, each with coefficients of its own."""
    J = np.cumsum([0, *(len(space.joints) for space in spaces)])
    C = np.cumsum([0, *(space.n_components for space in spaces)])
    components = np.zeros((C[-1], J[-1], 3))
    for i, space in enumerate(spaces):
        components[C[i] : C[i + 1], J[i] : J[i + 1]] = space.components
    return PoseSpace(
        tuple(joint for space in spaces for joint in space.joints),
        np.concatenate([space.mean for space in spaces]),
        components,
        np.concatenate([space.deviations for space in spaces]),
    )


def _space(body: Body, end: str, joints: tuple[str, ...], count: int | None) -> PoseSpace:
    """The first components of the space of some joints, from entries whose keys have this end."""
    keys, extras = (f"hands_mean{end}", f"hands_components{end}"), body.extras
    if not {*keys} <= extras.keys():
        raise BadBody(
            f"body {body.name!r} has no pose space: there are no {' and '.join(keys)} "
            "among its extras; take the embedded body 'hand' or 'full-hands', or a file of MANO "
            "or SMPL-H"
        )
    mean, rows = (reals(key, extras[key]) for key in keys)
    if mean.size != 3 * len(joints) or rows.ndim != 2 or rows.shape[1] != mean.size:
        where = "below its root" if not end else f"of the hand {end!r}"
        raise BadBody(
            f"body {body.name!r} has {len(joints)} joints {where}, but {keys[0]} of shape "
            f"{mean.shape} and {keys[1]} of shape {rows.shape}"
        )
    if not (np.isfinite(mean).all() and np.isfinite(rows).all()):
        raise BadBody(f"body {body.name!r} has numbers in {' or '.join(keys)} that are not finite")
    components = rows.reshape(len(rows), len(joints), 3)
    deviations = _deviations(extras, end, len(rows))
    space = PoseSpace(joints, mean.reshape(-1, 3), components, deviations)
    return space if count is None else space.first(count)


def _deviations(extras: Mapping[str, NDArray[Any]], end: str, count: int) -> Array:
    if f"hands_deviations{end}" in extras:
        return reals(f"hands_deviations{end}", extras[f"hands_deviations{end}"])
    coefficients = extras.get(f"hands_coeffs{end}")
    if coefficients is None or coefficients.ndim != 2:
        return np.ones(count)
    if coefficients.shape[1] == count and len(coefficients) > 1:
        with np.errstate(over="ignore", invalid="ignore"):
            spread = reals(f"hands_coeffs{end}", coefficients).std(axis=0)
        return spread if ((spread > 0) & np.isfinite(spread)).all() else np.ones(count)
    return np.ones(count)


WITH_FACE = ("SMPL-X", "FLAME")
FACE_BETAS = {400: (300, 100), 20: (10, 10)}  # of shape and of expression, by their number


@dataclass(frozen=True)
class ShapeSpace:
    """Which of B betas are the shape's, and which the expression's.

    Attributes:
        n_betas: B.
        shape: the rows of betas that are the person's shape.
        expression: the rows that are the expression of the face; empty for a body without a face.
    """

    n_betas: int
    shape: range
    expression: range

    def first(self, shape: int, expression: int = 0) -> "ShapeSpace":
        """The space of the first few coefficients of shape and expression; all others stay zero.

        Raises BadArgument if there are fewer.
        """
        _check_count("coefficients of shape", shape, len(self.shape))
        _check_count("coefficients of expression", expression, len(self.expression))
        return replace(self, shape=self.shape[:shape], expression=self.expression[:expression])

    def betas(self, shape: cs.MX, expression: cs.MX | None = None) -> cs.MX:
        """The betas (B, 1) of a shape (S, 1) and an expression (E, 1), zero without one.

        The map is affine, so that a body takes it wherever it takes betas.
        """
        parts = [(self.shape, shape, "shape")]
        if expression is not None:
            parts.append((self.expression, expression, "expression"))
        total = cs.MX(self.n_betas, 1)
        for rows, part, what in parts:
            if part.shape != (len(rows), 1):
                raise BadArgument(
                    f"the {what} is an expression ({len(rows)}, 1) here, not {part.shape}"
                )
            placed = cs.DM(np.eye(self.n_betas)[:, rows.start : rows.stop])
            total = total + cs.sparsify(placed) @ part
        return total

    def numbers(self, shape: ArrayLike = (), expression: ArrayLike = ()) -> Array:
        """The same in numbers: betas (..., B) of a shape (..., S) and an expression (..., E).

        Fewer coefficients than there are stand for the first ones; the others are zero. Raises
        BadArgument for too many.
        """
        parts = [reals("the shape", shape), reals("the expression", expression)]
        front = np.broadcast_shapes(*(part.shape[:-1] for part in parts))
        betas = np.zeros((*front, self.n_betas))
        for rows, part, what in zip(
            (self.shape, self.expression), parts, ("shape", "expression"), strict=True
        ):
            if part.shape[-1] > len(rows):
                raise BadArgument(
                    f"there are {len(rows)} coefficients of {what}, and {part.shape[-1]} were given"
                )
            betas[..., rows.start : rows.start + part.shape[-1]] = part
        return betas


def shape_space(body: Body) -> ShapeSpace:
    """Which betas of a body are the shape's, and which the expression's.

    SMPL-X and FLAME with 400 betas have 300 of shape and 100 of expression, with 20 they have 10 of
    each. All betas of other bodies, and of SMPL-X and FLAME in other numbers, are of shape.
    """
    B = body.n_betas
    with_face = family(body.n_joints, body.parents) in WITH_FACE
    shape = FACE_BETAS[B][0] if with_face and B in FACE_BETAS else B
    return ShapeSpace(B, range(shape), range(shape, B))


DENSITY = 985.0  # kg/m^3, of a person with air in the lungs


def body_mass_index(body: Body, betas: ArrayLike | None = None) -> float:
    """The body mass index in kg/m^2 of the person with these betas, at rest.

    It is the volume of the surface times 985 kg/m^3 over the square of the height, from the lowest
    vertex to the highest one. Neither the embedded bodies nor their people were weighed.
    """
    surface = body.vertices(body.bind_pose, betas)
    height = float(np.ptp(surface[:, 1]))
    return DENSITY * volume(surface, body.faces) / height**2


def body_mass_index_of(body: SkinnedBody, betas: cs.MX) -> cs.MX:
    """`body_mass_index` (1, 1) in symbols, of betas (B, 1).

    The height is from the vertex that is lowest at these betas to the one that is highest, so that
    its derivatives jump where another vertex becomes one of them.
    """
    N = body.n_vertices
    flat = cs.DM(body.template.ravel()) + cs.DM(body.shapedirs.reshape(3 * N, -1)) @ betas
    rest = cs.reshape(flat, 3, N)
    around = rest - cs.sum2(rest) / N @ cs.DM.ones(1, N)
    a, b, c = (around[:, corner.tolist()] for corner in body.faces.T)
    inside = cs.dot(a, cs.cross(b, c, 1)) / 6  # m^3
    return DENSITY * inside / (cs.mmax(rest[1, :]) - cs.mmin(rest[1, :])) ** 2
