"""The motion of one body as that of another, and as a file that engines and browsers play.

A person of the body `default` waves and turns. The same angles on the coarse body `small`, which
has other proportions, are another motion. `convert` fits `small` to the surface of `default`
instead: one shape for all frames, and a pose for each. The result is written as glTF with a few
correctives, and the file says how far its surface is off.
"""

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import workbench as wb
from workbench.conversion import conversion_errors, convert, correspond, motion_from_points
from workbench.motions import write_glb

default, small = wb.load_body("default"), wb.load_body("small")
times = np.arange(16) / 15  # s
pose = np.zeros((len(times), default.n_joints, 3))
joint = default.joint_names.index
pose[:, joint("pelvis"), 1] = 0.25 * np.pi * times
pose[:, joint("left_shoulder"), 2] = -1.1
pose[:, joint("right_elbow"), 1] = 1.0 + 0.5 * np.sin(6 * times)
pose[:, joint("left_knee"), 0] = 0.4 + 0.4 * np.cos(3 * times)
trans = np.column_stack([0 * times, 0.9 + 0 * times, 0.5 * times])  # m
betas = np.random.default_rng(1).normal(size=default.n_betas)
motion = wb.Motion(pose, trans, 15.0, default.joint_names, betas, origin="made up")

correspondence = correspond(default, small)  # once for all motions of these bodies
print(correspondence)
found = convert(motion, default, small, correspondence=correspondence)
copied = conversion_errors(motion.named(small), small, motion, default, correspondence)
print(
    f"copied angles:   {1e3 * np.nanmean(copied):5.2f} mm from the surface of default, on average"
)
print(f"converted:       {1e3 * found.mean():5.2f} mm")
worst = [f"{part} {1e3 * mean:.1f}" for part, (mean, _) in list(found.by_part.items())[:3]]
print("the worst parts, mm:", ", ".join(worst))

# The joints alone, in another order, with 5 mm of noise and every tenth missing.
rng = np.random.default_rng(2)
points = motion.joints(default) + rng.normal(scale=0.005, size=(len(times), 24, 3))
points[rng.random(points.shape[:2]) < 0.1] = np.nan
tracked = motion_from_points(
    points[:, ::-1], default.joint_names[::-1], default, motion.fps, kind="joints", sigma=0.005
)
off = np.linalg.norm(tracked.motion.joints(default) - motion.joints(default), axis=2)
print(f"from noisy joints: joints {1e3 * off.mean():.1f} mm off, those that were hidden too")

with TemporaryDirectory() as folder:
    for count in (0, 2, None):
        path = Path(folder) / "wave.glb"
        print(write_glb(path, motion, default, correctives=count, shapes=10))
    again = wb.read_motion(path)
    print(f"read again: {len(again)} frames of {len(again.joint_names)} joints")
