"""Motion: poses and places of a body, frame by frame."""

import numpy as np

import workbench as wb

body = wb.load_body("small")
pose = np.zeros((11, body.n_joints, 3))
pose[:, body.joint_names.index("left_elbow"), 1] = np.linspace(0, -1.5, 11)
motion = wb.Motion(pose, np.zeros((11, 3)), fps=10.0, joint_names=body.joint_names)
print(len(motion), "frames,", motion.seconds, "s")
print(motion[2:6].resampled(30).vertices(body).shape)
