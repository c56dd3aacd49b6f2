"""The vertices that the package smplx shows as joints 24 to 44, for bodies of any topology."""

from dataclasses import dataclass

import numpy as np

from workbench.arrays import Array
from workbench.bodies.skinned import SkinnedBody


@dataclass(frozen=True)
class Extra:
    """A point on the skin: a landmark, or else the skin of some joints farthest in a direction.

    Attributes:
        landmark: the name of the landmark; that of a finger may end in `_tip`.
        joints: the names of the joints.
        direction: for the body's left side; on the right, x has the other sign.
    """

    landmark: str
    joints: tuple[str, ...]
    direction: tuple[float, float, float]


HEAD, FOOT, HAND = ("head",), ("ankle", "foot"), ("wrist", "hand")


def _finger(name: str) -> tuple[str, ...]:
    """The joints whose skin has the tip of a finger: its own, or the hand's if it has none."""
    return (*HAND, *(f"{name}{i}" for i in (1, 2, 3)))


# The name in smplx with the letter of its side, and what it is on the left. Directions are those in
# a T-pose, palms down; they matter only for bodies without such landmarks.
SIDED = (
    ("{0}eye", Extra("eye", HEAD, (0.5, 0.5, 1.0))),
    ("{0}ear", Extra("ear", HEAD, (1.0, 0.0, 0.0))),
    ("{1}BigToe", Extra("big_toe", FOOT, (-0.3, 0.0, 1.0))),
    ("{1}SmallToe", Extra("small_toe", FOOT, (0.7, 0.0, 1.0))),
    ("{1}Heel", Extra("heel", FOOT, (0.0, -0.3, -1.0))),
    ("{0}thumb", Extra("thumb", _finger("thumb"), (0.5, 0.0, 1.0))),
    ("{0}index", Extra("index", _finger("index"), (1.0, 0.0, 0.4))),
    ("{0}middle", Extra("middle", _finger("middle"), (1.0, 0.0, 0.1))),
    ("{0}ring", Extra("ring", _finger("ring"), (1.0, 0.0, -0.2))),
    ("{0}pinky", Extra("pinky", _finger("pinky"), (1.0, 0.0, -0.6))),
)
SIDES = (("l", "left", 1.0), ("r", "right", -1.0))


def extras() -> dict[str, Extra]:
    """The 21 names that smplx asks for, each with what it is on a body."""
    found = {"nose": Extra("nose", HEAD, (0.0, 0.0, 1.0))}
    for letter, side, sign in SIDES:
        for name, left in SIDED:
            joints = HEAD if left.joints == HEAD else tuple(f"{side}_{j}" for j in left.joints)
            x, y, z = left.direction
            extra = Extra(f"{side}_{left.landmark}", joints, (sign * x, y, z))
            found[name.format(letter, letter.upper())] = extra
    return found


def vertex_ids(body: SkinnedBody) -> dict[str, int]:
    """The number of a vertex for each of smplx's 21 names: nose, leye, LBigToe, lthumb, ...

    The vertex nearest to the body's landmark of that name in the template, or, where it has
    none, a guess from the template's geometry.
    """
    points = _landmarks(body)
    found = {}
    for name, extra in extras().items():
        known = [one for one in (extra.landmark, f"{extra.landmark}_tip") if one in points]
        place = _nearest(body.template, points[known[0]]) if known else _farthest(body, extra)
        found[name] = place
    return found


def _landmarks(body: SkinnedBody) -> dict[str, Array]:
    return {
        name: point
        for landmarks in body.landmarks.values()
        for name, point in zip(landmarks.names, landmarks.regressor @ body.template, strict=True)
    }


def _nearest(template: Array, point: Array) -> int:
    return int(np.argmin(np.linalg.norm(template - point, axis=1)))


def _farthest(body: SkinnedBody, extra: Extra) -> int:
    """Among the vertices that move mostly with the joints; among all, if there are none."""
    mine = np.isin(np.array(body.joint_names)[body.weights.argmax(axis=1)], extra.joints)
    along = body.template @ np.array(extra.direction)
    return int(np.argmax(np.where(mine, along, -np.inf) if mine.any() else along))
