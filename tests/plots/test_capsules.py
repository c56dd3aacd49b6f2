"""A body with its capsules, on paper and in words."""

import numpy as np
import pytest
from matplotlib.patches import Polygon

from workbench import load_body
from workbench.bodies.capsules import posed_capsules
from workbench.plots import caption_capsules, sheet
from workbench.plots.body import plot_capsules


def test_every_capsule_is_drawn_twice_and_the_deepest_pair_is_marked() -> None:
    body = load_body("small")
    pose = np.zeros((24, 3))
    pose[body.joint_names.index("left_shoulder"), 2] = -1.75  # into the side
    posed, vertices = posed_capsules(body, pose), body.vertices(pose)
    one, other = (posed.names[k] for k in posed.pairs[posed.deepest])
    assert posed.gaps[posed.deepest] == posed.gaps.min() < 0
    assert posed.gaps.min() == pytest.approx(
        np.linalg.norm(posed.places[1] - posed.places[0])
        - posed.radii[posed.names.index(one)]
        - posed.radii[posed.names.index(other)]
    )
    _, (ax,) = sheet(8, 6)
    assert plot_capsules(vertices, body.faces, posed, ax=ax) is ax
    outlines = [p for p in ax.patches if isinstance(p, Polygon)]
    assert sum(patch.get_fill() for patch in outlines) == 4  # two capsules, two views
    assert len(outlines) == 2 * 2 * len(posed.names)
    (ring, _) = ax.lines
    assert ring.get_ydata()[0] == pytest.approx(posed.places[:, 1].mean())
    words = caption_capsules(posed)
    assert one.replace("_", " ") in words
    assert f"overlap most, by {-1e3 * posed.gaps.min():.1f} mm" in words
    tall = np.concatenate([np.asarray(patch.get_xy()) for patch in outlines])
    top = (posed.ends[..., 1] + posed.radii[:, None]).max()
    assert tall[:, 1].max() == pytest.approx(top, abs=1e-3)
