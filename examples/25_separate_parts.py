"""Separate parts or a tree? 24 x 6 = 144 numbers that fall apart, or 72 + 3 that hold together.

Both are fitted to the same 150 noisy points, a third of the vertices. A part that few points are on
goes where it likes; the tree holds it where its neighbours are.
"""

from pathlib import Path

import casadi as cs
import numpy as np

import workbench as wb
from workbench.bodies.ablations import without_blend_weights, without_pose_blend_shapes
from workbench.lectures.material.separate_parts import SeparateParts

body = without_pose_blend_shapes(wb.load_body("small"))
parts, tree = SeparateParts(body), without_blend_weights(body)
rng = np.random.default_rng(0)
truth = 0.35 * rng.standard_normal((24, 3))
seen = rng.permutation(body.n_vertices)[:150]  # of 369, with 1 cm of noise
points = body.vertices(truth)[seen] + 0.01 * rng.standard_normal((len(seen), 3))

turns, places = (block.symbol for block in parts.blocks)
pose, betas, trans = (block.symbol for block in tree.blocks())


def picked(symbols: cs.MX, *of: wb.Points) -> wb.Residual:
    """The distance of the vertices (3, N) m that were seen."""
    differences = symbols[:, seen.tolist()] - points.T
    return wb.Residual("seen", differences.reshape((-1, 1)), sigma=0.01, unit="m", points=of)


apart = wb.Problem(
    [
        picked(parts.points()),
        wb.residuals.gaussian(turns, covariance=1.0),
        wb.residuals.gaussian(places, covariance=1.0),
    ],
    free=["turns", "places"],
    blocks=parts.blocks,
)
surface = tree.points(pose, betas, trans)
together = wb.Problem(
    [picked(surface.symbol, surface), wb.residuals.gaussian(pose, covariance=1.0)],
    free=["pose", "trans"],
)
loose = wb.solve(apart, parts.articulated(np.zeros((24, 3)))).values
held = wb.solve(together, tree.start()).values

numbers = apart.free.size, together.free.size
gaps = parts.gaps(**{name: loose[name] for name in ("turns", "places")})  # (23,) m
no_gaps = parts.gaps(**parts.articulated(held["pose"], held["trans"]))
clean = tree.vertices(truth)
errors = {
    "separate parts": np.linalg.norm(
        parts.vertices(loose["turns"], loose["places"]) - clean, axis=1
    ),
    "a tree": np.linalg.norm(tree.vertices(held["pose"], trans=held["trans"]) - clean, axis=1),
}

if __name__ == "__main__":
    from workbench.plots import caption_differences, house_style, plot_differences, png, sheet

    shown = {
        "separate parts": parts.vertices(loose["turns"], loose["places"]),
        "a tree": tree.vertices(held["pose"], trans=held["trans"]),
    }
    with house_style():
        figure, (ax,) = sheet(11, 4.8)
        plot_differences(clean, shown, body.faces, ax=ax, name="the truth", most=40)
    Path(__file__).with_name("separate_parts.png").write_bytes(png(figure))
    print(caption_differences(clean, shown, "the truth"))
    print(
        f"{numbers[0]} and {numbers[1]} unknowns; joints torn by up to {1e3 * gaps.max():.0f} mm "
        f"and {1e3 * no_gaps.max():.0e} mm"
    )
