"""Bodies in SMPL's shape made of random numbers, the problems that are timed on them, and linear
blend skinning as one would write it, in NumPy or in jax.numpy.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.sparse import csr_array

import workbench as wb
from workbench.arrays import Array
from workbench.bodies.catalogue import load_skinned

BODIES = ("6890", "small", "default", "full")
SIGMA = 0.01  # m, of the observed vertices
PARENTS = (-1, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 9, 12, 13, 14, 16, 17, 18, 19, 20, 21)
JOINTS, BETAS, WEIGHTS = len(PARENTS), 10, 4
POSE_SIGMA, BETAS_SIGMA, TRANS_SIGMA = 0.3, 1.0, 0.1  # rad, 1, m: how people differ


@dataclass(frozen=True, eq=False)
class Case:
    """The vertices of a body, all of them seen; the unknowns are its pose, betas and trans."""

    name: str
    body: wb.SkinnedBody
    problem: wb.Problem
    observed: Array  # (N, 3) m

    @property
    def fixed(self) -> Array:
        """The observed vertices, flat."""
        return self.observed.ravel()

    def vertices(self, x: Array) -> Array:
        """(N, 3) m at flat unknowns."""
        return self.body.vertices(*self.problem.free.unpack(x).values())

    def seeing(self, x: Array) -> "Case":
        """The same with the vertices of somebody else observed."""
        return replace(self, observed=self.vertices(x))

    def people(self, count: int, seed: int = 0) -> list[Array]:
        """Random unknowns, flat."""
        rng = np.random.default_rng(seed)
        sigma = {"pose": POSE_SIGMA, "betas": BETAS_SIGMA, "trans": TRANS_SIGMA}
        return [
            np.concatenate([rng.normal(0, sigma[b.name], b.size) for b in self.problem.free.blocks])
            for _ in range(count)
        ]


def case_of(name: str, body: wb.SkinnedBody) -> Case:
    """Any body; each call makes a body of its own of the same arrays, sharing no caches."""
    body = replace(body)
    symbols = [block.symbol for block in body.blocks()]
    observed = wb.Block("observed", (body.n_vertices, 3), "m")
    residual = wb.residuals.vertices(body.points(*symbols), observed.symbol, sigma=SIGMA)
    problem = wb.Problem([residual], free=("pose", "betas", "trans"))
    return Case(name, body, problem, body.template)


def random_body(n_vertices: int, seed: int = 0) -> wb.SkinnedBody:
    """Dense pose directions and four weights a vertex, as a file of SMPL has them."""
    rng = np.random.default_rng(seed)
    N, K = n_vertices, JOINTS
    posedirs = rng.standard_normal((N, 3, 9 * (K - 1)))
    posedirs *= 0.01
    return wb.SkinnedBody(
        template=rng.normal(0, 0.5, (N, 3)),
        shapedirs=rng.normal(0, 0.02, (N, 3, BETAS)),
        posedirs=posedirs,
        J_regressor=csr_array(_shares(rng, K, N, min(N, 30))),
        weights=_shares(rng, N, K, WEIGHTS),
        parents=PARENTS,
        faces=rng.integers(N, size=(2 * N, 3)),
        joint_names=tuple(f"joint{k}" for k in range(K)),
        name=f"random {N}",
    )


def body_called(name: str) -> wb.SkinnedBody:
    """An embedded body by its name, or a random one by its number of vertices."""
    return random_body(int(name)) if name.isdigit() else load_skinned(name)


def _shares(rng: np.random.Generator, rows: int, columns: int, filled: int) -> Array:
    """Random rows with few entries above zero, which sum to one."""
    shares = np.zeros((rows, columns))
    for row in shares:
        row[rng.choice(columns, filled, replace=False)] = rng.dirichlet(np.ones(filled))
    return shares


def arrays_of(body: wb.SkinnedBody) -> tuple[Array, ...]:
    """What `plain_vertices` reads, in the order that matrix products like.

    Template (3 N,), shapedirs (B, 3 N), posedirs (9 (K - 1), 3 N), weights (N, K), and the joints,
    which follow the betas directly: (3 K,) and (B, 3 K).
    """
    N, K, B = body.n_vertices, body.n_joints, body.n_betas
    moved = body.J_regressor @ body.shapedirs.reshape(N, 3 * B)  # (K, 3 B)
    return (
        body.template.ravel(),
        np.ascontiguousarray(body.shapedirs.reshape(3 * N, B).T),
        np.ascontiguousarray(body.posedirs.reshape(3 * N, -1).T),
        body.weights,
        (body.J_regressor @ body.template).ravel(),
        np.ascontiguousarray(moved.reshape(3 * K, B).T),
    )


def plain_vertices(xp: Any, arrays: Any, parents: tuple[int, ...], x: Any) -> Any:
    """(N, 3) m at x = (pose, betas, trans), flat, computed by the module xp; arrays in order."""
    template, shapedirs, posedirs, weights, joints, joint_shapedirs = arrays
    K, B = len(parents), len(shapedirs)
    pose, betas, trans = x[: 3 * K].reshape(K, 3), x[3 * K : 3 * K + B], x[3 * K + B :]
    R = _rotations(xp, pose)
    rest = (joints + betas @ joint_shapedirs).reshape(K, 3)
    turned, at = [R[0]], [rest[0]]
    for k in range(1, K):
        parent = parents[k]
        turned.append(turned[parent] @ R[k])
        at.append(turned[parent] @ (rest[k] - rest[parent]) + at[parent])
    Q, t = xp.stack(turned), xp.stack(at)
    shift = t - xp.einsum("kdc,kc->kd", Q, rest)
    G = xp.concatenate([Q, shift[:, :, None]], axis=2).reshape(K, 12)
    features = (R[1:] - xp.eye(3)).reshape(-1)
    v = (template + betas @ shapedirs + features @ posedirs).reshape(-1, 3)
    M = (weights @ G).reshape(-1, 3, 4)
    return xp.einsum("ndc,nc->nd", M[:, :, :3], v) + M[:, :, 3] + trans


def _rotations(xp: Any, pose: Any) -> Any:
    """exp([pose_k]x), (K, 3, 3), by Rodrigues' formula, smooth at zero."""
    t = xp.sqrt((pose**2).sum(axis=1) + 1e-32)[:, None, None]
    zero = xp.zeros_like(pose[:, 0])
    a, b, c = pose[:, 0], pose[:, 1], pose[:, 2]
    S = xp.stack([zero, -c, b, c, zero, -a, -b, a, zero], axis=1).reshape(-1, 3, 3)
    return xp.eye(3) + xp.sin(t) / t * S + 2 * (xp.sin(t / 2) / t) ** 2 * (S @ S)
