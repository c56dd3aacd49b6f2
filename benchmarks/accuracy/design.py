"""What to measure next: predictions of `wb.design` beside what fits find.

Predicted standard deviations stand beside those of many fits to data that are made anew at a point,
with noise of the size that each sigma states (`repeated_fits`). The four real cameras of
`balance` are ranked as second cameras beside each first one. Nothing was tuned.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import kendalltau

import workbench as wb
from benchmarks.accuracy.images import NAMES, limbs
from benchmarks.measuring import table
from workbench.arrays import Array, Mask
from workbench.blocks import Block, Layout, Values
from workbench.bodies import SkinnedBody
from workbench.diagnostics.design import (
    Candidate,
    MeasurementDesign,
    Quantity,
    design,
    sd_of,
    with_candidates,
)
from workbench.errors import BadArgument
from workbench.experiments.balance import balance, balance_monocular, observations
from workbench.fitting import default_markers
from workbench.fitting.body_priors import pose_prior, shape_prior
from workbench.fitting.candidates import (
    cameras_of,
    cameras_on_a_sphere,
    depth_of,
    marker_candidates,
    stature_of,
)
from workbench.priors.poses import draw_poses, shipped_gaussian
from workbench.problem import Problem
from workbench.residuals import Residual
from workbench.solvers import Solver, TrustRegion

FITS, SECOND = 400, 200
FRAMES = range(0, 100, 4)  # of `balance`
RESAMPLED = 2000
MM = 1e3


@dataclass(frozen=True, eq=False)
class RepeatedFits:
    """The ends of N fits.

    Attributes:
        free: the layout of the unknowns.
        ends: (N, n) the free numbers at the ends.
        converged: (N,) which of the fits converged.
    """

    free: Layout
    ends: Array
    converged: Mask

    def values(self, fit: int, values: Values) -> Values:
        """The values of all blocks at the end of one fit; fixed ones are taken from `values`."""
        return dict(values) | self.free.unpack(self.ends[fit])


def repeated_fits(
    problem: Problem,
    values: Mapping[str, ArrayLike],
    count: int,
    *,
    seed: int = 0,
    solver: Solver | None = None,
) -> RepeatedFits:
    """`count` fits to data with new noise, each of which begins at the point `values`.

    At that point x* every whitened row r(x) is replaced by r(x) - r(x*) - e with e ~ N(0, 1): data
    at which x* is exact, and noise of the size that sigma states. Priors count as data about x*, so
    that the ends spread as the posterior does: exactly where residuals are linear (randomized
    maximum likelihood; Oliver, He and Reynolds, Conditioning permeability fields to pressure data,
    1996).

    Bounds and constraints hold as usual. Raises BadArgument for less than one fit, and for a
    problem whose residuals are of a sequence.
    """
    if count < 1:
        raise BadArgument(f"one fit or more can be made, not {count}")
    if any(residual.by_frame for residual in problem.residuals):
        raise BadArgument(
            "the data of a sequence are not made anew; take the problem of one frame, or stack "
            "residuals of your own in a Problem"
        )
    x, fixed = problem.split(values)
    exact = problem.residual(x, fixed)
    noise = Block("noise", (problem.size,), "1")
    noisy = []
    for one in problem.residuals:  # zero at the point but for the noise
        rows = problem.rows[one.name]
        whitened = one.whitened - exact[rows] - noise.symbol[rows]
        noisy.append(Residual(one.name, whitened, 1.0, points=one.points, blocks=one.blocks))
    blocks = (*problem.known.values(), noise)
    made = Problem(
        noisy, problem.free.spelled(), problem.bounds, blocks, constraints=problem.constraints
    )
    rng, by = np.random.default_rng(seed), solver or TrustRegion()
    ends, converged = [], []
    for _ in range(count):
        data = {noise.name: rng.standard_normal(problem.size)}
        solution = by.solve(made, {**problem.read(values), **data})
        ends.append(problem.split(dict(values) | solution.values)[0])
        converged.append(solution.converged)
    return RepeatedFits(problem.free, np.array(ends), np.array(converged))


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
    "a decay": decay,
    "41 markers": worn,
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
    """The best second camera of `balance-monocular` beside random ones, one fit each: root mean
    squares of the distance's errors in m, predicted and simulated.
    """
    case = monocular()
    found = predicted(case)
    sds = np.array([one.sd for one in found.ranking])
    x = case.problem.split(case.values)[0]
    at_truth = RepeatedFits(case.problem.free, x[None], np.array([True]))
    truth = float(case.number(at_truth)[0])

    def errors(name: str, fits: int, seed: int) -> Array:
        problem = with_candidates(case.problem, case.candidates, [name])
        return case.number(repeated_fits(problem, case.values, fits, seed=seed)) - truth

    best, others = errors(found.best, count, 3), np.zeros(count)
    drawn = np.random.default_rng(2).integers(0, len(sds), count)
    for i in sorted(set(drawn.tolist())):
        at = np.flatnonzero(drawn == i)
        others[at] = errors(found.ranking[i].name, len(at), 100 + i)
    picks = np.random.default_rng(3).integers(0, count, (2, RESAMPLED, count))
    ratios = np.sqrt(np.mean(others[picks[1]] ** 2, axis=1) / np.mean(best[picks[0]] ** 2, axis=1))
    return {
        "fits": count,
        "best": found.best,
        "predicted": [float(sds[0]), float(np.sqrt(np.mean(sds**2)))],
        "simulated": [float(np.sqrt(np.mean(off**2))) for off in (best, others)],
        "interval of the ratio": np.quantile(ratios, [0.025, 0.975]).tolist(),
    }


# The cameras of `balance`


def places(body: SkinnedBody) -> Quantity:
    """The places of the twelve landmarks of the limbs, (36, 1) m."""
    points = body.landmark_points("coco", *(block.symbol for block in body.blocks()))
    names = body.landmark_names("coco")
    chosen = [names.index(name) for name in NAMES]
    return Quantity("the limbs", cs.vec(points.symbol[:, chosen]), "m", (points,))


def of_frame(number: int, sigma: float = 4.0) -> list[dict[str, Any]]:
    """Every first and second camera of a frame: predicted sd and error, m, rms over landmarks."""
    photographs = observations(number)[0].photographs
    cameras = [photo.name for photo in photographs]
    fitted: dict[frozenset[str], Values] = {}

    def fit(*seen: str) -> tuple[wb.Problem, Values, SkinnedBody]:
        held_out = [name for name in cameras if name not in seen]
        setup = balance(number, held_out=held_out, sigma=sigma, compared=())
        assert isinstance(setup.body, SkinnedBody)
        key = frozenset(seen)
        if key not in fitted:
            fitted[key] = setup.start | wb.solve(setup.problem, setup.start).values
        return setup.problem, fitted[key], setup.body

    _, four, body = fit(*cameras)

    def places_of(body: SkinnedBody, values: Values) -> Array:
        at = [values[block.name] for block in body.blocks()]
        return limbs(body, body.landmark("coco", *at))

    true = places_of(body, four)
    found = []
    for first in cameras:
        problem, values, own = fit(first)
        others = [photo for photo in photographs if photo.name != first]
        told = design(
            problem, cameras_of(own, others, sigma=sigma), values, criterion=sd_of(places(own))
        )
        predicted = {one.name: one.sd / np.sqrt(len(NAMES)) for one in told.ranking}
        for second in predicted:
            off = places_of(own, fit(first, second)[1]) - true
            error = float(np.sqrt(np.mean(np.sum(off**2, axis=1))))
            found.append(
                {
                    "frame": number,
                    "first": first,
                    "second": second,
                    "predicted": float(predicted[second]),
                    "error": error,
                }
            )
    return found


def judged(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """How often the predicted best is the best, and how alike the two orders of three are."""
    frames = sorted({row["frame"] for row in rows})
    firsts = sorted({row["first"] for row in rows})
    hits, taus = np.zeros((len(frames), len(firsts))), np.zeros((len(frames), len(firsts)))
    for i, number in enumerate(frames):
        for j, first in enumerate(firsts):
            three = [row for row in rows if row["frame"] == number and row["first"] == first]
            sd, error = (np.array([row[key] for row in three]) for key in ("predicted", "error"))
            hits[i, j] = np.argmin(sd) == np.argmin(error)
            taus[i, j] = kendalltau(sd, error).statistic
    rng = np.random.default_rng(0)
    picks = rng.integers(0, len(frames), (RESAMPLED, len(frames)))  # whole frames

    def spread(each: Array) -> list[float]:
        return [float(q) for q in np.quantile(each[picks].mean(axis=(1, 2)), [0.025, 0.975])]

    return {
        "frames": len(frames),
        "cases": hits.size,
        "best is best": float(hits.mean()),
        "best is best, interval": spread(hits),
        "tau": float(taus.mean()),
        "tau, interval": spread(taus),
    }


def measured(quick: bool) -> dict[str, object]:
    """All three."""
    names, rows = list(CASES)[: 2 if quick else None], []
    for number in FRAMES[: 2 if quick else None]:
        rows += of_frame(number)
    return {
        "compared": {name: compared(name, 40 if quick else FITS) for name in names},
        "against random": against_random(4 if quick else SECOND),
        "recorded": judged(rows),
    }


def tables(found: dict[str, Any]) -> str:
    """All three."""
    head: tuple[str, ...]
    rows: list[tuple[object, ...]] = []
    for name, one in found["compared"].items():
        for when, after in (("before", ""), ("after", f", with {one['best']} of {one['of']}")):
            row, unit = one[when], one["unit"]
            told = f"{row['simulated']:.4g} ({row['low']:.4g} to {row['high']:.4g}) {unit}"
            ratio = f"{row['predicted'] / row['simulated']:.2f}"
            rows.append(
                (
                    f"{name}: {one['quantity']}{after}",
                    *(one["unknowns"], f"{row['predicted']:.4g} {unit}", told, ratio, one["fits"]),
                )
            )
    head = (
        *("standard deviations", "unknowns", "predicted", "of fits (95 % bootstrap)"),
        *("predicted / of fits", "fits"),
    )
    text = table(head, rows)
    two = found["against random"]
    rows = [
        (name, f"{MM * two['predicted'][i]:.1f}", f"{MM * two['simulated'][i]:.1f}")
        for i, name in enumerate((f"the best, {two['best']}", "a random one"))
    ]
    low, high = two["interval of the ratio"]
    ratios = [two[how][1] / two[how][0] for how in ("predicted", "simulated")]
    rows.append(("random / best", f"{ratios[0]:.2f}", f"{ratios[1]:.2f} ({low:.2f} to {high:.2f})"))
    head = (
        f"a second camera for `balance-monocular`, {two['fits']} fits each, mm",
        *("predicted", "simulated"),
    )
    text += f"\n{table(head, rows)}"
    real = found["recorded"]
    share, tau = real["best is best, interval"], real["tau, interval"]
    return (
        f"{text}\nOf the real cameras, in {100 * real['best is best']:.0f} % "
        f"({100 * share[0]:.0f} to {100 * share[1]:.0f}) of {real['cases']} cases "
        f"({real['frames']} frames, each camera as "
        "the first) the predicted best of three second ones has the smallest error, where chance "
        f"has 33 %; Kendall's tau of the two orders is {real['tau']:.2f} ({tau[0]:.2f} to "
        f"{tau[1]:.2f}). Intervals are of 95 %, by a bootstrap over whole frames.\n"
    )
