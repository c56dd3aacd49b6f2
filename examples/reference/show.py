"""show: a motion, a run or a registration as a page on which a body moves."""

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import workbench as wb

body = wb.load_body("small")
pose = np.zeros((30, body.n_joints, 3))
pose[:, body.joint_names.index("left_elbow"), 1] = np.linspace(0, -2, 30)
motion = wb.Motion(pose, np.zeros((30, 3)), 30.0, body.joint_names)

page = wb.show(motion, body=body)  # in a notebook, the last line of a cell plays it
print(page)
with TemporaryDirectory() as folder:
    print(page.save(Path(folder) / "elbow.html").name)
