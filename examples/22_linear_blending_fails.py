"""Why linear blending fails, in numbers: the candy wrapper and the collapsing elbow.

On a tube everything can be computed by hand: halfway between two bones a twist by the angle a
leaves |cos(a / 2)| of the radius, and a bend loses volume as sin^2(a / 2). On the body the same
happens at wrists and elbows; dual quaternions and pose blend shapes repair it, in part.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np

import workbench as wb
from workbench.bodies.ablations import without_pose_blend_shapes
from workbench.geometry.solids import volume
from workbench.lectures.material.limbs import Limb
from workbench.lectures.material.tubes import linear_radius, tube, volume_lost_bent

angles = np.radians(np.arange(0, 181, 10))
body = wb.load_body("full")  # 12,272 vertices: volumes want a fine mesh
linear = without_pose_blend_shapes(body)
dual = replace(linear, skinning=wb.dual_quaternion_blend)
ways = {"linear blending": linear, "dual quaternions": dual, "SMPL (linear + blend shapes)": body}

# the tube
pipe = tube(rings=121)
twisted = Limb(pipe, "joint").posed([1, 0, 0], angles)
middle = pipe.weights[:, 1] == 0.5
radius = np.linalg.norm(twisted[:, middle, 1:], axis=2).mean(axis=1) / 0.05
off_the_law = np.abs(radius - np.abs(np.cos(angles / 2))).max()

area = 16 * 0.05**2 * np.sin(2 * np.pi / 32)  # m^2, of the tube's 32-gon
bent = Limb(pipe, "joint").posed([0, 0, 1], angles)
full = volume(pipe.template, pipe.faces)
lost = full - np.array([volume(v, pipe.faces) for v in bent])
off_the_integral = np.abs(lost - volume_lost_bent(area, 0.1, angles)).max() / full

# the body
wrist = {name: Limb(one, "left_wrist").radii(angles) for name, one in ways.items()}
bends = angles[angles <= np.radians(150)]
elbow = {}
for name, one in ways.items():
    found = Limb(one, "left_elbow").volumes([0, -1, 0], bends)
    elbow[name] = 1e6 * (found - found[0])  # cm^3
limb = Limb(linear, "left_wrist")
weights = limb.turning[limb.waist]
predicted = np.array([linear_radius(weights, a).mean() for a in angles])  # as if all were as thick
stretch = {
    name: Limb(one, "left_elbow").stretches([0, -1, 0], bends)[1] for name, one in ways.items()
}

if __name__ == "__main__":
    from workbench.lectures.material.by_angle import caption_by_angle, plot_by_angle
    from workbench.plots import house_style, png, sheet

    with house_style():
        figure, axes = sheet(14, 4.2, columns=3)
        law = "mean of |1 - w + w exp(ia)|", predicted
        plot_by_angle(angles, wrist, "radius of the twisted wrist (share)", ax=axes[0], law=law)
        plot_by_angle(bends, elbow, "volume of the bent arm (cm³ gained)", ax=axes[1], at_rest=0)
        plot_by_angle(bends, stretch, "longest edge of the bent arm (share)", ax=axes[2])
    Path(__file__).with_name("linear_blending_fails.png").write_bytes(png(figure))
    print(
        f"the tube is off the laws by {off_the_law:.0e} (radius), {off_the_integral:.1e} (volume)"
    )
    print(
        caption_by_angle(
            angles, wrist, "radius of the twisted wrist, a share of the radius at rest"
        )
    )
    print(caption_by_angle(bends, elbow, "volume gained by the bent arm, cm³"))
    print(caption_by_angle(bends, stretch, "longest edge of the bent arm over its length at rest"))
