"""Pose, betas, trans, offsets and arrays of a body may be blocks or affine maps of blocks.

Whatever they are, the chain rule gives what the graph gives."""

from collections.abc import Callable
from dataclasses import replace

import casadi as cs
import numpy as np
import pytest
from scipy.sparse import csr_array

import workbench as wb
from tests.bodies.laws import assert_chain_rule_is_graph, in_symbols, some_arguments, some_values
from tests.bodies_made_up import random_body, tube_body
from tests.tiers import few
from workbench import Landmarks, residuals
from workbench.blocks.affine import Affine
from workbench.bodies.forward import posed_points
from workbench.bodies.forward.freed import BLOCKS, FreedSurface
from workbench.bodies.triangles.body import blend_scape
from workbench.errors import BadBody, NotSupported, UnknownName

RNG = np.random.default_rng(0)
BODY = random_body(2, n_vertices=12, n_joints=5, n_betas=3)
K = BODY.n_joints
COMPONENTS, MEAN = RNG.normal(size=(3 * K, 4)), RNG.normal(scale=0.1, size=(3, K))
Given = tuple[cs.MX, cs.MX, cs.MX]


def symbols(**shapes: tuple[int, ...]) -> dict[str, cs.MX]:
    return {name: wb.Block(name, shape).symbol for name, shape in shapes.items()}


def plain() -> Given:
    s = symbols(pose=(K, 3), betas=(3,), trans=(3,))
    return s["pose"], s["betas"], s["trans"]


def pieces() -> Given:
    s = symbols(root=(1, 3), rest=(K - 1, 3))
    return cs.horzcat(s["root"], s["rest"]), *plain()[1:]


def components() -> Given:
    c = symbols(coefficients=(4,))["coefficients"]
    return cs.MX(MEAN) + cs.reshape(cs.DM(COMPONENTS) @ c, 3, K), *plain()[1:]


def shifted() -> Given:
    pose, betas, trans = plain()
    return pose + cs.DM(MEAN), betas + 0.5, trans - cs.DM([0.0, 1.0, 2.0])


def two_roles() -> Given:
    pose, _, trans = plain()
    return pose, trans, trans  # a block that is the shape as well as the place


def mirrored() -> Given:
    a, b, c = cs.horzsplit(symbols(half=(3, 3))["half"])
    return cs.horzcat(a, b, -b, c, cs.DM([1.0, -1.0, -1.0]) * c), *plain()[1:]


ALL = (plain, pieces, components, shifted, two_roles, mirrored)


def terms(body: wb.SkinnedBody | wb.TriangleBody, given: Given) -> list[wb.Residual]:
    observed = np.random.default_rng(5).normal(size=(body.n_vertices, 3))
    points, some = body.points(*given), body.points(*given, vertices=[3, 1])
    joints = body.joint_points(*given)
    return [
        residuals.vertices(points, observed, sigma=0.01),
        residuals.vertices(some, observed[:2], sigma=0.02, name="some"),
        residuals.landmarks(joints, np.zeros((joints.count, 3)), sigma=0.1),
    ]


def names_of(given: Given) -> list[str]:
    return [symbol.name() for symbol in cs.symvar(cs.veccat(*given))]


def assert_costs_of_many(problem: wb.Problem, values: wb.Values) -> None:
    x, fixed = problem.split(values)
    many = np.array([x, x + 0.1])
    expected = [problem.linearize_at(z, fixed).cost for z in many]
    np.testing.assert_allclose(problem.costs(x, fixed)(many), expected, rtol=1e-10)


# Affine maps of blocks.


@pytest.mark.parametrize("compiled", few([False, True], 1), ids=["NumPy", "compiled"])
@pytest.mark.parametrize("given", few(ALL, ALL[1:]), ids=lambda f: f.__name__)
def test_affine_arguments_keep_the_chain_rule(
    given: Callable[[], Given], compiled: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(posed_points, "WORTH_COMPILING", 1 if compiled else 10**9)
    arguments = given()
    names, (of_mesh, *others) = names_of(arguments), terms(BODY, arguments)
    # alone, the mesh writes into the Jacobian itself; among others, it does so by parts
    for stacked, free in (([of_mesh], names[::-1]), ([of_mesh, *others], names[:1])):
        problem = wb.Problem(stacked, free)
        assert all(p.source.numeric is not None for r in problem.residuals for p in r.points)
        assert_chain_rule_is_graph(problem, some_values(problem))
    problem = wb.Problem(terms(BODY, arguments), names)
    assert_chain_rule_is_graph(problem, some_values(problem))
    assert_costs_of_many(problem, some_values(problem))
    source = BODY.joint_points(*arguments).source
    values = [some_values(problem, seed) for seed in range(2)]
    many = source.numeric.evaluate_batch({n: np.array([v[n] for v in values]) for n in values[0]})
    for found, one in zip(many, values, strict=True):
        expected = in_symbols(BODY.joint_points(*arguments), one)
        np.testing.assert_allclose(found, expected, atol=1e-12)


def test_arguments_that_are_not_affine_go_by_the_graph() -> None:
    pose, betas, trans = plain()
    for bent in (cs.sin(betas), betas * cs.sum1(betas), cs.fmax(betas, 0)):
        assert Affine.of(bent, (3,)) is None
        source = BODY.points(pose, bent, trans).source
        assert source.numeric is None
        assert source.tree is None
        problem = wb.Problem(terms(BODY, (pose, bent, trans)), ("pose", "betas"))
        assert_chain_rule_is_graph(problem, some_values(problem))


# The tree and its names.


def test_coefficients_of_a_pose_space_have_no_joints() -> None:
    front = wb.Block("front", (2, 3), "rad", BODY.joint_names[:2])
    s = symbols(coefficients=(4,))
    hands = cs.reshape(cs.DM(COMPONENTS[6:]) @ s["coefficients"], 3, K - 2)
    arguments = cs.horzcat(front.symbol, hands), *plain()[1:]
    term = residuals.landmarks(BODY.joint_points(*arguments), BODY.joints(), sigma=0.01)
    problem = wb.Problem([term], ("front", "coefficients"), blocks=(front,))
    (tree,) = problem.trees
    assert tree.places == (("front", 0), ("front", 3), None, None, None)
    assert len(problem.rotations) == 2
    found = wb.diagnose(problem, some_values(problem))
    assert found.rank_law is None  # it counts joints that turn by three numbers of their own
    for direction in found.null_directions:
        assert not set(direction.joints) & set(BODY.joint_names[2:])


def test_negative_or_shifted_copies_are_no_rotation_vectors() -> None:
    for given, turned in ((mirrored, 1), (shifted, 0), (two_roles, K)):
        arguments = given()
        problem = wb.Problem(terms(BODY, arguments), names_of(arguments))
        assert len(problem.rotations) == turned, given.__name__


# Free arrays.

PLAIN = random_body(4, n_vertices=5, n_joints=4, n_betas=2)
BENT = replace(PLAIN, bound_in=np.random.default_rng(1).normal(scale=0.4, size=(4, 3)))
LIMBS = replace(  # no vertex hangs at all joints, and each joint is at one vertex
    random_body(5, n_vertices=8, n_joints=7, n_betas=2), J_regressor=csr_array(np.eye(7, 8))
)
ALL_BUT_JOINTS = ("template", "shapedirs", "posedirs", "J_regressor", "weights")
JOINTS = ("template", "posedirs", "weights", "joints")
CASES = {
    "all but joints": (PLAIN, ALL_BUT_JOINTS),
    "joints": (PLAIN, JOINTS),
    "drawn bent": (BENT, ALL_BUT_JOINTS),
    "limbs, weights": (LIMBS, ("template", "weights")),
    "limbs, regressor": (LIMBS, ("posedirs", "J_regressor")),
}
EACH_CASE = pytest.mark.parametrize("case", few(CASES, 4))


def freed_problem(body: wb.SkinnedBody, free: tuple[str, ...]) -> wb.Problem:
    """Two people of one body, each in a pose, and ridges on what is free."""
    student, rng, stacked = body.freed(*free), np.random.default_rng(5), []
    for person, chosen in (("a/", None), ("b/", [4, 2, 3, 2])):
        points = student.points(*(b.symbol for b in student.blocks(person)), vertices=chosen)
        assert isinstance(points.source.numeric, FreedSurface)
        data = rng.normal(size=(points.count, 3))
        stacked.append(residuals.vertices(points, data, sigma=0.1, name=person))
    for name, block in student.free.items():
        ridge = residuals.gaussian(block.symbol, covariance=4.0, name=f"ridge of {name}")
        stacked.append(ridge)
    names = (f"{person}{b.name}" for person in ("a/", "b/") for b in body.blocks())
    return wb.Problem(stacked, (*names, *student.free))


@EACH_CASE
def test_free_arrays_keep_the_chain_rule(case: str) -> None:
    problem = freed_problem(*CASES[case])
    assert_chain_rule_is_graph(problem, some_values(problem))
    assert_costs_of_many(problem, some_values(problem))
    at_zero = some_values(problem) | {"a/pose": 0 * some_values(problem)["a/pose"]}
    assert_chain_rule_is_graph(problem, at_zero)


@EACH_CASE
def test_patterns_are_where_derivatives_are_not_zero(case: str) -> None:
    """No fewer entries, at any values; and no more, where all numbers are random."""
    body, free = CASES[case]
    student, rng = body.freed(*free), np.random.default_rng(9)
    blocks = [*student.blocks(), *student.free.values()]
    source = student.points(*(b.symbol for b in blocks[:3])).source.numeric
    assert isinstance(source, FreedSurface)
    values = dict(zip(BLOCKS, some_arguments(body, scale=0.8), strict=True))
    full = values | {name: rng.normal(size=body.array(name).shape) for name in free}
    patterns = {b.name: p for b in blocks if (p := source.pattern(b.name)) is not None}
    for name, pattern in patterns.items():
        there = pattern.toarray() != 0
        np.testing.assert_array_equal(source.evaluate(full).jacobian(name).toarray() != 0, there)
        for at in (values, body.start()):
            arrays = {name: body.array(name) for name in free}
            assert there[source.evaluate(at | arrays).jacobian(name).toarray() != 0].all()
    through_regressor = {"template", "shapedirs"} if "J_regressor" in free else set()
    through_weights = {"J_regressor", "joints"} if "weights" in free else set()
    assert set(patterns) == set(free) - through_weights - through_regressor


# Landmarks that offsets displace at rest.


def with_markers(body: wb.SkinnedBody, M: int = 6) -> wb.SkinnedBody:
    """The body with single vertices and means of vertices as landmarks, the last two in common."""
    rows, rng = np.zeros((M, body.n_vertices)), np.random.default_rng(5)
    rows[np.arange(M - 2), rng.permutation(body.n_vertices)[: M - 2]] = 1.0
    rows[M - 2 :, [3, 8, 11]] = [[0.2, 0.3, 0.5], [0.6, 0.3, 0.1]]
    names = tuple(f"marker {i}" for i in range(M))
    return replace(body, landmarks={"markers": Landmarks(names, csr_array(rows))})


MARKED = with_markers(random_body(2, n_vertices=16, n_joints=5, n_betas=3))
MARKED_BODIES = {
    "bound": with_markers(random_body(3, n_vertices=16, n_joints=5, n_betas=3, bound=True)),
    "joints given": replace(MARKED, rest_joints=RNG.normal(size=(5, 3))),
    "unbent": replace(MARKED, posedirs=np.zeros_like(MARKED.posedirs)),
}
EACH_MARKED = pytest.mark.parametrize("name", few(MARKED_BODIES, 2))
SET = "markers"


@EACH_MARKED
def test_offsets_displace_vertices_in_the_template(name: str) -> None:
    """A landmark is the mean of its vertices, each displaced in the template by its offset."""
    body = MARKED_BODIES[name]
    pose, betas, trans = some_arguments(body, scale=0.4)
    offsets = 0.4 * RNG.normal(size=(6, 3))
    still = body
    if body.rest_joints is None:  # joints do not follow a displaced vertex
        still = replace(body, rest_joints=body.joints(betas=betas))
    expected = [
        row @ replace(still, template=body.template + own).vertices(pose, betas, trans)
        for row, own in zip(body.landmarks[SET].regressor.toarray(), offsets, strict=True)
    ]
    found = body.landmark(SET, pose, betas, trans, offsets)
    np.testing.assert_allclose(found, expected, atol=1e-13)
    many = body.landmark(SET, pose, betas, trans, np.stack([0 * offsets, offsets]))
    np.testing.assert_allclose(many[1], expected, atol=1e-13)
    np.testing.assert_allclose(many[0], body.landmark(SET, pose, betas, trans), atol=1e-14)


@EACH_MARKED
def test_offsets_keep_the_chain_rule(name: str) -> None:
    body = MARKED_BODIES[name]
    offsets = body.offsets(SET).symbol
    points = body.landmark_points(SET, *(block.symbol for block in body.blocks()), offsets)
    seen = residuals.landmarks(points, np.ones((6, 3)), sigma=0.1)
    prior = residuals.gaussian(offsets, mean=0.0, covariance=0.0095**2, unit="m")
    for free in (
        ("offsets",),
        ("trans", "pose", "betas", "offsets"),
        (f"pose[{body.joint_names[1]}]", "offsets[marker 3]", "offsets[marker 5, y]"),
    ):
        problem = wb.Problem([seen, prior], free=free)
        assert_chain_rule_is_graph(problem, some_values(problem))


def test_offsets_that_make_no_sense_are_refused() -> None:
    given, offsets = [b.symbol for b in MARKED.blocks()], MARKED.offsets(SET).symbol
    with pytest.raises(UnknownName, match="'shoes'"):
        MARKED.offsets("shoes")
    with pytest.raises(BadBody, match="for offsets"):
        MARKED.landmark_points(SET, *given, offsets.T)
    with pytest.raises(BadBody, match="for 6 landmarks"):
        MARKED.landmark(SET, offsets=np.zeros((5, 3)))
    with pytest.raises(BadBody, match="do not fit each other"):
        MARKED.landmark(SET, np.zeros((2, 5, 3)), offsets=np.zeros((3, 6, 3)))
    for body in (replace(MARKED, skinning=wb.dual_quaternion_blend), MARKED.freed("weights")):
        points = body.landmark_points(SET, *(b.symbol for b in body.blocks()), offsets)
        with pytest.raises(NotSupported, match="have no offsets"):
            points.graph()
    for body, name in (
        (MARKED, "no offsets of joints"),
        (blend_scape(tube_body()), "TriangleBody"),
    ):
        with pytest.raises(NotSupported, match=name):
            body.landmark_points("joints", *(b.symbol for b in body.blocks()), offsets)
        with pytest.raises(NotSupported, match=name):
            body.landmark("joints", offsets=np.zeros((5, 3)))
