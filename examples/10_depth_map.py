"""A depth map and nobody to say which point is which: closest points, found again and again.

A sensor in front sees the side of a body that faces it, a cloud of points without names. Each
round gives every point the closest vertex that faces the sensor, then a fit is solved. The
targets are a *fixed* block and a confidence: new correspondences change numbers, and the problem
is built once.
"""

from pathlib import Path

import casadi as cs
import numpy as np
from scipy.spatial import KDTree

import workbench as wb

ROUNDS, SIGMA = 16, 0.01  # m
rng = np.random.default_rng(2)
body = wb.load_body("small")
rest = np.zeros((24, 3))
rest[16, 2], rest[17, 2] = -0.9, 0.9  # arms down: as somebody stands
truth = {"pose": rest + 0.1 * rng.standard_normal((24, 3)), "trans": np.array([0.05, 0.02, 0.1])}


def facing(vertices: np.ndarray) -> np.ndarray:
    """Which vertices (N,) look towards the sensor, which is far out along +z."""
    a, b, c = vertices[body.faces].transpose(1, 0, 2)
    normal = np.zeros_like(vertices)
    for corner in body.faces.T:
        np.add.at(normal, corner, np.cross(b - a, c - a))
    return normal[:, 2] > 0.2 * np.linalg.norm(normal, axis=1)


def cloud(vertices: np.ndarray, count: int) -> np.ndarray:
    """Random points of the faces that look towards the sensor, 3 mm of noise, no names."""
    seen = facing(vertices)[body.faces].all(axis=1)
    corners = vertices[body.faces[seen]]
    area = np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
    )
    some = corners[rng.choice(len(corners), size=count, p=area / area.sum())]
    points = (rng.dirichlet([1, 1, 1], size=count)[..., None] * some).sum(axis=1)
    return points + 0.003 * rng.standard_normal(points.shape)


surface = body.vertices(**truth)
points = cloud(surface, 8000)

pose, betas, trans = (block.symbol for block in body.blocks())
target = wb.Block("target", (body.n_vertices, 3), "m")
sure = wb.Block("sure", (body.n_vertices,))
skin = body.points(pose, betas, trans)
apart = (skin.symbol - target.symbol) * cs.repmat(sure.symbol.T, 3, 1)
term = wb.Residual("closest", cs.vec(apart), SIGMA, "m", wb.residuals.geman_mcclure, (skin,))
prior = wb.residuals.gaussian(pose - cs.DM(rest.T), covariance=0.15**2, unit="rad", name="prior")
problem = wb.Problem([term, prior], free=["pose", "trans"], blocks=[target, sure])

values = body.start() | {
    "pose": rest,
    "trans": points.mean(axis=0) - body.vertices(rest)[facing(body.vertices(rest))].mean(axis=0),
}
tree = KDTree(points)
errors, gaps = [], []
for turn in range(ROUNDS):
    vertices = body.vertices(values["pose"], trans=values["trans"])
    away, closest = tree.query(vertices, k=5)  # the mean of five is on the surface, nearly
    errors.append(1e3 * np.linalg.norm(vertices - surface, axis=1).mean())  # mm
    gaps.append(1e3 * np.median(away[facing(vertices), 0]))  # mm
    coarse = max(1.0, 10 * 0.8**turn)  # a wide net first, in units of SIGMA
    sees = facing(vertices) / coarse
    values |= {"target": points[closest].mean(axis=1), "sure": sees}
    values |= wb.solve(problem, values).values
fitted = body.vertices(values["pose"], trans=values["trans"])
front = 1e3 * np.linalg.norm(fitted - surface, axis=1)[facing(surface)]

if __name__ == "__main__":
    from workbench.plots import house_style, plot_distances, png, sheet

    for k, (error, gap) in enumerate(zip(errors, gaps, strict=True)):
        print(f"round {k:2}: vertices off by {error:5.1f} mm, gap to the cloud {gap:4.1f} mm")
    with house_style():
        figure, (ax,) = sheet(7.5, 5.0)
        plot_distances(fitted, 1e3 * np.linalg.norm(fitted - surface, axis=1), body.faces, ax=ax)
    Path(__file__).with_name("depth_map.png").write_bytes(png(figure))
    print("The fitted body from the front, which the sensor saw, and from the back, which follows.")
