"""WorkbenchError: every error that the workbench raises on purpose is one of these."""

import workbench as wb

x = wb.Block("x", (2,))
try:
    wb.Problem([wb.Residual("small", x.symbol, sigma=1.0)], free=["y"], blocks=[x])
except wb.WorkbenchError as error:
    print(type(error).__name__)
    print(error)
