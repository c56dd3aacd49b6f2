"""Coverage of intervals by simulation: truths from the prior, data from the truth, intervals.

Where a truth is drawn from the prior and the data from the truth, a posterior interval of 90 %
holds the truth in 90 % of the cases, whatever the problem (Cook, Gelman and Rubin 2006, Validation
of software for Bayesian models using posterior quantiles). All truths and data are synthetic. Five
problems are small enough for hundreds of fits; two of them are bodies.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import casadi as cs
import numpy as np
import scipy.stats

import workbench as wb
from workbench.bodies import SkinnedBody
from workbench.errors import WorkbenchError
from workbench.sampling import laplace

LEVEL = 0.9
UNLIKELY = 1e-3  # over all entries of a problem together
DRAWS = 1000  # of Laplace's approximation
SPREAD, TURN, PLACE = 0.01, 0.1, 0.03  # m of measured joints, rad and m of priors
PIXELS, AWAY = 4.0, 3.0  # px, m


@dataclass(frozen=True, eq=False)
class Simulated:
    """A problem whose free numbers have priors, and how its data are made.

    Attributes:
        problem: the problem.
        truth: from a generator to the values of all free blocks, drawn from the priors.
        data: from these values and a generator to the values of all blocks with data.
    """

    problem: wb.Problem
    truth: Callable[[np.random.Generator], wb.Values]
    data: Callable[[wb.Values, np.random.Generator], wb.Values]


def _curve(
    form: Callable[[Any, Any], Any], count: int, noise: float, mean: Any, sd: Any
) -> Simulated:
    """Numbers x with a Gaussian prior, measured as form(x, t) at times t between 0 and 1."""
    x, y = wb.Block("x", (len(mean),)), wb.Block("y", (count,))
    t, mean, sd = np.linspace(0, 1, count), np.asarray(mean), np.asarray(sd)
    terms = [
        wb.Residual("fit", form(x.symbol, cs.DM(t)) - y.symbol, noise),
        wb.residuals.gaussian(x.symbol, mean=mean, covariance=np.diag(sd**2), name="prior"),
    ]
    X = cs.MX.sym("x", len(mean))
    of = cs.Function("of", [X], [form(X, cs.DM(t))])
    return Simulated(
        wb.Problem(terms, "x", blocks=[x, y]),
        lambda rng: {"x": mean + sd * rng.standard_normal(len(mean))},
        lambda truth, rng: {
            "y": np.asarray(of(truth["x"])).ravel() + noise * rng.standard_normal(count)
        },
    )


def line() -> Simulated:
    """A parabola through nine points: linear, so that Laplace's approximation is exact."""
    return _curve(lambda x, t: x[0] + x[1] * t + x[2] * t**2, 9, 0.1, np.zeros(3), np.ones(3))


def decay() -> Simulated:
    """a exp(-b t): an amplitude and a rate."""
    return _curve(lambda x, t: x[0] * cs.exp(-x[1] * t), 12, 0.1, [2.0, 2.0], [0.3, 0.4])


def anchors() -> Simulated:
    """A place in the plane by its distances from four anchors."""
    corners = cs.DM([[-3, -3, 3, 3], [-3, 3, -3, 3]])

    def distances(x: Any, t: Any) -> Any:
        away = cs.repmat(x, 1, 4) - corners
        return cs.sqrt(cs.sum1(away**2)).T + 0 * t

    return _curve(distances, 4, 0.2, [0.0, 0.0], [0.7, 0.7])


def _body() -> tuple[SkinnedBody, wb.Values]:
    body = wb.load_body("small")
    still = {"pose": np.zeros((24, 3)), "betas": np.zeros(10), "trans": np.zeros(3)}
    return body, still


def arm() -> Simulated:
    """Shoulder and elbow of the body `small`, six numbers, by its joints in space."""
    body, still = _body()
    pose, betas, trans = body.blocks()
    seen = wb.Block("seen", (24, 3), "m")
    free = ("pose[left_shoulder]", "pose[left_elbow]")
    rows = [body.joint_names.index(name) for name in ("left_shoulder", "left_elbow")]
    joints = body.joint_points(pose.symbol, betas.symbol, trans.symbol)
    terms = [
        wb.residuals.landmarks(joints, seen.symbol, sigma=SPREAD),
        wb.residuals.gaussian(pose.symbol[:, rows], covariance=TURN**2, unit="rad", name="prior"),
    ]

    def truth(rng: np.random.Generator) -> wb.Values:
        turned = still["pose"].copy()
        turned[rows] = TURN * rng.standard_normal((2, 3))
        return still | {"pose": turned}

    def data(values: wb.Values, rng: np.random.Generator) -> wb.Values:
        at = body.joints(values["pose"], values["betas"], values["trans"])
        return {"seen": at + SPREAD * rng.standard_normal(at.shape)}

    return Simulated(wb.Problem(terms, free, blocks=[seen]), truth, data)


def shape() -> Simulated:
    """Betas and place of the body `small`, 13 numbers, by keypoints that one camera sees."""
    body, still = _body()
    pose, betas, trans = body.blocks()
    camera, seen = wb.Camera("camera/"), wb.Block("seen", (23, 2), "px")
    points = body.landmark_points("coco", pose.symbol, betas.symbol, trans.symbol)
    terms = [
        wb.residuals.keypoints(points, camera, seen.symbol, np.ones(23), sigma=PIXELS),
        wb.residuals.gaussian(betas.symbol, name="shape"),
        wb.residuals.gaussian(trans.symbol, covariance=PLACE**2, unit="m", name="place"),
    ]
    K = [[1000.0, 0, 500], [0, 1000, 500], [0, 0, 1]]
    photo = camera.values(K=K, R=np.diag([1.0, -1.0, -1.0]), t=[0.0, 0.0, AWAY])

    def truth(rng: np.random.Generator) -> wb.Values:
        return (
            still
            | photo
            | {
                "betas": rng.standard_normal(10),
                "trans": PLACE * rng.standard_normal(3),
            }
        )

    def data(values: wb.Values, rng: np.random.Generator) -> wb.Values:
        at = body.landmark("coco", values["pose"], values["betas"], values["trans"])
        pixels = camera.pixels(at, values)
        return {"seen": pixels + PIXELS * rng.standard_normal(pixels.shape)}

    problem = wb.Problem(terms, ("betas", "trans"), blocks=[seen, *camera.blocks])
    return Simulated(problem, truth, data)


PROBLEMS: dict[str, Callable[[], Simulated]] = {
    "parabola": line,
    "decay": decay,
    "distances": anchors,
    "arm of a body": arm,
    "shape and place of a body": shape,
}


def covered(one: Simulated, count: int, seed: int) -> dict[str, Any]:
    """How many of `count` fits are usable, and in how many of these each entry is covered.

    Each begins at the middle of the prior, where somebody would begin who does not know the truth.
    """
    problem, hits = one.problem, np.zeros(one.problem.free.size, dtype=int)
    usable = failed = 0
    middle = one.truth(_Middle())  # type: ignore[arg-type]  # draws nothing but zeros
    for i in range(count):
        rng = np.random.default_rng([seed, i])
        truth = one.truth(rng)
        values = truth | one.data(truth, rng)
        try:
            found = wb.solve(problem, middle | {k: values[k] for k in values if k not in middle})
            posterior = laplace(problem, values | found.values, draws=DRAWS, seed=i)
        except WorkbenchError:
            failed += 1
            continue
        if not posterior.usable:
            continue
        usable += 1
        ends, right = posterior.interval(LEVEL), problem.free.pack(truth)
        hits += (ends[:, 0] < right) & (right < ends[:, 1])
    labels = problem.free.labels_of(np.arange(problem.free.size))
    return {
        "labels": list(labels),
        "fits": count,
        "usable": usable,
        "failed": failed,
        "covered": hits.tolist(),
        "band": list(band(usable, problem.free.size)),
    }


class _Middle:
    """Takes the place of a generator, and draws zeros."""

    def standard_normal(self, size: Any = None) -> Any:
        """Zeros of this size."""
        return np.zeros(() if size is None else size)


def band(count: int, entries: int) -> tuple[int, int]:
    """Between which counts all entries lie together, but for a chance of one in a thousand."""
    tail = UNLIKELY / entries / 2
    low, high = scipy.stats.binom(count, LEVEL).ppf([tail, 1 - tail])
    return int(low), int(high)


def of_problems(count: int, seed: int) -> dict[str, Any]:
    """Every problem with so many fits."""
    found = {}
    for name, make in PROBLEMS.items():
        found[name] = covered(make(), count, seed)
        print(f"{name}: {found[name]}", flush=True)
    return found
