"""Points whose derivative is sparse: the chain rule has the whole graph's numbers and pattern."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import casadi as cs
import numpy as np
import pytest
from scipy.sparse import csc_array, random_array

import workbench as wb
from tests.bodies_made_up import random_body
from tests.tiers import few
from workbench import residuals
from workbench.blocks import Block, NumericPoints, PointsAt, Tree
from workbench.blocks.functions import sparse_constant
from workbench.problem import storage

STORED = pytest.mark.parametrize("dense_from", [0, 10**9], ids=["sparse", "dense"])


@dataclass(frozen=True, eq=False)
class Web:
    """N points p = 1/2 max(A a, 0)^2 + B b, A sparse and B without zeros: see PointSource.

    Where A a is negative, the derivative by `a` has fewer entries than its pattern.
    """

    a: Block
    b: Block
    A: csc_array
    B: np.ndarray

    tree: Tree | None = None
    labels = None

    @property
    def count(self) -> int:
        return int(self.A.shape[0]) // 3

    @property
    def expression(self) -> cs.MX:
        found = (
            0.5 * cs.fmax(sparse_constant(self.A) @ self.a.symbol, 0) ** 2
            + sparse_constant(self.B) @ self.b.symbol
        )
        return cs.reshape(found, 3, self.count)

    @property
    def blocks(self) -> tuple[Block, ...]:
        return self.a, self.b

    @cached_property
    def numeric(self) -> NumericPoints:
        return WebNumbers(self)


@dataclass(frozen=True, eq=False)
class WebNumbers(NumericPoints):
    of: Web

    @property
    def reads(self) -> tuple[str, ...]:
        return self.of.a.name, self.of.b.name

    def pattern(self, name: str) -> csc_array | None:
        return self.of.A if name == self.of.a.name else None

    def evaluate(self, values: wb.Values) -> "WebAt":
        return WebAt(self.of, values[self.of.a.name], values[self.of.b.name])


@dataclass(frozen=True, eq=False)
class WebAt(PointsAt):
    of: Web
    a: np.ndarray
    b: np.ndarray

    @property
    def above(self) -> np.ndarray:
        return np.maximum(self.of.A @ self.a, 0.0)

    @property
    def points(self) -> np.ndarray:
        return (0.5 * self.above**2 + self.of.B @ self.b).reshape(-1, 3)

    def jacobian(self, name: str) -> csc_array:
        assert name == self.of.a.name
        found = csc_array(self.of.A * self.above[:, None])
        found.eliminate_zeros()
        assert found.nnz < self.of.A.nnz
        return found

    def write_jacobian(self, into: wb.Values, scale: np.ndarray | None) -> None:
        assert self.of.a.name not in into  # that has a pattern
        into[self.of.b.name][...] = self.of.B.T * (1.0 if scale is None else scale)

    def vjp(self, cotangent: np.ndarray) -> wb.Values:
        back = self.jacobian(self.of.a.name).T @ cotangent
        return {self.of.a.name: back, self.of.b.name: self.of.B.T @ cotangent}


def web(seed: int, a: Block, b: Block, count: int = 9) -> wb.Points:
    rng = np.random.default_rng(seed)
    A = random_array((3 * count, a.size), density=0.15, rng=rng, data_sampler=rng.standard_normal)
    of = Web(a, b, csc_array(A), rng.normal(size=(3 * count, b.size)))
    return wb.Points.of(of, f"web {seed}")


A, B, C = Block("a", (12,), "m"), Block("b", (3,), "m"), Block("c", (12,), "m")


def alone() -> list[wb.Residual]:
    """Each point against a place: a diagonal of the residual by the points."""
    return [residuals.vertices(web(0, A, B), np.ones((9, 3)), sigma=0.5)]


def two_sources() -> list[wb.Residual]:
    """Each against a place, the gap between both, and a prior that reads a block directly."""
    one, other = web(1, A, B), web(2, C, B)
    gap = cs.vec(one.symbol - other.symbol) ** 3
    return [
        residuals.vertices(one, np.ones((9, 3)), sigma=0.5, name="one"),
        wb.Residual("gap", gap, 0.1, "m^3", points=(one, other)),
        residuals.gaussian(A.symbol[::2], covariance=2.0),
    ]


TERMS = pytest.mark.parametrize("terms", [alone, two_sources])
FREE = pytest.mark.parametrize(
    "free", few([("b", "a[2:7]"), ("a", "b"), ("a",), ("a[0]", "a[11]"), ("b",)], 1), ids=str
)


def made(
    terms: list[wb.Residual], free: tuple[str, ...]
) -> tuple[wb.Problem, np.ndarray, np.ndarray]:
    problem = wb.Problem(terms, free)
    rng = np.random.default_rng(5)
    layouts = problem.free.blocks + problem.fixed.blocks
    values = {block.name: rng.normal(size=block.base.shape) for block in layouts}
    return problem, *problem.split(values)


@pytest.fixture
def stored(dense_from: int, monkeypatch: pytest.MonkeyPatch) -> int:
    monkeypatch.setattr(storage, "DENSE_FROM", dense_from)
    monkeypatch.setattr(storage, "SPARSE_UP_TO", 2.0)
    return dense_from


@TERMS
@FREE
@STORED
def test_sparse_jacobian_matches_the_graph(
    terms: Callable[[], list[wb.Residual]], free: tuple[str, ...], stored: int
) -> None:
    problem, x, fixed = made(terms(), free)
    here = problem.linearize_at(x, fixed)
    assert here.estimated == (stored == 0)
    r, J = (np.asarray(part) for part in problem.derivative(x, fixed))
    np.testing.assert_allclose(here.residual, r.ravel(), rtol=0, atol=1e-11 * abs(r).max())
    np.testing.assert_allclose(here.dense, J, rtol=0, atol=1e-11 * abs(J).max())
    cost, gradient = problem.cost_and_gradient(x, fixed)
    assert cost == pytest.approx(here.cost, rel=1e-12)
    np.testing.assert_allclose(gradient, J.T @ r.ravel(), atol=1e-11 * abs(gradient).max())


@TERMS
@FREE
def test_pattern_and_support_match_the_graph(
    terms: Callable[[], list[wb.Residual]], free: tuple[str, ...]
) -> None:
    problem, *_ = made(terms(), free)
    pattern = problem.pattern
    sparsity = problem.derivative.sparsity_out(1)
    there = np.zeros(sparsity.shape, dtype=bool)
    rows, columns = (np.array(part, dtype=int) for part in sparsity.get_triplet())
    there[rows, columns] = True
    assert pattern.data.all()
    assert pattern.has_canonical_format
    np.testing.assert_array_equal(pattern.toarray(), there)
    for i in range(problem.free.size):
        one = np.arange(problem.free.size) == i
        np.testing.assert_array_equal(problem.support.rows(one), there[:, i])
    v = np.random.default_rng(1).normal(size=problem.size)
    np.testing.assert_allclose(problem.support.norms(v) ** 2, v**2 @ there, atol=1e-12)


@STORED
def test_free_entries_of_arrays_have_a_sparse_jacobian(stored: int) -> None:
    body = random_body(4, n_vertices=9, n_joints=4, n_betas=2)
    student = body.freed("template", "posedirs", "weights", "joints")
    points = student.points(*(b.symbol for b in student.blocks()))
    joints = student.joint_points(*(b.symbol for b in student.blocks()))  # by the graph
    terms = [
        residuals.vertices(points, body.template + 0.1, sigma=0.1),
        wb.Residual(
            "gap", cs.vec(points.symbol[:, :4] - joints.symbol), 0.1, "m", points=(points, joints)
        ),
    ]
    free = ("template[2:5]", "pose", "weights", "posedirs[3]", "joints[1:3]")
    problem = wb.Problem(terms, free)
    rng = np.random.default_rng(6)
    values = {
        name: value + 0.3 * rng.normal(size=np.shape(value))
        for name, value in student.start().items()
    }
    x, fixed = problem.split(values)
    here = problem.linearize_at(x, fixed)
    J = np.asarray(problem.derivative(x, fixed)[1])
    np.testing.assert_allclose(here.dense, J, rtol=0, atol=1e-11 * abs(J).max())
    assert here.estimated == (stored == 0)
    there = problem.pattern.toarray()
    assert there[here.dense != 0].all()
    assert there.mean() < 0.5
