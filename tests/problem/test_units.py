"""Sums of different units are refused where both units are known, and only there."""

import casadi as cs
import numpy as np
import pytest

import workbench as wb
from workbench.errors import BadResidual

BODY = wb.load_body("small")
POSE, BETAS, TRANS = (block.symbol for block in BODY.blocks())
JOINTS = BODY.joint_points(POSE, BETAS, TRANS)
SEEN_MM = wb.Block("seen", (24, 3), "mm")
SEEN = wb.Block("seen", (24, 3), "m")


def mine(expression: cs.MX) -> wb.Residual:
    return wb.Residual("mine", cs.vec(expression), sigma=0.01, unit="m", points=(JOINTS,))


@pytest.mark.parametrize(
    "residual",
    [
        wb.residuals.landmarks(JOINTS, SEEN_MM.symbol, sigma=0.01),
        mine(JOINTS.symbol - SEEN_MM.symbol),
        mine((JOINTS.symbol - SEEN_MM.symbol) / 0.3),
        mine(2.0 * JOINTS.symbol[:, :3] - (1.0 + SEEN_MM.symbol[:, 3:6] - JOINTS.symbol[:, 1:4])),
        mine(cs.horzcat(JOINTS.symbol[:, 2], JOINTS.symbol[:, 5]) + SEEN_MM.symbol[:, :2]),
        mine(cs.repmat(TRANS, 1, 24) - SEEN_MM.symbol + 0.0 * JOINTS.symbol),
    ],
    ids=["landmarks", "own", "weighted", "in a sum", "columns", "a block"],
)
def test_metres_less_millimetres_are_refused(residual: wb.Residual) -> None:
    said = (
        r"residual '.*' adds or subtracts '.*', in m?m, and '.*', in m?m; .* observed.symbol / 1000"
    )
    with pytest.raises(BadResidual, match=said):
        wb.Problem([residual], free=["pose"], blocks=[SEEN_MM])


def test_pixels_are_no_metres() -> None:
    camera, seen = wb.Camera("cam/"), wb.Block("seen", (24, 2), "m")
    residual = wb.residuals.keypoints(JOINTS, camera, seen.symbol, np.ones(24), sigma=1.0)
    with pytest.raises(BadResidual, match="'cam/centre', in px, and 'seen', in m"):
        wb.Problem([residual], free=["pose"], blocks=[seen])


@pytest.mark.parametrize(
    ("expression", "block"),
    [
        (JOINTS.symbol - SEEN.symbol, SEEN),
        (JOINTS.symbol - SEEN_MM.symbol / 1000, SEEN_MM),
        (JOINTS.symbol - 1e-3 * SEEN_MM.symbol, SEEN_MM),
        (JOINTS.symbol - cs.diag(cs.DM([1e-3] * 3)) @ SEEN_MM.symbol, SEEN_MM),
        (cs.vertcat(JOINTS.symbol, SEEN_MM.symbol) - 1.0, SEEN_MM),
    ],
    ids=["alike", "divided", "multiplied", "a matrix", "stacked"],
)
def test_what_may_be_right_is_taken(expression: cs.MX, block: wb.Block) -> None:
    assert wb.Problem([mine(expression)], free=["pose"], blocks=[block]).size


def test_a_block_without_a_unit_and_a_symbol_alone_are_taken() -> None:
    for seen in (wb.Block("seen", (24, 3)).symbol, cs.MX.sym("seen", 3, 24)):
        residual = wb.residuals.landmarks(JOINTS, seen, sigma=0.01)
        assert wb.Problem([residual], free=["pose"]).size == 72


def test_constraints_are_looked_at_too() -> None:
    metres, seconds = wb.Block("a", (), "m"), wb.Block("b", (), "s")
    residual = wb.Residual("r", metres.symbol * seconds.symbol, sigma=1.0)
    limit = wb.Constraint("limit", metres.symbol - seconds.symbol, lower=0.0)
    with pytest.raises(BadResidual, match="constraint 'limit' adds or subtracts"):
        wb.Problem([residual], ["a"], blocks=[metres, seconds], constraints=[limit])


def test_a_large_expression_is_given_up_and_a_deep_one_does_no_harm() -> None:
    metres, seconds = wb.Block("a", (), "m"), wb.Block("b", (), "s")
    deep = cs.sin(metres.symbol)
    for _ in range(3_000):
        deep = cs.sin(deep) + 1.0
    residual = wb.Residual("r", deep * seconds.symbol, sigma=1.0)
    assert wb.Problem([residual], ["a"], blocks=[metres, seconds]).size == 1


def test_keypoints_keep_the_units_and_labels_of_a_camera() -> None:
    """They were lost, so that the diagnosis spoke of cam/translation[1] in no unit."""
    camera, seen = wb.Camera("cam/"), wb.Block("seen", (24, 2), "px")
    residual = wb.residuals.keypoints(JOINTS, camera, seen.symbol, np.ones(24), sigma=1.0)
    problem = wb.Problem([residual], ["pose", "cam/translation"], blocks=[seen])
    for which in (
        problem,
        problem.freeing("trans"),
        wb.sequence([problem] * 2, shared=["cam/translation"]),
    ):
        known = {block.name: block for block in (*which.free.blocks, *which.fixed.blocks)}
        for block in camera.blocks:
            assert (known[block.name].unit, known[block.name].labels) == (block.unit, block.labels)
    assert problem.free.label(problem.free.slices["cam/translation"].start + 1).endswith("[y]")


def test_what_nobody_reads_and_points_that_nobody_gave_are_named() -> None:
    x, y = wb.Block("x", (2,)), wb.Block("y", (2,))
    residual = wb.Residual("r", x.symbol - 1.0, sigma=1.0)
    with pytest.raises(
        wb.WorkbenchError, match="no residual and no constraint reads the block 'y'"
    ):
        wb.Problem([residual], ["x", "y"], blocks=[x, y])
    with pytest.raises(wb.WorkbenchError, match="can be neither free nor bounded"):
        wb.Problem([residual], ["x", "y"])
    with pytest.raises(BadResidual, match=r"give the Points themselves, as in points=\(points,\)"):
        wb.Residual("r", cs.vec(JOINTS.symbol - SEEN.symbol), sigma=1.0)


def test_a_transposed_symbol_is_named_as_such() -> None:
    with pytest.raises(BadResidual, match=r"it is transposed: .* observed.symbol without .T"):
        wb.residuals.landmarks(JOINTS, SEEN.symbol.T, sigma=0.01)


@pytest.mark.parametrize(
    ("first", "second", "refused"),
    [
        ("m/s", "mm/s", True),
        ("m/s", "rad/s", True),
        ("kg m/s^2", "kg mm/s^2", True),
        ("m^2", "mm²", True),
        ("m/s", "m", False),  # times one second
        ("m/s", "m/frame", False),  # at one frame a second
        ("m/s", "m s^-1", False),  # two spellings
        ("N*m", "J", False),
        ("m/s", "pace (m per s)", False),
    ],
)
def test_units_that_are_put_together_are_compared(first: str, second: str, refused: bool) -> None:
    a, b = wb.Block("a", (3,), first), wb.Block("b", (3,), second)
    residual = wb.Residual("r", a.symbol - b.symbol, sigma=1.0)
    if refused:
        with pytest.raises(BadResidual, match=r"adds or subtracts 'a', in .*, and 'b', in"):
            wb.Problem([residual], ["a"], blocks=[a, b])
    else:
        assert wb.Problem([residual], ["a"], blocks=[a, b]).size == 3


def test_a_speed_times_one_second_is_a_way() -> None:
    """CasADi leaves the factor out."""
    start, speed = wb.Block("start", (), "m"), wb.Block("speed", (), "m/s")
    seen = [start.symbol + t * speed.symbol - 2.0 for t in (0.5, 1.0, 2.0)]
    residual = wb.Residual("seen", cs.vertcat(*seen), sigma=0.1, unit="m")
    problem = wb.Problem([residual], ["start", "speed"], blocks=[start, speed])
    assert wb.solve(problem, {"start": 0.0, "speed": 0.0}).cost < 1e-9
