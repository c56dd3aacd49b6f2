"""Which function of theta should drive blend shapes? A turning neck, and a small table.

B_P(theta) = sum over n of f_n(theta) P_n. With f(theta) = theta a neck that turns once round is
not where it was; with the elements of its rotation matrix it is. `workbench blendshapes` is the
same with all predictors, more poses and a recording.
"""

from pathlib import Path

import numpy as np

import workbench as wb
from workbench.priors.poses import draw_poses, shipped_gaussian
from workbench.studies.blend_shapes import questions
from workbench.studies.blend_shapes.predictors import LINEAR, LINEAR_IN, accuracy
from workbench.studies.blend_shapes.training_data import (
    PosedSurfaces,
    TrainingData,
    with_blend_shapes,
)
from workbench.synthetic.teacher import body_on_teachers_rig, teacher_of

body = wb.load_body("small")
linear, teacher = body_on_teachers_rig(body), teacher_of(body)
rng = np.random.default_rng(0)
training, validation, test = (
    PosedSurfaces.of(teacher, draw_poses(shipped_gaussian(), n, rng)) for n in (250, 40, 60)
)
data = TrainingData(linear, training, validation)
wanted = data.correctives(linear)  # what linear blending gets wrong, brought back to rest

predictors = {LINEAR: linear}
for name, features in LINEAR_IN.items():
    posedirs, ridge = data.fit(features, wanted)
    predictors[name] = with_blend_shapes(linear, features, posedirs)
errors = {name: accuracy(body, test).mean for name, body in predictors.items()}  # mm

by_angle = questions.by_angle(data, wanted, "neck")  # rms mm while the neck turns twice around
once_round = {name: size[len(size) // 2] - size[0] for name, size in by_angle.items()}

if __name__ == "__main__":
    from workbench.plots import house_style, png, sheet
    from workbench.studies.blend_shapes.figures import caption_by_angle, plot_by_angle

    with house_style():
        figure, (ax,) = sheet(7, 4)
        plot_by_angle(by_angle, ax=ax)
    Path(__file__).with_name("neck.png").write_bytes(png(figure))
    print(caption_by_angle(by_angle))
    for name, millimetres in sorted(errors.items(), key=lambda pair: pair[1]):
        print(f"{name:34}{millimetres:8.2f} mm on {len(test)} unseen draws")
