"""Small pictures of bodies in images."""

from xml.etree import ElementTree

import numpy as np
import pytest

from workbench.fitting.jobs import FittedPicture
from workbench.reports.many import MARGIN, PICTURE_HEIGHT, thumbnail

SVG = "{http://www.w3.org/2000/svg}"
PARENTS = (0, 0, 1)


def test_bones_and_observed_keypoints_are_drawn_in_their_places() -> None:
    joints = np.array([[100.0, 50], [150, 100], [100, 250]])
    observed = np.array([[100.0, 150], [0, 0], [120, 50]])
    drawn = ElementTree.fromstring(
        thumbnail(FittedPicture(joints, observed, np.array([1, 0, 0.5])), PARENTS)
    )
    lines, circles = list(drawn.iter(f"{SVG}line")), list(drawn.iter(f"{SVG}circle"))
    assert len(lines) == 2
    assert [circle.get("stroke-opacity") for circle in circles] == ["1.00", "0.50"]
    scale = (PICTURE_HEIGHT - 2 * MARGIN) / 200
    ends = [float(lines[1].attrib[name]) for name in ("x1", "y1", "x2", "y2")]
    expected = [50 * scale + MARGIN, 50 * scale + MARGIN, MARGIN, 200 * scale + MARGIN]
    assert ends == pytest.approx(expected, abs=0.06)
    assert drawn.get("height") == f"{PICTURE_HEIGHT:.0f}"
    assert float(drawn.attrib["width"]) == round(50 * scale + 2 * MARGIN)
