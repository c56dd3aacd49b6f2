"""closest, ClosestPoints, Mesh: the place on a mesh that is closest to each point."""

import numpy as np

import workbench as wb

body = wb.load_body("default")
mesh = wb.Mesh(body.vertices(), body.faces)  # at rest, in m; body.trimesh() will do as well
points = body.joints() + np.array([0.0, 0.0, 0.2])  # 20 cm in front of each joint
found: wb.ClosestPoints = wb.closest(points, mesh)
print(found.points.shape)
print(f"{1e3 * np.abs(found.distances).mean():.0f} mm from the surface in the mean")
