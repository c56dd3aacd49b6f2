"""Results of MediaPipe as its programs write them; the points are random."""

from typing import Any

import numpy as np


def dots(count: int, seed: int, visible: bool = False) -> list[dict[str, float]]:
    """Points as fractions of an image, with a depth, and a visibility for those of a body."""
    rng = np.random.default_rng(seed)
    numbers = rng.uniform(0.1, 0.9, (count, 4)).round(4).tolist()
    return [
        {"x": x, "y": y, "z": z - 0.5} | ({"visibility": v} if visible else {})
        for x, y, z, v in numbers
    ]


def mediapipe_results() -> dict[str, dict[str, Any]]:
    """By the program: tasks in Python and JavaScript, messages, the holistic model."""
    left, right, body = dots(21, 1), dots(21, 2), dots(33, 3, visible=True)
    said = [
        [{"index": i, "score": 0.9, "category_name": n}] for i, n in ((0, "Left"), (1, "Right"))
    ]
    camel = [[{"index": 0, "score": 0.9, "categoryName": n}] for n in ("Left", "Right")]
    classified = [{"classification": [{"score": 0.9, "label": n}]} for n in ("Left", "Right")]
    messages = [{"landmark": one} for one in (left, right)]
    return {
        "hands-of-python": {
            "handedness": said,
            "hand_landmarks": [left, right],
            "hand_world_landmarks": [left, right],
        },
        "hands-of-javascript": {"landmarks": [left, right], "handedness": camel},
        "hands-as-messages": {"multiHandLandmarks": messages, "multiHandedness": classified},
        "bodies-of-python": {"pose_landmarks": [body, dots(33, 4, visible=True)]},
        "bodies-of-javascript": {"landmarks": [body], "worldLandmarks": [body]},
        "holistic": {
            "poseLandmarks": {"landmark": body},
            "leftHandLandmarks": None,
            "rightHandLandmarks": {"landmark": right},
            "faceLandmarks": {"landmark": dots(468, 5)},
        },
    }
