"""Staged: a few blocks first, then all."""

import numpy as np

import workbench as wb

body = wb.load_body("small")
pose, betas, trans = (block.symbol for block in body.blocks())
bent = body.start() | {"trans": np.array([0.5, 0.0, 0.0]), "pose": np.full((24, 3), 0.1)}
seen = body.vertices(**bent)
term = wb.residuals.vertices(body.points(pose, betas, trans), seen, sigma=0.01)
problem = wb.Problem([term], free=["pose", "trans"])
solver = wb.Staged((("trans",), ("trans", "pose")), wb.LevenbergMarquardt())
solution = wb.solve(problem, body.start(), solver)
print(solution.status.name, solution.values["trans"].round(4))
