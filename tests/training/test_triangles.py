"""Learning SCAPE and BlendSCAPE back from what they generated, and SMPL's way beside theirs."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from numpy.typing import ArrayLike
from scipy.linalg import lstsq
from scipy.sparse.linalg import LinearOperator

from builder.triangle_learning import LSQR, Lsqr, learn_pose_deformations
from tests.bodies_made_up import tube_body
from workbench.arrays import Array
from workbench.bodies.triangles import TriangleBody, blend_scape, scape
from workbench.errors import BadArgument
from workbench.training.triangles import (
    PosedMeshes,
    learn_gradient_shapes,
)


class Direct(Lsqr):
    """By QR with pivots of the matrix itself: exact to the last digit, even for unknowns that
    blended rotations show a million times less clearly than the others.
    """

    def solve(self, A: LinearOperator, b: Array) -> Array:
        """The minimum x."""
        return np.asarray(lstsq(A @ np.eye(A.shape[1]), b, cond=1e-13, lapack_driver="gelsy")[0])


def learn(
    start: TriangleBody,
    people: ArrayLike,
    posed: PosedMeshes,
    *,
    n_betas: int,
    ridge: float,
    by: Lsqr = LSQR,
) -> TriangleBody:
    """Learn SCAPE or BlendSCAPE, depending on the weights of `start`, from two sets of meshes.

    `people` (P, N, 3) m at rest give the template and D; `posed` meshes of them give Q, with the
    betas that each person has at rest. SCAPE also has one set of people and one of poses.
    """
    shapes = learn_gradient_shapes(people, start.faces, n_betas)
    shaped = replace(start, template=shapes.template, shapedirs=shapes.shapedirs)
    return learn_pose_deformations(shaped, posed, shapes.betas, ridge=ridge, by=by)


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


@pytest.mark.thorough
@pytest.mark.parametrize(
    "blended",
    [False, True],
    ids=["SCAPE", "BlendSCAPE"],
)
def test_generators_are_learned_back(blended: bool) -> None:
    true = generator(blended)
    betas, posed = drawn(true, 50, 1)
    people = true.vertices(betas=betas)
    trained = learn(
        untrained(true), people, posed, n_betas=B, ridge=0.0, by=Direct()
    )  # LSQR: minutes
    # the learned betas are the true ones in another basis
    learned = learn_gradient_shapes(people, true.faces, B).betas
    change = np.linalg.lstsq(betas, learned)[0]
    rng = np.random.default_rng(2)
    new, poses = rng.normal(size=(20, B)), rng.normal(scale=0.5, size=(20, 3, 3))
    apart = trained.vertices(poses, new @ change) - true.vertices(poses, new)
    before = replace(trained, posedirs=0 * trained.posedirs).vertices(poses, new @ change)
    assert np.linalg.norm(apart, axis=-1).max() < 1e-8
    assert np.linalg.norm(before - true.vertices(poses, new), axis=-1).max() > 0.01


def test_mismatched_meshes_are_refused() -> None:
    true = generator()
    betas, posed = drawn(true, 3, 9)
    with pytest.raises(BadArgument, match="6 people tell up to 5 shape directions apart, not 6"):
        learn_gradient_shapes(true.vertices(betas=betas), true.faces, 6)
    with pytest.raises(BadArgument, match="must be as many"):
        PosedMeshes(posed.vertices, posed.poses[:1], posed.person)
