"""load_body, save_body, SkinnedBody: a body, its blocks and its surface; and a file of it."""

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import workbench as wb

body = wb.load_body("small")
print(body.n_vertices, "vertices,", len(body.joint_names), "joints,", body.n_betas, "betas")
print([(block.name, block.shape, block.unit) for block in body.blocks()])
pose = np.zeros((24, 3))
pose[body.joint_names.index("left_elbow")] = [0.0, 0.0, 1.0]  # rad
print(body.vertices(pose).shape, body.joints(pose).shape)
with TemporaryDirectory() as folder:
    wb.save_body(body, Path(folder) / "mine.npz")
    again = wb.load_body(Path(folder) / "mine.npz")
print(np.abs(again.vertices(pose) - body.vertices(pose)).max())
