"""The animation of a glTF file: for each moving node its rotation, translation and scale in time.

Khronos Group, glTF 2.0 Specification, section 3.11 and appendix C (interpolation).
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from workbench.arrays import Array, Mask
from workbench.errors import shown
from workbench.geometry.gltf import GlbDocument, several

WIDTHS = {"rotation": 4, "translation": 3, "scale": 3}
LINEAR, STEP, CUBIC = "LINEAR", "STEP", "CUBICSPLINE"
PARALLEL = 1 - 1e-9  # of the product of two quaternions: closer ones are blended as numbers


@dataclass(frozen=True, eq=False)
class Track:
    """One property of one node in time.

    Attributes:
        times: (n,) s, rising.
        values: (n, w), or (n, 3, w) with the tangents before and after for CUBICSPLINE.
        way: LINEAR, STEP or CUBICSPLINE.
        turns: whether the values are quaternions xyzw.
    """

    times: Array
    values: Array
    way: str
    turns: bool

    def at(self, times: Array) -> Array:
        """The values (S, w) at times (S,) s; before the first and after the last they stay."""
        n, t = len(self.times), np.clip(times, self.times[0], self.times[-1])
        before = np.clip(np.searchsorted(self.times, t, side="right") - 1, 0, n - 1)
        after = np.minimum(before + 1, n - 1)
        gap = self.times[after] - self.times[before]
        share = np.divide(t - self.times[before], gap, out=np.zeros_like(t), where=gap > 0)
        s = share[:, None]
        if self.way == CUBIC:
            p0, p1 = self.values[before, 1], self.values[after, 1]
            m0, m1 = (gap[:, None] * self.values[i, k] for i, k in ((before, 2), (after, 0)))
            found = (2 * s**3 - 3 * s**2 + 1) * p0 + (s**3 - 2 * s**2 + s) * m0
            found = found + (3 * s**2 - 2 * s**3) * p1 + (s**3 - s**2) * m1
        elif self.way == STEP:
            found = self.values[before]
        elif self.turns:
            found = _slerp(self.values[before], self.values[after], s)
        else:
            found = (1 - s) * self.values[before] + s * self.values[after]
        return np.asarray(_unit(found) if self.turns else found)


def tracks_of(document: GlbDocument, animation: dict[str, Any]) -> dict[tuple[int, str], Track]:
    """The tracks of an animation by node and property; others, as of morph targets, are left out.

    Raises ValueError for a track that does not fit together.
    """
    samplers, found = several(animation, "samplers"), {}
    for channel in several(animation, "channels"):
        target = channel.get("target")
        if not isinstance(target, dict) or target.get("path") not in WIDTHS:
            continue
        node, path = target.get("node"), str(target["path"])
        if type(node) is not int:
            continue
        number = channel.get("sampler")
        if type(number) is not int or not 0 <= number < len(samplers):
            raise ValueError(f"there is no samplers[{shown(number)}] of its animation")
        found[node, path] = _track(document, samplers[number], path)
    return found


def _track(document: GlbDocument, sampler: dict[str, Any], path: str) -> Track:
    way, width = sampler.get("interpolation", LINEAR), WIDTHS[path]
    if way not in (LINEAR, STEP, CUBIC):
        raise ValueError(f"there is no interpolation {shown(way)}")
    times = document.values(sampler.get("input"), "SCALAR", 1).ravel()
    values = document.values(sampler.get("output"), f"VEC{width}", width)
    if not len(times) or len(values) != len(times) * (3 if way == CUBIC else 1):
        raise ValueError(f"a {path} has {len(times)} times and {len(values)} values")
    if not np.isfinite(times).all() or not np.isfinite(values).all() or (np.diff(times) < 0).any():
        raise ValueError(f"a {path} has times or values that are not finite, or times that fall")
    turns = path == "rotation"
    if way == CUBIC:
        values = values.reshape(len(times), 3, width)
    elif turns:
        values = _unit(values)
    return Track(times, values, way, turns)


def _unit(q: Array) -> Array:
    size = np.linalg.norm(q, axis=-1, keepdims=True)
    if not (size > 0).all():
        raise ValueError("a rotation is zero, and not a unit quaternion")
    return np.asarray(q / size)


def _slerp(a: Array, b: Array, s: Array) -> Array:
    """Quaternions (S, 4) on the shorter way from a to b, at shares s (S, 1)."""
    product = (a * b).sum(axis=1, keepdims=True)
    b, product = np.where(product < 0, -b, b), np.abs(product)
    close: Mask = np.asarray(product > PARALLEL)
    angle = np.arccos(np.clip(product, -1, 1))
    sine = np.where(close, 1.0, np.sin(angle))
    first = np.where(close, 1 - s, np.sin((1 - s) * angle) / sine)
    second = np.where(close, s, np.sin(s * angle) / sine)
    return np.asarray(first * a + second * b)


def local_motions(base: Array, node: dict[str, Any], parts: dict[str, Array], count: int) -> Array:
    """The motions (S, 4, 4) of a node whose properties are animated; `base` (4, 4) if none is."""
    if not parts:
        return np.broadcast_to(base, (count, 4, 4))
    given = {
        "translation": node.get("translation", (0.0, 0.0, 0.0)),
        "rotation": node.get("rotation", (0.0, 0.0, 0.0, 1.0)),
        "scale": node.get("scale", (1.0, 1.0, 1.0)),
    }
    whole = {
        name: parts.get(name, np.broadcast_to(np.asarray(value, float), (count, WIDTHS[name])))
        for name, value in given.items()
    }
    found = np.zeros((count, 4, 4))
    found[:, :3, :3] = Rotation.from_quat(whole["rotation"]).as_matrix()
    found[:, :3, :3] *= whole["scale"][:, None]
    found[:, :3, 3], found[:, 3, 3] = whole["translation"], 1.0
    return found
