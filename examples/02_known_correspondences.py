"""The course's align_3Dpoints: the pose and shape of a body whose every vertex is known.

min |M(theta, beta) - V|^2 from zero. Noise of 1 mm on the vertices becomes a fraction of it on
the parameters, and the linearization says how much.
"""

import numpy as np

import workbench as wb

rng = np.random.default_rng(1)
body = wb.load_body("small")
truth = {
    "pose": 0.3 * rng.standard_normal((24, 3)),
    "betas": rng.standard_normal(body.n_betas),
    "trans": np.array([0.1, 0.9, 2.0]),
}
clean = body.vertices(**truth)

pose, betas, trans = (block.symbol for block in body.blocks())
observed = wb.Block("observed", (body.n_vertices, 3), "m")
points = body.points(pose, betas, trans)
problem = wb.Problem(
    residuals=[wb.residuals.vertices(points, observed.symbol, sigma=0.001)],
    free=["pose", "betas", "trans"],
    blocks=[observed],
)
start = body.start() | {"observed": clean + 0.001 * rng.standard_normal(clean.shape)}
solution = wb.solve(problem, start)
fitted = body.vertices(**solution.values)
error = np.linalg.norm(fitted - clean, axis=1)  # m, to the clean surface

if __name__ == "__main__":
    for iterate in solution.trace:
        print(f"cost {iterate.cost:14.6g}   step {iterate.step_norm:.1e}")
    print(f"{solution.status.name}; mean distance to the clean surface {1e3 * error.mean():.2f} mm")
