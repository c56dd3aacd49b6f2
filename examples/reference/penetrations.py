"""penetrations: how deep parts of a posed body are within each other, on its mesh."""

import numpy as np

from workbench import load_body
from workbench.bodies import capsule_gaps, capsules_of, penetrations

body = load_body("small")
pose = np.zeros((24, 3))
pose[body.joint_names.index("left_shoulder")] = 0, -1.2, 0
pose[body.joint_names.index("left_elbow")] = 0, -2.2, 0

for one in penetrations(body, body.vertices(pose)):
    print(f"{one.part} is {1e3 * one.depth:.0f} mm within {one.within}")

gaps = capsule_gaps(body, pose)
deepest = int(np.argmin(gaps))
print(f"capsules: {capsules_of(body).pair_names[deepest]}, {1e3 * gaps[deepest]:.0f} mm")
