"""emcee beside NUTS on the same posteriors, and how many posteriors a second: two tables.

    python -m benchmarks.posterior nuts          # minutes to half an hour; needs nutpie
    python -m benchmarks.posterior throughput    # a minute
    python -m benchmarks.posterior coverage      # an hour; the person on the beam, 40 frames

NUTS (Hoffman and Gelman 2014, as in nutpie) shares nothing with the ensembles but the problem: it
takes the cost and gradient of `Problem.cost_and_gradient`, in coordinates whitened by Laplace's
approximation. Its own numbers (R-hat, divergences, effective draws) stand beside the comparison,
for it is a reference only as far as they are good.
"""

import argparse
import time
import warnings
from collections.abc import Callable, Sequence
from typing import Any

import emcee
import numpy as np

import workbench as wb
from benchmarks.bodies_made_up import random_body
from benchmarks.machine import description
from workbench.experiments import find
from workbench.problem.batch import Way, compiled, interpreted
from workbench.sampling import conditional, sample
from workbench.sampling.arviz_quietly import arviz
from workbench.sampling.choice import chosen
from workbench.sampling.entries import entries
from workbench.sampling.subspace import Subspace, fixed
from workbench.threads import limited_threads


def _arm(side: str) -> tuple[str, ...]:
    return tuple(f"pose[{side}_{joint}]" for joint in ("shoulder", "elbow", "wrist"))


BLOCKS = {
    "betas": ("betas",),
    "left arm": _arm("left"),
    "betas, trans": ("betas", "trans"),
    "orientation, betas, trans": ("pose[pelvis]", "betas", "trans"),
    "both arms, trans": (*_arm("left"), *_arm("right"), "trans"),
}
ALLOWED_SD, ALLOWED_MEAN = 0.05, 0.1
ENOUGH = 2000  # effective draws: a standard deviation is then known to 1.6 %


def nuts(
    problem: wb.Problem, fixed_numbers: Any, space: Subspace, centre: Any, half: Any,
    draws: int, seed: int,
) -> tuple[Any, float, int, float]:  # fmt: skip
    """Draws (4, N, k), largest R-hat, divergences, least effective draws."""
    import nutpie
    from nutpie.compiled_pyfunc import from_pyfunc

    k = space.size

    def make_log_density() -> Callable[[Any], tuple[float, Any]]:
        def log_density(u: Any) -> tuple[float, Any]:
            x = space.points((centre + half @ u)[None])[0]
            cost, gradient = problem.cost_and_gradient(x, fixed_numbers)
            return -cost, -(half.T @ (space.along.T @ gradient))

        return log_density

    def make_expand(*_: Any) -> Callable[[Any], dict[str, Any]]:
        return lambda u: {"z": centre + half @ u}

    model = from_pyfunc(
        ndim=k, make_logp_fn=make_log_density, make_expand_fn=make_expand,
        expanded_dtypes=[np.dtype(np.float64)], expanded_shapes=[(k,)], expanded_names=["z"],
        make_initial_point_fn=lambda s: np.random.default_rng(s).standard_normal(k),
    )  # fmt: skip
    trace = nutpie.sample(
        model,
        draws=draws,
        tune=800,
        chains=4,
        cores=1,
        seed=seed,
        progress_bar=False,
        target_accept=0.95,
    )
    az = arviz()
    divergent = int(np.asarray(trace.sample_stats["diverging"]).sum())
    return (
        np.asarray(trace.posterior["z"]), float(az.rhat(trace)["z"].max()), divergent,
        float(az.ess(trace)["z"].min()),
    )  # fmt: skip


def beside_nuts(names: Sequence[str], draws: int, seed: int = 1) -> None:
    """Both on blocks of `balance-monocular`, and where they differ."""
    setup = find("balance-monocular").setup()
    at = setup.start | wb.solve(setup.problem, setup.start).values
    x, given = setup.problem.split(at)
    print(f"{'block':26} {'k':>3} {'steps/tau':>9} {'s':>6}  {'NUTS R-hat':>10} {'div.':>4} "
          f"{'ESS':>6} {'s':>6}  {'sd ratio':>12} {'mean / sd':>9}", flush=True)  # fmt: skip
    for name in names:
        block = BLOCKS[name]
        began = time.perf_counter()
        ours = sample(setup.problem, at, block, seed=seed, steps=40_000)
        took = time.perf_counter() - began
        space = chosen(setup.problem, x, given, block, fixed)
        mode = ours.modes[0]
        began = time.perf_counter()
        with limited_threads():
            theirs, r_hat, divergent, effective = nuts(
                setup.problem, given, space, mode.z, mode.half, draws, seed
            )
        other = time.perf_counter() - began
        flat = theirs.reshape(-1, space.size)
        ratio = ours.sd / flat.std(axis=0)
        shift = np.abs(ours.mean - flat.mean(axis=0)) / flat.std(axis=0)
        alike = abs(ratio - 1).max() <= ALLOWED_SD and shift.max() <= ALLOWED_MEAN
        said = "agree" if alike else "DIFFER"
        if r_hat > 1.01 or effective < ENOUGH:
            said += " (NUTS itself has not converged)"
        print(f"{name:26} {space.size:>3} {ours.mixing.length:>9.0f} {took:>6.0f}  {r_hat:>10.3f} "
              f"{divergent:>4} {effective:>6.0f} {other:>6.0f}  "
              f"{ratio.min():>5.2f}..{ratio.max():<5.2f} {shift.max():>9.3f}"
              f"  {said}",
              flush=True)  # fmt: skip


def coverage(count: int, steps: int, level: float = 0.9, seed: int = 0) -> None:
    """How often an interval from one camera holds the estimate of four cameras.

    Of orientation, betas and place; the pose is integrated out by its Gaussian conditional. By
    draws where they are usable, and by Laplace's approximation to all 85 numbers.
    """
    from workbench.experiments.balance import balance, balance_monocular, published

    with published() as data:
        frames = np.linspace(0, len(data["keypoints"]) - 1, count).astype(int)
    names = ("pose[pelvis]", "betas", "trans")
    held: dict[str, list[Any]] = {"draws": [], "Laplace": []}
    holds = 0
    labels: tuple[str, ...] = ()
    for frame in frames:
        four, one = balance(frame=int(frame), compared=()), balance_monocular(frame=int(frame))
        truth = wb.solve(four.problem, four.start).values
        # from the answer, so that a wrong local minimum is not counted as a wrong interval
        at = one.start | wb.solve(one.problem, one.start | truth).values
        approximation = wb.laplace(one.problem, at, names, rest=conditional, seed=seed)
        places = entries(one.problem.free, names)
        right = one.problem.free.pack(at | truth)[places]
        labels = approximation.labels
        tail = (1 - level) / 2
        ends = np.quantile(approximation.flat, [tail, 1 - tail], axis=0)
        held["Laplace"].append((ends[0] < right) & (right < ends[1]))
        drawn = sample(one.problem, at, names, rest=conditional, walkers=32, steps=steps, seed=seed)
        holds += bool(drawn.importance is not None and drawn.importance.holds)
        ends = np.quantile(drawn.flat, [tail, 1 - tail], axis=0)
        if drawn.mixing.usable:
            held["draws"].append((ends[0] < right) & (right < ends[1]))
        print(f"frame {frame:>4}  {drawn.verdict}", flush=True)
    for how, rows in held.items():
        if not rows:
            continue
        rate = np.mean(rows, axis=0)
        said = ", ".join(f"{label} {r:.0%}" for label, r in zip(labels, rate, strict=True))
        print(f"{how}: {np.mean(rows):.1%} of {len(rows)} frames x {len(labels)} ({said})")
    print(f"the Gaussian conditional of the pose holds (k-hat) in {holds} of {len(frames)} frames")


def throughput(walkers: int = 192, seconds: float = 3.0, rounds: int = 3) -> None:
    """Posteriors a second inside of emcee, as shares of emcee's own with nothing to compute."""
    print(f"one core, {walkers} walkers, emcee's own moves and loops; best of {rounds}")
    for name, (problem, start) in _posteriors().items():
        x, given = problem.split(start)
        k = problem.free.size
        ways: tuple[Way, ...] = (interpreted, compiled)
        costs = {way.__name__: problem.costs(x, given, None, way) for way in ways}
        noise = np.random.default_rng(0).standard_normal((walkers, k))
        best: dict[str, float] = {}
        for _ in range(rounds):  # taking turns, so that a disturbance meets all of them
            best["null"] = max(
                best.get("null", 0), _rate(lambda z: np.zeros(len(z)), x, noise, seconds)
            )
            for way, cost in costs.items():
                density = lambda z, cost=cost: -cost(z)  # noqa: E731
                best[way] = max(best.get(way, 0), _rate(density, x, noise, seconds))
        print(f"{name:34} {k:>3} free  emcee alone {best['null']:>8,.0f}/s   "
              + "   ".join(f"{way} {best[way]:>8,.0f}/s = {best[way] / best['null']:.0%}"
                           for way in costs), flush=True)  # fmt: skip


def _rate(density: Callable[[Any], Any], x: Any, noise: Any, seconds: float) -> float:
    walkers, k = noise.shape
    sampler = emcee.EnsembleSampler(walkers, k, density, moves=emcee.moves.DEMove(), vectorize=True)
    state = emcee.State(x + 1e-3 * noise, random_state=np.random.RandomState(0).get_state())
    with limited_threads():
        state = sampler.run_mcmc(state, 10, store=False)
        steps, began = 0, time.perf_counter()
        while time.perf_counter() - began < seconds:
            state = sampler.run_mcmc(state, 20, store=False, skip_initial_state_check=True)
            steps += 20
    return steps * walkers / (time.perf_counter() - began)


def _posteriors() -> dict[str, tuple[wb.Problem, wb.Values]]:
    body = wb.load_body()
    pose, betas, trans = (block.symbol for block in body.blocks())
    priors = [
        wb.residuals.gaussian(betas, name="shape prior"),
        wb.residuals.gaussian(pose, covariance=0.25, unit="rad", name="pose prior"),
    ]
    joints = body.joint_points(pose, betas, trans)
    landmarks = wb.residuals.landmarks(joints, body.joints(), sigma=0.01)
    coco = find("balance-monocular").setup()
    large = random_body(6890)
    large_symbols = [block.symbol for block in large.blocks()]
    vertices = wb.residuals.vertices(large.points(*large_symbols), large.vertices(), sigma=0.01)
    free = ("pose", "betas", "trans")
    return {
        "24 joints in space": (wb.Problem([landmarks, *priors], free), body.start()),
        "COCO keypoints, one camera": (coco.problem, coco.start),
        "all 6,890 vertices (made up)": (wb.Problem([vertices], free), large.start()),
    }


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.posterior", description=__doc__)
    parser.add_argument("what", choices=("nuts", "throughput", "coverage"))
    parser.add_argument("--blocks", nargs="+", default=list(BLOCKS), choices=list(BLOCKS))
    parser.add_argument("--draws", type=int, default=1500, help="of NUTS, for each of 4 chains")
    parser.add_argument("--frames", type=int, default=40, help="of the coverage")
    parser.add_argument("--steps", type=int, default=8000, help="of the coverage, at most")
    asked = parser.parse_args(arguments)
    facts = description()
    print(f"{facts['processor']}, load {facts['load'][0]:.1f} of {facts['cores']} cores")
    if asked.what == "throughput":
        throughput()
        return
    if asked.what == "coverage":
        coverage(asked.frames, asked.steps)
        return
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", r"\s*ArviZ is undergoing", FutureWarning)
        beside_nuts(asked.blocks, asked.draws)


if __name__ == "__main__":
    main()
