"""Which function of theta should drive blend shapes? The lecture's neck, and a table in small.

B_P(theta) = sum over n of f_n(theta) P_n. With f(theta) = theta a neck that turns once round is
not where it was; with the elements of its rotation matrix it is. `workbench blendshapes` is the
same with all predictors, more poses and a recording.
"""

from pathlib import Path

import numpy as np

import workbench as wb
from workbench.training.blend_shapes import studies
from workbench.training.blend_shapes.comparison import shipped_prior
from workbench.training.blend_shapes.contest import LINEAR, LINEAR_IN, Contender, School, measured
from workbench.training.blend_shapes.lesson import Lesson, taught
from workbench.training.embedded.fine_weights import pupil_of, teacher_of
from workbench.training.pose_prior import draw_poses

body = wb.load_body("small")
bare, teacher = pupil_of(body), teacher_of(body)
rng = np.random.default_rng(0)
lesson, trial, test = (
    Lesson.by(teacher, draw_poses(shipped_prior(), n, rng)) for n in (250, 40, 60)
)
school = School(bare, lesson, trial)
shapes = school.bulges(bare)  # what linear blending gets wrong, brought back to rest

students = {LINEAR: Contender(LINEAR, bare, 0)}
for name, features in LINEAR_IN.items():
    posedirs, price = school.fit(features, shapes)
    students[name] = Contender(name, taught(bare, features, posedirs), np.count_nonzero(posedirs))
errors = {name: measured(student, test).mean for name, student in students.items()}  # mm

by_turn = studies.by_turn(school, shapes, "neck")  # rms mm while the neck turns twice round
once_round = {name: size[len(size) // 2] - size[0] for name, size in by_turn.items()}

if __name__ == "__main__":
    from workbench.plots import house_style, png, sheet
    from workbench.plots.blend_shapes import caption_by_turn, plot_by_turn

    with house_style():
        figure, (ax,) = sheet(7, 4)
        plot_by_turn(by_turn, ax=ax)
    Path(__file__).with_name("neck.png").write_bytes(png(figure))
    print(caption_by_turn(by_turn))
    for name, millimetres in sorted(errors.items(), key=lambda pair: pair[1]):
        print(f"{name:34}{millimetres:8.2f} mm on {len(test)} unseen draws")
