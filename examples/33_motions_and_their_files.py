"""A motion: made, resampled, played on a body, and written to files that other programs read.

A person turns on the spot and waves, 20 frames a second. The motion is written as .npz in AMASS's
layout and as BVH, with the bones of the body. Both are read again, and the joints are where they
were; so it is with the names that smplx gives its arguments. One frame becomes a `trimesh.Trimesh`,
which trimesh writes and reads.
"""

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import trimesh

import workbench as wb
from workbench.motions import write_bvh

body = wb.load_body("small")
times = np.arange(41) / 20  # s
pose = np.zeros((len(times), body.n_joints, 3))
joint = body.joint_names.index
pose[:, joint("pelvis"), 1] = 0.5 * np.pi * times  # half a turn in two seconds
pose[:, joint("left_shoulder"), 2] = -1.2
pose[:, joint("right_shoulder"), 2] = -0.5
pose[:, joint("right_elbow"), 2] = -1.0 + 0.6 * np.sin(6 * times)
trans = np.column_stack([0 * times, 0.9 + 0 * times, 0 * times])  # m, the pelvis above the floor
wave = wb.Motion(pose, trans, 20.0, body.joint_names, origin="made up")

fast = wave.resampled(60)  # each joint turns along the shortest arc
print(f"{len(wave)} frames at {wave.fps:g}, {len(fast)} at {fast.fps:g} frames a second")
print("surface:", fast.vertices(body).shape, " first second:", len(fast[:60]), "frames")

with TemporaryDirectory() as folder:
    wb.save_motion(Path(folder) / "wave.npz", fast)
    wb.save_motion(Path(folder) / "smplx.npz", fast, layout="smplx")
    write_bvh(Path(folder) / "wave.bvh", fast, body)
    for name in ("wave.npz", "smplx.npz", "wave.bvh"):
        found = wb.read_motion(Path(folder) / name)
        order = [found.joint_names.index(k) for k in body.joint_names]
        places = found.joints(None if found.bones else body)[:, order]
        off = np.abs(places - fast.joints(body)).max()
        print(f"{name}: {len(found)} frames; joints differ by {1e6 * off:.2f} micrometres at most")
        print(*found.notes, sep="\n")

    mesh = body.trimesh(fast.pose[60], trans=fast.trans[60])  # in m
    mesh.export(Path(folder) / "frame.ply")
    again = trimesh.load(Path(folder) / "frame.ply")
    off = np.abs(wb.closest(again.vertices, mesh).distances).max()
    print(f"frame.ply: {len(again.vertices)} vertices, {1e6 * off:.2f} micrometres off at most")
