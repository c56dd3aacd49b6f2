"""Where the derivative of a surface by a body's free arrays can be nonzero.

A vertex moves with its own numbers in the template, the blend shapes and the weights, and with the
joints at and above which it hangs. Where the regressor finds the joints, it also moves with the
template and the shape blend shapes of those vertices that these joints are means of.
"""

from collections.abc import Container

import numpy as np
from scipy.sparse import csc_array, csr_array, kron

from workbench.arrays import Index
from workbench.bodies.forward.arrays import SkinnedArrays
from workbench.bodies.forward.kinematics import ancestors


def pattern_by(
    body: SkinnedArrays, chosen: Index, name: str, free: Container[str]
) -> csc_array | None:
    """Where the derivative (3 n, size) of the chosen vertices (n,) by an array can be nonzero.

    It holds at any values of the arrays in `free`. None where the derivative is dense: by pose,
    betas and trans; by joints and regressor where the weights are free, so that each vertex may
    hang at any joint; by what goes through a regressor that is free itself.
    """
    (N, _, B), K = body.shapedirs.shape, len(body.parents)
    if name == "weights":
        return _blocks(body, chosen, K)
    if name == "posedirs":
        return csc_array(kron(_blocks(body, chosen, 3), np.ones((1, body.posedirs.shape[2]))))
    if name in ("joints", "J_regressor") and "weights" not in free:
        return csc_array(kron(_below(body, chosen), np.ones((3, 3 if name == "joints" else N))))
    if name not in ("template", "shapedirs") or "J_regressor" in free:
        return None
    there = _blocks(body, chosen, 3)
    if "joints" not in free and body.rest_joints is None:
        there = csc_array(there + _through_joints(body, chosen, "weights" in free))
    return there if name == "template" else csc_array(kron(there, np.ones((1, B))))


def _blocks(body: SkinnedArrays, chosen: Index, width: int) -> csc_array:
    """Each of a vertex's coordinates by all of its own numbers, `width` of them."""
    n = len(chosen)
    own = width * chosen[:, None, None] + np.arange(width)
    columns = np.broadcast_to(own, (n, 3, width)).ravel()
    starts = np.arange(0, len(columns) + 1, width)
    shape = 3 * n, width * body.n_vertices
    return csc_array(csr_array((np.ones(len(columns)), columns, starts), shape=shape))


def _through_joints(body: SkinnedArrays, chosen: Index, free_weights: bool) -> csr_array:
    """Each coordinate by those of the vertices behind the joints at and above which it hangs."""
    K = len(body.parents)
    below = csr_array(np.ones((len(chosen), K))) if free_weights else _below(body, chosen)
    means = csr_array(body.J_regressor)
    means = csr_array((np.ones(means.nnz), means.indices, means.indptr), shape=means.shape)
    return csr_array(kron(below @ means, np.ones((3, 3))))


def _below(body: SkinnedArrays, chosen: Index) -> csr_array:
    """Which vertices (n,) hang at or below which joints (K,) by the body's own weights."""
    weights = np.asarray(body.weights[chosen] != 0, dtype=float)
    return csr_array((weights @ ancestors(body.parents) > 0).astype(float))
