"""What is wrong with each of the known cases is found: rank, null directions and their names."""

import json

import casadi as cs
import numpy as np
import pytest

from tests.diagnostics import cases
from workbench import Block, Diagnosis, Problem, Residual, diagnose, residuals
from workbench.diagnostics.null_space import Direction


def null_names(diagnosis: Diagnosis) -> list[tuple[str, str]]:
    return [(d.kind, d.name) for d in diagnosis.null_directions]


def entries(diagnosis: Diagnosis, direction: Direction) -> dict[str, float]:
    """The entries of a direction that move at all, by name."""
    moved = np.flatnonzero(abs(direction.vector) > 1e-12)
    return {diagnosis.free.label(int(i)): float(direction.vector[i]) for i in moved}


def suggested(diagnosis: Diagnosis, kind: str) -> list[str]:
    return [s.what for s in diagnosis.suggestions if s.kind == kind]


def warned(diagnosis: Diagnosis) -> str:
    return "; ".join(finding.text for finding in diagnosis.warnings)


def test_a_shape_without_effect_is_named() -> None:
    found = cases.diagnosed(cases.shape_without_effect)
    assert found.rank == 5
    assert null_names(found) == [("entry", "betas[1]")]
    assert suggested(found, "fix") == ["fix betas"]


def test_a_free_block_that_nobody_reads_is_named() -> None:
    found = cases.diagnosed(cases.pose_that_nobody_reads)
    assert (found.rank, found.structural_rank) == (3, 3)
    assert {kind for kind, _ in null_names(found)} == {"entry"}
    assert len(found.null_directions) == 72
    assert "no residual depends on all of pose" in warned(found)
    assert found.free.label(int(found.structure.unread[0])) == "pose[pelvis, x]"
    assert suggested(found, "fix") == ["fix pose"]
    assert "72 single entries: pose[pelvis, x y z]" in str(found)


def test_a_repeated_residual_is_dropped() -> None:
    found = cases.diagnosed(cases.the_same_twice)
    assert found.rank == 4
    assert found.duplicates == (("first", "second"),)
    assert "second repeats first row by row" in warned(found)
    (drop,) = (s for s in found.suggestions if s.kind == "drop")
    assert drop.what == "drop the residual second"
    assert list(drop.problem.rows) == ["first", "other"]
    assert diagnose(drop.problem, drop.values).duplicates == ()


def test_two_measurements_of_the_same_thing_are_no_duplicates() -> None:
    """Where both are met exactly, only what they read tells them apart."""
    x = Block("x", (3,))
    seen = [Block(name, (3,)) for name in ("monday", "tuesday")]
    problem = Problem([Residual(b.name, x.symbol - b.symbol, 1.0) for b in seen], ("x",))
    values = {"x": np.ones(3), "monday": np.ones(3)}
    assert diagnose(problem, values | {"tuesday": np.ones(3)}).duplicates == ()
    assert diagnose(problem, values | {"tuesday": np.zeros(3)}).duplicates == ()
    again = diagnose(problem, {"x": np.zeros(3), "monday": np.ones(3), "tuesday": np.ones(3)})
    assert again.duplicates == (("monday", "tuesday"),)  # the same numbers under two names


def test_a_freed_template_can_move_against_the_translation() -> None:
    found = cases.diagnosed(cases.template_and_translation)
    assert (found.rank, found.shape[1]) == (90, 93)
    assert sorted(null_names(found)) == [
        ("translation", f"a translation along {axis} of template, undone by trans")
        for axis in "xyz"
    ]
    for direction in found.null_directions:
        parts = {name: direction.vector[at] for name, at in found.free.slices.items()}
        np.testing.assert_allclose(
            parts["template"].reshape(30, 3), np.tile(-parts["trans"], (30, 1)), atol=1e-12
        )


def test_a_derivative_made_by_hand_and_wrong_is_named() -> None:
    A = np.array([[2.0, 0, 1], [0, 3, 0], [1, 1, 1]])
    wrong = A.copy()
    wrong[1, 1] = 3.3
    X, Y = cs.MX.sym("X", 3), cs.MX.sym("Y", 3)
    by_hand = cs.Function(
        "jac_f", [X, Y], [cs.DM(wrong) @ cs.diag(cs.cos(X))], ["x", "out_y"], ["jac_y_x"]
    )
    options = {"custom_jacobian": by_hand, "never_inline": True, "jac_penalty": 0}
    f = cs.Function("f", [X], [cs.DM(A) @ cs.sin(X)], ["x"], ["y"], options)
    x = Block("x", (3,), "1", ("u", "v", "w"))
    problem = Problem((Residual("by hand", f(x.symbol), 0.1),), ("x",), blocks=(x,))
    found = diagnose(problem, {"x": [0.1, 0.2, 0.3]})
    check = found.derivatives
    assert not check.passed
    assert check.wrong == 1
    (suspect,) = check.suspects
    assert (suspect.row, suspect.column) == (1, 1)
    assert suspect.given == pytest.approx(33 * np.cos(0.2))
    assert suspect.differences == pytest.approx(30 * np.cos(0.2), rel=1e-7)
    assert check.slope == pytest.approx(1, abs=0.05)
    assert "the worst is by hand[1] by x[v]: 32.34" in warned(found)
    with pytest.raises(AssertionError, match=r"by hand\[1\] by x\[v\]"):
        found.assert_no_warnings()
    right = Problem((Residual("r", cs.DM(A) @ cs.sin(x.symbol), 0.1),), ("x",), blocks=(x,))
    assert diagnose(right, {"x": [0.1, 0.2, 0.3]}).derivatives.passed


def test_not_a_number_is_named_and_nothing_crashes() -> None:
    found = cases.diagnosed(cases.naive_rodrigues)
    assert not found.here.finite
    assert len(found.not_finite) == 12 + 36
    assert "the residual is not finite: turned[0], turned[1]" in warned(found)
    assert "the Jacobian is not finite: turned[0] by turn[x], turned[0] by turn[y]" in warned(found)
    assert "turned[0] by turn[x]" in str(found)
    assert "turned[0] by turn[x]" in found.report()
    data = json.loads(json.dumps(found.data(), allow_nan=False))
    assert data["finite"] is False
    assert data["not_finite"]["count"] == 48
    assert {"row": "turned[0]", "column": "turn[x]"} in data["not_finite"]["first"]
    assert "rank" not in data
    assert str(found.state) == "not finite"
    (note,) = (finding.text for finding in found.findings if not finding.warning)
    assert note.startswith("a thousandth of a characteristic scale away it is finite")
    with pytest.raises(AssertionError, match=r"no rank: the residual is not finite: turned\[0\]"):
        found.assert_rank(3)
    with pytest.raises(AssertionError, match="not finite"):
        found.assert_no_warnings()


def test_a_single_entry_that_is_no_number_is_named() -> None:
    """sqrt(x) is finite at 0, its derivative is not."""
    x = Block("x", (2,))
    problem = Problem((Residual("root", cs.sqrt(x.symbol), 1.0),), ("x",), blocks=(x,))
    found = diagnose(problem, {"x": [1.0, 0.0]})
    assert found.not_finite == ((1, 1),)
    assert found.warnings[0].text == "the Jacobian is not finite: root[1] by x[1]"
    near_the_edge = diagnose(problem, {"x": [1.0, 1e-6]})  # differences would step over it
    assert near_the_edge.derivatives.wrong == 0
    near_the_edge.report()
    smooth = Problem((Residual("r", x.symbol**1.5, 1.0),), ("x",), blocks=(x,))
    at_the_edge = diagnose(smooth, {"x": [1.0, 0.0]})  # the derivative is 0 there
    assert at_the_edge.derivatives.wrong == 0
    at_the_edge.report()


def test_a_prior_alone_is_no_null_space() -> None:
    x = Block("x", (3,), "m")
    problem = Problem((residuals.gaussian(x.symbol),), ("x",), blocks=(x,))
    found = diagnose(problem, {"x": np.zeros(3)})
    found.assert_rank(3)
    found.assert_no_warnings()
    assert "full rank" in str(found)
    with pytest.raises(AssertionError, match="the rank is 3, not 2; null directions: none"):
        found.assert_rank(2)


def test_an_assertion_about_the_rank_names_what_is_not_seen() -> None:
    with pytest.raises(AssertionError, match=r"the rank is 5, not 6; null directions: betas\[1\]"):
        cases.diagnosed(cases.shape_without_effect).assert_rank(6)
    with pytest.raises(AssertionError, match="1 of 6 directions change no residual"):
        cases.diagnosed(cases.shape_without_effect).assert_no_warnings()
