"""A skeleton from meshes in motion: bones, weights, joints and their tree, none of which is given.

The meshes are synthetic: an arm of five bones, driven by made-up angles, so that the answer is
known. Linear blend skinning explains them exactly, and what is found is the arm to within rounding.
A wrist that only bends about one axis does not show where on that axis its joint is, and the notes
say so.
"""

import numpy as np
from scipy.sparse import csr_array

import workbench as wb
from workbench.geometry.solids import heat
from workbench.training.rigging.rig import pose_rms

RINGS, AROUND, LENGTH = 25, 8, 0.7  # m
JOINTS = np.array([0.0, 0.12, 0.38, 0.58, 0.64])  # m along the arm: chest, shoulder, elbow, ...
NAMES = ("chest", "shoulder", "elbow", "wrist", "fingers")

# The arm: a tube along x, in segments whose borders are blurred by heat.
x = np.repeat(np.linspace(0, LENGTH, RINGS), AROUND)
angle = np.tile(2 * np.pi * np.arange(AROUND) / AROUND, RINGS)
radius = 0.05 - 0.03 * x / LENGTH
template = np.stack([x, radius * np.cos(angle), radius * np.sin(angle)], axis=1)
ring, k = np.divmod(np.arange((RINGS - 1) * AROUND), AROUND)
a, b = ring * AROUND + k, ring * AROUND + (k + 1) % AROUND
faces = np.concatenate([np.stack([a, b, a + AROUND], 1), np.stack([b, b + AROUND, a + AROUND], 1)])
segment = np.searchsorted(JOINTS, x, side="right") - 1
weights = heat(template, faces, 0.03).solve(np.eye(5)[segment]).clip(0)
weights[weights < 0.01] = 0
nearest = [np.abs(x - joint) < LENGTH / RINGS for joint in JOINTS]
regressor = np.stack([near / near.sum() for near in nearest])
arm = wb.SkinnedBody(
    template=template,
    shapedirs=np.zeros((len(x), 3, 0)),
    posedirs=np.zeros((len(x), 3, 36)),
    J_regressor=csr_array(regressor),
    weights=weights / weights.sum(axis=1, keepdims=True),
    parents=(-1, 0, 1, 2, 3),
    faces=faces,
    joint_names=NAMES,
    name="arm",
)


def moving(frames: int, seed: int) -> np.ndarray:
    """Meshes (T, N, 3) m of the arm; the wrist only bends about z."""
    rng = np.random.default_rng(seed)
    pose = 0.5 * rng.standard_normal((frames, 5, 3))
    pose[:, 3, :2] = 0
    trans = rng.standard_normal((frames, 3))
    return np.stack([arm.vertices(p, trans=t) for p, t in zip(pose, trans, strict=True)])


# What was found: the order of bones is its own, so bones are matched by their weights.
found = wb.rig(moving(40, seed=0), faces, rest=template)
body = found.body
gaps = np.abs(body.weights[:, :, None] - arm.weights[:, None]).max(axis=0)
true = [NAMES[j] for j in gaps.argmin(axis=1)]
edges = {frozenset((true[k], true[body.parents[k]])) for k in range(1, body.n_joints)}
print(f"{body.n_joints} bones; the meshes are met to {found.rms:.0e} m (rms)")
print(f"weights differ by at most {gaps.min(axis=1).max():.0e}")
print(
    "joints between " + ", ".join(" and ".join(sorted(edge)) for edge in sorted(edges, key=sorted))
)
held_out = pose_rms(body, moving(5, seed=1))
print(f"meshes that nothing was learned from are met to {held_out:.0e} m")
for note in found.notes:
    print(note)
