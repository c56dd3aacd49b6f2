"""SMPL is almost entirely linear: which of its arrays are, together and one by one."""

from collections.abc import Sequence

import casadi as cs
import numpy as np
import pytest

from tests.bodies_made_up import random_body
from workbench import SkinnedBody
from workbench.bodies.forward.kinematics import binding_motions, pose_features
from workbench.bodies.forward.skinning import linear_blend
from workbench.geometry.rotation import rodrigues

N, K, B = 6, 3, 2


def surface(*free: str) -> tuple[SkinnedBody, cs.MX, dict[str, cs.MX]]:
    """A small body, its vertices as a column, and the symbols that they are made of."""
    body = random_body(n_vertices=N, n_joints=K, n_betas=B).freed(*free)
    blocks = (*body.blocks(), *body.free.values())
    symbols = {block.name: block.symbol for block in blocks}
    arguments = [block.symbol for block in body.blocks()]
    return body, cs.vec(body.points(*arguments).source.expression), symbols


def linear_in(expression: cs.MX, symbols: Sequence[cs.MX]) -> bool:
    """CasADi's own answer, on the expanded graph: there structure is exact, entry by entry."""
    others = [s for s in cs.symvar(expression) if not any(cs.is_equal(s, t) for t in symbols)]
    f = cs.Function("f", [*symbols, *others], [expression]).expand()
    x = cs.SX.sym("x", sum(s.numel() for s in symbols))
    edges = np.cumsum([0, *(s.numel() for s in symbols)]).tolist()
    pieces = [
        cs.reshape(part, s.shape) for part, s in zip(cs.vertsplit(x, edges), symbols, strict=True)
    ]
    rest = [cs.SX.sym("other", *s.shape) for s in others]
    return bool(cs.is_linear(f(*pieces, *rest), x))


@pytest.mark.parametrize(
    "name", ["template", "shapedirs", "posedirs", "weights", "J_regressor", "betas", "trans"]
)
def test_the_surface_is_linear_in_each(name: str) -> None:
    free = [name] if name not in ("betas", "trans") else []
    _, vertices, symbols = surface(*free)
    assert linear_in(vertices, [symbols[name]])


def test_the_surface_is_not_linear_in_the_pose() -> None:
    _, vertices, symbols = surface()
    assert not linear_in(vertices, [symbols["pose"]])


@pytest.mark.parametrize(
    "names",
    [
        ("weights", "posedirs"),
        ("weights", "template"),
        ("shapedirs", "betas"),
        ("J_regressor", "template"),
        ("weights", "J_regressor"),
    ],
    ids="+".join,
)
def test_products_of_two_are_not_linear(names: tuple[str, str]) -> None:
    free = [name for name in names if name != "betas"]
    _, vertices, symbols = surface(*free)
    assert not linear_in(vertices, [symbols[name] for name in names])


def test_template_and_pose_directions_are_linear_together() -> None:
    _, vertices, symbols = surface("template", "posedirs")
    assert linear_in(vertices, [symbols["template"], symbols["posedirs"]])


def test_pose_training_is_one_linear_problem() -> None:
    """Jointly linear in rest template, pose directions and joints, for fixed pose and weights."""
    body = random_body(n_vertices=N, n_joints=K)
    pose = cs.MX.sym("pose", 3, K)
    rest, joints = cs.MX.sym("rest", 3, N), cs.MX.sym("joints", 3, K)
    P, W = cs.MX.sym("P", 3 * N, 9 * (K - 1)), cs.MX.sym("W", N, K)
    R, bind = rodrigues(pose), rodrigues(cs.DM(body.bind_pose.T))
    G, _ = binding_motions(R, bind, joints, body.parents)
    bent = rest + cs.reshape(P @ pose_features(R, bind), 3, N)
    vertices = cs.vec(linear_blend(bent, G, W))
    assert linear_in(vertices, [rest, P, joints])
    assert linear_in(vertices, [W])
    assert not linear_in(vertices, [W, P])
    assert not linear_in(vertices, [W, joints])
    assert not linear_in(vertices, [pose])


def test_linearity_is_a_fact_about_numbers_too() -> None:
    """Midpoints go to midpoints: what is_linear says, seen without CasADi's structure."""
    body = random_body(n_vertices=N, n_joints=K, n_betas=B)
    rng = np.random.default_rng(0)
    pose = rng.normal(size=(K, 3))
    betas = rng.normal(size=(2, B))
    ends, middle = body.vertices(pose, betas), body.vertices(pose, betas.mean(axis=0))
    np.testing.assert_allclose(middle, ends.mean(axis=0), atol=1e-14)
    poses = rng.normal(size=(2, K, 3))
    bent = body.vertices(poses.mean(axis=0)) - body.vertices(poses).mean(axis=0)
    assert np.abs(bent).max() > 1e-2
