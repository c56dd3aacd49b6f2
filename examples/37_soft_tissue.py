"""Soft tissue that follows a motion: dynamic blend shapes, driven by a second-order model.

The tissue of the embedded body is simulated: springs and dampers on the mesh, driven by recorded
motion; none was measured. The motion here is made up of sines. A coefficient is a number for each
frame that says how far one dynamic blend shape is displaced; it follows from the two frames before
and from what the parts of the body feel. Coefficients of zero give SMPL to the last bit, and an
exaggeration multiplies them.
"""

from dataclasses import replace

import numpy as np

import workbench as wb
from workbench.bodies.spaces import body_mass_index
from workbench.lectures.material.tissue_simulation import simulate_tissue
from workbench.motions import load_tissue
from workbench.synthetic.made_up import made_up_motion

body, tissue = wb.load_body("default"), load_tissue()
motion = made_up_motion(body, seconds=4.0, seed=1)
print(
    f"{tissue.n_coefficients} dynamic blend shapes, {len(tissue.poles)} poles, "
    f"spectral radius {tissue.spectral_radius:.3f}"
)

bare = motion.vertices(body)
same = np.array_equal(tissue.vertices(body, motion, exaggeration=0.0), bare)
print("without it the surface is SMPL's to the last bit:", same)

# How far tissue moves: the same motion, made by people of different weight, and exaggerated.
farthest = {}
for third in (-2.0, 0.0, 2.0):
    here = replace(motion, betas=np.array([0.0, 0.0, third]))
    index = body_mass_index(body, here.betas)
    for exaggeration in (1.0, 3.0):
        moved = tissue.vertices(body, here, exaggeration) - here.vertices(body)
        farthest[index, exaggeration] = 1e3 * np.linalg.norm(moved, axis=-1).max()
        print(
            f"body mass index {index:.1f}, exaggeration {exaggeration:g}: tissue moves by "
            f"{farthest[index, exaggeration]:.0f} mm at most"
        )

# Against the springs themselves, in this motion, which is unlike any recording.
true = simulate_tissue(body, motion)
found = tissue.displacements(body, tissue.coefficients(body, motion))
left = np.square(true - found).sum() / np.square(true - true.mean(axis=0)).sum()
explained = float(1 - left)
print(f"a free run explains {100 * explained:.0f} % of the simulated displacement")
