"""How exactly each keypoint is known, compared with the others: an eye better than a hip.

Several people marked the same persons in photographs of COCO, and the standard deviations of what
they marked, divided by the square root of the person's area, came out between 0.025 for eyes and
0.107 for hips; COCO's measure of detectors, the object keypoint similarity, is made with them
(Lin et al., Microsoft COCO, 2014, and its page on the evaluation of keypoints; for feet Jin et al.,
Whole-Body Human Pose Estimation in the Wild, 2020, the mean of both sides). Detectors learn from
such marks.
"""

from collections.abc import Sequence

import numpy as np

from workbench.arrays import Array

MARKED = {
    "nose": 0.026,
    "eye": 0.025,
    "ear": 0.035,
    "shoulder": 0.079,
    "elbow": 0.072,
    "wrist": 0.062,
    "hip": 0.107,
    "knee": 0.087,
    "ankle": 0.089,
    "toe": 0.080,
    "heel": 0.080,
}
TYPICAL = 0.080  # the median of COCO's 17 keypoints and 6 of the feet, both sides counted


def alike(names: Sequence[str]) -> Array:
    """The relative standard deviations (M,) of keypoints that are all known alike: 1."""
    return np.ones(len(names))


def as_marked(names: Sequence[str]) -> Array:
    """The standard deviations (M,) of keypoints with these names, relative to a typical one's.

    A landmark of a body is besides not at the very place that a detector calls by its name. That
    difference is taken to be as large for all as the marks of a typical keypoint spread, so that
    variances are m_k^2 + m^2, divided by 2 m^2, with m = 0.080. Eyes have 0.74, hips 1.18. A
    keypoint that nobody marked for COCO, such as one of a finger, has 1.
    """
    ends = [next((s for end, s in MARKED.items() if name.endswith(end)), TYPICAL) for name in names]
    found: Array = np.sqrt((np.array(ends) ** 2 + TYPICAL**2) / (2 * TYPICAL**2))
    return found
