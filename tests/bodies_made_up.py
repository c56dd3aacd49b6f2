"""Made-up bodies in the layout of SMPL's files: random numbers, nobody's licence."""

from functools import cache

import numpy as np
from scipy.sparse import csr_array

from workbench import SkinnedBody
from workbench.bodies.files.joint_names import joint_names

SMPL_NAMES = joint_names(24)
SMPL_PARENTS = (-1, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 9, 12, 13, 14, 16, 17, 18, 19, 20, 21)


def random_body(
    seed: int = 0,
    *,
    n_vertices: int = 30,
    n_joints: int = 5,
    n_betas: int = 3,
    parents: tuple[int, ...] | None = None,
    joint_names: tuple[str, ...] | None = None,
    bound: bool = False,
) -> SkinnedBody:
    """A body of random arrays on a random tree; `bound` draws its template in a random pose."""
    rng = np.random.default_rng(seed)
    N, K, B = n_vertices, n_joints, n_betas
    if parents is None:
        parents = (-1, *(int(rng.integers(k)) for k in range(1, K)))
    return SkinnedBody(
        template=rng.normal(scale=0.5, size=(N, 3)),
        shapedirs=rng.normal(scale=0.02, size=(N, 3, B)),
        posedirs=rng.normal(scale=0.01, size=(N, 3, 9 * (K - 1))),
        J_regressor=csr_array(_rows(rng, K, N, min(N, 4))),
        weights=_rows(rng, N, K, min(K, 4)),
        parents=parents,
        faces=rng.integers(N, size=(2 * N, 3)),
        joint_names=joint_names or tuple(f"joint{k}" for k in range(K)),
        bound_in=rng.normal(scale=0.3, size=(K, 3)) if bound else None,
        name="made-up",
    )


@cache
def smpl_like_body(n_vertices: int = 60, n_betas: int = 4, seed: int = 1) -> SkinnedBody:
    """A random body on SMPL's tree of 24 joints, with its names."""
    return random_body(
        seed,
        n_vertices=n_vertices,
        n_joints=24,
        n_betas=n_betas,
        parents=SMPL_PARENTS,
        joint_names=SMPL_NAMES,
    )


def _rows(rng: np.random.Generator, rows: int, columns: int, nonzeros: int) -> np.ndarray:
    """(rows, columns), each row `nonzeros` positive numbers that sum to one."""
    array = np.zeros((rows, columns))
    for row in array:
        where = rng.choice(columns, size=nonzeros, replace=False)
        row[where] = rng.dirichlet(np.ones(nonzeros))
    return array


@cache
def tube_body(rings: int = 5, n_betas: int = 2, seed: int = 0) -> SkinnedBody:
    """A closed crooked tube of rings of four vertices and two caps, along a chain of three joints.

    22 vertices and 40 faces by default; small enough for everything to be checked.
    """
    rng = np.random.default_rng(seed)
    heights = np.linspace(0.0, 1.0, rings)
    corners = 0.15 * np.array([[1.0, 0, 0], [0, 0, -1], [-1, 0, 0], [0, 0, 1]])
    body = (corners + heights[:, None, None] * [0, 1, 0]).reshape(-1, 3)
    template = np.vstack([body, [[0.0, -0.1, 0], [0, 1.1, 0]]])
    template += rng.normal(scale=0.02, size=template.shape)
    N, faces = len(template), []
    for ring in range(rings - 1):
        for side in range(4):
            a, b = 4 * ring + side, 4 * ring + (side + 1) % 4
            faces += [[a, b, a + 4], [b, b + 4, a + 4]]
    for side in range(4):
        a, b = side, (side + 1) % 4
        faces += [[N - 2, b, a], [N - 1, a + N - 6, b + N - 6]]
    at = np.array([0.0, 0.35, 0.7])
    nearness = np.exp(-(((template[:, 1:2] - at - 0.15) / 0.2) ** 2))
    ring_of = [np.flatnonzero(abs(heights - y) == abs(heights - y).min())[0] for y in at]
    J = np.zeros((3, N))
    for k, ring in enumerate(ring_of):
        J[k, 4 * ring : 4 * ring + 4] = 0.25
    return SkinnedBody(
        template=template,
        shapedirs=rng.normal(scale=0.02, size=(N, 3, n_betas)),
        posedirs=np.zeros((N, 3, 18)),
        J_regressor=csr_array(J),
        weights=nearness / nearness.sum(axis=1, keepdims=True),
        parents=(-1, 0, 1),
        faces=np.array(faces),
        joint_names=("root", "middle", "end"),
        name="tube",
    )
