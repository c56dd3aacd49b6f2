"""Ways through a surface, against a ball whose chords are known."""

import numpy as np
import trimesh

from workbench.geometry.sight import passages


def test_chords_of_a_ball() -> None:
    ball = trimesh.creation.icosphere(subdivisions=4)
    eye = np.array([0.013, 0.021, 5.0])
    points = np.array([[0, 0, 0], [0, 0, -2], [0, 0, 2], [3, 0, 0], [0.5, 0, -0.5], [1.1, 0, -2]])
    exits, inside = passages(eye, points, np.array(ball.vertices), np.array(ball.faces))
    way = points - eye
    # |eye + t way| = 1: two values of t, of which those between 0 and 1 count
    a, b, c = (way**2).sum(axis=1), way @ eye, eye @ eye - 1
    root = np.sqrt(np.maximum(b**2 - a * c, 0))
    first, last = (-b - root) / a, (-b + root) / a
    chord = np.clip(last, 0, 1) - np.clip(first, 0, 1)
    np.testing.assert_allclose(inside, chord * np.sqrt(a), atol=0.01)
    np.testing.assert_array_equal(exits, (root > 0) & (last < 1) & (last > 0))
    assert list(exits) == [0, 1, 0, 0, 0, 1]
