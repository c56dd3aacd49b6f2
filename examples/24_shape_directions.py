"""The shape space: directions at plus and minus three sigma, what they explain, where joints go.

Betas are in standard deviations. Joints are regressed from the shaped surface, J(beta), because a
tall person's knee is elsewhere: on the mean's skeleton the same skin bends in the wrong places.

The example also counts the numbers of which a body is made, array by array, beside the table in
the lecture Body Models II of Pons-Moll and Swoboda (2018). For N = 6,890 vertices, 23 joints and 10
shape directions the sum in that table is right. But one of its products lacks a factor that its
value has, and two of its values are not what a released model holds; `PUBLISHED` says why.
"""

from pathlib import Path

import numpy as np

import workbench as wb
from workbench.lectures.material.shape_directions import along, joint_moves, with_joints_of_the_mean


def variances(body: wb.SkinnedBody) -> np.ndarray:
    """The variance that each direction gives the surface, (B,) m^2 summed over coordinates.

    With betas in standard deviations, as in SMPL's files, it is the column's squared length.
    """
    return np.asarray(np.sum(body.shapedirs**2, axis=(0, 1)))


def reconstruction_errors(body: wb.SkinnedBody, people: np.ndarray) -> np.ndarray:
    """The rms distance of vertices after fitting 0, 1, ..., B directions: (B + 1, P) m.

    People (P, N, 3) m are at rest, and their betas are the best ones. They may stand anywhere,
    because their mean point is moved to the template's.
    """
    shapes = people - body.template
    shapes = (shapes - shapes.mean(axis=1, keepdims=True)).reshape(len(shapes), -1)
    S = body.shapedirs - body.shapedirs.mean(axis=0)
    flat = S.reshape(-1, body.n_betas)
    found = [shapes]
    for b in range(1, body.n_betas + 1):
        Q, _ = np.linalg.qr(flat[:, :b])
        found.append(shapes - (shapes @ Q) @ Q.T)
    return np.asarray([np.linalg.norm(rest, axis=1) / np.sqrt(body.n_vertices) for rest in found])


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
with np.load(Path(wb.__file__).parent / "data" / "bodies" / "held_out_people.npz") as file:
    strangers = file["default"].astype(float)  # four people it was not learned from
left = reconstruction_errors(body, strangers)  # (11, 4) m

# joints: the tallest in the gallery, bent on the skeleton of the mean
tall = along(body, 0, 3.0)
moved = joint_moves(body, tall)  # (24,) m
stranger_skeleton = with_joints_of_the_mean(body, tall)
bent = np.zeros((24, 3))
bent[[4, 5], 0], bent[18, 1], bent[19, 1] = np.radians(90), -np.radians(90), np.radians(90)
wrong = np.linalg.norm(stranger_skeleton.vertices(bent) - body.vertices(bent, tall), axis=1)  # m

# how many numbers each array holds: published, of the released model, of this body
PUBLISHED = {  # as the lecture counts them, with a remark
    "template": (20_670, ""),
    "shapedirs": (206_700, ""),
    "posedirs": (4_278_690, "printed as 9 x 23 x 6890, without the factor 3 of the coordinates"),
    "weights": (
        82_680,
        "printed as 4 x 3 x 6890: four weights a vertex are 27,560 and a dense file has 165,360",
    ),
    "J_regressor": (
        1_426_230,
        "a free linear map from all coordinates to all joints; the model has one weight for each "
        "vertex and joint, 158,470, or 165,360 with the root",
    ),
}


def sizes(N: int, K: int, B: int) -> dict[str, int]:
    """The sizes of the arrays of a file: N vertices, K joints with the root, B directions."""
    return {
        "template": N * 3,
        "shapedirs": N * 3 * B,
        "posedirs": N * 3 * 9 * (K - 1),
        "weights": N * K,
        "J_regressor": K * N,
    }


released = sizes(6890, 24, 10)
here = {name: body.array(name) for name in PUBLISHED}

if __name__ == "__main__":
    from workbench.lectures.material.variance import (
        caption_left_over,
        caption_variances,
        plot_left_over,
        plot_variances,
    )
    from workbench.plots import caption_shape_gallery, house_style, png, sheet
    from workbench.plots.body import shape_gallery_sheet

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
    print(f"{'array':14}{'published':>12}{'SMPL file':>12}{'this body':>12}{'not zero':>12}")
    for name, (count, remark) in PUBLISHED.items():
        array = here[name]
        numbers = f"{count:12,}{released[name]:12,}{array.size:12,}{np.count_nonzero(array):12,}"
        print(f"{name:14}{numbers}  {remark}")
    totals = (
        sum(count for count, _ in PUBLISHED.values()),
        sum(released.values()),
        sum(array.size for array in here.values()),
    )
    print(f"{'all':14}" + "".join(f"{total:12,}" for total in totals))
