"""Learning SCAPE and BlendSCAPE back from what they generated, and SMPL's way beside theirs."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import workbench as wb
from tests.bodies_made_up import tube_body
from tests.training.known_poses import Direct, learn
from workbench.bodies.triangles import TriangleBody, blend_scape, scape
from workbench.errors import BadArgument
from workbench.geometry.triangles import Stitching, edges
from workbench.lectures.material.variance import (
    additivity_gap,
    explained_by_triangles,
    explained_by_vertices,
    unposed,
)
from workbench.training.triangles.learning import PosedMeshes, learn_person
from workbench.training.triangles.shape_space import learn_shapes, stitched_directions
from workbench.training.triangles.stitched_fit import (
    CentredVertices,
    ClosedEdges,
    LeastSquares,
    Lsqr,
    Measure,
    NotConverged,
    StitchedFit,
    neighbour_differences,
)

SMALL = wb.load_body("small")
TETRAHEDRON = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])
P, B = 6, 2


@cache
def generator(blended: bool = False) -> TriangleBody:
    body = (blend_scape if blended else scape)(tube_body(rings=3))
    posedirs = np.random.default_rng(0).normal(scale=0.05, size=body.posedirs.shape)
    return replace(body, posedirs=posedirs)


def drawn(true: TriangleBody, meshes: int, seed: int) -> tuple[np.ndarray, PosedMeshes]:
    """Betas (P, 2) of people whose mean is the template, and meshes of them."""
    rng = np.random.default_rng(seed)
    betas = rng.normal(size=(P, B))
    betas -= betas.mean(axis=0)
    person, poses = rng.integers(P, size=meshes), rng.normal(scale=0.7, size=(meshes, 3, 3))
    return betas, PosedMeshes(true.vertices(poses, betas[person]), poses, person)


def untrained(true: TriangleBody) -> TriangleBody:
    shapes = np.zeros((true.n_faces, 3, 3, 0))
    return replace(true, posedirs=0 * true.posedirs, shapedirs=shapes)


# Recovery.


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("blended", "by", "measure"),
    [
        (False, Lsqr(1e-10), ClosedEdges),
        (True, Direct(), CentredVertices),  # LSQR would need minutes for 1e-8 m
    ],
    ids=["SCAPE", "BlendSCAPE"],
)
def test_generators_are_learned_back(
    blended: bool, by: LeastSquares, measure: Callable[[Stitching], Measure]
) -> None:
    true = generator(blended)
    betas, posed = drawn(true, 50, 1)
    people = true.vertices(betas=betas)
    trained = learn(untrained(true), people, posed, n_betas=B, ridge=0.0, by=by, measure=measure)
    # the learned betas are the true ones in another basis
    found = learn_shapes(people, true.faces, B).betas
    change = np.linalg.lstsq(betas, found)[0]
    rng = np.random.default_rng(2)
    new, poses = rng.normal(size=(20, B)), rng.normal(scale=0.5, size=(20, 3, 3))
    apart = trained.vertices(poses, new @ change) - true.vertices(poses, new)
    before = replace(trained, posedirs=0 * trained.posedirs).vertices(poses, new @ change)
    assert np.linalg.norm(apart, axis=-1).max() < 1e-8
    assert np.linalg.norm(before - true.vertices(poses, new), axis=-1).max() > 0.01


@pytest.mark.thorough
def test_one_person_is_learned_from_posed_meshes() -> None:
    true = generator()
    beta = np.array([1.5, -1.0])
    rng = np.random.default_rng(4)
    poses = rng.normal(scale=0.7, size=(12, 3, 3))
    posed = PosedMeshes(true.vertices(poses, beta), poses, np.zeros(12, dtype=np.int64))
    D = learn_person(true, posed, smoothness=1e-12, by=Lsqr(1e-9))
    one = replace(true, shapedirs=(D - np.eye(3))[..., None])
    new = rng.normal(scale=0.5, size=(10, 3, 3))
    apart = one.vertices(new, [1.0]) - true.vertices(new, beta)
    assert abs(apart).max() < 1e-4
    # and the smoother, the more alike are neighbours, at the cost of the fit
    roughness = []
    for smoothness in (1e-6, 1e-3, 1.0):
        D = learn_person(true, posed, smoothness=smoothness, by=Lsqr(1e-8))
        roughness.append(np.linalg.norm(neighbour_differences(true.faces) @ D.reshape(len(D), -1)))
    assert roughness[0] > roughness[1] > roughness[2]


# Its parts.


@pytest.mark.parametrize("measure", [ClosedEdges, CentredVertices])
def test_stitched_fit_is_dense_least_squares(
    measure: Callable[[Stitching], Measure],
) -> None:
    rng = np.random.default_rng(6)
    stitching, M, q = Stitching(TETRAHEDRON, 4), 3, 2
    left, features = rng.normal(size=(4, M, 3, 3)), rng.normal(size=(4, 2, M, q))
    wanted = rng.normal(size=(4, 2, M, 3))
    ridge, smoothness = 0.3, 0.2
    fit = StitchedFit(stitching, left, features, wanted, measure)
    C = fit.solve(ridge, smoothness, Lsqr(1e-14))
    A = stitching.A.toarray()
    S = A @ np.linalg.pinv(A) if measure is ClosedEdges else np.linalg.pinv(A)  # means at 0
    columns = []
    for unit in np.eye(4 * 3 * q):
        e = np.einsum("fmac,fcq,fimq->fima", left, unit.reshape(4, 3, q), features)
        tied = neighbour_differences(TETRAHEDRON).toarray() @ unit.reshape(4, -1)
        parts = S @ e.reshape(8, -1), np.sqrt(smoothness) * tied, np.sqrt(ridge) * unit
        columns.append(np.concatenate([part.ravel() for part in parts]))
    J = np.array(columns).T
    target = (S @ wanted.reshape(8, -1)).ravel()
    right = np.concatenate([target, np.zeros(len(J) - target.size)])
    np.testing.assert_allclose(C.ravel(), np.linalg.lstsq(J, right)[0], atol=1e-9)
    np.testing.assert_allclose(fit.solve(ridge, smoothness, Direct()), C, atol=1e-9)
    with pytest.raises(NotConverged, match="24 unknowns were stopped after 2 iterations"):
        fit.solve(by=Lsqr(most=2))
    with pytest.raises(BadArgument, match=r"24 unknowns are too many .* up to 20; take Lsqr"):
        fit.solve(by=Direct(most=20))


def test_closing_edges_is_an_orthogonal_projection() -> None:
    stitching, rng = Stitching(SMALL.faces, SMALL.n_vertices), np.random.default_rng(7)
    a, b = rng.normal(size=(2, 2 * len(SMALL.faces), 3))
    closed = ClosedEdges(stitching).observed
    np.testing.assert_allclose(closed(closed(a)), closed(a), atol=1e-12)
    np.testing.assert_allclose((closed(a) * b).sum(), (a * closed(b)).sum(), atol=1e-9)
    mesh = edges(SMALL.template, SMALL.faces).reshape(-1, 3)
    np.testing.assert_allclose(closed(mesh), mesh, atol=1e-13)
    centred = SMALL.template - SMALL.template.mean(axis=0)
    np.testing.assert_allclose(CentredVertices(stitching).observed(mesh), centred, atol=1e-12)


@pytest.mark.thorough
def test_k_dimensional_people_have_k_components() -> None:
    rng = np.random.default_rng(8)
    betas = rng.normal(size=(12, 10))
    people = SMALL.vertices(betas=betas)
    shapes = learn_shapes(people, SMALL.faces, 11)
    assert (shapes.explained[:10] > 1e-5).all()
    assert abs(shapes.explained[10]) < 1e-12
    np.testing.assert_allclose(shapes.explained.sum(), 1)
    np.testing.assert_allclose(shapes.betas[:, :10].std(axis=0, ddof=1), 1)
    directions = stitched_directions(shapes, SMALL.faces)
    rebuilt = shapes.template + np.einsum("nab,pb->pna", directions, shapes.betas)
    rebuilt -= rebuilt.mean(axis=1, keepdims=True)
    np.testing.assert_allclose(rebuilt, people - people.mean(axis=1, keepdims=True), atol=1e-10)


def test_mismatched_meshes_are_refused() -> None:
    true = generator()
    betas, posed = drawn(true, 3, 9)
    with pytest.raises(BadArgument, match="6 people tell up to 5 shape directions apart, not 6"):
        learn_shapes(true.vertices(betas=betas), true.faces, 6)
    with pytest.raises(BadArgument, match="must be as many"):
        PosedMeshes(posed.vertices, posed.poses[:1], posed.person)
    with pytest.raises(BadArgument, match="persons 0 to 2, no others"):
        learn(
            true,
            true.vertices(betas=betas[:3]),
            PosedMeshes(posed.vertices, posed.poses, np.full(3, 3)),
            n_betas=1,
            ridge=0.0,
        )


# SMPL's way beside SCAPE's.


def many_people(seed: int) -> np.ndarray:
    """The small body's shapes, and bumps that no shape direction has: full rank."""
    rng = np.random.default_rng(seed)
    people = SMALL.vertices(betas=rng.normal(size=(24, 10)))
    middles = SMALL.template[rng.integers(SMALL.n_vertices, size=(24, 5))]
    apart = np.linalg.norm(SMALL.template[None, :, None] - middles[:, None], axis=-1)
    bumps = np.einsum("pnc,pca->pna", np.exp(-((apart / 0.1) ** 2)), rng.normal(size=(24, 5, 3)))
    return np.asarray(people + 0.01 * bumps)


@pytest.mark.thorough
@pytest.mark.parametrize("seed", range(1))
def test_vertex_components_explain_no_less(seed: int) -> None:
    people = many_people(seed)
    vertices = explained_by_vertices(people, 23)
    triangles = explained_by_triangles(people, SMALL.faces, 23)
    assert (vertices.share >= triangles.share - 1e-12).all()
    assert (vertices.rms**2 <= triangles.rms**2 + 1e-12).all()
    assert (vertices.share - triangles.share)[1:10].max() > 1e-4
    for found in (vertices, triangles):
        assert found.share[0] == 0
        assert (np.diff(found.share) >= -1e-12).all()
        np.testing.assert_allclose(found.share[23], 1, atol=1e-9)  # 24 people span 23 dimensions
        left = found.rms[:20] ** 2 / found.rms[0] ** 2
        np.testing.assert_allclose(left, 1 - found.share[:20], atol=1e-12)


@pytest.mark.thorough
def test_smpl_adds_and_scape_multiplies_pose() -> None:
    rng = np.random.default_rng(10)
    pose, betas = rng.normal(scale=0.4, size=(24, 3)), rng.normal(size=10)
    np.testing.assert_allclose(additivity_gap(SMALL, pose, betas), 0, atol=1e-15)
    plain = scape(SMALL)
    np.testing.assert_allclose(additivity_gap(plain, pose, betas), 0, atol=1e-13)  # Q = I
    bent = replace(plain, posedirs=rng.normal(scale=0.1, size=plain.posedirs.shape))
    gap = additivity_gap(bent, pose, betas)
    assert np.linalg.norm(gap, axis=1).max() > 1e-3
    # (D - I)(Q - I), stitched: so it is bilinear for small shapes and poses
    half = additivity_gap(bent, pose / 2, betas / 2)
    np.testing.assert_allclose(half, gap / 4, atol=1e-12)
    np.testing.assert_allclose(unposed(bent, 0 * pose, 0 * betas), SMALL.template, atol=1e-13)
