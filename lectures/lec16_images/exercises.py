"""Exercises of lecture 16, fitting images.

Write each answer in place of the line that raises `Unsolved`, and keep the names, arguments and shapes.
Lengths are in metres, places in images in pixels (px), angles in radians. This command grades the file:

    workbench lecture check 16 lec16_images.py
"""

import numpy as np

from workbench.course import Unsolved

Array = np.ndarray


def torso_depth(points: Array, pixels: Array, focal: float) -> float:
    """How far away a person is, by similar triangles on the torso, as SMPLify begins.

    The rows are left shoulder, right shoulder, left hip and right hip. The length of the torso is the mean
    of the two distances from a shoulder to the hip of the same side, in space and in the image alike.

    points (4, 3) m; pixels (4, 2) px; focal px -> m
    """
    raise Unsolved("torso_depth")


def keypoint_cost(off: Array, confidence: Array, sigma: float, scale: float) -> float:
    """What reprojection errors cost: half of the sum of w rho over all coordinates.

    The weight w of a keypoint is the square of its confidence, and stands outside of Geman and McClure's loss
    rho. The scale is in px here, and not in sigmas as in the lecture: near zero an error r in px costs
    rho = (r / sigma)^2; at r = scale, half of that; and far away rho is (scale / sigma)^2.

    off (M, 2) px; confidence (M,); sigma, scale px -> the cost, no unit
    """
    raise Unsolved("keypoint_cost")


def bending_cost(pose: Array) -> float:
    """What elbows and knees cost that bend backwards: half of the sum of exp(2 s theta).

    Of each joint, theta is one number of its rotation vector: that about y for the elbows, joints 18 (left)
    and 19 (right), and that about x for the knees, joints 4 (left) and 5 (right). The sign s is such that
    s theta > 0 bends the joint backwards. The template stands with its arms to the sides and faces +z; its
    left arm points along +x. If in doubt, bend `workbench.load_body("small")` and look.

    pose (24, 3) rad -> the cost, no unit
    """
    raise Unsolved("bending_cost")


def mixture_costs(x: Array, shares: Array, means: Array, covariances: Array) -> tuple[float, float]:
    """Minus the log density of a mixture of Gaussians at x: by its likeliest component, and exactly.

    The first is min over j of -log(g_j N_j(x)), SMPLify's max-mixture; the second is -log of the sum of all
    g_j N_j(x). Both have all their constants. The second has to be finite wherever the first one is, even if
    every N_j(x) is too small for a floating-point number.

    x (D,); shares (C,), whose sum is 1; means (C, D); covariances (C, D, D) -> (max-mixture, exact)
    """
    raise Unsolved("mixture_costs")


def sphere_slope(distance: float, r1: float, r2: float) -> float:
    """The derivative of SMPLify's term of two spheres by the distance of their centres.

    The term is exp(-distance^2 / (s1^2 + s2^2)) with s = 0.3 r for each sphere.

    distance, r1, r2 m -> 1/m
    """
    raise Unsolved("sphere_slope")


def fitted_joints(pixels: Array, confidence: Array, focal: float, centre: Array) -> Array:
    """The joints of a person in one photograph, in the frame of the camera: x right, y down, z forward.

    The keypoints are the 23 landmarks "coco" of the body `default`, in its order
    (`workbench.load_body("default").landmark_names("coco")`), with an error of about 5 px; two of them may be
    wrong by 150 px, and one with confidence 0 was not seen. The people are 500 to 900 px tall. The joints,
    taken from the pelvis, should be off by less than 110 mm on average. You may use all of `workbench`, such as

        from workbench.fitting import Observations, image_fit, photograph
        camera = {"K": (3, 3) px, "R": (3, 3), "t": (3,) m}
        shot = photograph("one", (width, height) px, (23, 3) of u, v and confidence, camera)
        setup = image_fit(Observations(tuple of 23 names, (shot,)), body, "Which pose is it?")
        values = setup.strategy(None).solve(setup.problem, setup.start).values  # pose, betas, trans

    pixels (23, 2) px; confidence (23,); focal px; centre (2,) px -> joints (24, 3) m
    """
    raise Unsolved("fitted_joints")
