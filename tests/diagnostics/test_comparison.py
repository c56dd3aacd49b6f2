"""Two diagnoses side by side: what the one sees that the other does not, by name."""

import json

import casadi as cs
import numpy as np

from tests.diagnostics import cases
from workbench import Block, Problem, Residual, diagnose, residuals
from workbench.diagnostics import DiagnosisComparison
from workbench.geometry.camera import Camera


def with_more(problem: Problem, *more: Residual) -> Problem:
    blocks = (*problem.free.blocks, *problem.fixed.blocks)
    return Problem((*problem.residuals, *more), problem.free.names, blocks=blocks)


def test_a_second_camera_tells_scale_from_distance() -> None:
    problem, values = cases.scale_against_depth()
    camera = Camera("left/")
    # the same eight points, seen from the side
    shape = np.random.default_rng(0).normal(scale=0.3, size=(8, 3))
    scale, trans = (problem.free[name].symbol for name in ("scale", "trans"))
    observed, confidence = Block("left/observed", (8, 2), "px"), Block("left/confidence", (8,))
    points = scale * cs.DM(shape.T) + cs.repmat(trans, 1, 8)
    seen = residuals.keypoints(points, camera, observed.symbol, confidence.symbol, sigma=1.0)
    sideways = [[0, 0, -1], [0, 1, 0], [1, 0, 0]]
    values |= camera.values(K=[[1000, 0, 500], [0, 1000, 500], [0, 0, 1]], R=sideways, t=[3, 0, 3])
    values |= {"left/observed": np.zeros((8, 2)), "left/confidence": np.ones(8)}
    one, two = diagnose(problem, values), diagnose(with_more(problem, seen), values)
    change = DiagnosisComparison(one, two)
    (gained,) = change.gained
    assert gained.name == "a common factor of scale and trans"
    assert change.lost == ()
    text = change.report()
    assert (
        "1 direction determined by the second only:\n  a common factor of scale and trans" in text
    )
    rows = {line.split("  ")[0]: line.split()[-2:] for line in text.splitlines()[1:] if line}
    assert (rows["rank"], rows["null directions"]) == (["3", "4"], ["1", "0"])
    back = DiagnosisComparison(two, one)
    assert (len(back.gained), len(back.lost)) == (0, 1)
    assert (
        "1 direction determined by the first only:\n  a common factor of scale and trans"
        in back.report()
    )
    # what was unknown and now is known has changed most
    assert {name for name, before, _ in change.sigmas[:4] if np.isinf(before)} == {
        "scale",
        "trans[x]",
        "trans[y]",
        "trans[z]",
    }


def test_the_comparison_as_data() -> None:
    problem, values = cases.scale_against_depth()
    one = diagnose(problem, values)
    data = json.loads(json.dumps(DiagnosisComparison(one, one).data(), allow_nan=False))
    assert list(data) == ["schema", "version", "first", "second", "gained", "lost"]
    assert data["first"] == data["second"] == json.loads(json.dumps(one.data()))
    assert (data["gained"], data["lost"]) == ([], [])
