"""What is claimed of posteriors: beside NUTS, against known truths, and how many a second.

Ensembles of emcee are compared with NUTS (Hoffman and Gelman 2014, as in nutpie), which shares
nothing with them but the problem: it takes the cost and gradient of `Problem.cost_gradients`, in
coordinates whitened by Laplace's approximation at the mode. Intervals are judged on densities whose
marginals are known (`known_posteriors`), and by truths drawn from priors: where data are made of
such a truth, a posterior interval of 90 % holds it in 90 % of the cases (Cook, Gelman and Rubin
2006, Validation of software for Bayesian models using posterior quantiles).
"""

import time
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, partial
from importlib.util import find_spec
from typing import Any

import casadi as cs
import emcee
import numpy as np
import scipy.stats

import workbench as wb
from benchmarks.accuracy import share
from benchmarks.known_posteriors import DENSITIES, verdicts
from benchmarks.measuring import table
from benchmarks.problems import random_body
from workbench.arrays import Array, Index
from workbench.blocks.layout import entries
from workbench.errors import WorkbenchError
from workbench.experiments import find
from workbench.problem.costs import compiled, interpreted
from workbench.sampling import fixed, laplace, sample
from workbench.sampling.modes import Mode
from workbench.threads import limited_threads

PACKAGES = ("emcee", "nutpie", "arviz")
LEVEL = 0.9
SEEDS, FITS = 20, 200  # of each known density, and of each simulated problem
UNLIKELY = 1e-3  # over all entries of a problem together
DRAWS = 1000  # of Laplace's approximation
SPREAD, TURN, PLACE = 0.01, 0.1, 0.03  # m of measured joints, rad and m of priors
PIXELS, AWAY = 4.0, 3.0  # px, m
ARMS = {
    side: tuple(f"pose[{side}_{joint}]" for joint in ("shoulder", "elbow", "wrist"))
    for side in ("left", "right")
}
BLOCKS = {
    "betas": ("betas",),
    "left arm": ARMS["left"],
    "orientation, betas, trans": ("pose[pelvis]", "betas", "trans"),
    "both arms, trans": (*ARMS["left"], *ARMS["right"], "trans"),
}
ALLOWED_SD, ALLOWED_MEAN, TIMES = 0.05, 0.1, 50.0
NUTS_DRAWS, WARM, ACCEPTED = 6000, 2000, 0.97  # of each of four chains; small steps
WALKERS = 192
ALONE = "emcee alone"


# Beside NUTS


def beside_nuts(block: Sequence[str], draws: int, steps: int, seed: int = 1) -> dict[str, Any]:
    """One block of the posterior of `balance-monocular` by both, all other entries fixed."""
    problem, at = monocular()
    ours = sample(problem, at, block, rest=fixed, seed=seed, steps=steps)
    with limited_threads():
        began = time.perf_counter()
        x, given = problem.split(at)
        places = entries(problem.free, block)
        theirs, told = nuts(problem, x, given, places, ours.modes[0], draws, seed)
        seconds = time.perf_counter() - began
    flat = theirs.reshape(-1, ours.size)
    ratio = ours.sd / flat.std(axis=0)
    shift = float((np.abs(ours.mean - flat.mean(axis=0)) / flat.std(axis=0)).max())
    over = ours.sd / np.linalg.norm(ours.modes[0].half, axis=1)
    alike = np.abs(ratio - 1).max() <= ALLOWED_SD and shift <= ALLOWED_MEAN
    return {
        "entries": ours.size,
        "times": float(ours.mixing.length),
        "seconds": [ours.seconds, seconds],
        "nuts": told,
        "sd ratio": [float(ratio.min()), float(ratio.max())],
        "mean apart": shift,
        "sd over Laplace's": [float(over.min()), float(over.max())],
        "agree": bool(alike and ours.mixing.length >= TIMES),
    }


@cache
def monocular() -> tuple[wb.Problem, wb.Values]:
    """`balance-monocular`, solved: a person on a beam, seen by one camera."""
    setup = find("balance-monocular").setup()
    return setup.problem, setup.start | wb.solve(setup.problem, setup.start).values


def nuts(
    problem: wb.Problem, x: Array, given: Array, places: Index, mode: Mode, draws: int, seed: int
) -> tuple[Array, dict[str, Any]]:
    """Draws (4, N, k) of x's entries in these places, and what is known of them.

    Chains begin at draws of Laplace's approximation at the mode.
    """
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", r"\s*ArviZ is undergoing", FutureWarning)
        import arviz as az  # beside nutpie, which needs it
        import nutpie
        from nutpie.compiled_pyfunc import from_pyfunc

    k, gradients = len(places), problem.cost_gradients(x, given, places)

    def make_log_density() -> Callable[[Array], tuple[float, Array]]:
        def log_density(u: Array) -> tuple[float, Array]:
            cost, gradient = gradients((mode.z + mode.half @ u)[None])
            return -float(cost[0]), -(mode.half.T @ gradient[0])

        return log_density

    model = from_pyfunc(
        ndim=k,
        make_logp_fn=make_log_density,
        make_expand_fn=lambda *_: lambda u: {"z": mode.z + mode.half @ u},
        expanded_dtypes=[np.dtype(np.float64)],
        expanded_shapes=[(k,)],
        expanded_names=["z"],
        make_initial_point_fn=lambda s: np.random.default_rng(s).standard_normal(k),
    )
    trace = nutpie.sample(
        model,
        draws=draws,
        tune=WARM,
        chains=4,
        cores=1,
        seed=seed,
        progress_bar=False,
        target_accept=ACCEPTED,
    )
    return np.asarray(trace.posterior["z"]), {
        "R-hat": float(az.rhat(trace)["z"].max()),
        "divergences": int(np.asarray(trace.sample_stats["diverging"]).sum()),
        "effective": float(az.ess(trace)["z"].min()),
        "draws": 4 * draws,
    }


# Coverage


@dataclass(frozen=True, eq=False)
class Simulated:
    """A problem whose free numbers have priors, and how its data are made.

    Attributes:
        problem: the problem.
        middle: values of all known and free blocks at the middle of the priors.
        truth: from a generator to values of the free blocks, drawn from the priors.
        data: from all values but the data to the exact values of the one block with data.
        noise: of the data.
    """

    problem: wb.Problem
    middle: wb.Values
    truth: Callable[[np.random.Generator], wb.Values]
    data: Callable[[wb.Values], wb.Values]
    noise: float


def decay() -> Simulated:
    """a exp(-b t): an amplitude and a rate."""
    x, y = wb.Block("x", (2,)), wb.Block("y", (12,))
    t, mean, sd, noise = np.linspace(0, 1, 12), np.array([2.0, 2.0]), np.array([0.3, 0.4]), 0.1
    form = x.symbol[0] * cs.exp(-x.symbol[1] * cs.DM(t))
    terms = [
        wb.Residual("fit", form - y.symbol, noise),
        wb.residuals.gaussian(x.symbol, mean=mean, covariance=np.diag(sd**2), name="prior"),
    ]
    return Simulated(
        wb.Problem(terms, "x", blocks=[x, y]),
        {"x": mean},
        lambda rng: {"x": mean + sd * rng.standard_normal(2)},
        lambda values: {"y": values["x"][0] * np.exp(-values["x"][1] * t)},
        noise,
    )


STILL = {"pose": np.zeros((24, 3)), "betas": np.zeros(10), "trans": np.zeros(3)}


def arm() -> Simulated:
    """Shoulder and elbow of the body `small`, six numbers, by its joints in space."""
    body = wb.load_body("small")
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
        turned = STILL["pose"].copy()
        turned[rows] = TURN * rng.standard_normal((2, 3))
        return {"pose": turned}

    return Simulated(
        wb.Problem(terms, free, blocks=[seen]),
        STILL,
        truth,
        lambda values: {"seen": body.joints(*(values[name] for name in STILL))},
        SPREAD,
    )


def shape() -> Simulated:
    """Betas and place of the body `small`, 13 numbers, by keypoints that one camera sees."""
    body = wb.load_body("small")
    pose, betas, trans = body.blocks()
    camera, seen = wb.Camera("camera/"), wb.Block("seen", (23, 2), "px")
    points = body.landmark_points("coco", pose.symbol, betas.symbol, trans.symbol)
    terms = [
        wb.residuals.keypoints(points, camera, seen.symbol, np.ones(23), sigma=PIXELS),
        wb.residuals.gaussian(betas.symbol, name="shape"),
        wb.residuals.gaussian(trans.symbol, covariance=PLACE**2, unit="m", name="place"),
    ]
    K = np.array([[1000.0, 0, 500], [0, 1000, 500], [0, 0, 1]])
    photo = camera.values(K=K, R=np.diag([1.0, -1.0, -1.0]), t=[0.0, 0.0, AWAY])

    def data(values: wb.Values) -> wb.Values:
        at = body.landmark("coco", *(values[name] for name in STILL))
        return {"seen": camera.pixels(at, values)}

    return Simulated(
        wb.Problem(terms, ("betas", "trans"), blocks=[seen, *camera.blocks]),
        STILL | photo,
        lambda rng: {"betas": rng.standard_normal(10), "trans": PLACE * rng.standard_normal(3)},
        data,
        PIXELS,
    )


PROBLEMS: dict[str, Callable[[], Simulated]] = {
    "decay": decay,
    "arm of a body": arm,
    "shape and place of a body": shape,
}


def covered(one: Simulated, count: int, seed: int = 1) -> dict[str, Any]:
    """How many of `count` fits are usable, and in how many of these each entry is covered by
    Laplace's interval.

    Each begins at the middle of the prior, where somebody would begin who does not know the truth.
    """
    problem, hits = one.problem, np.zeros(one.problem.free.size, dtype=int)
    usable = failed = 0
    for i in range(count):
        rng = np.random.default_rng([seed, i])
        truth = one.middle | one.truth(rng)
        seen = {
            name: exact + one.noise * rng.standard_normal(exact.shape)
            for name, exact in one.data(truth).items()
        }
        start = one.middle | seen
        try:
            found = wb.solve(problem, start)
            posterior = laplace(problem, start | found.values, draws=DRAWS, seed=i)
        except WorkbenchError:
            failed += 1
            continue
        if posterior.usable:
            usable += 1
            ends, right = posterior.interval(LEVEL), problem.free.pack(truth)
            hits += (ends[:, 0] < right) & (right < ends[:, 1])
    return {"fits": count, "usable": usable, "failed": failed, "covered": hits.tolist()}


def band(count: int, entries: int) -> tuple[int, int]:
    """Between which counts all entries lie together, but for a chance of one in a thousand."""
    tail = UNLIKELY / entries / 2
    low, high = scipy.stats.binom(count, LEVEL).ppf([tail, 1 - tail])
    return int(low), int(high)


# Throughput


def throughput(seconds: float, rounds: int) -> dict[str, dict[str, float]]:
    """Densities in a second of the processor's, the best of some rounds, candidates in turn."""
    found = {}
    for name, (problem, start) in posteriors().items():
        x, given = problem.split(start)
        densities: dict[str, Callable[[Array], Array]] = {ALONE: lambda z: np.zeros(len(z))}
        for way in (interpreted, compiled):
            costs = problem.costs(x, given, None, way)
            densities[way.__name__] = partial(_negative, costs)
        noise = np.random.default_rng(0).standard_normal((WALKERS, problem.free.size))
        best = dict.fromkeys(densities, 0.0)
        for _ in range(rounds):  # taking turns, so that a disturbance meets all of them
            for name_of, density in densities.items():
                best[name_of] = max(best[name_of], per_second(density, x, noise, seconds))
        found[name] = best
    return found


def _negative(costs: Callable[[Array], Array], x: Array) -> Array:
    return -costs(x)


def per_second(density: Callable[[Array], Array], x: Array, noise: Array, seconds: float) -> float:
    """Densities in a second of the processor's, with emcee's own moves and loops."""
    walkers, k = noise.shape
    sampler = emcee.EnsembleSampler(walkers, k, density, moves=emcee.moves.DEMove(), vectorize=True)
    state = emcee.State(x + 1e-3 * noise, random_state=np.random.RandomState(0).get_state())
    with limited_threads():
        state = sampler.run_mcmc(state, 10, store=False)
        steps, began = 0, time.process_time()
        while time.process_time() - began < seconds:
            state = sampler.run_mcmc(state, 20, store=False, skip_initial_state_check=True)
            steps += 20
    return float(steps * walkers / (time.process_time() - began))


def posteriors() -> dict[str, tuple[wb.Problem, wb.Values]]:
    """All 85 entries of a body free, seen in three ways."""
    body = wb.load_body()
    pose, betas, trans = (block.symbol for block in body.blocks())
    joints = body.joint_points(pose, betas, trans)
    seen = [
        wb.residuals.landmarks(joints, body.joints(), sigma=0.01),
        wb.residuals.gaussian(betas, name="shape prior"),
        wb.residuals.gaussian(pose, covariance=0.25, unit="rad", name="pose prior"),
    ]
    coco, large = find("balance-monocular").setup(), random_body(6890)
    symbols = [block.symbol for block in large.blocks()]
    vertices = wb.residuals.vertices(large.points(*symbols), large.vertices(), sigma=0.01)
    free = ("pose", "betas", "trans")
    return {
        "24 joints in space": (wb.Problem(seen, free), body.start()),
        "COCO keypoints, one camera": (coco.problem, coco.start),
        "6,890 vertices (made up)": (wb.Problem([vertices], free), large.start()),
    }


def measured(quick: bool) -> dict[str, object]:
    """All four; nothing beside NUTS without nutpie, which is in the extra `bench`."""
    blocks = dict(list(BLOCKS.items())[: 1 if quick else None] if find_spec("nutpie") else ())
    draws, steps = (500, 2000) if quick else (NUTS_DRAWS, 40_000)
    fits, known = (20, ["Student, 4"]) if quick else (FITS, list(DENSITIES))
    return {
        "nuts": {name: beside_nuts(block, draws, steps) for name, block in blocks.items()},
        "throughput": throughput(0.2, 1) if quick else throughput(1.5, 4),
        "known": verdicts(known, range(200, 200 + (1 if quick else SEEDS))),
        "coverage": {name: covered(make(), fits) for name, make in PROBLEMS.items()},
    }


def tables(found: dict[str, Any]) -> str:
    """All four."""
    head: tuple[str, ...]
    rows: list[tuple[object, ...]] = []
    for name, one in found["nuts"].items():
        theirs = one["nuts"]
        spans = ("{:.2f} to {:.2f}".format(*one[key]) for key in ("sd ratio", "sd over Laplace's"))
        ratio, over = spans
        rows.append(
            (
                *(name, one["entries"], f"{one['times']:.0f}", f"{theirs['R-hat']:.3f}"),
                *(theirs["divergences"], f"{theirs['effective']:,.0f} of {theirs['draws']:,}"),
                "{:.0f}, {:.0f}".format(*one["seconds"]),
                *(ratio, f"{one['mean apart']:.3f}", over, "yes" if one["agree"] else "no"),
            )
        )
    head = (
        *("block", "entries", "emcee: steps / autocorrelation time", "NUTS: R-hat"),
        *("NUTS: divergences", "NUTS: effective draws", "emcee, NUTS: s"),
        *("emcee's sd / NUTS's", "means apart / sd", "sd / Laplace's", "agree"),
    )
    text = table(head, rows)
    rows = [
        (name, *(f"{one[way]:,.0f}" for way in (ALONE, "interpreted", "compiled")))
        for name, one in found["throughput"].items()
    ]
    head = (f"densities a second, {WALKERS} walkers", ALONE, "without a compiler", "compiled")
    text += f"\n{table(head, rows)}"
    keys = "runs", "right", "usable", "wrong", "refused"
    counts = found["known"]
    rows = [(name, *(one[key] for key in keys)) for name, one in counts.items()]
    head = ("density", "runs", "right", "called usable", "usable, but wrong", "refused, but right")
    right, usable, wrong, refused = (sum(one[key] for one in counts.values()) for key in keys[1:])
    text += (
        f"\n{table(head, rows)}\nWrong of those called usable: {share(wrong, usable)}. Refused of "
        f"those that are right: {share(refused, right)}.\n\n"
    )
    rows = []
    for name, one in found["coverage"].items():
        hits = one["covered"]
        low, high = band(one["usable"], len(hits))
        whole = sum(hits) / max(1, one["usable"] * len(hits))
        rows.append(
            (
                *(name, len(hits), one["fits"], one["usable"], one["failed"]),
                *(min(hits), max(hits), f"{low} to {high}", f"{whole:.1%}"),
            )
        )
    head = (
        *("problem", "entries", "fits", "usable", "failed", "covered, least", "covered, most"),
        *("band", "of all entries"),
    )
    return text + table(head, rows)
