"""jacobian: the derivative of an expression by a block, in symbols."""

import casadi as ca

import workbench as wb

x = wb.Block("x", (2,))
expression = ca.vertcat(x.symbol[0] ** 2, x.symbol[0] * x.symbol[1])
derivative = wb.jacobian(expression, x)
print(derivative)
print(ca.Function("J", [x.symbol], [derivative])([3, 5]))
