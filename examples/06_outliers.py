"""A fifth of the data is wrong: squares follow it, robust kernels do not.

The cost of a residual r is rho(r^2 / sigma^2) / 2. With rho(s) = s the pull of a bad point
grows with its distance. Geman and McClure's rho(s) = s / (1 + s) never exceeds 1, and pulls
hardest at sigma / sqrt(3); Huber's cost continues as a straight line. The sigma says where
outliers begin, so it has a unit.
"""

from pathlib import Path

import casadi as cs
import numpy as np

import workbench as wb
from workbench.residuals import geman_mcclure, huber, quadratic

rng = np.random.default_rng(0)
body = wb.load_body("small")
truth = {"pose": 0.2 * rng.standard_normal((24, 3)), "trans": np.array([0.3, 0.1, -0.2])}
clean = body.vertices(**truth)
observed = clean + 0.003 * rng.standard_normal(clean.shape)  # 3 mm of noise
wrong = rng.random(body.n_vertices) < 0.2
observed[wrong] += [0.0, 0.4, 0.3]  # a fifth is 50 cm off, all to one side

pose, betas, trans = (block.symbol for block in body.blocks())
points = body.points(pose, betas, trans)
KERNELS = {"squares": quadratic, "Huber": huber(), "Geman-McClure": geman_mcclure}
errors, statuses = {}, {}
for name, kernel in KERNELS.items():
    term = wb.residuals.vertices(points, observed, sigma=0.02, kernel=kernel)
    problem = wb.Problem([term], free=["pose", "trans"])
    # squares first: a kernel that ignores what is far away needs to start near
    start = body.start() | {"trans": observed.mean(axis=0) - body.template.mean(axis=0)}
    nearly = wb.solve(
        wb.Problem([wb.residuals.vertices(points, observed, sigma=0.02)], free=["pose", "trans"]),
        start,
    )
    solution = wb.solve(problem, start | nearly.values)
    found = body.vertices(**solution.values)
    errors[name] = 1e3 * np.linalg.norm(found - clean, axis=1)  # mm, to the clean surface
    statuses[name] = solution.status.name

# the kernels themselves: rho and its slope by r, for residuals in sigmas
r = np.linspace(-5, 5, 401)
rho = {}
for name, kernel in KERNELS.items():
    x = cs.MX.sym("x")
    shrunk = cs.Function("shrunk", [x], [kernel(x) ** 2 * x])
    rho[name] = np.asarray(shrunk(r**2)).ravel()
pull = {name: np.gradient(half / 2, r) for name, half in rho.items()}
strongest = r[np.argmax(pull["Geman-McClure"])]  # sigmas

if __name__ == "__main__":
    from workbench.plots import house_style, png, sheet

    for name, off in errors.items():
        print(f"{name:14} {statuses[name]:10} mean {off.mean():6.1f} mm, most {off.max():6.1f} mm")
    with house_style():
        figure, (left, right) = sheet(9, 3.6, columns=2)
        for name in KERNELS:
            left.plot(r, rho[name], label=name)
            right.plot(r, pull[name], label=name)
        left.set(xlabel="residual (sigmas)", ylabel="rho", ylim=(0, 8))
        right.set(xlabel="residual (sigmas)", ylabel="pull (1 / sigma)", ylim=(-3, 3))
        left.legend()
    Path(__file__).with_name("outliers.png").write_bytes(png(figure))
    print("Left: what a residual costs. Right: how hard it pulls. Far away, Geman-McClure lets go.")
