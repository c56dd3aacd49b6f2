"""One problem, every kind of solver: the same minimum, at very different prices.

Rosenbrock's valley as two residuals, 10 (y - x^2) and 1 - x. A gradient is a direction and not a
step; how well a method chooses its steps shows in the number of its calls. Convergence means the
same for all.
"""

from pathlib import Path

import numpy as np

import workbench as wb

x = wb.Block("x", (2,))
valley = wb.Residual("valley", 10 * (x.symbol[1] - x.symbol[0] ** 2), sigma=1.0)
wall = wb.Residual("wall", 1 - x.symbol[0], sigma=1.0)
problem = wb.Problem([valley, wall], free=["x"], blocks=[x])
start = {"x": np.array([-1.2, 1.0])}

ASKED = (
    "gauss-newton",
    "gauss-newton-full",
    "levenberg-marquardt",
    "dogleg",
    "newton",
    "scipy-lm",
    "nlopt-lbfgs",
    "ipopt",
    "nlopt-bobyqa",
    "steepest-descent",
)
solutions = {name: wb.solve(problem, start, wb.SOLVERS[name]) for name in ASKED}
calls = {name: solution.evaluations.total for name, solution in solutions.items()}
ends = {name: solution.values["x"] for name, solution in solutions.items()}

if __name__ == "__main__":
    from workbench.plots import house_style, png, sheet

    for name, solution in sorted(solutions.items(), key=lambda pair: calls[pair[0]]):
        print(
            f"{name:22}{solution.status.name:16}{calls[name]:6} calls, "
            f"cost {solution.cost:8.1e}, at {solution.values['x'].round(6)}"
        )
    with house_style():
        figure, (ax,) = sheet(7.5, 4.6)
        u, v = np.meshgrid(np.linspace(-1.6, 1.4, 200), np.linspace(-0.6, 2.0, 200))
        cost = 50 * (v - u**2) ** 2 + (1 - u) ** 2 / 2
        ax.contour(u, v, cost, levels=10.0 ** np.arange(-2, 3), colors="0.8", linewidths=0.8)
        for name in ("gauss-newton", "levenberg-marquardt", "dogleg", "nlopt-lbfgs"):
            way = np.array([iterate.values["x"] for iterate in solutions[name].trace])
            ax.plot(*way.T, "o-", ms=3, lw=1, label=name)
        ax.set(xlabel="x", ylabel="y", xlim=(-1.6, 1.4), ylim=(-0.6, 2.0))
        ax.legend(loc="upper center")
    Path(__file__).with_name("many_solvers.png").write_bytes(png(figure))
    print("Iterates of four solvers in Rosenbrock's valley, from (-1.2, 1) to (1, 1).")
