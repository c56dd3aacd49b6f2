"""Means of a stitched surface as sums over parts: the same numbers as from the whole surface."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.sparse import csr_array

from tests.bodies_made_up import tube_body
from workbench.bodies.catalogue import load_body
from workbench.bodies.triangles import TriangleBody, blend_scape, scape
from workbench.bodies.triangles.means import StitchedMeans
from workbench.bodies.triangles.sources import FEW, NumericMeans

RNG = np.random.default_rng(5)
TOLERANCE = 1e-13  # m, of two ways to sum some hundred numbers of a metre


def bent(body: TriangleBody) -> TriangleBody:
    return replace(body, posedirs=0.1 * RNG.standard_normal(body.posedirs.shape))


BODIES: dict[str, Callable[[], TriangleBody]] = {
    "small-scape": lambda: load_body("small-scape"),
    "small-blend-scape": lambda: load_body("small-blend-scape"),
    "tube, SCAPE": lambda: bent(scape(tube_body())),
    "tube, BlendSCAPE": lambda: bent(blend_scape(tube_body())),
}
EACH = pytest.mark.parametrize("name", BODIES)


def arguments(body: TriangleBody, count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    poses = RNG.standard_normal((count, body.n_joints, 3))
    return poses, RNG.standard_normal((count, body.n_betas)), RNG.standard_normal((count, 3))


@EACH
def test_means_are_those_of_the_surface(name: str) -> None:
    body = BODIES[name]()
    given = arguments(body, 9)
    shares = RNG.random((5, body.n_vertices))
    scattered = csr_array(shares / shares.sum(axis=1, keepdims=True))
    for regressor in (body.J_regressor, scattered):
        found = StitchedMeans(body.arithmetic.packed, regressor)(*given)
        surfaces = body.vertices(*given)
        wanted = np.stack([regressor @ surface for surface in surfaces])
        np.testing.assert_allclose(found, wanted, rtol=0, atol=TOLERANCE)


@EACH
def test_rows_that_do_not_sum_to_one_are_taken_as_they_are(name: str) -> None:
    body = BODIES[name]()
    given = arguments(body, 3)
    rows = csr_array(RNG.standard_normal((2, body.n_vertices)) / body.n_vertices)
    found = StitchedMeans(body.arithmetic.packed, rows)(*given)
    wanted = np.stack([rows @ surface for surface in body.vertices(*given)])
    np.testing.assert_allclose(found, wanted, rtol=0, atol=TOLERANCE)


def test_each_part_with_faces_has_a_coefficient_for_each_product() -> None:
    body = load_body("small-scape")
    means = StitchedMeans(body.arithmetic.packed, body.J_regressor)
    B = body.n_betas
    for part in means.parts:
        T = 3 * len(part.felt)
        assert part.coefficients.shape == (3 * body.n_joints, (1 + B) * (1 + T))
    assert sorted(part.part for part in means.parts) == sorted(set(body.weights.indices.tolist()))


def test_few_means_are_found_without_the_surface_and_many_with_it() -> None:
    body = load_body("small-scape")
    given = arguments(body, 4)
    for count in (body.n_vertices // FEW, body.n_vertices // FEW + 1):
        selection = csr_array(np.eye(body.n_vertices)[:count])
        means = NumericMeans(body.arithmetic, selection)
        wanted = body.vertices(*given)[:, :count]
        np.testing.assert_allclose(means.evaluate_batch(*given), wanted, rtol=0, atol=TOLERANCE)
        assert ("_without_surface" in vars(means)) == (count <= body.n_vertices / FEW)
