"""closest: the place on a mesh that is closest to each point."""

import numpy as np
import trimesh

import workbench as wb

body = wb.load_body("default")
mesh: trimesh.Trimesh = body.trimesh()  # at rest, in m
points = body.joints() + np.array([0.0, 0.0, 0.2])  # 20 cm in front of each joint
found = wb.closest(points, mesh)
print(found.points.shape)
print(f"{1e3 * np.abs(found.distances).mean():.0f} mm from the surface in the mean")
