"""Predicted standard deviations beside those of many fits to data that are made anew."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import casadi as cs
import numpy as np

import workbench as wb
from workbench.arrays import Array
from workbench.blocks import Values
from workbench.diagnostics.design import (
    Candidate,
    MeasurementDesign,
    Quantity,
    design,
    sd_of,
    with_candidates,
)
from workbench.experiments.balance import balance_monocular
from workbench.fitting import default_markers
from workbench.fitting.body_priors import pose_prior, shape_prior
from workbench.fitting.candidates import (
    cameras_on_a_sphere,
    depth_of,
    marker_candidates,
    stature_of,
)
from workbench.fitting.refits import RepeatedFits, repeated_fits
from workbench.priors.poses import draw_poses, shipped_gaussian

FITS, SECOND = 400, 200
RESAMPLED = 2000


@dataclass(frozen=True, eq=False)
class Case:
    """A problem at a point, candidates, what matters, and the same as a function of values."""

    problem: wb.Problem
    values: Values
    candidates: Mapping[str, Candidate | wb.Residual]
    quantity: Quantity

    def number(self, fits: RepeatedFits) -> Array:
        """What matters at the end of each fit, (N,)."""
        expression = self.quantity.residual.graph()
        symbols = cs.symvar(expression)
        function = cs.Function("quantity", symbols, [expression])
        told = []
        for i in range(len(fits.ends)):
            at = fits.values(i, self.values)
            told.append(float(function(*(np.asarray(at[s.name()]).T for s in symbols))))
        return np.array(told)


def line() -> Case:
    """A cubic in seven noisy points; an eighth may be anywhere. Linear, so that all is exact."""
    w = wb.Block("w", (4,), "m")
    t = np.linspace(0, 1, 7)
    fit = wb.Residual("fit", cs.DM(np.vander(t, 4)) @ w.symbol, 0.1, "m", blocks=(w,))
    problem = wb.Problem([fit], ["w"], blocks=[w])
    candidates = {
        f"at {x:g}": wb.Residual("p", cs.DM(np.vander([x], 4)) @ w.symbol, 0.1, "m", blocks=(w,))
        for x in np.linspace(-0.5, 1.5, 9).tolist()
    }
    beyond = Quantity("the value at 1.3", cs.DM(np.vander([1.3], 4)) @ w.symbol, "m")
    return Case(problem, {"w": np.array([1.0, -2.0, 0.5, 3.0])}, candidates, beyond)


def decay() -> Case:
    """a exp(-k t) at five early times; one more time may be chosen, to know a half-life."""
    x = wb.Block("x", (2,), "1", ("a", "k"))
    early = np.array([0.0, 0.1, 0.2, 0.3, 0.4])

    def at(t: Array, name: str) -> wb.Residual:
        model = x.symbol[0] * cs.exp(-x.symbol[1] * cs.DM(t))
        return wb.Residual(name, model, 0.02, blocks=(x,))

    problem = wb.Problem([at(early, "early")], ["x"], blocks=[x])
    candidates = {f"at {t:g}": at(np.array([t]), "late") for t in (0.2, 0.5, 1.0, 1.5, 2.0, 3.0)}
    half = Quantity("the half-life", cs.log(2) / x.symbol[1], "s")
    return Case(problem, {"x": np.array([1.0, 1.2])}, candidates, half)


def worn() -> Case:
    """`small`, its joints seen to 2 cm with a third of them missing; one of 41 markers is added."""
    body = wb.load_body("small")
    blocks = body.blocks()
    joints = body.joint_points(*(block.symbol for block in blocks))
    sure = np.where(np.arange(24) % 3 == 0, 0.0, 1.0)
    seen = wb.residuals.landmarks(joints, np.zeros((24, 3)), sigma=0.02, name="joints")
    seen = replace(seen, weights=sure)
    problem = wb.Problem(
        [seen, pose_prior(body), shape_prior(body)], [block.name for block in blocks]
    )
    rng = np.random.default_rng(3)
    values = {
        "pose": draw_poses(shipped_gaussian(), 1, rng)[0],
        "betas": 0.5 * rng.normal(size=body.n_betas),
        "trans": np.zeros(3),
    }
    candidates = marker_candidates(body, default_markers(body))
    return Case(problem, values, candidates, stature_of(body))


def two_views() -> Case:
    """`small` in two cameras 20 degrees apart; a third may be anywhere. Where is the left wrist?"""
    body = wb.load_body("small")
    blocks = body.blocks()
    rng = np.random.default_rng(7)
    values = {
        "pose": draw_poses(shipped_gaussian(), 1, rng)[0],
        "betas": 0.5 * rng.normal(size=body.n_betas),
        "trans": np.zeros(3),
    }
    centre = body.joints(**values)[0]
    cameras = cameras_on_a_sphere(body, centre)
    narrow = cameras_on_a_sphere(body, centre, around=(0, 20), up=(0,))
    priors = wb.Problem([pose_prior(body), shape_prior(body)], ["pose", "betas"])
    joints = body.joint_points(*(block.symbol for block in blocks))
    hold = wb.residuals.gaussian(
        blocks[2].symbol, covariance=100.0, unit="m", name="anywhere within 10 m"
    )
    free = [block.name for block in blocks]
    problem = wb.Problem([*priors.residuals, hold], free, blocks=blocks)
    problem = with_candidates(problem, narrow, tuple(narrow))
    wrist = body.joint_names.index("left_wrist")
    place = Quantity("the left wrist's z", joints.symbol[2, wrist], "m", (joints,))
    return Case(problem, values, cameras, place)


def monocular() -> Case:
    """`balance-monocular`: a second camera may be anywhere 4 m away. How far away is the person?"""
    setup = balance_monocular()
    values = setup.start | wb.solve(setup.problem, setup.start).values
    body = setup.body
    assert body is not None
    centre = body.joints(*(values[block.name] for block in body.blocks()))[0]
    cameras = cameras_on_a_sphere(body, centre)
    return Case(setup.problem, values, cameras, depth_of(body, setup.views[0].camera, values))


CASES: Mapping[str, Callable[[], Case]] = {
    "a cubic": line,
    "a decay": decay,
    "41 markers": worn,
    "a third camera": two_views,
    "balance-monocular": monocular,
}


def predicted(case: Case) -> MeasurementDesign:
    """The best single candidate for what matters."""
    return design(case.problem, case.candidates, case.values, criterion=sd_of(case.quantity))


def interval(sample: Array, rng: np.random.Generator) -> tuple[float, float]:
    """The 95 % bootstrap interval of a standard deviation of numbers (N,)."""
    picks = rng.integers(0, len(sample), (RESAMPLED, len(sample)))
    low, high = np.quantile(sample[picks].std(axis=1, ddof=1), [0.025, 0.975])
    return float(low), float(high)


def compared(name: str, count: int = FITS) -> dict[str, Any]:
    """Predicted and simulated standard deviations of one case, before and after the best one."""
    case = CASES[name]()
    found = predicted(case)
    rng = np.random.default_rng(0)
    told: dict[str, Any] = {"best": found.best, "of": len(found.ranking), "unit": found.unit}
    told["quantity"], told["unknowns"], told["fits"] = (
        case.quantity.name,
        case.problem.free.size,
        count,
    )
    after = with_candidates(case.problem, case.candidates, found.chosen)
    for when, problem, sd in (
        ("before", case.problem, found.before.sd),
        ("after", after, found.after.sd),
    ):
        fits = repeated_fits(problem, case.values, count, seed=1)
        numbers = case.number(fits)
        low, high = interval(numbers, rng)
        told[when] = {
            "predicted": sd,
            "simulated": float(numbers.std(ddof=1)),
            "low": low,
            "high": high,
            "converged": int(fits.converged.sum()),
        }
    return told


def against_random(count: int = SECOND) -> dict[str, Any]:
    """The best second camera of `balance-monocular` beside random ones, one fit each."""
    case = monocular()
    found = predicted(case)
    rng = np.random.default_rng(2)
    sds = np.array([one.sd for one in found.ranking])
    names = [one.name for one in found.ranking]
    best = case.number(
        repeated_fits(
            with_candidates(case.problem, case.candidates, found.chosen), case.values, count, seed=3
        )
    )
    drawn = rng.integers(0, len(names), count)
    others = np.zeros(count)
    for i in sorted(set(drawn.tolist())):
        at = np.flatnonzero(drawn == i)
        problem = with_candidates(case.problem, case.candidates, [names[i]])
        others[at] = case.number(repeated_fits(problem, case.values, len(at), seed=100 + i))
    truth = float(case.number(_at_truth(case))[0])
    off = best - truth, others - truth
    rms = [float(np.sqrt(np.mean(one**2))) for one in off]
    picks = rng.integers(0, count, (2, RESAMPLED, count))
    ratios = np.sqrt(
        np.mean(off[1][picks[1]] ** 2, axis=1) / np.mean(off[0][picks[0]] ** 2, axis=1)
    )
    low, high = np.quantile(ratios, [0.025, 0.975])
    return {
        "fits": count,
        "best": found.best,
        "predicted": {
            "best": float(sds[0]),
            "random": float(np.sqrt(np.mean(sds**2))),
            "drawn": float(np.sqrt(np.mean(sds[drawn] ** 2))),
        },
        "simulated": {"best": rms[0], "random": rms[1]},
        "factor": {
            "predicted": float(np.sqrt(np.mean(sds**2)) / sds[0]),
            "simulated": rms[1] / rms[0],
            "low": float(low),
            "high": float(high),
        },
    }


def _at_truth(case: Case) -> RepeatedFits:
    x = case.problem.split(case.values)[0]
    return RepeatedFits(case.problem.free, x, x[None], np.array([True]))
