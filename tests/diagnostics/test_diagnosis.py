"""What joints hide of a body, structure and terms; every suggestion does what it says."""

from collections.abc import Callable

import casadi as cs
import numpy as np
import pytest
import scipy.linalg

from tests.bodies_made_up import SMPL_NAMES, SMPL_PARENTS, random_body, smpl_like_body
from tests.diagnostics import cases
from tests.tiers import few
from workbench import Block, Diagnosis, Problem, Residual, Values, diagnose, residuals
from workbench.diagnostics import Direction
from workbench.diagnostics.report import gauges_in_words

LEAVES = ("head", "left_foot", "right_foot", "left_hand", "right_hand")
CHILDREN = {
    name: [SMPL_NAMES[c] for c, parent in enumerate(SMPL_PARENTS) if parent == k]
    for k, name in enumerate(SMPL_NAMES)
}
SINGLE_CHILD = [name for name, children in CHILDREN.items() if len(children) == 1]


def joints_problem(*free: str) -> Problem:
    body = smpl_like_body()
    symbols = [block.symbol for block in body.blocks()]
    observed = Block("observed", (24, 3), "m").symbol
    return Problem((residuals.landmarks(body.joint_points(*symbols), observed, sigma=0.01),), free)


def at(seed: int | None) -> Values:
    """Numbers for all blocks: the bind pose, or a random one."""
    body = smpl_like_body()
    values = body.start() | {"observed": np.zeros((24, 3))}
    if seed is not None:
        rng = np.random.default_rng(seed)
        values |= {"pose": rng.normal(size=(24, 3)), "betas": rng.normal(size=4)}
    return values


@pytest.mark.parametrize("seed", few([None, 0, 1, 2, 3], 2), ids=lambda s: f"pose {s}")
@pytest.mark.parametrize("free", [("pose",), ("pose", "trans")], ids="+".join)
def test_joints_hide_fifteen_numbers_and_seventeen_twists(
    free: tuple[str, ...], seed: int | None
) -> None:
    """They see 40 of 72, and of a translation all: 5 leaves hide 3 numbers, 17 bones a twist."""
    problem = joints_problem(*free)
    found = diagnose(problem, at(seed))
    rank = 40 + 3 * (len(free) - 1)
    assert (found.rank, len(found.null_directions)) == (rank, 32)
    entries = [d for d in found.null_directions if d.kind == "entry"]
    assert {d.name for d in entries} == {f"pose[{leaf}, {a}]" for leaf in LEAVES for a in "xyz"}
    twists = [d for d in found.null_directions if d.kind == "twist"]
    # one for each joint with a single child: about the bone, and undone where the bone ends
    assert {d.joints[0] for d in twists} == set(SINGLE_CHILD)
    for d in twists:
        below = CHILDREN[d.joints[0]][0]
        assert d.joints in ((d.joints[0],), (d.joints[0], below))
        assert all(joint in d.name for joint in d.joints)
        assert len(d.joints) == 2 or below in LEAVES  # whose own turns nobody sees
    for direction in found.null_directions:
        labels = [problem.free.label(i) for i in np.flatnonzero(direction.vector)]
        for label in labels:
            assert any(f"[{joint}," in label for joint in direction.joints), direction.name
    J = problem.linearize(at(seed)).jacobian
    vectors = np.column_stack([d.vector for d in found.null_directions])
    np.testing.assert_allclose(np.linalg.norm(vectors, axis=0), 1, rtol=1e-14)
    angles = scipy.linalg.subspace_angles(vectors, np.linalg.svd(J)[2][rank:].T)
    assert angles.max() < 1e-7  # arccos of 1 - eps


def test_a_twist_is_about_its_bone() -> None:
    body, values = smpl_like_body(), at(None)
    joints = body.joints(values["pose"], values["betas"])
    diagnosis = diagnose(joints_problem("pose"), values)
    (thigh,) = (d for d in diagnosis.null_directions if d.joints[:1] == ("left_hip",))
    hip, knee = SMPL_NAMES.index("left_hip"), SMPL_NAMES.index("left_knee")
    bone = (joints[knee] - joints[hip]) / np.linalg.norm(joints[knee] - joints[hip])
    turns = thigh.vector.reshape(24, 3)
    np.testing.assert_allclose(abs(turns[hip] @ bone), np.sqrt(0.5), rtol=1e-10)
    np.testing.assert_allclose(turns[knee], -turns[hip], atol=1e-10)  # at the bind pose, undone


def test_the_report_says_it_in_words() -> None:
    text = str(diagnose(joints_problem("pose"), at(0)))
    assert "Jacobian 72 x 72" in text
    assert "numerical rank 40 of 72 (singular value 40 is" in text
    assert "32 null directions (no residual changes along them):" in text
    assert "15 single entries: pose[left_foot, x y z], pose[right_foot" in text
    assert "a turn of pose[left_knee], undone at left_ankle" in text
    assert text.count("\n  ") == 18


def test_a_surface_sees_all_of_a_body() -> None:
    """The surface sees everything."""
    body = smpl_like_body()
    symbols = [block.symbol for block in body.blocks()]
    observed = Block("observed", (60, 3), "m").symbol
    problem = Problem(
        (residuals.vertices(body.points(*symbols), observed, sigma=0.01),),
        ("pose", "betas", "trans"),
    )
    diagnosis = diagnose(problem, at(0) | {"observed": np.zeros((60, 3))})
    assert diagnosis.rank == diagnosis.structural_rank == 72 + 4 + 3
    assert diagnosis.null_directions == ()
    s = diagnosis.singular_values
    assert diagnosis.condition == pytest.approx(s[0] / s[-1])
    assert "full rank" in str(diagnosis)


def linear(A: np.ndarray, *shapes: tuple[int, ...]) -> Diagnosis:
    """The diagnosis of A x = 0, x cut into blocks called a, b, ..."""
    blocks = [Block(name, shape) for name, shape in zip("abc", shapes, strict=False)]
    x = cs.vertcat(*[cs.vec(block.symbol) for block in blocks])
    matrix = cs.sparsify(cs.DM(A)) if not A.all() else cs.DM(A)
    problem = Problem((Residual("r", matrix @ x, 1.0),), [block.name for block in blocks])
    return diagnose(problem, {block.name: np.zeros(block.shape) for block in blocks})


def test_trade_offs_at_one_point_alone_are_no_gauges() -> None:
    gain, rate = Block("gain", (2,), "V"), Block("rate", (2,), "1/s")
    t = np.linspace(0, 3, 20)
    decay = [gain.symbol[i] * cs.exp(-rate.symbol[i] * t) for i in range(2)]
    problem = Problem((Residual("sum", decay[0] + decay[1] - 2, 0.1, "V"),), ["gain", "rate"])
    diagnosis = diagnose(problem, {"gain": np.ones(2), "rate": np.ones(2)})
    assert max(diagnosis.ranks_nearby) > diagnosis.rank == 2
    assert any(one.name.startswith("a trade-off within gain") for one in diagnosis.null_directions)
    assert not any("gauge" in finding.text for finding in diagnosis.findings)


def test_directions_within_a_block_and_across_blocks_are_told_apart() -> None:
    rng = np.random.default_rng(0)
    A = rng.normal(size=(8, 3))
    across = linear(np.column_stack([A, A[:, 0] - A[:, 1]]), (2,), (2,))
    (direction,) = across.null_directions
    assert direction.kind == "trade-off"
    assert direction.name.startswith("a trade-off of a and b: ")
    assert all(entry in direction.name for entry in ("+1 of a[0]", "-1 of a[1]", "-1 of b[1]"))
    assert "b[0]" not in direction.name
    block = linear(np.column_stack([rng.normal(size=8), A, A @ [1.0, 2, 3]]), (1,), (4,))
    (direction,) = block.null_directions
    assert direction.kind == "trade-off"
    assert direction.name.startswith("a trade-off within b: ")
    np.testing.assert_allclose(direction.vector[0], 0, atol=1e-15)
    expected = np.array([0, 1, 2, 3, -1]) / np.sqrt(15)
    np.testing.assert_allclose(abs(direction.vector @ expected), 1, rtol=1e-12)


def test_terms_say_who_reads_what() -> None:
    body = random_body()
    symbols = [block.symbol for block in body.blocks()]
    observed = Block("observed", (5, 3), "m").symbol
    problem = Problem(
        (
            residuals.landmarks(body.joint_points(*symbols), observed, sigma=0.01),
            residuals.gaussian(symbols[1]),
        ),
        ("pose", "betas", "trans"),
    )
    diagnosis = diagnose(problem, body.start() | {"observed": np.zeros((5, 3))})
    terms = {(term.residual, term.block): term for term in diagnosis.terms}
    prior = terms["gaussian(betas)", "betas"]
    assert (prior.rows, prior.columns, prior.nonzeros) == (3, 3, 3)
    assert prior.norm == pytest.approx(np.sqrt(3))
    assert terms["gaussian(betas)", "pose"].nonzeros == 0
    moved = terms["landmarks(observed)", "trans"]
    assert (moved.nonzeros, moved.norm) == (15, pytest.approx(100 * np.sqrt(15)))
    assert sum(term.nonzeros for term in diagnosis.terms) == diagnosis.nonzeros
    assert diagnosis.row_edges == (0, 15, 18)


# Suggestions.


REMEDIED = [case for case in cases.CASES if case not in (cases.naive_rodrigues, cases.uneven)]
FAST = [cases.scale_against_depth, cases.the_same_twice, cases.two_pieces]


@pytest.mark.parametrize("case", few(REMEDIED, FAST), ids=lambda case: case.__name__)
def test_every_suggestion_does_what_it_says(case: Callable[[], cases.Case]) -> None:
    found = cases.diagnosed(case)
    assert any(suggestion.cured for suggestion in found.suggestions)  # all have something wrong
    for suggestion in found.suggestions:
        assert suggestion.before == found.state
        after = diagnose(suggestion.problem, suggestion.values)
        rank, condition = after.rank, after.condition
        assert suggestion.after.unknowns == after.shape[1], suggestion.what
        assert suggestion.after.rank == rank, suggestion.what
        assert suggestion.after.condition == pytest.approx(condition, rel=1e-9), suggestion.what
        assert suggestion.cured == (rank == after.shape[1]), suggestion.what
        if suggestion.kind in ("fix", "prior"):
            assert after.shape[1] - rank < found.shape[1] - found.rank, suggestion.what
        assert f"{suggestion.what}: {suggestion.before} -> {suggestion.after}" in found.report()


def test_a_prior_stands_at_the_present_value() -> None:
    problem, values = cases.scale_against_depth()
    priors = [s.problem for s in diagnose(problem, values).suggestions if s.kind == "prior"]
    (fuller,) = (problem for problem in priors if "prior on scale" in problem.rows)
    np.testing.assert_array_equal(
        fuller.linearize(values).residual[fuller.rows["prior on scale"]], 0.0
    )


def test_a_healthy_problem_gets_no_advice() -> None:
    x = Block("x", (3,))
    A = np.random.default_rng(0).normal(size=(8, 3))
    problem = Problem((Residual("r", cs.DM(A) @ x.symbol, 0.1),), ("x",), blocks=(x,))
    found = diagnose(problem, {"x": np.zeros(3)})
    assert found.suggestions == ()
    assert found.findings == ()
    assert "no warnings" in found.report()
    found.assert_no_warnings()


# Words.


def direction(kind: str, change: float = 0.0) -> Direction:
    return Direction(f"one of {kind}", kind, (), np.array([1.0, 0.0]), change)


@pytest.mark.parametrize(
    ("kinds", "said"),
    [
        (["scale", "scale"], "2 changes of scale: 2 of 2 null directions are gauges"),
        (["mixing", "mixing"], "2 mixings of factors: 2 of 2 null directions are gauges"),
        (["mixing"], "1 mixing of factors: 1 of 1 null direction is a gauge"),
        (["offset", "entry"], "1 common offset: 1 of 2 null directions is a gauge"),
    ],
    ids=" and ".join,
)
def test_gauges_are_counted_in_english(kinds: list[str], said: str) -> None:
    assert (
        gauges_in_words([direction(kind) for kind in kinds]) == f"no residual changes under {said}"
    )


def test_a_shared_number_is_held_before_entries_of_points() -> None:
    """f x against a depth of many points: a user fixes f, though points move more."""
    f, depth = Block("f", (), "px"), Block("depth", (12,), "m")
    seen = Residual("seen", f.symbol / depth.symbol - 100, 1.0, "px", blocks=(f, depth))
    at = {"f": np.array(800.0), "depth": np.full(12, 8.0)}
    (first, *_) = diagnose(Problem([seen], ("f", "depth")), at).suggestions
    assert (first.kind, first.acts) == ("least", 1)
    assert first.what in ("fix f", "hold f")
