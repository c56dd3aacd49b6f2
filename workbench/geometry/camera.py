"""A pinhole camera with lens distortion: five small blocks, each of which may be free or fixed."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike

from workbench.arrays import Array
from workbench.blocks import Block, Layout, Values
from workbench.blocks.checks import reals
from workbench.errors import BadCamera
from workbench.geometry.rotation import matrix_from_vector, rodrigues, vector_from_matrix

ROTATION_TOLERANCE = 1e-3  # of R R' from the identity: files may hold three digits


@dataclass(frozen=True, eq=False)
class Camera:
    """The blocks of one camera; their names begin with `prefix`.

    `rotation` (rad) and `translation` (m) take world points to the camera's frame
    (x right, y down, z forward); `focal` (fx, fy) and `centre` are in pixels; `distortion`
    holds k1 k2 p1 p2 k3 in OpenCV's order, all zero for a pure pinhole.

    Attributes:
        prefix: how the names of the five blocks begin, such as `cam1/`.
    """

    prefix: str = ""

    def __post_init__(self) -> None:
        if not isinstance(self.prefix, str):
            raise BadCamera(f"a camera's prefix is a text, not a {type(self.prefix).__name__}")

    @cached_property
    def focal(self) -> Block:
        """The block of focal lengths, (2,) px."""
        return Block(self.prefix + "focal", (2,), "px", ("x", "y"))

    @cached_property
    def centre(self) -> Block:
        """The block of the principal point, (2,) px."""
        return Block(self.prefix + "centre", (2,), "px", ("u", "v"))

    @cached_property
    def distortion(self) -> Block:
        """The block of the lens distortion, (5,): k1 k2 p1 p2 k3."""
        return Block(self.prefix + "distortion", (5,), "1", ("k1", "k2", "p1", "p2", "k3"))

    @cached_property
    def rotation(self) -> Block:
        """The block of the rotation vector, (3,) rad."""
        return Block(self.prefix + "rotation", (3,), "rad", ("x", "y", "z"))

    @cached_property
    def translation(self) -> Block:
        """The block of the translation, (3,) m: the world's origin as the camera sees it."""
        return Block(self.prefix + "translation", (3,), "m", ("x", "y", "z"))

    @property
    def blocks(self) -> tuple[Block, ...]:
        """The five blocks of the camera."""
        return self.focal, self.centre, self.distortion, self.rotation, self.translation

    def project(self, points: cs.MX) -> cs.MX:
        """World points (3, N) in metres -> pixels (2, N). Raises BadCamera for other input."""
        if not isinstance(points, cs.MX) or points.shape[0] != 3:
            kind = f"shape {points.shape}" if isinstance(points, cs.MX) else type(points).__name__
            raise BadCamera(
                f"a camera projects points (3, N), a CasADi matrix (MX), not one of {kind}; "
                "numbers (N, 3) go to camera.pixels"
            )
        return self.image_of(self.seen(points))

    def seen(self, points: cs.MX) -> cs.MX:
        """World points (3, N) m in the camera's frame, (3, N) m; the last row is their depth."""
        t = cs.repmat(self.translation.symbol, 1, points.shape[1])
        return rodrigues(self.rotation.symbol) @ points + t

    def image_of(self, seen: cs.MX) -> cs.MX:
        """The pixels (2, N) of points in the camera's frame (3, N) m.

        A pinhole also projects what is behind it, upside down: whoever asks has to look at depths.
        """
        lens = self.focal, self.centre, self.distortion
        return project(seen, *(block.symbol for block in lens))

    def values(
        self,
        *,
        K: ArrayLike,
        R: ArrayLike = ((1, 0, 0), (0, 1, 0), (0, 0, 1)),
        t: ArrayLike = (0, 0, 0),
        distortion: ArrayLike = (),
    ) -> Values:
        """Numbers for the blocks from the usual matrices: K (3, 3), R (3, 3), t (3,), k1 k2 ...

        Raises BadCamera for other shapes, numbers that are not finite, skewed pixels, an R that
        is no rotation or more than five coefficients, and NotNumbers for text and the like.
        """
        K, R, t = reals("K", K), reals("R", R), reals("t", t)
        coefficients = reals("distortion", distortion).ravel()
        if K.shape != (3, 3) or R.shape != (3, 3) or t.shape != (3,):
            raise BadCamera(
                f"a camera takes K (3, 3), R (3, 3) and t (3,), not {K.shape}, {R.shape} and "
                f"{t.shape}"
            )
        for name, array in (("K", K), ("R", R), ("t", t), ("distortion", coefficients)):
            if not np.isfinite(array).all():
                raise BadCamera(f"a camera needs finite numbers, but {name} is {array.tolist()}")
        if coefficients.size > 5:
            raise BadCamera(
                f"a camera takes up to five distortion coefficients (k1 k2 p1 p2 k3), not "
                f"{coefficients.size}; the rational and thin-prism models are not supported"
            )
        skew = max(abs(K[0, 1]), abs(K[1, 0])) > 1e-6 * K[0, 0]
        if skew or K[:2, :2].diagonal().min() <= 0 or not np.allclose(K[2], (0, 0, 1), atol=1e-6):
            raise BadCamera(
                "the rows of K are fx, 0, cx and 0, fy, cy and 0, 0, 1, with focal lengths above "
                f"zero, not {K.tolist()}; leave skew out, transpose K, or divide it by K[2, 2]"
            )
        _check_rotation(R)
        k = np.zeros(5)
        k[: coefficients.size] = coefficients
        numbers = (K[[0, 1], [0, 1]], K[:2, 2], k, vector_from_matrix(R), t.copy())
        return {block.name: n for block, n in zip(self.blocks, numbers, strict=True)}

    def pixels(self, points: ArrayLike, values: Mapping[str, ArrayLike]) -> Array:
        """World points (..., 3) in metres -> pixels (..., 2), with this camera's numbers.

        Raises BadCamera for points of another shape, and what Layout.pack raises for values.
        """
        where, numbers = _places(points), self._numbers(values)
        flat = where.reshape(-1, 3)
        return np.asarray(_numeric(len(flat))(flat.T, *numbers)).T.reshape(*where.shape[:-1], 2)

    def depths(self, points: ArrayLike, values: Mapping[str, ArrayLike]) -> Array:
        """How far in front of the camera world points (..., 3) are: (...) m, negative behind it.

        Raises as `pixels` does.
        """
        *_, rotation, t = self._numbers(values)
        return np.asarray(_places(points) @ matrix_from_vector(rotation)[2] + t[2])

    def _numbers(self, values: Mapping[str, ArrayLike]) -> list[Array]:
        layout = Layout(self.blocks)
        return list(layout.unpack(layout.pack(values)).values())


def project(seen: cs.MX, focal: cs.MX, centre: cs.MX, distortion: cs.MX) -> cs.MX:
    r"""The pinhole camera with radial and tangential distortion (Brown 1971, as in OpenCV).

    With (x, y) = (X / Z, Y / Z) of points `seen` in the camera's frame and r^2 = x^2 + y^2:
        radial = 1 + k1 r^2 + k2 r^4 + k3 r^6
        u = f_x (x radial + 2 p1 x y + p2 (r^2 + 2 x^2)) + c_x
        v = f_y (y radial + p1 (r^2 + 2 y^2) + 2 p2 x y) + c_y
    """
    x, y = seen[0, :] / seen[2, :], seen[1, :] / seen[2, :]
    k1, k2, p1, p2, k3 = (distortion[i] for i in range(5))
    r2 = x**2 + y**2
    radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
    u = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x**2)
    v = y * radial + p1 * (r2 + 2 * y**2) + 2 * p2 * x * y
    return cs.vertcat(focal[0] * u + centre[0], focal[1] * v + centre[1])


def _check_rotation(R: Array) -> None:
    off = float(np.abs(R @ R.T - np.eye(3)).max())
    if not off <= ROTATION_TOLERANCE:  # nor NaN
        raise BadCamera(f"R must be a rotation, but R R' differs from the identity by {off:.2g}")
    if np.linalg.det(R) < 0:
        raise BadCamera(
            "R must be a rotation, but it mirrors (its determinant is -1); turn the sign of one "
            "of its rows, according to x right, y down, z forward"
        )


def _places(points: ArrayLike) -> Array:
    places = reals("points", points)
    if places.shape[-1:] != (3,):
        raise BadCamera(f"a camera sees points of shape (..., 3), not {places.shape}")
    return places


@cache
def _numeric(count: int) -> cs.Function:
    points = cs.MX.sym("points", 3, count)
    camera = Camera()
    symbols = [block.symbol for block in camera.blocks]
    return cs.Function("project", [points, *symbols], [camera.project(points)])


def triangulate(
    cameras: Sequence[Camera],
    values: Mapping[str, ArrayLike],
    pixels: Sequence[ArrayLike],
    confidence: Sequence[ArrayLike],
) -> Array:
    """World points (N, 3) m from their pixels (N, 2) in several cameras.

    Each view counts by its confidence (N,), and by 0 where a pixel is NaN. A point that fewer than
    two cameras see is NaN. The method is linear (DLT; Hartley and Zisserman, Multiple View
    Geometry, 12.2). It ignores the lens distortion, which is good enough for a start. Raises
    BadCamera without cameras, or without pixels and confidence for each.
    """
    if not len(cameras) == len(pixels) == len(confidence) > 0:
        raise BadCamera(
            f"there are {len(cameras)} cameras, pixels of {len(pixels)} and confidences of "
            f"{len(confidence)}; give both for each camera, and at least one"
        )
    count = len(np.asarray(pixels[0]))
    rows = np.zeros((count, 2 * len(cameras), 4))
    seen = np.zeros(count, dtype=int)
    for i, camera in enumerate(cameras):
        f, c, _, w, t = (np.asarray(values[b.name], dtype=float) for b in camera.blocks)
        P = np.column_stack([matrix_from_vector(w), t])  # (3, 4) world -> camera
        u = np.asarray(pixels[i], dtype=float)
        weight = np.where(np.isfinite(u).all(axis=1), np.asarray(confidence[i], dtype=float), 0)
        x = (np.nan_to_num(u) - c) / f  # (N, 2)
        rows[:, 2 * i : 2 * i + 2] = weight[:, None, None] * (x[:, :, None] * P[2] - P[:2])
        seen += weight > 0
    _, _, Vt = np.linalg.svd(rows)
    h = Vt[:, -1]
    with np.errstate(divide="ignore", invalid="ignore"):
        points = h[:, :3] / h[:, 3:]
    points[seen < 2] = np.nan
    return np.asarray(points)
