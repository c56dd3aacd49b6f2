"""Intervals hold what they promise: simulated many times over, and where the sampler must fail."""

import numpy as np
import pytest
import scipy.stats

import workbench as wb
from workbench.problem.costs import compiled
from workbench.sampling.ensembles import SamplerSettings, run
from workbench.sampling.log_density import LogDensity
from workbench.sampling.subspace import fixed, subspace_of

pytestmark = pytest.mark.thorough

REPLICATIONS = 50
DRAWS = 99  # kept of each
ROOT, PLACE, PIXELS = 0.2, 0.15, 4.0  # rad, m, px: priors and noise
UNLIKELY = 1e-3  # over all entries together


def ranks(replications: int, seed: int = 0) -> tuple[tuple[str, ...], np.ndarray]:
    """Where the truth stands among draws of its posterior, uniform on (0, 1): (replications, k).

    One camera sees the keypoints of a body whose limbs are known; its orientation, betas and
    place, 16 numbers, are drawn from their priors, the keypoints from the truth (Talts et al.
    2018, Validating Bayesian inference algorithms with simulation-based calibration).
    """
    body = wb.load_body("small")
    pose, betas, trans = body.blocks()
    camera, seen = wb.Camera("camera/"), wb.Block("seen", (23, 2), "px")
    points = body.landmark_points("coco", pose.symbol, betas.symbol, trans.symbol)
    problem = wb.Problem(
        [
            wb.residuals.keypoints(points, camera, seen.symbol, np.ones(23), sigma=PIXELS),
            wb.residuals.gaussian(betas.symbol, name="shape"),
            wb.residuals.gaussian(pose.symbol[:, 0], covariance=ROOT**2, unit="rad", name="root"),
            wb.residuals.gaussian(trans.symbol, covariance=PLACE**2, unit="m", name="place"),
        ],
        ("pose", "betas", "trans"),
        blocks=[seen, *camera.blocks],
    )
    K = [[1000.0, 0, 500], [0, 1000, 500], [0, 0, 1]]
    photo = camera.values(K=K, R=np.diag([1.0, -1.0, -1.0]), t=[0.0, 0.0, 3.0])
    names = ("pose[pelvis]", "betas", "trans")
    labels, found = (), []
    for replication in range(replications):
        rng = np.random.default_rng([seed, replication])
        truth = {
            "pose": 0.3 * rng.standard_normal((24, 3)),
            "betas": rng.standard_normal(10),
            "trans": PLACE * rng.standard_normal(3),
        }
        truth["pose"][0] = ROOT * rng.standard_normal(3)
        pixels = camera.pixels(body.landmark("coco", *truth.values()), photo)
        at = truth | photo | {"seen": pixels + PIXELS * rng.standard_normal(pixels.shape)}
        x, given = problem.split(at)
        here = problem.linearize_at(x, given)
        space = fixed(problem, here, x, chosen_entries(problem, x, given, names))
        target = LogDensity(problem, given, space, compiled)
        plan = SamplerSettings(40, 1, 1600, 40, replication, whole=True)
        chain = run(target, plan).chain[0, 8:]  # of 40 kept, every 40th step
        draws = rng.permutation(chain.reshape(-1, space.size))[:DRAWS]
        below = np.sum(draws < space.centre, axis=0)
        found.append((below + rng.uniform(size=space.size)) / (DRAWS + 1))
        labels = space.labels
    return labels, np.array(found)


def chosen_entries(problem: wb.Problem, x: np.ndarray, given: np.ndarray, names: object) -> object:
    return subspace_of(problem, x, given, names, fixed).entries  # type: ignore[arg-type]


def test_ranks_of_truths_are_uniform() -> None:
    labels, u = ranks(REPLICATIONS)
    k = len(labels)
    assert k == 16
    chances = [scipy.stats.kstest(u[:, i], "uniform").pvalue for i in range(k)]
    assert min(chances) > UNLIKELY / k, dict(zip(labels, chances, strict=True))
    covered = np.sum(np.abs(u - 0.5) < 0.45, axis=0)
    low, high = scipy.stats.binom(REPLICATIONS, 0.9).ppf([UNLIKELY / k / 2, 1 - UNLIKELY / k / 2])
    assert (covered >= low).all(), dict(zip(labels, covered, strict=True))
    assert (covered <= high).all(), dict(zip(labels, covered, strict=True))
