"""TriangleBody: a body whose triangles are turned one by one and then stitched."""

import numpy as np

import workbench as wb
from workbench.bodies.triangles import blend_scape

body: wb.TriangleBody = blend_scape(wb.load_body("small"))
print(body.n_faces, "triangles,", body.n_joints, "joints")
pose = np.zeros((body.n_joints, 3))
pose[body.joint_names.index("left_elbow")] = [0.0, 0.0, 1.0]
print(body.vertices(pose).shape)
