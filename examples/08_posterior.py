"""Truth, least squares, Laplace, emcee: what a fit does not know about itself.

Eight noisy readings of a decay, a exp(-k t) + c. Least squares gives one answer. Laplace's
approximation puts a Gaussian around it, from the Jacobian there. emcee draws from the posterior
itself, which has a bend and a long tail: a decay that ends slowly looks like a constant.
"""

from pathlib import Path

import casadi as cs
import numpy as np

import workbench as wb

SIGMA = 0.05
rng = np.random.default_rng(3)
truth = np.array([1.0, 0.6, 0.2])  # a, k (1/s), c
times = np.linspace(0, 3, 8)  # s
readings = truth[0] * np.exp(-truth[1] * times) + truth[2] + SIGMA * rng.standard_normal(8)

w = wb.Block("w", (3,), labels=("a", "k", "c"))
a, k, c = cs.vertsplit(w.symbol)
decay = wb.Residual("decay", a * cs.exp(-k * cs.DM(times)) + c - cs.DM(readings), sigma=SIGMA)
vague = wb.residuals.gaussian(w.symbol, mean=[1.0, 1.0, 0.0], covariance=1.0, name="vague prior")
problem = wb.Problem([decay, vague], free=["w"], blocks=[w])

solution = wb.solve(problem, {"w": np.array([1.0, 1.0, 0.0])})
approximation = wb.laplace(problem, solution.values, "w")
posterior = wb.sample(problem, solution.values, "w", walkers=16, steps=15_000, seed=0)
by_draws, by_laplace = posterior.interval(0.9), approximation.interval(0.9)  # (3, 2)
middle = np.median(posterior.flat, axis=0)
lean = (by_draws[:, 1] - middle) / (middle - by_draws[:, 0])  # 1 for what is symmetric

if __name__ == "__main__":
    from workbench.plots import house_style, png, sheet

    print(posterior)
    for name, true, one, other, off in zip("akc", truth, by_draws, by_laplace, lean, strict=True):
        print(
            f"{name}: true {true:.2f}, emcee {one.round(2)}, Laplace {other.round(2)}, "
            f"upper side over lower {off:.2f}"
        )
    with house_style():
        figure, (left, right) = sheet(10, 4.0, columns=2)
        fine = np.linspace(0, 6, 100)
        for a, k, c in posterior.points(60):
            left.plot(fine, a * np.exp(-k * fine) + c, color="0.7", lw=0.6)
        left.plot(times, readings, "ko", label="readings")
        left.plot(fine, truth[0] * np.exp(-truth[1] * fine) + truth[2], label="truth")
        left.set(xlabel="time (s)", ylabel="reading")
        left.legend()
        right.plot(*posterior.flat[::7, [1, 2]].T, ".", ms=1, color="0.6", label="draws of emcee")
        right.plot(*approximation.flat[:600, [1, 2]].T, ".", ms=2, label="draws of Laplace")
        right.set(xlabel="k (1/s)", ylabel="c")
        right.legend(markerscale=5)
    Path(__file__).with_name("posterior.png").write_bytes(png(figure))
    print(
        "Left: decays that the readings allow. Right: rate and end hang together, along a bow "
        "that no Gaussian has."
    )
