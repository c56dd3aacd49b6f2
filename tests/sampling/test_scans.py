"""Where a body stands on a scan, sampled: contacts are chosen anew at every point."""

import numpy as np

import workbench as wb
from workbench.registration import random_surface_points
from workbench.residuals import scan_to_model
from workbench.sampling import laplace, sample

NOISE = 0.005  # m
FREE = ("trans", "pose[pelvis]")


def placed(seed: int) -> tuple[wb.Problem, dict[str, np.ndarray]]:
    """200 noisy points of a body whose place and facing are free, and the minimum."""
    rng, body = np.random.default_rng(seed), wb.load_body("small")
    values = {**body.start(), "pose": 0.2 * rng.standard_normal((24, 3))}
    surface = body.vertices(values["pose"], values["betas"], values["trans"])
    points, _ = random_surface_points(surface, body.faces, 200, rng)
    points += NOISE * rng.standard_normal(points.shape)
    vertices = body.points(*(block.symbol for block in body.blocks()))
    problem = wb.Problem([scan_to_model(vertices, body.faces, points, sigma=NOISE)], FREE)
    return problem, values | wb.solve(problem, values).values


def test_draws_spread_as_laplaces_approximation_says() -> None:
    problem, at = placed(0)
    gaussian = laplace(problem, at, draws=400)
    drawn = sample(problem, at, walkers=16, ensembles=2, steps=250, seed=0)
    effective = drawn.mixing.effective
    assert effective.min() > 100
    errors = 4 / np.sqrt(2 * effective)  # four standard errors of a standard deviation
    assert (np.abs(drawn.sd / gaussian.sd - 1) < errors).all()
    off = drawn.flat.mean(axis=0) - problem.split(at)[0]
    assert (np.abs(off) < 4 * gaussian.sd / np.sqrt(effective) + 0.1 * gaussian.sd).all()
