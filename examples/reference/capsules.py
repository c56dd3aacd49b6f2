"""Capsules: a body as tubes with round ends, which follow its shape."""

import numpy as np

import workbench as wb
from workbench.bodies import capsule_gaps

body = wb.load_body("small")
print(body.capsules.names[:3], body.capsules.radii_of(np.zeros(body.n_betas))[:3])
hands_on_hips = np.zeros((24, 3))
hands_on_hips[body.joint_names.index("left_shoulder"), 2] = -1.5
gaps = capsule_gaps(body, hands_on_hips)
print(body.capsules.pair_names[gaps.argmin()], f"{1e3 * gaps.min():.0f} mm")
