"""Solutions of lecture 16."""

from functools import cache

import numpy as np

import workbench as wb
from workbench.fitting import ImageFits, Observations, photograph
from workbench.residuals.numbers import HINGES

Array = np.ndarray


def torso_depth(points: Array, pixels: Array, focal: float) -> float:
    in_space, in_image = (
        np.linalg.norm(places[:2] - places[2:], axis=1).mean() for places in (points, pixels)
    )
    return focal * in_space / in_image


def keypoint_cost(off: Array, confidence: Array, sigma: float, scale: float) -> float:
    rho = (off / sigma) ** 2 / (1 + (off / scale) ** 2)
    return 0.5 * np.sum(confidence[:, None] ** 2 * rho)


def bending_cost(pose: Array) -> float:
    joints = {"left_elbow": 18, "right_elbow": 19, "left_knee": 4, "right_knee": 5}
    angles = [h.backwards * pose[joints[name], h.axis] for name, h in HINGES.items()]
    return 0.5 * np.sum(np.exp(2 * np.array(angles)))


def mixture_costs(x: Array, shares: Array, means: Array, covariances: Array) -> tuple[float, float]:
    costs = component_costs(x, shares, means, covariances)
    least = costs.min()
    return least, least - np.log(np.exp(least - costs).sum())


def component_costs(x: Array, shares: Array, means: Array, covariances: Array) -> Array:
    """-log(g_j N_j(x)) of each component, (C,)."""
    off = x - means
    distances = np.einsum("cd,cd->c", off, np.linalg.solve(covariances, off[..., None])[..., 0])
    log_dets = np.linalg.slogdet(2 * np.pi * covariances)[1]
    return 0.5 * distances + 0.5 * log_dets - np.log(shares)


def sphere_slope(distance: float, r1: float, r2: float) -> float:
    width = 0.3**2 * (r1**2 + r2**2)
    return -2 * distance / width * np.exp(-(distance**2) / width)


def fitted_joints(pixels: Array, confidence: Array, focal: float, centre: Array) -> Array:
    fits = image_fits()
    observed = seen_by(fits.body, pixels, confidence, focal, centre)
    setup = fits.setup(observed, "Which pose is it?")
    found = setup.strategy(None).solve(setup.problem, setup.start).values
    return fits.body.joints(found["pose"], found["betas"], found["trans"])


@cache
def image_fits() -> ImageFits:
    """Fits of the body `default`, by the recipe of the workbench."""
    return ImageFits(wb.load_body("default"))


def seen_by(body, pixels, confidence, focal, centre) -> Observations:
    """The keypoints in a photograph of a camera that is the world."""
    K = np.array([[focal, 0, centre[0]], [0, focal, centre[1]], [0, 0, 1]])
    camera = {"K": K, "R": np.eye(3), "t": np.zeros(3)}
    shot = photograph("one", 2 * centre, np.column_stack([pixels, confidence]), camera)
    return Observations(tuple(body.landmark_names("coco")), (shot,))
