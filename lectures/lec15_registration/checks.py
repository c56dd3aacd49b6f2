"""Checks of lecture 15, and the mistakes that they tell apart."""

from functools import cache
from itertools import combinations

import numpy as np
from scipy.spatial import cKDTree

import workbench as wb
from workbench.course import check, equal, holds, mistake
from workbench.geometry.rigid import procrustes
from workbench.geometry.rotation import matrix_from_vector
from workbench.lectures.lec15_registration import solutions
from workbench.registration import GemanMcClure, LeastSquares, random_surface_points

RNG = np.random.default_rng(15)

# closest_on_triangle

A, B, C = np.array([[0.1, 0.0, 0.2], [0.9, 0.1, 0.0], [0.3, 0.7, -0.1]])
NORMAL = np.cross(B - A, C - A) / np.linalg.norm(np.cross(B - A, C - A))
SHARES = {
    "above the inside": [0.3, 0.3, 0.4],
    "beyond the edge from a to b": [0.8, 0.6, -0.4],
    "beyond the edge from b to c": [-0.5, 0.6, 0.9],
    "beyond the edge from c to a": [0.5, -0.3, 0.8],
    "beyond the corner a": [1.9, -0.5, -0.4],
    "beyond the corner c": [-0.9, -0.4, 2.3],
}
AROUND = {
    name: np.array(b) @ [A, B, C] + 0.2 * (-1) ** k * NORMAL
    for k, (name, b) in enumerate(SHARES.items())
}
LATTICE = np.array([[i, j, 40 - i - j] for i in range(41) for j in range(41 - i)]) / 40


@check("closest_on_triangle", points=1)
def is_on_it_and_closest(closest_on_triangle):
    """it is on the triangle, and no place of the triangle is closer"""
    for where, p in AROUND.items():
        s = closest_on_triangle(p, A, B, C)
        b = np.linalg.lstsq(np.vstack([np.transpose([A, B, C]), np.ones(3)]), [*s, 1], rcond=None)
        off = np.linalg.norm(b[0] @ [A, B, C] - s)
        holds(
            b[0].min() > -1e-7 and off < 1e-7,
            f"the place for a point {where}",
            "on the triangle: shares that are not negative",
            f"shares {b[0].round(3)}, {off:.1g} m off their sum",
        )
        least = np.linalg.norm(LATTICE @ [A, B, C] - p, axis=1).min()
        came = np.linalg.norm(s - p)
        holds(
            came <= least + 1e-9,
            f"the distance of a point {where}",
            f"at most {least:.5f} m, at which there is a place of the triangle",
            f"{came:.5f} m",
        )


@check("closest_on_triangle", points=1)
def is_the_place(closest_on_triangle):
    """it is that place, wherever the point is"""
    for where, p in AROUND.items():
        right = solutions.closest_on_triangle(p, A, B, C)
        equal(closest_on_triangle(p, A, B, C), right, f"the place for a point {where}", 1e-7)
        turned = closest_on_triangle(p, C, A, B)
        equal(turned, right, f"the same with the corners in another order, {where}", 1e-7)


def shares_of_foot(p, a, b, c):
    y, z = np.linalg.lstsq(np.column_stack([b - a, c - a]), p - a, rcond=None)[0]
    return np.array([1 - y - z, y, z])


@mistake(
    "closest_on_triangle",
    "this is the foot of the perpendicular on the plane, which may be outside of the triangle",
)
def on_the_plane(p, a, b, c):
    return shares_of_foot(p, a, b, c) @ [a, b, c]


@mistake(
    "closest_on_triangle",
    "setting negative shares to zero leads onto the right edge, but not to its closest place: the way "
    "from there to the point is not perpendicular to the edge",
)
def with_shares_cut_off(p, a, b, c):
    kept = np.maximum(shares_of_foot(p, a, b, c), 0)
    return kept / kept.sum() @ [a, b, c]


@mistake("closest_on_triangle", "this is the closest corner; most closest places are not corners")
def the_closest_corner(p, a, b, c):
    return min((a, b, c), key=lambda s: np.linalg.norm(p - s))


def on_edges(p, a, b, c, ends):
    found = []
    for start, end in ((a, b), (b, c), (c, a)):
        along = end - start
        share = np.clip((p - start) @ along / (along @ along), *ends)
        found.append(start + share * along)
    return min(found, key=lambda s: np.linalg.norm(p - s))


@mistake("closest_on_triangle", "this is the closest place of the edges: the inside counts too")
def without_the_inside(p, a, b, c):
    return on_edges(p, a, b, c, (0, 1))


@mistake("closest_on_triangle", "an edge ends at its corners: this goes along the whole line")
def along_whole_lines(p, a, b, c):
    b0 = shares_of_foot(p, a, b, c)
    return b0 @ [a, b, c] if b0.min() >= 0 else on_edges(p, a, b, c, (-np.inf, np.inf))


# icp_step

CLOUD = RNG.uniform(-0.5, 0.5, (60, 3)) * [1.0, 1.5, 0.6]
NEAR = CLOUD[:25] @ matrix_from_vector([0.05, -0.1, 0.08]).T + [0.04, -0.03, 0.02]
FLAT = RNG.uniform(-1, 1, (9, 3)) * [1.0, 1.0, 0.01]  # and mirrored: every contact is its own image
SCENES = {
    "25 points near a cloud of 60": (NEAR, CLOUD),
    "a flat set near its mirror": (FLAT, FLAT * [1, 1, -1]),
}


@check("icp_step", points=1)
def is_rigid(icp_step):
    """it is rigid: distances and handedness stay"""
    for name, (points, cloud) in SCENES.items():
        came = icp_step(points, cloud)
        for i, j in combinations(range(6), 2):
            length = np.linalg.norm(points[i] - points[j])
            equal(np.linalg.norm(came[i] - came[j]), length, f"a distance between points, {name}")
        for i in range(4):
            before, after = (x[i + 1 : i + 4] - x[i] for x in (points, came))
            equal(np.linalg.det(after), np.linalg.det(before), f"a signed volume, {name}", 1e-9)


@check("icp_step", points=1)
def is_the_best_motion(icp_step):
    """it is the motion that brings the points closest to their contacts"""
    for name, (points, cloud) in SCENES.items():
        contacts = cloud[cKDTree(cloud).query(points)[1]]
        least = np.sum((solutions.icp_step(points, cloud) - contacts) ** 2)
        came = np.sum((icp_step(points, cloud) - contacts) ** 2)
        holds(
            abs(came - least) < 1e-9,
            f"the sum of squared distances from the contacts, {name}",
            f"{least:.6f} m^2",
            f"{came:.6f} m^2",
        )


@mistake("icp_step", "these are the contacts themselves: the points have to move rigidly")
def snapped(points, cloud):
    return cloud[cKDTree(cloud).query(points)[1]]


@mistake("icp_step", "this is the way back: the motion leads from the points to their contacts")
def step_backwards(points, cloud):
    return procrustes(cloud[cKDTree(cloud).query(points)[1]], points)(points)


@mistake(
    "icp_step",
    "each point looks for its contact in the cloud, and not each point of the cloud for a point",
)
def pairs_from_the_cloud(points, cloud):
    return procrustes(points[cKDTree(points).query(cloud)[1]], cloud)(points)


@mistake("icp_step", "the points only moved: a rotation is part of the motion")
def only_moved(points, cloud):
    return points + (cloud[cKDTree(cloud).query(points)[1]] - points).mean(axis=0)


@mistake("icp_step", "without looking at the determinant this may be a mirror")
def with_mirrors(points, cloud):
    contacts = cloud[cKDTree(cloud).query(points)[1]]
    p, q = points.mean(axis=0), contacts.mean(axis=0)
    U, _, Vt = np.linalg.svd((contacts - q).T @ (points - p))
    return (points - p) @ (U @ Vt).T + q


@mistake("icp_step", "nobody said that the points come in the order of the cloud")
def paired_in_order(points, cloud):
    return procrustes(points, cloud[: len(points)])(points)


# distance_gradient

CORNERS = np.array([A, B, C])


@check("distance_gradient", points=1)
def is_that_of_the_distance(distance_gradient):
    """it is the derivative of the distance, though the closest place moves along"""
    h = 1e-6
    for name in ("above the inside", "beyond the edge from a to b", "beyond the corner a"):
        p = AROUND[name]
        s = solutions.closest_on_triangle(p, *CORNERS)
        shares = np.linalg.solve(CORNERS.T, s)
        quotient = np.zeros((3, 3))
        for k in range(3):
            for i in range(3):
                step = np.zeros((3, 3))
                step[k, i] = h
                far, near = (
                    np.linalg.norm(p - solutions.closest_on_triangle(p, *(CORNERS + sign * step)))
                    for sign in (1, -1)
                )
                quotient[k, i] = (far - near) / (2 * h)
        came = distance_gradient(p, CORNERS, shares)
        equal(came, quotient, f"the derivatives for a point {name}", 1e-6)


@check("distance_gradient", points=1)
def moves_with_all(distance_gradient):
    """if all corners move alike towards the point, the distance falls as fast as they move"""
    for name, b in (("inside", [0.2, 0.5, 0.3]), ("on an edge", [0.4, 0.6, 0.0])):
        place = np.array(b) @ CORNERS
        for away in (0.1, 0.4):
            u = NORMAL
            rows = distance_gradient(place + away * u, CORNERS, np.array(b))
            equal(rows.sum(axis=0), -u, f"the sum of the rows, closest place {name}, {away} m off")
            equal(rows[2], -b[2] * u, "the row of the third corner")


@mistake("distance_gradient", "the sign: a corner that comes nearer makes the distance smaller")
def with_the_other_sign(p, corners, shares):
    return -solutions.distance_gradient(p, corners, shares)


@mistake("distance_gradient", "this is the derivative of half of the squared distance")
def of_half_the_square(p, corners, shares):
    return -np.outer(shares, p - shares @ corners)


@mistake("distance_gradient", "this is the derivative of the squared distance")
def of_the_square(p, corners, shares):
    return -2 * np.outer(shares, p - shares @ corners)


@mistake(
    "distance_gradient",
    "the shares are missing: a corner moves the closest place only by its share",
)
def without_shares(p, corners, shares):
    return solutions.distance_gradient(p, corners, shares) / np.where(shares, shares, 1)


@mistake("distance_gradient", "each row has the direction from its own corner to the point")
def from_each_corner(p, corners, shares):
    away = p - corners
    return -shares[:, None] * away / np.linalg.norm(away, axis=1, keepdims=True)


# robust_weight

DISTANCES = np.array([0.001, 0.004, 0.02, 0.03, 0.1, 0.5])  # m


@check("robust_weight", points=1)
def has_the_slope(robust_weight):
    """w d is the derivative of the cost"""
    h = 1e-7
    for sigma, scale in ((0.005, 0.03), (0.002, 0.1)):

        def cost(d, sigma=sigma, scale=scale):
            return 0.5 * (d / sigma) ** 2 / (1 + (d / scale) ** 2)

        slope = (cost(DISTANCES + h) - cost(DISTANCES - h)) / (2 * h)
        came = robust_weight(DISTANCES, sigma, scale) * DISTANCES
        what = f"w d over the derivative of the cost, sigma {sigma} m, scale {scale} m"
        equal(came / slope, np.ones(6), what, 1e-5)


@check("robust_weight", points=1)
def keeps_the_two_apart(robust_weight):
    """at zero it is 1 / sigma^2, whatever the scale; it is a quarter of that at the scale"""
    for sigma, scale in ((0.005, 0.03), (0.005, 0.2), (0.02, 0.03)):
        w = sigma**2 * robust_weight(np.array([0.0, scale]), sigma, scale)
        equal(w, [1, 0.25], f"sigma^2 w at 0 and at the scale, sigma {sigma} m, scale {scale} m")


@mistake(
    "robust_weight",
    "this is rho / d^2, with which the cost is the same but not its derivative: it pulls too much",
)
def with_the_same_cost(d, sigma, scale):
    return 1 / sigma**2 / (1 + (d / scale) ** 2)


@mistake(
    "robust_weight",
    "outliers begin at the scale and not at sigma: this takes one number for both",
)
def sigma_for_the_scale(d, sigma, scale):
    return solutions.robust_weight(d, sigma, sigma)


@mistake("robust_weight", "sigma is missing: how exact a good point is decides how much it counts")
def without_sigma(d, sigma, scale):
    return solutions.robust_weight(d, 1.0, scale)


@mistake("robust_weight", "a factor of 2 too much: half of w d^2 has the derivative w d")
def twice_the_weight(d, sigma, scale):
    return 2 * solutions.robust_weight(d, sigma, scale)


@mistake("robust_weight", "this is the root, a factor for residuals; w multiplies their squares")
def the_root_of_it(d, sigma, scale):
    return np.sqrt(solutions.robust_weight(d, sigma, scale))


# coupling_residual

MODEL = np.array([[0.0, 0, 0], [1, 0, 0.1], [0, 1, 0], [0.2, 0.1, 1]])
ENDS = np.array([[0, 1], [0, 2], [3, 0], [1, 2], [2, 3]])
FREE = MODEL + 0.05 * RNG.standard_normal(MODEL.shape)


@check("coupling_residual", points=1)
def is_blind_to_translation(coupling_residual):
    """it is zero where V is M, or M moved somewhere else, but not where M is turned"""
    for shift in (np.zeros(3), np.array([0.3, -2.0, 0.7])):
        came = coupling_residual(MODEL + shift, MODEL, ENDS, 0.01)
        equal(came, np.zeros(15), f"the residual of M moved by {shift} m", 1e-9)
        same = coupling_residual(FREE + shift, MODEL, ENDS, 0.01)
        equal(same, coupling_residual(FREE, MODEL, ENDS, 0.01), "that of V, moved", 1e-9)
    turned = MODEL @ matrix_from_vector([0, 0, 0.1]).T
    size = np.linalg.norm(coupling_residual(turned, MODEL, ENDS, 0.01))
    holds(size > 1, "the length of the residual of M turned by 0.1 rad", "above 1", size)


@check("coupling_residual", points=1)
def is_in_sigmas_of_edges(coupling_residual):
    """it is V minus M along each edge, in sigmas, edge by edge"""
    for sigma in (0.002, 0.5):
        came = coupling_residual(FREE, MODEL, ENDS, sigma)
        right = solutions.coupling_residual(FREE, MODEL, ENDS, sigma)
        equal(came, right, f"the residual for a sigma of {sigma} m", 1e-7)


@mistake(
    "coupling_residual",
    "this compares the places of vertices, and not differences along edges: it sees a translation",
)
def of_first_ends(V, M, edges, sigma):
    return (V - M)[edges[:, 0]].ravel() / sigma


@mistake("coupling_residual", "the difference of the ends of an edge was asked for, not their sum")
def of_sums(V, M, edges, sigma):
    return (V - M)[edges].sum(axis=1).ravel() / sigma


@mistake("coupling_residual", "the sign: second end minus first, and V minus M")
def with_a_sign(V, M, edges, sigma):
    return -solutions.coupling_residual(V, M, edges, sigma)


@mistake("coupling_residual", "sigma is missing: this is in metres")
def in_metres(V, M, edges, sigma):
    return solutions.coupling_residual(V, M, edges, 1.0)


@mistake("coupling_residual", "divide by sigma: its square belongs to the cost")
def by_the_variance(V, M, edges, sigma):
    return solutions.coupling_residual(V, M, edges, sigma**2)


@mistake("coupling_residual", "the order: x, y and z of the first edge come first, not all x")
def all_x_first(V, M, edges, sigma):
    return solutions.coupling_residual(V, M, edges, sigma).reshape(-1, 3).T.ravel()


# align


@cache
def standing():
    """A mesh of a standing person, (369, 3) m, and its faces."""
    body = wb.load_body("small")
    pose = np.zeros((24, 3))
    pose[body.joint_names.index("left_shoulder"), 2] = -1.0
    pose[body.joint_names.index("right_knee"), 0] = 0.6
    return body.vertices(pose), body.faces


@cache
def handed_in(degrees, seed):
    """A scan that was turned by some degrees: its points, and where those of the person belong."""
    rng = np.random.default_rng(seed)
    vertices, faces = standing()
    own, _ = random_surface_points(vertices, faces, 240, rng)
    own = own + 0.002 * rng.standard_normal(own.shape)
    clutter = vertices.mean(axis=0) + rng.uniform(-1, 1, (60, 3)) * [0.7, 0.9, 0.7]
    R = matrix_from_vector(0.05 * rng.standard_normal(3)) @ matrix_from_vector(
        [0.0, np.radians(degrees), 0.0]
    )
    return np.concatenate([own, clutter]) @ R.T + rng.uniform(-1, 1, 3), own


def is_aligned(align, degrees, seed):
    points, own = handed_in(degrees, seed)
    R, t = align(points, *standing())
    what = f"of a scan that was turned by {degrees} degrees"
    equal(R.T @ R, np.eye(3), f"R'R {what}", 1e-7)
    equal(np.linalg.det(R), 1, f"det R {what}", 1e-7)
    off = 1e3 * np.linalg.norm(points[: len(own)] @ R.T + t - own, axis=1).mean()
    holds(off < 5, f"the mean error of the person's points {what}", "below 5 mm", f"{off:.1f} mm")


@check("align", points=1)
def survives_clutter(align):
    """it is right for a scan that is turned by 10 degrees, with clutter"""
    is_aligned(align, 10, seed=1)


@check("align", points=2)
def finds_the_facing(align):
    """it is right for scans that were turned by any angle"""
    for degrees, seed in ((-160, 2), (70, 3)):
        is_aligned(align, degrees, seed)


@mistake("align", "nothing was moved")
def as_it_came(points, vertices, faces):
    return np.eye(3), np.zeros(3)


@mistake("align", "the means of both now agree; turn the scan as well, and beware of clutter")
def by_the_means(points, vertices, faces):
    return np.eye(3), vertices.mean(axis=0) - points.mean(axis=0)


@mistake(
    "align", "this takes the mesh to the scan: R and t lead from the scan's points to the mesh"
)
def the_way_back(points, vertices, faces):
    R, t = solutions.align(points, vertices, faces)
    return R.T, -R.T @ t


@mistake(
    "align",
    "one start reaches only one basin: begin at several angles, and keep the end of the lowest cost",
)
def from_one_start(points, vertices, faces):
    narrow = GemanMcClure(0.02)
    return solutions.best_of(points, vertices, faces, [0], GemanMcClure(0.1), narrow)


@mistake("align", "least squares believe the clutter: take a loss that levels off")
def by_least_squares(points, vertices, faces):
    squares = LeastSquares()
    return solutions.best_of(points, vertices, faces, range(8), squares, squares)


@mistake(
    "align",
    "with so wide a loss, clutter still pulls: make its scale smaller once the scan is near",
)
def with_a_wide_loss(points, vertices, faces):
    wide = GemanMcClure(1.0)
    return solutions.best_of(points, vertices, faces, range(8), wide, wide)
