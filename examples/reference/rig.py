"""rig, Rigged, JointCandidate: bones, weights, joints and a tree from meshes in motion."""

import numpy as np

import workbench as wb
from workbench.synthetic.made_up import limb, random_smpl

bent = random_smpl(limb(9, 6), 1, seed=0)  # a synthetic limb of two bones
rng = np.random.default_rng(1)
pose = 0.5 * rng.standard_normal((20, 2, 3))
meshes = np.stack([bent.vertices(p) for p in pose])
found: wb.Rigged = wb.rig(meshes, bent.faces, rest=bent.template, bones=2)
print(found.body.n_joints, "bones,", round(1e3 * found.rms, 2), "mm from the meshes (rms)")
print(found.notes[-1])
joint: wb.JointCandidate = found.joints[0]
print("directions along which the joint may slide:", len(joint.free))
