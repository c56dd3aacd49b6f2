"""The course's visualize_pose_blends: the rest surface that pose blend shapes make, and why.

Before anything is skinned, the pose changes the rest surface: T + B_P(theta). It looks wrong there
(an elbow swells, a forearm is wound up) and right where skinning has bent it. The page that it
writes, sliders.html, has sliders for all of it.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np

import workbench as wb
from workbench.bodies.ablations import without_pose_blend_shapes
from workbench.geometry.rotation import matrix_from_vector
from workbench.lectures.material.blend_shapes import feature_matrix

body = wb.load_body()
bare = without_pose_blend_shapes(body)
dual = replace(bare, skinning=wb.dual_quaternion_blend)
joint = {name: k for k, name in enumerate(body.joint_names)}

pose = np.zeros((24, 3))
for name, degrees in {
    "left_elbow": (0, -110, 0),
    "right_wrist": (120, 0, 0),
    "left_knee": (100, 0, 0),
    "right_hip": (-80, 0, 0),
    "right_knee": (90, 0, 0),
}.items():
    pose[joint[name]] = np.radians(degrees)

features = feature_matrix(body, body.features, pose[None])[0]  # vec(R_k - I), 207 of them
offsets = body.posedirs @ features  # (N, 3) m
rest = body.template + offsets
posed = {"SMPL": body, "linear blending alone": bare, "dual quaternions alone": dual}
surfaces = {name: one.vertices(pose) for name, one in posed.items()}

# only the joints that turned contribute, nine shapes each, and at rest nothing does
turned = sorted(body.joint_names[1 + k] for k in set(np.flatnonzero(features) // 9))
at_rest = body.posedirs @ feature_matrix(body, body.features, np.zeros((1, 24, 3)))[0]
largest = 1e3 * np.linalg.norm(offsets, axis=1).max()  # mm

if __name__ == "__main__":
    from workbench.plots import caption_differences, house_style, plot_differences, png, sheet
    from workbench.reports.sliders import write_sliders

    def aslant(vertices: np.ndarray) -> np.ndarray:
        """From half left, so that what comes to the front is seen."""
        return vertices @ matrix_from_vector([0, -0.7, 0]).T

    here, others = Path(__file__), {n: v for n, v in surfaces.items() if n != "SMPL"}
    with house_style():
        figure, (ax,) = sheet(11, 5)
        plot_differences(
            body.template,
            {"with B_P, at rest": rest},
            body.faces,
            ax=ax,
            look=aslant,
            name="the template",
        )
        here.with_name("pose_blends_at_rest.png").write_bytes(png(figure))
        figure, (ax,) = sheet(11, 5)
        plot_differences(surfaces["SMPL"], others, body.faces, ax=ax, look=aslant)
        here.with_name("pose_blends.png").write_bytes(png(figure))
    print(f"turned: {', '.join(turned)}; the largest displacement at rest is {largest:.0f} mm")
    print(caption_differences(surfaces["SMPL"], others))
    print("sliders:", write_sliders(body, Path("sliders.html")).resolve())
