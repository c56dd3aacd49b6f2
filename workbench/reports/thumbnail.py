"""A small picture of a body in an image, as text (SVG): a thousand of them are made in a second."""

from collections.abc import Sequence

import numpy as np

from workbench.arrays import Array
from workbench.fitting.jobs import Picture
from workbench.plots.palette import BLUE, VERMILLION

HEIGHT, MARGIN = 120.0, 8.0  # px of the picture, and of it around the person


def thumbnail(picture: Picture, parents: Sequence[int]) -> str:
    """The body's bones as lines, and the observed keypoints as circles, cropped to both.

    The higher the confidence of a keypoint, the more opaque its circle.
    """
    seen = picture.confidence > 0
    inside = np.concatenate([picture.joints, picture.observed[seen]])
    inside = inside[np.isfinite(inside).all(axis=1)]
    low, high = (inside.min(axis=0), inside.max(axis=0)) if len(inside) else (np.zeros(2),) * 2
    scale = (HEIGHT - 2 * MARGIN) / max(float(high[1] - low[1]), float(high[0] - low[0]), 1.0)
    size = scale * (high - low) + 2 * MARGIN

    def placed(points: Array) -> Array:
        return np.asarray(scale * (points - low) + MARGIN)

    joints = placed(picture.joints)
    lines = [
        f'<line x1="{a[0]:.1f}" y1="{a[1]:.1f}" x2="{b[0]:.1f}" y2="{b[1]:.1f}"/>'
        for a, b in ((joints[parent], joints[k]) for k, parent in enumerate(parents) if k)
        if np.isfinite([a, b]).all()
    ]
    circles = [
        f'<circle cx="{u:.1f}" cy="{v:.1f}" r="2.2" stroke-opacity="{min(float(c), 1):.2f}"/>'
        for (u, v), c in zip(placed(picture.observed[seen]), picture.confidence[seen], strict=True)
    ]
    width, height = (f"{number:.0f}" for number in size)
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" '
        f'viewBox="0 0 {width} {height}" fill="none">'
        f'<g stroke="{BLUE}" stroke-width="2" stroke-linecap="round">{"".join(lines)}</g>'
        f'<g stroke="{VERMILLION}" stroke-width="1.2">{"".join(circles)}</g></svg>\n'
    )
