"""Which function of theta should drive blend shapes? A turning neck, and a small table.

B_P(theta) = sum over n of f_n(theta) P_n. With f(theta) = theta a neck that turns once round is
not where it was; with the elements of its rotation matrix it is. `examples/studies/blend_shapes.py`
is the same with all predictors, more poses and a recording.
"""

from pathlib import Path

import numpy as np

import workbench as wb
from workbench.bodies.forward.surface import (
    quaternion_elements,
    rotation_elements,
    rotation_vectors,
)
from workbench.lectures.material.blend_shapes import (
    PosedSurfaces,
    TrainingData,
    feature_matrix,
    rms_length,
    with_blend_shapes,
)
from workbench.lectures.material.teacher import body_on_teachers_rig, teacher_of
from workbench.priors.poses import draw_poses, shipped_gaussian
from workbench.training.estimate import bent

LINEAR = "linear blending (LBS)"
FEATURES = {
    "LBS + theta": rotation_vectors,
    "LBS + quaternions": quaternion_elements,
    "LBS + rotation elements (SMPL)": rotation_elements,
}

body = wb.load_body("small")
linear, teacher = body_on_teachers_rig(body), teacher_of(body)
rng = np.random.default_rng(0)
training, validation, test = (
    PosedSurfaces.of(teacher, draw_poses(shipped_gaussian(), n, rng)) for n in (250, 40, 60)
)
data = TrainingData(linear, training, validation)
wanted = data.correctives(linear)  # what linear blending gets wrong, brought back to rest
fitted = {name: data.fit(features, wanted)[0] for name, features in FEATURES.items()}

predictors = {LINEAR: linear} | {
    name: with_blend_shapes(linear, FEATURES[name], P) for name, P in fitted.items()
}
errors = {
    name: 1e3 * np.linalg.norm(one.vertices(test.poses) - test.vertices, axis=2).mean()
    for name, one in predictors.items()
}  # mm

turns = np.radians(np.arange(0, 721, 5))  # the neck turns twice around
poses = np.tile(linear.bind_pose, (len(turns), 1, 1))
poses[:, linear.joint_names.index("neck"), 1] = turns
by_angle = {
    name: np.array(
        [1e3 * rms_length(d) for d in bent(P, feature_matrix(linear, FEATURES[name], poses))]
    )
    for name, P in fitted.items()
}  # mm
once_round = {name: size[len(size) // 2] - size[0] for name, size in by_angle.items()}

if __name__ == "__main__":
    from workbench.plots import house_style, png, sheet

    with house_style():
        figure, (ax,) = sheet(7, 4)
        for name, size in by_angle.items():
            ax.plot(np.degrees(turns), size, label=name)
        ax.set(xlabel="turn of the neck (degrees)", ylabel="rms length of the blend shapes (mm)")
        ax.legend()
    Path(__file__).with_name("neck.png").write_bytes(png(figure))
    for name, millimetres in sorted(errors.items(), key=lambda pair: pair[1]):
        print(f"{name:34}{millimetres:8.2f} mm on {len(test)} unseen draws")
