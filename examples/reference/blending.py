"""linear_blend, dual_quaternion_blend: two ways to skin, on a point between two bones."""

import casadi as ca
import numpy as np

import workbench as wb

point, weights = ca.MX(ca.DM([0.0, 1.0, 0.0])), ca.MX(ca.DM([[0.5, 0.5]]))
still = ca.MX(ca.DM(np.eye(3, 4)))
angle = np.radians(150.0)
c, s = np.cos(angle), np.sin(angle)
twisted = ca.MX(ca.DM([[1, 0, 0, 0], [0, c, -s, 0], [0, s, c, 0]]))  # about the bone, the x axis
for blend in (wb.linear_blend, wb.dual_quaternion_blend):
    moved = np.array(ca.evalf(blend(point, [still, twisted], weights))).ravel()
    print(f"{blend.__name__}: radius {np.linalg.norm(moved):.3f} of 1")
