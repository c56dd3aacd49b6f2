"""The shape space: directions at plus and minus three sigma, what they explain, where joints go.

Betas are in standard deviations. Joints are regressed from the shaped surface, J(beta), because a
tall person's knee is elsewhere: on the mean's skeleton the same skin bends in the wrong places. And
the lecture's table of parameters, counted from arrays.
"""

from pathlib import Path

import numpy as np

import workbench as wb
from workbench.course.shapes.counting import SLIDE, SMPL_SIZE, counts, dense_counts, total
from workbench.course.shapes.shape_directions import (
    along,
    joint_moves,
    reconstruction_errors,
    variances,
    with_joints_of_the_mean,
)

body = wb.load_body()
pose = np.zeros((24, 3))
pose[[16, 17], 2] = -1.15, 1.15  # arms down, so that people stand closer together
gallery = {"mean": body.vertices(pose)}
for k in range(5):
    for sign in (1, -1):
        gallery[f"betas[{k}] {3 * sign:+d} sd"] = body.vertices(pose, along(body, k, 3.0 * sign))

# explained variance: of the population, by its card; of strangers, by projecting them
shares = np.array(body.card["betas"]["explained_variance"])
own = variances(body) / variances(body).sum()  # the same ratios, from shapedirs alone
with np.load(Path(wb.__file__).parent / "data" / "bodies" / "strangers.npz") as file:
    strangers = file["default"].astype(float)  # four people it was not learned from
left = reconstruction_errors(body, strangers)  # (11, 4) m

# joints: the tallest in the gallery, bent on the skeleton of the mean
tall = along(body, 0, 3.0)
moved = joint_moves(body, tall)  # (24,) m
stranger_skeleton = with_joints_of_the_mean(body, tall)
bent = np.zeros((24, 3))
bent[[4, 5], 0], bent[18, 1], bent[19, 1] = np.radians(90), -np.radians(90), np.radians(90)
wrong = np.linalg.norm(stranger_skeleton.vertices(bent) - body.vertices(bent, tall), axis=1)  # m

released = dense_counts(*SMPL_SIZE)
here = counts(body)

if __name__ == "__main__":
    from workbench.plots import (
        caption_left_over,
        caption_shape_gallery,
        caption_variances,
        house_style,
        plot_left_over,
        plot_variances,
        png,
        sheet,
    )
    from workbench.plots.sheets import shape_gallery_sheet

    shown = {name: v for name, v in gallery.items() if "+" in name or name == "mean"}
    shown |= {f"{name} ": v for name, v in gallery.items() if "-" in name or name == "mean"}
    figure = shape_gallery_sheet(shown, body.faces)
    Path(__file__).with_name("shape_directions.png").write_bytes(png(figure))
    with house_style():
        figure, axes = sheet(11, 4, columns=2)
        plot_variances(shares, ax=axes[0])
        plot_left_over(left, ax=axes[1])
    Path(__file__).with_name("explained_variance.png").write_bytes(png(figure))
    print(caption_shape_gallery(gallery, "three"))
    print(caption_variances(shares), caption_left_over(left))
    worst = int(moved.argmax())
    print(
        f"the tallest: {body.joint_names[worst]} moves {1e3 * moved[worst]:.0f} mm; bent on the "
        f"mean's joints vertices are wrong by up to {1e3 * wrong.max():.0f} mm"
    )
    print(f"{'array':14}{'slide':>12}{'SMPL file':>12}{'this body':>12}{'not zero':>12}")
    for row, file, ours in zip(SLIDE, released, here, strict=True):
        print(
            f"{row.name:14}{row.numbers:12,}{file.numbers:12,}{ours.numbers:12,}{ours.nonzero:12,}"
            f"  {row.remark}"
        )
    print(f"{'all':14}{total(SLIDE):12,}{total(released):12,}{total(here):12,}")
