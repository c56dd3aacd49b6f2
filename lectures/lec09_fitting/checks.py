"""Checks of lecture 9, and the mistakes that they tell apart."""

from functools import cache

import numpy as np
from scipy.spatial.transform import Rotation

import workbench as wb
from workbench.course import check, equal, holds, mistake
from workbench.lectures.lec09_fitting import solutions
from workbench.lectures.lec09_fitting.solutions import BETAS, BODY, NOISE, POSE

RNG = np.random.default_rng(9)
POINTS = RNG.uniform(-0.8, 0.8, size=(6, 3))
C = np.array([640.0, 360.0])
TURNS = Rotation.from_rotvec([[0.2, 0.4, -0.1], [0.1, -1.2, 0.3], [-0.3, 1.0, 0.2]]).as_matrix()
OFFSETS = np.array([[0.3, -0.2, 4.0], [-0.2, 0.1, 5.0], [0.1, 0.4, 3.5]])


# project


@check("project", points=1)
def is_a_pinhole(project):
    """a point on the axis is seen at the centre, and at twice the depth things look half as large"""
    f, points = 1000.0, np.array([[0.0, 0, 3], [0.1, 0.2, 2], [0.1, 0.2, 4]])
    came = project(points, np.eye(3), np.zeros(3), f, C)
    equal(came[0], C, "the image of a point on the axis")
    equal(came[1], C + [50, 100], "the image of (0.1, 0.2, 2) m, with f = 1000 px")
    equal(came[2], C + [25, 50], "the image of (0.1, 0.2, 4) m, with f = 1000 px")


@check("project", points=1)
def goes_to_the_cameras_frame(project):
    """points are first written in the coordinates of the camera"""
    for R, t in zip(TURNS, OFFSETS, strict=True):
        came = project(POINTS, R, t, 800.0, C)
        equal(came, solutions.project(POINTS, R, t, 800.0, C), "the image of some points", 1e-7)


@mistake("project", "R and t lead from the world to the camera: R x + t. This turns the other way")
def with_r_for_its_transpose(points, R, t, f, c):
    return solutions.project(points, R.T, t, f, c)


@mistake(
    "project",
    "t is the world's origin in the camera's coordinates, and not where the camera stands: R x + t",
)
def with_t_as_the_cameras_place(points, R, t, f, c):
    return solutions.project(points - t, R, np.zeros(3), f, c)


@mistake("project", "divide by the depth Z, and not by the distance to the point")
def by_the_distance(points, R, t, f, c):
    x = points @ R.T + t
    return f * x[:, :2] / np.linalg.norm(x, axis=1, keepdims=True) + c


@mistake("project", "the image's centre is missing: pixels are counted from a corner")
def without_the_centre(points, R, t, f, c):
    return solutions.project(points, R, t, f, np.zeros(2))


@mistake("project", "v points down, and so does the camera's y: no sign has to be changed")
def with_v_upwards(points, R, t, f, c):
    return (solutions.project(points, R, t, f, c) - c) * [1, -1] + c


# depth

TRUNK = np.array([0.5, 0.45, 0.2, 0.35])


@check("depth", points=1)
def is_exact_across(depth):
    """it is exact for bones across the line of sight"""
    for Z, f in ((2.0, 1000.0), (7.5, 600.0)):
        equal(depth(TRUNK, f * TRUNK / Z, f), Z, f"the depth of a trunk at {Z} m, f = {f} px")


@check("depth", points=1)
def is_of_the_means(depth):
    """it takes the ratio of means, so that a short bone counts little"""
    pixels = np.array([100.0, 95, 1, 70])
    equal(
        depth(TRUNK, pixels, 900.0),
        solutions.depth(TRUNK, pixels, 900.0),
        "the depth, one bone seen at its end",
    )


@mistake(
    "depth",
    "the fraction is upside down: what is further away looks smaller, so divide by the pixels",
)
def upside_down(lengths, pixels, f):
    return f * np.mean(pixels) / np.mean(lengths)


@mistake(
    "depth", "the mean of the ratios is another number: one bone that points at the camera ruins it"
)
def mean_of_ratios(lengths, pixels, f):
    return f * np.mean(lengths / pixels)


@mistake("depth", "the focal length is missing: metres over pixels is no length yet")
def without_f(lengths, pixels, f):
    return np.mean(lengths) / np.mean(pixels)


@mistake("depth", "this uses one bone only: use all of them")
def of_the_first(lengths, pixels, f):
    return f * lengths[0] / pixels[0]


# keypoint_residual

SEEN, OBSERVED = 100 * RNG.uniform(1, 5, size=(2, 4, 2))
CONFIDENCE = np.array([1.0, 0.5, 0.0, 0.9])


@check("keypoint_residual", points=1)
def is_in_sigmas(keypoint_residual):
    """for confidence 1 it is the difference in units of sigma"""
    off = np.array([[3.0, -6.0]])
    equal(
        keypoint_residual(OBSERVED[:1] + off, OBSERVED[:1], np.ones(1), 3.0),
        [1, -2],
        "the residual of a point that is off by (3, -6) px, for sigma = 3 px",
    )
    came = keypoint_residual(SEEN, OBSERVED, np.ones(4), 5.0)
    equal(came, ((SEEN - OBSERVED) / 5).ravel(), "the residual of four points of confidence 1")


@check("keypoint_residual", points=1)
def hears_confidence(keypoint_residual):
    """half the confidence means twice the sigma, and at confidence 0 the residual is zero"""
    r = keypoint_residual(SEEN, OBSERVED, CONFIDENCE, 5.0)
    equal(r[4:6], [0, 0], "the residual of a point of confidence 0")
    equal(
        r,
        solutions.keypoint_residual(SEEN, OBSERVED, CONFIDENCE, 5.0),
        "the residual of four points",
    )


@mistake("keypoint_residual", "the confidence was not used")
def without_confidence(seen, observed, confidence, sigma):
    return solutions.keypoint_residual(seen, observed, np.ones(len(seen)), sigma)


@mistake(
    "keypoint_residual",
    "sigma / c is the standard deviation, so the residual is multiplied by c; its square root would be "
    "right if c were a weight of the square",
)
def with_the_root(seen, observed, confidence, sigma):
    return solutions.keypoint_residual(seen, observed, np.sqrt(confidence), sigma)


@mistake("keypoint_residual", "this is what was observed minus the model")
def the_other_sign(seen, observed, confidence, sigma):
    return -solutions.keypoint_residual(seen, observed, confidence, sigma)


@mistake("keypoint_residual", "the order is wrong: this has all u first and then all v")
def all_u_first(seen, observed, confidence, sigma):
    return (confidence[:, None] * (seen - observed) / sigma).T.ravel()


@mistake("keypoint_residual", "sigma is missing: this is in pixels")
def in_pixels(seen, observed, confidence, sigma):
    return solutions.keypoint_residual(seen, observed, confidence, 1.0)


# triangulate

CAMERAS = [np.column_stack([R, t]) for R, t in zip(TURNS, OFFSETS, strict=True)]


def images(point, cameras):
    return [(P[:2] @ [*point, 1]) / (P[2] @ [*point, 1]) for P in cameras]


@check("triangulate", points=1)
def is_seen_where_it_was(triangulate):
    """the cameras see the answer where they saw the point"""
    for cameras in (CAMERAS[:2], CAMERAS[1:], CAMERAS):
        for x in POINTS[:3]:
            came = triangulate(cameras, images(x, cameras))
            for P, there in zip(cameras, images(x, cameras), strict=True):
                h = P @ [*came, 1]
                equal(h[:2] / h[2], there, f"the image of the answer, {len(cameras)} cameras", 1e-7)


@check("triangulate", points=1)
def is_where_it_is(triangulate):
    """it is the position of the point"""
    for cameras in (CAMERAS[:2], CAMERAS):
        for x in POINTS[3:]:
            equal(triangulate(cameras, images(x, cameras)), x, "the point", 1e-7)


def rows(cameras, seen):
    return np.array(
        [s[i] * P[2] - P[i] for P, s in zip(cameras, seen, strict=True) for i in range(2)]
    )


@mistake(
    "triangulate",
    "four homogeneous coordinates stand for a point up to a factor: divide by the last",
)
def not_divided(cameras, seen):
    return np.linalg.svd(rows(cameras, seen))[2][-1][:3]


@mistake(
    "triangulate",
    "this is the singular vector of the largest singular value; the solution belongs to the smallest, "
    "the last row",
)
def of_the_first_row(cameras, seen):
    h = np.linalg.svd(rows(cameras, seen))[2][0]
    return h[:3] / h[3]


@mistake("triangulate", "NumPy's svd answers V', so a direction is a row of it, not a column")
def of_a_column(cameras, seen):
    h = np.linalg.svd(rows(cameras, seen))[2][:, -1]
    return h[:3] / h[3]


@mistake(
    "triangulate",
    "the translations of the cameras are missing: all cameras would stand in one place",
)
def without_translation(cameras, seen):
    A = np.array(
        [s[i] * P[2, :3] - P[i, :3] for P, s in zip(cameras, seen, strict=True) for i in range(2)]
    )
    return np.linalg.svd(A)[2][-1]


# place

CLOUDS = [RNG.uniform(-0.5, 0.5, size=(5, 3)) + [0.3, 1.0, 0.2] for _ in range(3)]
NOISES = [0.02 * RNG.standard_normal((5, 3)) for _ in range(3)]


@check("place", points=1)
def is_exact_without_noise(place):
    """without noise it finds the motion"""
    for cloud, R, t in zip(CLOUDS, TURNS, OFFSETS, strict=True):
        found, shift = place(cloud, cloud @ R.T + t)
        equal(found, R, "R", 1e-9)
        equal(shift, t, "t", 1e-9)


@check("place", points=1)
def is_least(place):
    """R is a rotation, and no other motion brings noisy points nearer"""
    mirror = np.diag([1.0, 1.0, -1.0])
    for cloud, R, t, noise in zip(CLOUDS, TURNS, OFFSETS, NOISES, strict=True):
        for seen in (cloud @ R.T + t + noise, cloud @ mirror + t + noise):
            found, shift = place(cloud, seen)
            equal(found.T @ found, np.eye(3), "R'R", 1e-9)
            equal(np.linalg.det(found), 1, "det R", 1e-9)
            best, best_shift = solutions.place(cloud, seen)
            least = np.sum((cloud @ best.T + best_shift - seen) ** 2)
            came = np.sum((cloud @ found.T + shift - seen) ** 2)
            holds(
                came <= least + 1e-9,
                "the sum of squares",
                f"at most {least:.6f} m^2",
                f"{came:.6f} m^2",
            )


@mistake(
    "place", "R turns backwards: the matrix is the sum of y x', with what was seen on the left"
)
def the_other_way(rest, seen):
    p, q = rest.mean(axis=0), seen.mean(axis=0)
    R = solutions.place(rest, seen)[0].T
    return R, q - R @ p


@mistake("place", "R turns the mean of the points as well: t = mean of y - R times the mean of x")
def with_the_mean_unturned(rest, seen):
    R, _ = solutions.place(rest, seen)
    return R, seen.mean(axis=0) - rest.mean(axis=0)


@mistake(
    "place", "subtract the means first; otherwise the offset between them changes the rotation"
)
def without_the_means(rest, seen):
    U, _, Vt = np.linalg.svd(seen.T @ rest)
    R = U @ np.diag([1, 1, np.linalg.det(U @ Vt)]) @ Vt
    return R, seen.mean(axis=0) - R @ rest.mean(axis=0)


@mistake(
    "place",
    "this may be a reflection: where det is -1, change the sign that belongs to the smallest singular value",
)
def with_reflections(rest, seen):
    p, q = rest.mean(axis=0), seen.mean(axis=0)
    U, _, Vt = np.linalg.svd((seen - q).T @ (rest - p))
    return U @ Vt, q - U @ Vt @ p


# fit


@cache
def people():
    body = wb.load_body(BODY)
    found = []
    for seed in (1, 2):
        rng = np.random.default_rng(seed)
        pose, betas = POSE * rng.standard_normal((24, 3)), rng.standard_normal(body.n_betas)
        seen = body.joints(pose, betas, 0.2 * rng.standard_normal(3))
        found.append((body, seen + NOISE * rng.standard_normal((24, 3))))
    return found


def cost(body, seen, pose, betas, trans):
    off = body.joints(pose, betas, trans) - seen
    return np.sum(off**2) / NOISE**2 + np.sum(pose**2) / POSE**2 + np.sum(betas**2) / BETAS**2


@check("fit", points=1)
def meets_the_joints(fit):
    """the fitted joints are within twice the noise"""
    for body, seen in people():
        off = np.sqrt(np.mean((body.joints(*fit(seen)) - seen) ** 2))
        holds(
            off < 2 * NOISE,
            "the root mean square of joints minus seen",
            f"below {2 * NOISE} m",
            f"{off:.3f} m",
        )


@check("fit", points=2)
def is_least_of_all(fit):
    """it minimises the whole sum, with the priors"""
    for body, seen in people():
        came = cost(body, seen, *fit(seen))
        least = cost(body, seen, *solutions.fit(seen))
        holds(came < least + 0.05, "the sum of squares", f"at most {least:.2f}", f"{came:.2f}")


@mistake("fit", "this is the body at rest: nothing was fitted")
def at_rest(seen):
    start = wb.load_body(BODY).start()
    return start["pose"], start["betas"], start["trans"]


@mistake("fit", "only pose and betas are free: trans has to be free as well")
def without_translation_of_the_body(seen):
    return solutions.solved(tuple(seen.ravel()), POSE**2, ("pose", "betas"))


@mistake("fit", "the priors are missing: nothing limits twists that move no joint, or the shape")
def without_priors(seen):
    return solutions.solved(tuple(seen.ravel()), np.inf)


@mistake("fit", "`gaussian` takes a variance: the square of POSE")
def with_sigma_for_the_variance(seen):
    return solutions.solved(tuple(seen.ravel()), POSE)


@mistake("fit", "the betas were kept at zero: they are unknown as well")
def without_betas(seen):
    return solutions.solved(tuple(seen.ravel()), POSE**2, ("pose", "trans"))
