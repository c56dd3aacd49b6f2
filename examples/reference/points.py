"""Points: placeholders in a residual for points that a body gives."""

import workbench as wb

body = wb.load_body("small")
pose, betas, trans = (block.symbol for block in body.blocks())
hand = body.joint_points(pose, betas, trans)
print(type(hand).__name__, hand.symbol.shape)  # 3 x K inside CasADi

k = body.joint_names.index("left_wrist")
above = wb.Residual("above", hand.symbol[1, k] - 1.5, sigma=0.01, unit="m", points=(hand,))
problem = wb.Problem([above], free=["pose"])
print(problem.linearize(body.start()).residual * 0.01, "m above 1.5 m")
