"""Small files of a user's own, and keypoints, for the command line."""

import json
from pathlib import Path

import numpy as np

LINE = '''
"""A line through three points."""
import numpy as np
import workbench as wb
a = wb.Block("a", (2,)).symbol
x, y = wb.Block("x", (3,)).symbol, wb.Block("y", (3,)).symbol
problem = wb.Problem([wb.Residual("line", a[0] + a[1] * x - y, sigma=0.1)], ["a"])
start = {"a": np.zeros(2), "x": np.arange(3.0), "y": np.array([1.0, 3.0, 5.5])}
compared = ("gauss-newton", "nlopt-lbfgs")
'''
SOLVER = '''
"""Gauss and Newton's, by hand."""
import workbench as wb
class Mine:
    def solve(self, problem, start, *, callback=None):
        return wb.GaussNewton().solve(problem, start, callback=callback)
solver = Mine()
'''
PARABOLA = """
import casadi as cs, numpy as np, workbench as wb
x = wb.Block("x", ({n},))
A = np.vander(np.linspace(0, 1, 9), 3)[:, :{columns}]
fit = wb.Residual("fit", cs.DM(A) @ x.symbol[:{columns}] - 1, 0.1)
hold = wb.Residual("hold", x.symbol[{columns}:] if {n} > {columns} else x.symbol[:1], 1e3)
problem = wb.Problem([fit, hold], ["x"], blocks=[x])
start = {{"x": np.zeros({n})}}
"""
POINTS = np.column_stack([np.arange(300, 317), np.arange(200, 540, 20), np.ones(17)])
KEYPOINTS = {
    "images": [{"id": 1, "width": 1088, "height": 1920}],
    "annotations": [{"image_id": 1, "keypoints": POINTS.ravel().tolist()}],
}


def write_keypoints(folder: Path) -> Path:
    """A person of COCO's 17 keypoints, seen in one image."""
    file = folder / "kp.json"
    file.write_text(json.dumps(KEYPOINTS))
    return file
