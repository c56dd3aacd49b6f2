"""A body's pose, betas and translation may be affine maps of blocks, and lose nothing by it."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import casadi as cs
import numpy as np
import pytest

import workbench as wb
from tests.bodies_made_up import random_body, smpl_like_body
from tests.outcomes_made_up import setup_made_up
from tests.problem.test_chain import assert_same
from workbench import residuals
from workbench.blocks.affine import Affine, _by_scalars
from workbench.bodies.forward import arithmetic, surface
from workbench.bodies.triangles.recipes import blend_scape
from workbench.diagnostics import diagnose
from workbench.experiments import Experiment, Setup, run
from workbench.problem import batch
from workbench.reports import write_report
from workbench.reports.direction_pictures import pictures
from workbench.sampling.log_density import LogDensity
from workbench.sampling.modes import shortest_rotations
from workbench.sampling.subspace import fixed
from workbench.solvers.wrapping import rewrapped

RNG = np.random.default_rng(0)
BODY = random_body(2, n_vertices=40, n_joints=5, n_betas=3)
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


def pieces_that_cross() -> Given:
    s = symbols(arms=(2, 3), legs=(3, 3))
    arms, legs = cs.horzsplit(s["arms"]), cs.horzsplit(s["legs"])
    return cs.horzcat(legs[0], arms[1], legs[2], arms[0], legs[1]), *plain()[1:]


def components() -> Given:
    c = symbols(coefficients=(4,))["coefficients"]
    return cs.MX(MEAN) + cs.reshape(cs.DM(COMPONENTS) @ c, 3, K), *plain()[1:]


def half_components() -> Given:
    s = symbols(front=(2, 3), coefficients=(4,))
    hand = cs.reshape(cs.DM(COMPONENTS[6:]) @ s["coefficients"], 3, K - 2)
    return cs.horzcat(s["front"], hand), *plain()[1:]


def offsets() -> Given:
    pose, betas, trans = plain()
    return pose + cs.DM(MEAN), betas + 0.5, trans - cs.DM([0.0, 1.0, 2.0])


def two_roles() -> Given:
    pose, _, trans = plain()
    return pose, trans, trans  # a block that is the shape as well as the place


def mirrored() -> Given:
    half = symbols(half=(3, 3))["half"]
    a, b, c = cs.horzsplit(half)
    return cs.horzcat(a, b, -b, c, cs.DM([1.0, -1.0, -1.0]) * c), *plain()[1:]


def held() -> Given:
    pose, _, trans = plain()
    return pose, cs.MX(cs.DM([0.3, -0.2, 0.1])), trans


def flat() -> Given:
    return cs.reshape(symbols(theta=(3 * K,))["theta"], 3, K), *plain()[1:]


def larger() -> Given:
    """A block of which the pose is a part: what is left of it moves nothing."""
    everything = symbols(everything=(K + 2, 3))["everything"]
    return everything[:, 1 : K + 1], *plain()[1:]


ALL = (
    plain,
    pieces,
    pieces_that_cross,
    components,
    half_components,
    offsets,
    two_roles,
    mirrored,
    held,
    flat,
    larger,
)
EACH = pytest.mark.parametrize("given", ALL, ids=lambda given: given.__name__)


def values_of(problem: wb.Problem, seed: int = 1) -> wb.Values:
    rng = np.random.default_rng(seed)
    blocks = (*problem.free.blocks, *problem.fixed.blocks)
    return {b.name: rng.normal(scale=0.4, size=b.shape) for b in blocks}


def terms(body: wb.SkinnedBody | wb.TriangleBody, given: Given) -> list[wb.Residual]:
    N = body.n_vertices
    observed = np.random.default_rng(5).normal(size=(N, 3))
    face = body.joint_points(*given)
    return [
        residuals.vertices(body.points(*given), observed, sigma=0.01),
        residuals.vertices(
            body.points(*given, vertices=[3, 1]), observed[:2], sigma=0.02, name="some"
        ),
        residuals.landmarks(face, np.zeros((face.count, 3)), sigma=0.1),
    ]


def names_of(given: Given) -> list[str]:
    return [symbol.name() for symbol in cs.symvar(cs.veccat(*given))]


# The numbers.


@pytest.mark.parametrize("worth_compiling", [1, 10**9], ids=["compiled, if it can be", "NumPy"])
@EACH
def test_the_chain_rule_gives_what_the_graph_gives(
    given: Callable[[], Given], worth_compiling: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(arithmetic, "WORTH_COMPILING", worth_compiling)
    arguments = given()
    names = names_of(arguments)
    of_mesh, *others = terms(BODY, arguments)
    for free in (names, names[::-1], names[:1], names[-1:]):
        # alone, the mesh writes into the Jacobian itself; among others, it does so by parts
        for stacked in ([of_mesh], [of_mesh, *others]):
            problem = wb.Problem(stacked, free)
            assert_same(problem, values_of(problem))


@pytest.mark.parametrize("given", ["pieces", "offset", "two roles"])
def test_triangle_bodies_take_them_too(given: str) -> None:
    body = blend_scape(wb.load_body("small"))
    pose, betas, trans = (block.symbol for block in body.blocks())
    s = symbols(root=(1, 3), rest=(body.n_joints - 1, 3))
    made = {
        "pieces": cs.horzcat(s["root"], s["rest"]),
        "offset": pose + 0.1,
        "two roles": pose + cs.repmat(trans, 1, body.n_joints),
    }
    arguments = made[given], betas, trans
    problem = wb.Problem(terms(body, arguments), names_of(arguments))
    assert all(p.source.numeric is not None for r in problem.residuals for p in r.points)
    assert_same(problem, values_of(problem))


@EACH
def test_no_graph_of_the_mesh_is_built(
    given: Callable[[], Given], monkeypatch: pytest.MonkeyPatch
) -> None:
    def built(*_: object) -> None:
        raise AssertionError("the graph of the mesh was built")

    monkeypatch.setattr(surface, "posed", built)
    arguments = given()
    problem = wb.Problem(terms(BODY, arguments)[:2], names_of(arguments))
    assert np.isfinite(problem.linearize(values_of(problem)).cost)


@pytest.mark.parametrize("longest", [0, 10**9], ids=["matrix products", "scalar instructions"])
@EACH
def test_costs_of_many_values(
    given: Callable[[], Given], longest: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(batch, "INTERPRETED_UP_TO", longest)
    arguments = given()
    problem = wb.Problem(terms(BODY, arguments), names_of(arguments))
    x, others = problem.split(values_of(problem))
    costs = problem.costs(x, others)(np.array([x, x + 0.1]))
    expected = [problem.linearize_at(z, others).cost for z in (x, x + 0.1)]
    np.testing.assert_allclose(costs, expected, rtol=1e-10)


@EACH
def test_many_joints_at_once(given: Callable[[], Given]) -> None:
    arguments = given()
    problem = wb.Problem(terms(BODY, arguments)[2:], names_of(arguments))
    many = BODY.joint_points(*arguments).source.numeric.evaluate_batch
    assert many is not None
    values = [values_of(problem, seed) for seed in range(3)]
    found = many({name: np.array([v[name] for v in values]) for name in values[0]})
    source = BODY.joint_points(*arguments).source
    function = cs.Function("joints", [b.symbol for b in source.blocks], [source.expression])
    for one, v in zip(found, values, strict=True):
        numbers = (v[b.name].T for b in source.blocks)
        np.testing.assert_allclose(one, np.asarray(function(*numbers)).T, atol=1e-12)


def test_values_of_a_plain_block_are_not_copied() -> None:
    maps = BODY.points(*plain()).source.arguments.maps
    pose = np.zeros((K, 3))
    assert maps[0].value({"pose": pose}) is pose
    assert BODY.points(*plain()).source.numeric.plain == ("pose", "betas", "trans")


@pytest.mark.parametrize(
    "bent",
    [
        lambda x: cs.sin(x),
        lambda x: x * cs.sum1(x),
        lambda x: cs.if_else(x[0] > 0, x, 2 * x),
        lambda x: cs.fmax(x, 0),
        lambda x: x + cs.norm_2(x),
    ],
)
def test_what_is_not_affine_goes_by_the_graph(bent: Callable[[cs.MX], cs.MX]) -> None:
    pose, betas, trans = plain()
    assert Affine.of(bent(betas), (3,)) is None
    source = BODY.points(pose, bent(betas), trans).source
    assert source.numeric is None
    assert source.tree is None
    problem = wb.Problem(terms(BODY, (pose, bent(betas), trans)), ("pose", "betas"))
    assert_same(problem, values_of(problem))


def test_an_affine_map_is_offset_and_matrices() -> None:
    s = symbols(a=(2, 3), b=(4,))
    A = RNG.normal(size=(6, 4))
    found = Affine.of(cs.reshape(cs.DM(A) @ s["b"], 3, 2) + 2 * s["a"] + 1, (2, 3))
    assert found is not None
    a, b = RNG.normal(size=(2, 3)), RNG.normal(size=4)
    expected = (A @ b).reshape(2, 3) + 2 * a + 1
    np.testing.assert_allclose(found.value({"a": a, "b": b}), expected, atol=1e-14)
    many = found.value_batch({"a": np.array([a, 2 * a]), "b": np.array([b, b])})
    np.testing.assert_allclose(many[1], expected + 2 * a, atol=1e-14)
    g = RNG.normal(size=6)
    np.testing.assert_allclose(found.pulled(g)["b"], A.T @ g, atol=1e-14)
    np.testing.assert_allclose(found.pulled(g)["a"], 2 * g, atol=1e-14)


MAPS: dict[str, Callable[[cs.MX, cs.MX], cs.MX]] = {
    "one frame of many": lambda x, y: x[:, 7],
    "rows in another order": lambda x, y: cs.vertcat(x[2:, :], cs.DM.ones(2, 20), x[:2, :]),
    "coefficients": lambda x, y: cs.DM(np.arange(24).reshape(4, 6)) @ x + 3,
    "sums, of which matrices have no constant slope": lambda x, y: cs.cumsum(x.T).T,
    "a scalar added to a matrix": lambda x, y: 2 * x[:, :3] - y,
    "fewer rows than columns": lambda x, y: cs.sum2(x)[:2] + y,
    "nothing left of one": lambda x, y: x - x + y,
    "the same twice": lambda x, y: (x + x) / 2,
}


@pytest.mark.parametrize("made", MAPS.values(), ids=list(MAPS))
def test_matrices_and_scalars_have_the_same_affine_map(
    made: Callable[[cs.MX, cs.MX], cs.MX],
) -> None:
    s = symbols(x=(20, 6), y=())
    expression = made(s["x"], s["y"])
    found = Affine.of(expression, expression.shape[::-1])
    assert found is not None
    by_values = cs.Function("f", [s["x"], s["y"]], [expression])
    rng = np.random.default_rng(3)
    for _ in range(2):
        values = {"x": rng.normal(size=(20, 6)), "y": rng.normal(size=())}
        expected = np.asarray(by_values(values["x"].T, values["y"])).T
        np.testing.assert_allclose(found.value(values), expected, rtol=0, atol=1e-13)
    column = cs.densify(cs.vec(expression))
    read = cs.symvar(expression)
    exact = _by_scalars(column, read)
    assert exact is not None
    for symbol, matrix in zip(read, exact, strict=True):
        own = found.terms[symbol.name()]
        assert own.nnz == matrix.nnz  # no zero is stored: a row that is one entry is seen as such
        np.testing.assert_array_equal(own.toarray(), matrix.toarray())


def test_no_derivative_is_taken_of_what_is_clearly_bent(monkeypatch: pytest.MonkeyPatch) -> None:
    """That of each entry by each would be without zeros."""

    def taken(*_: object) -> None:
        raise AssertionError

    monkeypatch.setattr(cs, "jacobian", taken)
    x = symbols(x=(200, 72))["x"]
    assert Affine.of(x / cs.norm_2(cs.vec(x)), (200, 72)) is None


def test_one_block_moves_two_bodies() -> None:
    """Their poses share all but the root; each body gives its part to the shared columns."""
    rest = wb.Block("rest", (K - 1, 3), "rad", BODY.joint_names[1:])
    stacked, others = [], []
    for who in ("a/", "b/"):
        root = wb.Block(who + "root", (1, 3), "rad", BODY.joint_names[:1])
        _, betas, trans = BODY.blocks(who)
        pose = cs.horzcat(root.symbol, rest.symbol)
        points = BODY.points(pose, betas.symbol, trans.symbol)
        stacked.append(residuals.vertices(points, BODY.template, sigma=0.1, name=who))
        others += [root, betas, trans]
    problem = wb.Problem(stacked, [rest.name, *(b.name for b in others)], blocks=(rest, *others))
    assert_same(problem, values_of(problem))
    assert len(problem.trees) == 2
    turned = [problem.free.label(at.start) for at in problem.rotations]
    assert turned[:2] == ["a/root[joint0, x]", "rest[joint1, x]"]
    assert turned[-1] == "b/root[joint0, x]"
    assert len(turned) == K + 1  # what is shared is counted once


# The tree and its names.


def in_two_ways(kind: str) -> tuple[wb.Problem, wb.Problem, Callable[[wb.Values], wb.Values]]:
    """A fit of joints or vertices with one pose block, and with a pose of two pieces."""
    body = smpl_like_body()
    pose, betas, trans = body.blocks()
    root = wb.Block("root", (1, 3), "rad", body.joint_names[:1])
    rest = wb.Block("rest", (23, 3), "rad", body.joint_names[1:])
    both = []
    for given, free in (
        (pose.symbol, ("pose", "trans")),
        (cs.horzcat(root.symbol, rest.symbol), ("root", "rest", "trans")),
    ):
        arguments = given, betas.symbol, trans.symbol
        if kind == "joints":
            term = residuals.landmarks(body.joint_points(*arguments), body.joints(), sigma=0.01)
        else:
            points = body.points(*arguments)
            term = residuals.vertices(points, body.template, sigma=0.01)
        both.append(wb.Problem([term], free, blocks=(root, rest) if "root" in free else ()))

    def cut(values: wb.Values) -> wb.Values:
        left = {name: value for name, value in values.items() if name != "pose"}
        return left | {"root": values["pose"][:1], "rest": values["pose"][1:]}

    return both[0], both[1], cut


def by_one_name(said: str) -> str:
    return said.replace("root[", "pose[").replace("rest[", "pose[")


def test_null_directions_have_the_same_names_and_the_rank_law_is_the_same() -> None:
    whole, cut, to_pieces = in_two_ways("joints")
    rng = np.random.default_rng(3)
    at = {"pose": 0.2 * rng.normal(size=(24, 3)), "betas": np.zeros(4), "trans": rng.normal(size=3)}
    one, other = diagnose(whole, at), diagnose(cut, to_pieces(at))
    names = [direction.name for direction in other.null_directions]
    assert [by_one_name(name) for name in names] == [d.name for d in one.null_directions]
    assert [d.joints for d in other.null_directions] == [d.joints for d in one.null_directions]
    assert any(name.startswith("a turn of rest[") for name in names)
    assert one.rank_law == other.rank_law
    assert other.rank_law is not None
    assert other.rank_law[0] == other.rank


def test_long_rotation_vectors_are_wrapped_alike() -> None:
    whole, cut, to_pieces = in_two_ways("vertices")
    pose = 0.1 * np.random.default_rng(4).normal(size=(24, 3))
    pose[0], pose[16] = (4.0, 0.0, 0.5), (0.0, -7.0, 0.2)
    start = {"pose": pose, "betas": np.zeros(4), "trans": np.zeros(3)}
    x, y = whole.split(start)[0], cut.split(to_pieces(start))[0]
    np.testing.assert_array_equal(x, y)  # the pieces are free in the order of the pose
    wrapped = rewrapped(whole, x, lambda _: True)
    np.testing.assert_array_equal(rewrapped(cut, y, lambda _: True), wrapped)
    assert np.linalg.norm(wrapped[:3]) < np.pi
    assert np.linalg.norm(wrapped[48:51]) < np.pi
    for problem, values in ((whole, start), (cut, to_pieces(start))):
        z, given = problem.split(values)
        space = fixed(problem, problem.linearize_at(z, given), z, np.arange(problem.free.size))
        np.testing.assert_array_equal(
            shortest_rotations(LogDensity(problem, given, space), z), wrapped
        )


def test_a_fit_of_pieces_walks_the_same_way() -> None:
    whole, cut, to_pieces = in_two_ways("vertices")
    start = {"pose": np.full((24, 3), 0.3), "betas": np.zeros(4), "trans": np.full(3, 0.1)}
    one, other = wb.solve(whole, start), wb.solve(cut, to_pieces(start))
    assert one.status == other.status
    assert len(one.trace) == len(other.trace)
    np.testing.assert_allclose(
        np.concatenate([other.values["root"], other.values["rest"]]), one.values["pose"], atol=1e-9
    )


def test_coefficients_have_no_joints_and_the_pieces_beside_them_do() -> None:
    body = smpl_like_body()
    _, betas, trans = body.blocks()
    front = wb.Block("front", (20, 3), "rad", body.joint_names[:20])
    coefficients = wb.Block("coefficients", (3,))
    hands = cs.reshape(cs.DM(RNG.normal(size=(12, 3))) @ coefficients.symbol, 3, 4)
    pose = cs.horzcat(front.symbol, hands)
    joints = body.joint_points(pose, betas.symbol, trans.symbol)
    term = residuals.landmarks(joints, body.joints(), sigma=0.01)
    problem = wb.Problem([term], ("front", "coefficients"), blocks=(front, coefficients))
    (tree,) = problem.trees
    assert tree.places[:2] == (("front", 0), ("front", 3))
    assert tree.places[20:] == (None,) * 4
    assert len(problem.rotations) == 20
    found = diagnose(problem, values_of(problem))
    assert found.rank_law is None  # it counts joints that turn by three numbers of their own
    for direction in found.null_directions:
        assert not set(direction.joints) & set(body.joint_names[20:])
        assert "front[left_wrist]" not in direction.name


def test_a_negative_or_shifted_copy_is_no_rotation_vector_of_its_own() -> None:
    for given, turned in ((mirrored, 1), (offsets, 0), (two_roles, K), (flat, K), (larger, K)):
        arguments = given()
        problem = wb.Problem(terms(BODY, arguments), names_of(arguments))
        assert len(problem.rotations) == turned, given.__name__


def test_a_run_whose_pose_is_in_pieces_is_shown(tmp_path: Path) -> None:
    body = smpl_like_body()
    root = wb.Block("root", (1, 3), "rad", body.joint_names[:1])
    rest = wb.Block("rest", (23, 3), "rad", body.joint_names[1:])
    _, betas, trans = body.blocks()
    arguments = cs.horzcat(root.symbol, rest.symbol), betas.symbol, trans.symbol
    data = residuals.landmarks(body.joint_points(*arguments), body.joints(), sigma=0.01)

    def build() -> Setup:
        made = setup_made_up()
        start = {name: value for name, value in made.start.items() if name != "pose"}
        start |= {"root": np.full((1, 3), 0.1), "rest": np.full((23, 3), 0.1)}
        fit = wb.Problem([data], ("root", "rest", "trans"), blocks=(root, rest))
        return replace(made, problem=fit, start=start, measures=lambda _: ())

    outcome = run(Experiment("pieces", build, "for tests"))
    values = outcome.values
    pose = np.concatenate([values["root"], values["rest"]])
    expected = body.vertices(pose, values["betas"], values["trans"])
    np.testing.assert_allclose(outcome.surface, expected, atol=1e-12)
    assert len(outcome.overlays) == len(outcome.setup.views) == 2
    page = write_report(outcome, tmp_path / "run").read_text()
    assert "a turn of rest[left_" in page
    directions = [d for d in outcome.diagnosis.null_directions if d.kind != "entry"]
    assert pictures(outcome.diagnosis, directions, body)


def test_bare_pieces_have_the_names_of_the_joints_that_they_turn() -> None:
    _, betas, trans = BODY.blocks()
    root, rest = cs.MX.sym("root", 3), cs.MX.sym("rest", 3, K - 1)
    pose = cs.horzcat(root, rest)
    data = terms(BODY, (pose, betas.symbol, trans.symbol))
    problem = wb.Problem(data, ("root", "rest", "trans"))
    labels = [problem.free.label(i) for i in (0, 2, 3, 5)]
    assert labels == ["root[joint0, x]", "root[joint0, z]", "rest[joint1, x]", "rest[joint1, z]"]
    assert problem.free.unit(3) == "rad"
    assert problem.freeing("rest[joint2]").free.size == 3
    mine = wb.Block.of(rest, "deg", ("a", "b", "c", "d"))  # whoever made it knows better
    described = wb.Problem(data, ("rest",), blocks=(mine,))
    assert (described.free.label(3), described.free.unit(3)) == ("rest[b, x]", "deg")
    shifted = terms(BODY, (pose + 0.1, betas.symbol, trans.symbol))
    assert wb.Problem(shifted, "rest").free.label(3) == "rest[1, x]"  # no rotation vectors
