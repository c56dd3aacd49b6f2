"""Motions: poses of a skeleton or of a body, frame by frame, and the files that hold them.

Every fit of a sequence returns a `Motion`, which any body plays with joints matched by name; what
either side lacks is named in its `notes`.

>>> import numpy as np
>>> from workbench import load_body
>>> from workbench.motions import Motion
>>> body = load_body("small")
>>> pose = np.zeros((3, body.n_joints, 3))
>>> pose[:, 0, 1] = [0.0, 0.4, 0.8]
>>> motion = Motion(pose, np.zeros((3, 3)), 10.0, body.joint_names)
>>> motion.resampled(20.0).pose[:, 0, 1].round(3).tolist()
[0.0, 0.2, 0.4, 0.6, 0.8]
"""

from workbench.motions.bones import Bones, bones_of
from workbench.motions.bvh import read_bvh, write_bvh
from workbench.motions.files import read_motion
from workbench.motions.gltf import read_glb, write_glb
from workbench.motions.markers import Trajectories, read_c3d, read_trc, write_trc
from workbench.motions.motion import Motion, splined
from workbench.motions.smpl_files import read_amass, save_motion
from workbench.motions.soft_tissue import SoftTissue, load_tissue, save_tissue, with_dmpls

__all__ = [
    "Bones",
    "Motion",
    "SoftTissue",
    "Trajectories",
    "bones_of",
    "load_tissue",
    "read_amass",
    "read_bvh",
    "read_c3d",
    "read_glb",
    "read_motion",
    "read_trc",
    "save_motion",
    "save_tissue",
    "splined",
    "with_dmpls",
    "write_bvh",
    "write_glb",
    "write_trc",
]
