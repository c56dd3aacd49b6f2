"""How many eigenvalues of a large symmetric matrix are negative, found part after part.

Sylvester's law of inertia: where unknowns u are eliminated from a symmetric matrix, it has as many
negative eigenvalues as its block of u and the Schur complement of this block have together
(Haynsworth, Determination of the inertia of a partitioned Hermitian matrix, Linear Algebra and its
Applications 1, 1968). A row c that ties parts together, or forbids a direction, becomes one more
unknown, with -1 or 0 on the diagonal, and is eliminated last.
"""

import numpy as np
from scipy.sparse import csr_array

from workbench.arrays import Array, Index, Mask
from workbench.diagnostics.parts import Parts
from workbench.diagnostics.row_spaces import held, row_space, tangent_space

LEAST = 1e-15  # size of an eigenvalue by which is divided, in columns of length 1


def negative_eigenvalues(
    parts: Parts, J: csr_array, signs: Array, shift: Array, forbidden: Array
) -> int:
    """How many eigenvalues of J' diag(signs) J - diag(shift) are negative along what may move.

    J (m, n) is the Jacobian that fell into these parts, in columns of length 1, `signs` (m,) are 1
    or -1, and along the rows `forbidden` (k, n) nothing may move.
    """
    n = J.shape[1]
    fixed, rest, home = _at_home(parts, forbidden)
    tied = np.zeros(J.shape[0], dtype=bool)
    tied[parts.tie_rows[parts.tie_rows < J.shape[0]]] = True
    others = csr_array(J[~tied])
    weighted = csr_array(
        (
            others.data * np.repeat(signs[~tied], np.diff(others.indptr)),
            others.indices,
            others.indptr,
        ),
        shape=others.shape,
    )
    S = csr_array(others.T @ weighted)
    border = row_space(rest[home < 0])
    W = np.vstack([J[tied].toarray(), border])
    shared = parts.shared[~fixed[parts.shared]]
    corner = np.diag(np.concatenate([-signs[tied], np.zeros(len(border))]))
    left = np.block([[_block(S, shared, shift), W[:, shared].T], [W[:, shared], corner]])
    found = -int(np.sum(signs[tied] > 0)) - len(border)
    for k, own in enumerate(parts.own):
        u = own[~fixed[own]]
        Z = tangent_space(rest[home == k][:, u])
        values, V = np.linalg.eigh(Z.T @ _block(S, u, shift) @ Z)
        across = (Z @ V).T @ np.hstack([S[u][:, shared].toarray(), W[:, u].T])
        found += int(np.sum(values < 0))
        values = np.where(values < 0, np.minimum(values, -LEAST), np.maximum(values, LEAST))
        left -= across.T @ (across / values[:, None])
    return found + int(np.sum(np.linalg.eigvalsh(left) < 0)) if n else 0


def _at_home(parts: Parts, forbidden: Array) -> tuple[Mask, Array, Index]:
    """Which unknowns are fixed (n,), what else is forbidden (k, n), and in which part that is.

    -1 stands for rows that read several parts, or shared unknowns.
    """
    fixed, rest = held(forbidden)
    part_of = np.full(forbidden.shape[1], -1)
    for k, own in enumerate(parts.own):
        part_of[own] = k
    read = [np.unique(part_of[row != 0]) for row in rest]
    home = np.array([k[0] if len(k) == 1 else -1 for k in read], dtype=np.int64)
    return fixed, rest, home


def _block(S: csr_array, places: Index, shift: Array) -> Array:
    return np.asarray(S[places][:, places].toarray() - np.diag(shift[places]))
