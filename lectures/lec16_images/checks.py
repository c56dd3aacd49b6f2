"""Checks of lecture 16, and the mistakes that they tell apart."""

from functools import cache

import numpy as np

import workbench as wb
from workbench.course import check, equal, holds, mistake
from workbench.fitting.images import NEARLY
from workbench.fitting.keypoints import KeypointProblem, keypoint_setup
from workbench.geometry.rotation import matrix_from_vector
from workbench.lectures.lec16_images import solutions
from workbench.priors.poses import draw_poses, shipped_mixture

RNG = np.random.default_rng(16)

# torso_depth

TORSO = np.array([[0.19, 0.45, 0.0], [-0.17, 0.47, 0.0], [0.1, -0.02, 0.0], [-0.11, 0.0, 0.0]])
FOCAL = 1200.0


def photographed(points, turn, away):
    """Pixels of the torso, turned about its middle, so many metres from the camera."""
    placed = (points - points.mean(axis=0)) @ matrix_from_vector(turn).T + [0.2, -0.1, away]
    return FOCAL * placed[:, :2] / placed[:, 2:] + [640, 360]


@check("torso_depth", points=1)
def is_exact_across(torso_depth):
    """it is exact if the torso lies across the line of sight, wherever it is"""
    for away in (2.5, 6.0):
        for turn in ([0, 0, 0.0], [0, 0, 0.7]):
            came = torso_depth(TORSO, photographed(TORSO, turn, away), FOCAL)
            equal(
                came, away, f"the depth of a torso {away} m away, turned in the image by {turn[2]}"
            )


@check("torso_depth", points=1)
def takes_means(torso_depth):
    """it takes means of lengths, also where one side is nearer than the other"""
    for turn in ([0.6, 0.4, 0.0], [-0.3, 0.9, 0.2]):
        pixels = photographed(TORSO, turn, 1.5)
        right = solutions.torso_depth(TORSO, pixels, FOCAL)
        equal(torso_depth(TORSO, pixels, FOCAL), right, f"the depth of a torso turned by {turn}")


def torso_lengths(points, pixels, ends=((0, 2), (1, 3))):
    a, b = np.transpose(ends)
    return [np.linalg.norm(places[a] - places[b], axis=1) for places in (points, pixels)]


@mistake("torso_depth", "it is upside down: what is far away looks small")
def upside_down(points, pixels, focal):
    H, h = torso_lengths(points, pixels)
    return focal * h.mean() / H.mean()


@mistake("torso_depth", "the focal length is missing: pixels are no metres")
def without_focal(points, pixels, focal):
    H, h = torso_lengths(points, pixels)
    return H.mean() / h.mean()


@mistake(
    "torso_depth",
    "this is the mean of two depths, one for each side; it should be one depth of the mean lengths",
)
def mean_of_depths(points, pixels, focal):
    H, h = torso_lengths(points, pixels)
    return focal * np.mean(H / h)


@mistake("torso_depth", "these lengths go from a shoulder to the hip of the other side")
def crosswise(points, pixels, focal):
    H, h = torso_lengths(points, pixels, ((0, 3), (1, 2)))
    return focal * H.mean() / h.mean()


@mistake("torso_depth", "the width of shoulders and hips changes with every turn: take the sides")
def by_widths(points, pixels, focal):
    H, h = torso_lengths(points, pixels, ((0, 1), (2, 3)))
    return focal * H.mean() / h.mean()


@mistake("torso_depth", "only the heights in the image count here: a person may lie on the side")
def by_heights(points, pixels, focal):
    H, _ = torso_lengths(points, pixels)
    return focal * H.mean() / np.abs(pixels[:2, 1] - pixels[2:, 1]).mean()


# keypoint_cost

OFF = np.array([[1.0, -2.0], [5.0, 0.5], [-40.0, 15.0], [0.0, 300.0]])
TRUST = np.array([1.0, 0.3, 0.8, 0.2])


@check("keypoint_cost", points=1)
def is_quadratic_near_and_flat_far(keypoint_cost):
    """near zero it is half of w r^2 / sigma^2; far away it is half of w (scale / sigma)^2"""
    for sigma, scale in ((4.0, 60.0), (2.0, 100.0)):
        for c in (1.0, 0.4):
            one, trust = np.array([[1e-3, 0.0]]), np.array([c])
            near = keypoint_cost(one, trust, sigma, scale) / 1e-6
            what = f"sigma {sigma} px, scale {scale} px, confidence {c}"
            equal(near, 0.5 * c**2 / sigma**2, f"the cost over r^2 near zero, {what}", 1e-7)
            far = keypoint_cost(1e10 * one, trust, sigma, scale)
            equal(far, 0.5 * c**2 * (scale / sigma) ** 2, f"the cost of 1e7 px, {what}", 1e-4)


@check("keypoint_cost", points=1)
def adds_up(keypoint_cost):
    """it adds up over all coordinates"""
    for sigma, scale in ((4.0, 60.0), (5.0, 20.0)):
        right = solutions.keypoint_cost(OFF, TRUST, sigma, scale)
        came = keypoint_cost(OFF, TRUST, sigma, scale)
        equal(came, right, f"the cost of four keypoints, sigma {sigma} px, scale {scale} px")


def summed(off, weight, rho):
    return 0.5 * np.sum(weight[:, None] * rho(off))


@mistake(
    "keypoint_cost", "the weight is inside of rho: a doubtful outlier then costs like a sure one"
)
def weight_inside(off, confidence, sigma, scale):
    inside = confidence[:, None] * off
    return summed(inside, np.ones(len(off)), lambda r: (r / sigma) ** 2 / (1 + (r / scale) ** 2))


@mistake("keypoint_cost", "the weight is the square of the confidence")
def weight_not_squared(off, confidence, sigma, scale):
    return summed(off, confidence, lambda r: (r / sigma) ** 2 / (1 + (r / scale) ** 2))


@mistake("keypoint_cost", "a half is missing: the cost is half of a sum of squares")
def without_half(off, confidence, sigma, scale):
    return 2 * solutions.keypoint_cost(off, confidence, sigma, scale)


@mistake(
    "keypoint_cost",
    "this is r^2 / (scale^2 + r^2), which is at most 1: near zero it should not depend on the scale",
)
def at_most_one(off, confidence, sigma, scale):
    return summed(off, confidence**2, lambda r: r**2 / (scale**2 + r**2))


@mistake("keypoint_cost", "outliers begin at the scale, and not at sigma")
def outliers_at_sigma(off, confidence, sigma, scale):
    return summed(off, confidence**2, lambda r: (r / sigma) ** 2 / (1 + (r / sigma) ** 2))


@mistake("keypoint_cost", "this is SMPLify's form in px^2, not divided by sigma^2")
def in_pixels(off, confidence, sigma, scale):
    return sigma**2 * solutions.keypoint_cost(off, confidence, sigma, scale)


@mistake("keypoint_cost", "this is the square: without rho an outlier costs without limit")
def squares(off, confidence, sigma, scale):
    return summed(off, confidence**2, lambda r: (r / sigma) ** 2)


@mistake(
    "keypoint_cost",
    "rho is of each coordinate here; this is rho of the distance of a keypoint in the image",
)
def of_distances(off, confidence, sigma, scale):
    r = np.linalg.norm(off, axis=1)
    return 0.5 * np.sum(confidence**2 * (r / sigma) ** 2 / (1 + (r / scale) ** 2))


# bending_cost

BENT = {"left elbow": (18, 1, -1), "right elbow": (19, 1, 1), "left knee": (4, 0, 1)}
BENT |= {"right knee": (5, 0, 1)}  # joint, axis, and the sign of a natural bend
POSE = RNG.normal(0, 0.4, (24, 3))


def bent(joint, axis, angle):
    pose = np.zeros((24, 3))
    pose[joint, axis] = angle
    return pose


@check("bending_cost", points=1)
def knows_backwards(bending_cost):
    """a natural bend costs less than a straight joint, and bending backwards more"""
    straight = bending_cost(np.zeros((24, 3)))
    equal(straight, 2.0, "the cost of four straight joints")
    for name, (joint, axis, natural) in BENT.items():
        for side, word in ((1, "as it should"), (-1, "backwards")):
            came = bending_cost(bent(joint, axis, side * natural * 1.0)) - straight
            expected = 0.5 * (np.exp(-2.0 * side) - 1)
            equal(came, expected, f"what is added by a {name} that bends {word} by 1 rad")


@check("bending_cost", points=1)
def reads_four_numbers(bending_cost):
    """it reads these four numbers of the pose, and no other"""
    equal(bending_cost(POSE), solutions.bending_cost(POSE), "the cost of a pose")
    others = POSE.copy()
    others[[18, 19], 0] += 1.0
    others[[4, 5], 1] -= 1.0
    others[[1, 2, 16, 17, 20]] *= 2
    equal(
        bending_cost(others), solutions.bending_cost(POSE), "the cost when the other numbers change"
    )


def summed_bends(pose, elbows=(1, -1), knees=(-1, -1), axes=(1, 0), power=2.0):
    angles = [s * pose[j, axes[0]] for s, j in zip(elbows, (18, 19), strict=True)]
    angles += [s * pose[j, axes[1]] for s, j in zip(knees, (4, 5), strict=True)]
    return 0.5 * np.sum(np.exp(power * np.array(angles)))


@mistake(
    "bending_cost",
    "without signs: this formula, which papers and notes print, holds if all natural angles are negative",
)
def without_signs(pose):
    return summed_bends(pose, (1, 1), (1, 1))


@mistake("bending_cost", "all signs are turned round: bending as it should costs most here")
def all_signs_wrong(pose):
    return summed_bends(pose, (-1, 1), (1, 1))


@mistake("bending_cost", "the elbows are mirror images of one another, and so their signs differ")
def elbows_alike(pose):
    return summed_bends(pose, (-1, -1))


@mistake("bending_cost", "the signs of the elbows: the left arm points along +x, and bends forward")
def elbows_exchanged(pose):
    return summed_bends(pose, (-1, 1))


@mistake(
    "bending_cost", "the knees: a positive turn about x takes the foot backwards, as it should"
)
def knees_wrong(pose):
    return summed_bends(pose, knees=(1, 1))


@mistake("bending_cost", "both knees turn about the same axis, in the same direction")
def knees_mirrored(pose):
    return summed_bends(pose, knees=(1, -1))


@mistake(
    "bending_cost", "the residual is exp(s theta), and the cost half of the sum of its squares"
)
def not_squared(pose):
    return summed_bends(pose, power=1.0)


@mistake("bending_cost", "elbows bend about y, knees about x: the axes are exchanged")
def axes_exchanged(pose):
    return summed_bends(pose, axes=(0, 1))


@mistake("bending_cost", "a half is missing")
def bends_without_half(pose):
    return 2 * summed_bends(pose)


# mixture_costs


def spread(D):
    A = RNG.normal(size=(D, D))
    return A @ A.T / D + 0.3 * np.eye(D)


MEANS = np.array([[0.0, 0.0, 0.0], [1.0, -0.5, 0.3], [-2.0, 1.0, 0.5]])
COVARIANCES = np.array([spread(3), 0.2 * spread(3), 2.5 * spread(3)])
SHARES = np.array([0.6, 0.1, 0.3])
PLACES = [
    np.zeros(3),
    np.array([0.7, -0.2, 0.1]),
    np.array([-1.0, 0.5, 0.2]),
    np.array([3.0, 2, 1]),
]
FAR = np.array([300.0, -200.0, 100.0])


@check("mixture_costs", points=1)
def lies_between(mixture_costs):
    """0 <= max-mixture - exact <= log C, and both bounds are reached"""
    for x in PLACES:
        largest, exact = mixture_costs(x, SHARES, MEANS, COVARIANCES)
        gap = largest - exact
        holds(
            -1e-12 <= gap <= np.log(3),
            f"max-mixture minus exact at {x.tolist()}",
            f"from 0 to log 3 = {np.log(3):.4f}",
            f"{gap:.4f}",
        )
    alike = np.full(4, 0.25), np.zeros((4, 2)), np.tile(np.eye(2), (4, 1, 1))
    largest, exact = mixture_costs(np.array([0.3, -0.2]), *alike)
    equal(largest - exact, np.log(4), "the gap of four components that are all the same")
    equal(exact, np.log(2 * np.pi) + 0.065, "the exact cost of these, which are one Gaussian")


@check("mixture_costs", points=1)
def are_the_costs(mixture_costs):
    """both are minus log densities, also where no density is left"""
    for x in PLACES:
        right = solutions.mixture_costs(x, SHARES, MEANS, COVARIANCES)
        equal(mixture_costs(x, SHARES, MEANS, COVARIANCES), right, f"the costs at {x.tolist()}")
    right = solutions.mixture_costs(FAR, SHARES, MEANS, COVARIANCES)
    came = mixture_costs(FAR, SHARES, MEANS, COVARIANCES)
    equal(came, right, "the costs far away, where every density is 0 in floating point", 1e-6)


def from_costs(costs):
    return costs.min(), costs.min() - np.log(np.exp(costs.min() - costs).sum())


@mistake(
    "mixture_costs",
    "log det is missing: a wide component is lower at its middle, and this decides which one is least",
)
def without_determinants(x, shares, means, covariances):
    costs = solutions.component_costs(x, shares, means, covariances)
    return from_costs(costs - 0.5 * np.linalg.slogdet(2 * np.pi * covariances)[1])


@mistake("mixture_costs", "the constant (D / 2) log(2 pi) is missing")
def without_two_pi(x, shares, means, covariances):
    costs = solutions.component_costs(x, shares, means, covariances)
    return from_costs(costs - 0.5 * len(x) * np.log(2 * np.pi))


@mistake("mixture_costs", "the shares g_j are missing")
def without_shares(x, shares, means, covariances):
    return from_costs(solutions.component_costs(x, shares, means, covariances) + np.log(shares))


@mistake("mixture_costs", "these are the two in the other order")
def other_order(x, shares, means, covariances):
    return solutions.mixture_costs(x, shares, means, covariances)[::-1]


@mistake("mixture_costs", "the signs: costs are minus the log densities")
def log_densities(x, shares, means, covariances):
    largest, exact = solutions.mixture_costs(x, shares, means, covariances)
    return -largest, -exact


@mistake("mixture_costs", "the log of a sum is not the sum of the logs")
def mean_of_costs(x, shares, means, covariances):
    costs = solutions.component_costs(x, np.ones(len(shares)), means, covariances)
    return solutions.mixture_costs(x, shares, means, covariances)[0], shares @ costs


@mistake(
    "mixture_costs",
    "far away every density is 0 in floating point, and log 0 is infinite: take the least cost out of the sum",
)
def without_taking_the_least_out(x, shares, means, covariances):
    costs = solutions.component_costs(x, shares, means, covariances)
    return costs.min(), -np.log(np.exp(-costs).sum())


@mistake("mixture_costs", "half of the squared distance: the half is missing")
def distances_not_halved(x, shares, means, covariances):
    off = x - means
    d2 = np.einsum("cd,cd->c", off, np.linalg.solve(covariances, off[..., None])[..., 0])
    return from_costs(solutions.component_costs(x, shares, means, covariances) + 0.5 * d2)


# sphere_slope

RADII = ((0.05, 0.05), (0.04, 0.09))


@check("sphere_slope", points=1)
def is_a_derivative(sphere_slope):
    """it is the derivative of the term"""
    for r1, r2 in RADII:
        width = 0.09 * (r1**2 + r2**2)
        for d in (0.01, 0.03, 0.08):
            h = 1e-6
            ends = [np.exp(-(x**2) / width) for x in (d - h, d + h)]
            came, expected = sphere_slope(d, r1, r2), (ends[1] - ends[0]) / (2 * h)
            equal(came, expected, f"the slope at {d} m, radii {r1} m and {r2} m", 1e-5)


@check("sphere_slope", points=1)
def vanishes_at_zero(sphere_slope):
    """it is 0 where the centres meet, and steepest at the root of (s1^2 + s2^2) / 2"""
    for r1, r2 in RADII:
        steepest = 0.3 * np.sqrt((r1**2 + r2**2) / 2)
        equal(sphere_slope(0.0, r1, r2), 0.0, "the slope where the centres meet")
        there = sphere_slope(steepest, r1, r2)
        equal(there * steepest, -np.exp(-0.5), "distance times slope at its steepest")
        for d in (0.9 * steepest, 1.1 * steepest):
            came = sphere_slope(d, r1, r2)
            holds(
                there < came < 0,
                f"the slope at {d:.4f} m",
                f"between {there:.4f} and 0",
                f"{came:.4f}",
            )


def sloped(distance, width, sign=-1.0):
    return sign * 2 * distance / width * np.exp(sign * distance**2 / width)


@mistake(
    "sphere_slope",
    "the minus sign is missing, as in the paper: this term is smallest where the spheres coincide",
)
def as_printed(distance, r1, r2):
    return sloped(distance, 0.09 * (r1**2 + r2**2), 1.0)


@mistake(
    "sphere_slope", "the sign: the term falls with the distance, so that its slope is negative"
)
def with_the_sign_lost(distance, r1, r2):
    return -solutions.sphere_slope(distance, r1, r2)


@mistake("sphere_slope", "this is the term itself, and not its derivative")
def the_term(distance, r1, r2):
    return np.exp(-(distance**2) / (0.09 * (r1**2 + r2**2)))


@mistake("sphere_slope", "the derivative of distance^2 is 2 distance")
def without_two(distance, r1, r2):
    return sloped(distance, 0.09 * (r1**2 + r2**2)) / 2


@mistake("sphere_slope", "the squares of the s are added, and not the s themselves")
def squared_sum(distance, r1, r2):
    return sloped(distance, 0.09 * (r1 + r2) ** 2)


@mistake("sphere_slope", "s = 0.3 r, which is not a third of r")
def a_third(distance, r1, r2):
    return sloped(distance, (r1**2 + r2**2) / 9)


@mistake(
    "sphere_slope", "s is missing: these are the spheres themselves, not a third of their size"
)
def whole_spheres(distance, r1, r2):
    return sloped(distance, r1**2 + r2**2)


# fitted_joints

CENTRE = np.array([550.0, 550.0])


@cache
def seen():
    """Two people: pixels, confidence, and the true joints in the camera's frame."""
    body, found = wb.load_body("default"), []
    draw = np.random.default_rng(18)
    for pose, facing in zip(draw_poses(shipped_mixture(), 2, draw), (0.4, 2.6), strict=True):
        R = np.diag([1.0, -1.0, -1.0]) @ matrix_from_vector([0.0, facing, 0.0])
        betas = 0.5 * draw.standard_normal(body.n_betas)
        t = np.array([0.1, -0.05, FOCAL * 1.7 / 650])
        trans = -body.joints(pose, betas).mean(axis=0)
        at = body.landmark("coco", pose, betas, trans) @ R.T + t
        pixels = FOCAL * at[:, :2] / at[:, 2:] + CENTRE + 5 * draw.standard_normal((len(at), 2))
        pixels[draw.choice(len(at), 2, replace=False)] += [110.0, -100.0]
        confidence = np.ones(len(at))
        confidence[draw.integers(5, len(at))] = 0.0
        joints = body.joints(pose, betas, trans) @ R.T + t
        found.append((pixels, confidence, joints))
    return found


def off_by(joints, truth):
    """How far joints are off on average, taken from the pelvis, mm."""
    return 1e3 * np.linalg.norm((joints - joints[0]) - (truth - truth[0]), axis=1).mean()


@check("fitted_joints", points=2)
def are_near(fitted_joints):
    """the joints are off by less than 110 mm, two keypoints being wrong"""
    for k, (pixels, confidence, truth) in enumerate(seen(), 1):
        came = off_by(fitted_joints(pixels, confidence, FOCAL, CENTRE), truth)
        holds(
            came < 110,
            f"how far the joints of person {k} are off",
            "below 110 mm",
            f"{came:.0f} mm",
        )


@check("fitted_joints", points=1)
def are_in_the_camera(fitted_joints):
    """the person is in front of the camera, where the keypoints are"""
    pixels, confidence, truth = seen()[0]
    came = fitted_joints(pixels, confidence, FOCAL, CENTRE)
    depth = came[0, 2] / truth[0, 2]
    holds(
        0.75 < depth < 1.33,
        "the pelvis' distance over the true one",
        "from 0.75 to 1.33",
        f"{depth:.2f}",
    )
    image = FOCAL * came[:, :2] / came[:, 2:] + CENTRE
    true_image = FOCAL * truth[:, :2] / truth[:, 2:] + CENTRE
    off = np.median(np.linalg.norm(image - true_image, axis=1))
    holds(
        off < 40, "how far the joints are off in the image, median", "below 40 px", f"{off:.0f} px"
    )


KNOWN = {}  # the joints of people who were fitted already, since fits take their time


def known(fit, pixels, *others):
    """What a fit answers, which is made once for the same keypoints."""
    key = fit.__name__, pixels.tobytes()
    if key not in KNOWN:
        KNOWN[key] = fit(pixels, *others)
    return KNOWN[key]


@mistake("fitted_joints", "this is the start: the body at rest, where its torso was seen")
def only_placed(pixels, confidence, focal, centre):
    setup = placing(pixels, confidence, focal, centre)
    return setup.body.joints(*(setup.start[name] for name in ("pose", "betas", "trans")))


@mistake(
    "fitted_joints",
    "this is a fit without a robust loss: two keypoints are wrong, and the square believes them",
)
def without_robust_loss(pixels, confidence, focal, centre):
    return known(by_squares, pixels, confidence, focal, centre)


@mistake("fitted_joints", "y points down in the frame of the camera")
def y_points_up(pixels, confidence, focal, centre):
    right = known(solutions.fitted_joints, pixels, confidence, focal, centre)
    return right * [1, -1, 1]


@mistake("fitted_joints", "this is the person in millimetres")
def in_millimetres(pixels, confidence, focal, centre):
    return 1e3 * known(solutions.fitted_joints, pixels, confidence, focal, centre)


def by_squares(pixels, confidence, focal, centre):
    setup = placing(pixels, confidence, focal, centre)
    found = NEARLY.solve(setup.problem, setup.start).values
    return setup.body.joints(found["pose"], found["betas"], found["trans"])


def placing(pixels, confidence, focal, centre):
    of = keypoint_problem()
    return keypoint_setup(of, solutions.seen_by(of.body, pixels, confidence, focal, centre), "")


@cache
def keypoint_problem() -> KeypointProblem:
    return KeypointProblem(wb.load_body("default"))
