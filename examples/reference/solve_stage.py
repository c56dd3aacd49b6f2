"""SolveStage: some residuals count otherwise at first."""

import numpy as np

import workbench as wb

body = wb.load_body("small")
pose, betas, trans = (block.symbol for block in body.blocks())
seen = body.vertices(np.full((24, 3), 0.2))
near = wb.residuals.vertices(body.points(pose, betas, trans), seen, sigma=0.01, name="surface")
prior = wb.residuals.gaussian(pose, covariance=0.04, unit="rad", name="prior")
problem = wb.Problem([near, prior], free=["pose", "trans"])
stages = (wb.SolveStage(("trans",)), wb.SolveStage(weights={"prior": 100.0}))
solution = wb.solve(problem, body.start(), wb.Staged(stages))
print([f"{solution.trace[end].cost:.4g}" for end in solution.stages], "costs of the stages")
