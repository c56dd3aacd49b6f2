"""What is hardly noticed is so relative to a yardstick, and not to the unit of a block."""

import casadi as cs
import numpy as np
import pytest

from workbench import Block, Camera, Diagnosis, Problem, Residual, Values, diagnose, residuals
from workbench.bodies.catalogue import load_body
from workbench.diagnostics.identifiability import EntryIdentifiability

RAYS = np.linspace(-0.4, 0.4, 20)


def focal_length(unit: str, scale: float, *, known_to: float = 5.0) -> Diagnosis:
    """1000 px, and 20 keypoints that know it to so many; told in a unit of 1 / scale px."""
    f = Block("focal", (), unit)
    r = Residual(
        "seen", (f.symbol / scale - 1000) * RAYS / np.linalg.norm(RAYS), known_to, "px", blocks=(f,)
    )
    return diagnose(Problem([r], "focal"), {"focal": np.array(1000 * scale)})


@pytest.mark.parametrize(("unit", "scale"), [("px", 1.0), ("kpx", 1e-3), ("1", 1e6)])
def test_a_focal_length_known_to_half_a_percent_is_known(unit: str, scale: float) -> None:
    d = focal_length(unit, scale)
    assert d.identifiability.sigma[0] == pytest.approx(5 * scale)
    assert d.identifiability.verdicts == (EntryIdentifiability.IDENTIFIED,)
    assert d.weak_count == 0
    assert not d.weak_directions
    assert not d.findings


@pytest.mark.parametrize(("unit", "scale"), [("px", 1.0), ("kpx", 1e-3)])
def test_one_that_may_as_well_be_zero_is_not(unit: str, scale: float) -> None:
    d = focal_length(unit, scale, known_to=2000.0)
    assert d.identifiability.verdicts == (EntryIdentifiability.PRACTICAL,)
    assert d.weak_count == 1
    assert d.weak_directions[0].change == pytest.approx(0.5)  # sigmas for 1000 px
    said = f"for focal: {1000 * scale:.4g} {unit}, its size here"
    assert said in d.findings[0].text
    assert said[1:-1] in d.report()
    assert said[1:-1] in str(d)


def body_in(unit: str, factor: float) -> Diagnosis:
    """A body whose translation is measured in so many parts of a metre, and a free camera."""
    body, camera = load_body("small"), Camera("cam/")
    pose, betas, _ = body.blocks()
    place = Block("place", (3,), unit, ("x", "y", "z"))
    joints = body.joint_points(pose.symbol, betas.symbol, place.symbol / factor)
    values = body.start() | camera.values(K=[[900, 0, 320], [0, 900, 240], [0, 0, 1]], t=(0, 0, 4))
    values |= {"place": np.array([0.1, -0.2, 0.3]) * factor}
    pixels = np.random.default_rng(0).normal(300, 80, (24, 2))
    seen = residuals.keypoints(joints, camera, pixels, np.ones(24), sigma=100.0)
    free = ("pose", "place", "cam/focal")
    return diagnose(Problem([seen], free, blocks=(place,)), values)


def test_millimetres_change_no_judgement() -> None:
    metres, millimetres = body_in("m", 1.0), body_in("mm", 1e3)
    assert metres.rank == millimetres.rank
    assert metres.weak_count == millimetres.weak_count > 0
    assert metres.identifiability.verdicts == millimetres.identifiability.verdicts
    found, other = ([x.change for x in d.weak_directions] for d in (metres, millimetres))
    np.testing.assert_allclose(found, other, rtol=1e-6)
    assert metres.nearby.ranks == millimetres.nearby.ranks
    assert metres.nearby.weaker_here == pytest.approx(millimetres.nearby.weaker_here, rel=1e-6)
    assert metres.weakest[0].change == pytest.approx(millimetres.weakest[0].change, rel=1e-6)


def test_a_prior_is_the_yardstick_of_what_has_no_natural_one() -> None:
    """50 px of prior: data that know the focal length to 40 px tell something, to 500 px not."""
    for known_to, verdict in (
        (40.0, EntryIdentifiability.IDENTIFIED),
        (500.0, EntryIdentifiability.PRACTICAL),
    ):
        f = Block("focal", (), "px")
        data = Residual("data", f.symbol - 1000, known_to, "px", blocks=(f,))
        prior = residuals.gaussian(f.symbol, mean=1000, covariance=50.0**2, name="prior")
        d = diagnose(Problem([data, prior], "focal"), {"focal": np.array(1000.0)}, priors="prior")
        assert d.identifiability.verdicts == (verdict,)
        assert d.point.yardsticks.sizes.tolist() == [pytest.approx(50.0)]
        assert "the standard deviation of its prior" in str(d.point.yardsticks)
        assert d.weak_count == 0  # the prior knows it


@pytest.mark.parametrize(
    ("unit", "values", "size", "said"),
    [
        ("rad", [5.0, 0.0], 1.0, "a radian"),
        ("deg", [5.0, 0.0], 180 / np.pi, "a radian"),
        ("sd", [0.0, 0.0], 1.0, "a standard deviation of shape"),
        ("mm", [0.0, 0.0], 1000.0, "a metre"),
        ("px", [3.0, 4.0], np.sqrt(12.5), "3.536 px, its size here"),
        ("1", [3.0, 4.0], np.sqrt(12.5), "3.536, its size here"),
        ("px", [0.0, 0.0], 600.0, "600 px, the size of all values in its unit"),
        ("1", [0.0, 0.0], 1.0, "1, since it is zero here and has no prior"),
    ],
)
def test_every_block_has_a_yardstick(
    unit: str, values: list[float], size: float, said: str
) -> None:
    x, other = Block("x", (2,), unit), Block("image", (2,), "px")
    r = Residual("r", cs.vertcat(x.symbol, other.symbol), 1.0, blocks=(x, other))
    at: Values = {
        "x": np.array(values),
        "image": np.full(2, 600.0) if unit == "px" else np.zeros(2),
    }
    if unit == "px" and not any(values):
        at["image"] = np.sqrt([2 * 600.0**2, 2 * 600.0**2])  # with the zeros of x: 600
    yardsticks = diagnose(Problem([r], "x"), at).point.yardsticks
    np.testing.assert_allclose(yardsticks.sizes, size)
    assert str(yardsticks) == f"for x: {said}"


def test_a_suggested_prior_is_as_wide_as_the_yardstick() -> None:
    f, g = Block("focal", (), "px"), Block("scale", (), "1")
    r = Residual("seen", f.symbol * g.symbol - 2000, 1.0, "px", blocks=(f, g))
    d = diagnose(
        Problem([r], ("focal", "scale")), {"focal": np.array(1000.0), "scale": np.array(2.0)}
    )
    priors = [s.what for s in d.suggestions if s.kind == "prior"]
    assert "add a Gaussian prior on focal (sigma 1000 px)" in priors


@pytest.mark.thorough
def test_pose_blend_shapes_are_spoken_of_where_there_are_some() -> None:
    body = load_body("small")
    pose, betas, trans = (block.symbol for block in body.blocks())
    surface = residuals.vertices(body.points(pose, betas, trans), body.vertices(), sigma=0.01)
    joints = residuals.landmarks(body.joint_points(pose, betas, trans), body.joints(), sigma=0.01)
    x = Block("x", (2,))
    line = Residual("line", cs.vertcat(x.symbol[0], 1e-5 * x.symbol[0] + x.symbol[1]), 1.0)
    assert "pose blend shapes" in diagnose(Problem([surface], "pose"), body.start()).report()
    assert "pose blend" not in diagnose(Problem([surface], "trans"), body.start()).report()
    assert "pose blend" not in diagnose(Problem([joints], "pose"), body.start()).report()
    thin = diagnose(Problem([line], "x"), {"x": np.zeros(2)}).report()
    assert "2 of them are above a thousandth of their column's largest entry; the others" in thin
    assert "pose blend" not in thin
