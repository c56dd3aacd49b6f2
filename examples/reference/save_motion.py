"""save_motion: a motion as .npz in AMASS's layout, or with the names of smplx's arguments."""

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import workbench as wb

body = wb.load_body("small")
pose = np.random.default_rng(0).normal(0, 0.1, (5, body.n_joints, 3))
motion = wb.Motion(pose, np.zeros((5, 3)), 30.0, body.joint_names)
with TemporaryDirectory() as folder:
    file = Path(folder) / "walk.npz"
    wb.save_motion(file, motion)
    with np.load(file) as arrays:
        print(sorted(arrays))
    print(np.abs(wb.read_motion(file).pose - pose).max())
    wb.save_motion(file, motion, layout="smplx")
    with np.load(file) as arrays:
        print({key: arrays[key].shape for key in arrays})
