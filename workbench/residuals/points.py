"""Error terms that compare points of a body with points, pixels, lengths or each other."""

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csr_array

from workbench.arrays import Array, Index
from workbench.blocks import Points
from workbench.blocks.checks import reals
from workbench.blocks.functions import sparse_constant
from workbench.errors import BadResidual
from workbench.geometry.camera import Camera
from workbench.geometry.mirror import REFLECTION
from workbench.geometry.triangles import edge_matrix
from workbench.residuals.kernels import Kernel, quadratic
from workbench.residuals.residual import (
    Residual,
    as_matrix,
    confidences,
    expressed,
    named_after,
    numbered,
    row_labels,
    same_shape,
)


def vertices(
    points: Points | cs.MX,
    observed: cs.MX | ArrayLike,
    *,
    sigma: float | Array,
    kernel: Kernel = quadratic,
    name: str | None = None,
) -> Residual:
    """v_i(theta, beta) - v^_i in metres: E_D of known correspondences.

    `observed` is the symbol of a block (N, 3), whose numbers may change, or an array (N, 3).
    `kernel=of_norms(...)` takes the distance |v_i - v^_i| instead of each coordinate.
    """
    name = name or named_after("vertices", observed, points)
    return landmarks(points, observed, sigma=sigma, kernel=kernel, name=name)


def landmarks(
    points: Points | cs.MX,
    observed: cs.MX | ArrayLike,
    *,
    sigma: float | Array,
    kernel: Kernel = quadratic,
    name: str | None = None,
) -> Residual:
    """p_k(theta, beta) - p^_k in metres for named points (joints, keypoints).

    `observed` is the symbol of a block (M, 3), whose numbers may change, or an array (M, 3).
    `kernel=of_norms(...)` takes the distance |p_k - p^_k| instead of each coordinate.
    """
    predicted, reads = expressed(points)
    name = name or named_after("landmarks", observed, points)
    target = as_matrix(name, "what was observed", observed, predicted.shape[::-1])
    same_shape(name, predicted, target)
    difference = cs.vec(predicted - target)  # (3 N, 1) m
    labels = row_labels(points, "xyz")
    return Residual(name, difference, sigma, "m", kernel, reads, labels, rows_per_point=3)


def keypoints(
    points: Points | cs.MX,
    camera: Camera,
    observed: cs.MX | ArrayLike,
    confidence: cs.MX | ArrayLike,
    *,
    sigma: float,
    kernel: Kernel = quadratic,
    name: str | None = None,
) -> Residual:
    """Pi(p_k(theta, beta)) - u^_k in pixels, for one camera; E_J of SMPLify (Bogo et al. 2016):

        1/2 sum over k of w_k (rho(du_k^2 / sigma^2) + rho(dv_k^2 / sigma^2))

    with the confidence of keypoint k as its weight w_k. SMPLify's code has rho of each coordinate;
    its paper writes rho of the difference of two points, which is 1/2 sum over k of w_k rho((du_k^2
    + dv_k^2) / sigma^2) and is chosen with kernel=of_norms(geman_mcclure). The weight stands
    outside of the kernel, as in SMPLify: sigma alone determines what counts as an outlier, and a
    doubtful keypoint has less influence both near and far. Without a robust kernel a keypoint of
    weight w has the standard deviation sigma / sqrt(w) px; for a standard deviation of sigma / c
    give confidence=c**2, as SPIN does (Kolotouros et al. 2019).

    points (3, M) m; observed (M, 2) px and confidence (M,), from 0 on, are symbols of blocks, or
    arrays, or expressions of symbols. A keypoint of confidence 0 has no influence, and its
    coordinates do not matter as long as they are numbers. Raises BadResidual for shapes that do not
    fit and for confidences below zero.

    The depths (M,) m in front of the camera are the domain of the residual: a posterior has no
    density where a keypoint with a confidence above 0 is behind the camera, where a pinhole
    projects upside down.
    """
    predicted, reads = expressed(points)
    if not isinstance(camera, Camera):
        raise BadResidual(
            f"keypoints are seen by a Camera, not by something of type {type(camera).__name__}"
        )
    seen = camera.seen(predicted)  # (3, M) m
    pixels = camera.image_of(seen)  # (2, M) px
    name = name or named_after("keypoints", observed, points)
    M = pixels.shape[1]
    target = as_matrix(name, "what was observed", observed, (M, 2))
    same_shape(name, pixels, target)
    weights = confidences(name, confidence, M, "keypoints")
    off = cs.vec(pixels - target)  # (2 M, 1) px
    labels, depths = row_labels(points, "uv"), seen[2, :].T
    return Residual(
        name, off, sigma, "px", kernel, reads, labels, weights, camera.blocks, 2, domain=depths
    )


def edges(
    points: Points | cs.MX,
    observed: cs.MX | ArrayLike,
    pairs: ArrayLike,
    *,
    sigma: float,
    confidence: cs.MX | ArrayLike | None = None,
    kernel: Kernel = quadratic,
    name: str | None = None,
) -> Residual:
    """(v_a - v_b) - (v^_a - v^_b) in metres for pairs (E, 2) of vertices: the E_C of edges.

    A translation of either changes nothing, so shape can be compared before it is known where
    the body stands (SMPL, section 4.1: the pose of a registration). `observed` is the symbol of
    a block (N, 3), or an array. The confidence of a pair (E,), from 0 on, is the weight of its
    three rows, outside of the kernel: 1/2 w rho((r / sigma)^2). `kernel=of_norms(...)` takes
    the length of the difference of two edges instead of each coordinate.
    Raises BadResidual for pairs of vertices that do not exist and for confidences below zero.
    """
    predicted, reads = expressed(points)
    name = name or named_after("edges", observed, points)
    target = as_matrix(name, "what was observed", observed, predicted.shape[::-1])
    same_shape(name, predicted, target)
    N = predicted.shape[1]
    vertex_pairs = numbered(name, "pairs (E", pairs, 2, N)
    E = len(vertex_pairs)
    rows, entries = np.repeat(np.arange(E), 2).tolist(), np.tile([1.0, -1.0], E)
    incidence = cs.DM.triplet(rows, vertex_pairs.ravel().tolist(), cs.DM(entries), E, N)
    difference = (predicted - target) @ incidence.T  # (3, E) m
    weights = None if confidence is None else confidences(name, confidence, E, "pairs")
    return Residual(
        name, cs.vec(difference), sigma, "m", kernel, reads, weights=weights, rows_per_point=3
    )


def stitching(
    vertices: Points | cs.MX,
    edges: cs.MX | ArrayLike,
    faces: Index,
    *,
    sigma: float,
    kernel: Kernel = quadratic,
    name: str | None = None,
) -> Residual:
    """(A V)_fi - X_f e_fi in metres: two edges of every face against deformed ones (SCAPE eq. 1).

    `edges` is the symbol of a block (2 F, 3), or an array: T_2 - T_0 and T_1 - T_0 of each face
    in turn. A common translation of vertices that are connected by faces changes nothing.
    `kernel=of_norms(...)` takes the length of an edge's difference instead of each coordinate.
    Raises BadResidual for edges that are not two per face.
    """
    placed, reads = expressed(vertices)
    name = name or named_after("stitching", edges, vertices)
    faces = numbered(name, "faces (F", faces, 3, placed.shape[1])
    target = as_matrix(name, "the edges", edges, (2 * len(faces), 3))
    if target.shape != (3, 2 * len(faces)):
        raise BadResidual(
            f"residual {name!r} needs two edges for each of {len(faces)} faces, a block of shape "
            f"({2 * len(faces)}, 3), not {target.shape[::-1]}"
        )
    A = cs.MX(sparse_constant(edge_matrix(faces, placed.shape[1]).T))
    labels = tuple(
        f"face {f}, {e}, {a}"
        for f in range(len(faces))
        for e in ("T2 - T0", "T1 - T0")
        for a in "xyz"
    )
    off = cs.vec(placed @ A - target)
    return Residual(name, off, sigma, "m", kernel, reads, labels, rows_per_point=3)


def mirrored(
    points: Points | cs.MX, opposite: ArrayLike, *, sigma: float, name: str | None = None
) -> Residual:
    """p_i - U(p)_i in metres: E_Y, the symmetry of a template or of its joints (SMPL, section 4.1).

    U exchanges the sides: U(p)_i = (-x, y, z) of p_opposite[i]. `points` are the symbol of a block
    (N, 3), or points of a body; `opposite` (N,) has for each point the number of the point on the
    other side, and for a point in the middle its own number. Each pair is in the residual twice.
    Raises BadResidual unless the other side of the other side is the point itself.
    """
    placed, reads = expressed(points)
    name = name or named_after("mirrored", points.symbol if reads else points, points)
    N = placed.shape[1]
    partner = numbered(name, "opposite (N", np.reshape(opposite, (-1, 1)), 1, N).ravel()
    if len(partner) != N or (partner[partner] != np.arange(N)).any():
        raise BadResidual(
            f"residual {name!r} needs for each of {N} points the number of its opposite, so that "
            f"the opposite of the opposite is the point itself; {len(partner)} numbers were given, "
            "and for them this is not so"
        )
    image = cs.diag(cs.MX(cs.DM(REFLECTION))) @ placed[:, partner.tolist()]
    return Residual(name, cs.vec(placed - image), sigma, "m", points=reads, rows_per_point=3)


def regressed(
    joints: Points | cs.MX,
    vertices: Points | cs.MX,
    regressor: cs.MX | csr_array | ArrayLike,
    *,
    sigma: float,
    name: str | None = None,
) -> Residual:
    """(R V)_k - J_k in metres: E_J, joints (K, 3) at the means of vertices (N, 3) (SMPL, 4.1).

    `joints` and `vertices` are symbols of blocks, or points; `regressor` (K, N) is an array, a
    sparse one, or the symbol of a block. Where the rows of the regressor sum to one, a common
    translation of joints and vertices changes nothing. Raises BadResidual for a regressor of
    another shape.
    """
    joint_points, joint_reads = expressed(joints)
    surface, surface_reads = expressed(vertices)
    name = name or named_after("regressed", joint_points, joint_points)
    shape = (joint_points.shape[1], surface.shape[1])
    if isinstance(regressor, cs.MX):
        R = regressor
    else:
        dense = regressor.toarray() if isinstance(regressor, csr_array) else regressor
        array = reals(f"residual {name!r}: the regressor", dense)
        if array.ndim != 2 or not np.isfinite(array).all():
            raise BadResidual(f"residual {name!r} needs a regressor (K, N) of finite numbers")
        R = cs.MX(cs.sparsify(cs.DM(array.T)))
    if R.shape != shape[::-1]:
        raise BadResidual(
            f"residual {name!r} needs a regressor of shape {shape}, a row for each joint and a "
            f"column for each vertex, not {R.shape[::-1]}"
        )
    return Residual(
        name,
        cs.vec(surface @ R - joint_points),
        sigma,
        "m",
        points=(*joint_reads, *surface_reads),
        rows_per_point=3,
    )
