"""Where the derivative of a surface by a body's free arrays can be nonzero.

A vertex moves with its own numbers in the template, the blend shapes and the weights, and with the
joints at and above which it hangs. Where the regressor finds the joints, it also moves with the
template and the shape blend shapes of those vertices that these joints are means of.
"""

from collections.abc import Container

import numpy as np
from scipy.sparse import csc_array, csr_array, kron

from workbench.bodies.forward.freed_numbers import FreedSurface


def pattern_by(of: FreedSurface, name: str, free: Container[str]) -> csc_array | None:
    """The pattern (3 n, size) of the derivative by an array where those named in `free` are.

    It holds at any values of these. None where the derivative is dense: by pose, betas and trans;
    by joints and regressor where the weights are free, so that each vertex may hang at any joint;
    by what goes through a regressor that is free itself.
    """
    (N, _, B), K = of.body.shapedirs.shape, len(of.body.parents)
    if name == "weights":
        return _blocks(of, K)
    if name == "posedirs":
        return csc_array(kron(_blocks(of, 3), np.ones((1, of.body.posedirs.shape[2]))))
    if name in ("joints", "J_regressor") and "weights" not in free:
        return csc_array(kron(_below(of), np.ones((3, 3 if name == "joints" else N))))
    if name not in ("template", "shapedirs") or "J_regressor" in free:
        return None
    there = _blocks(of, 3)
    if "joints" not in free and of.body.rest_joints is None:
        there = csc_array(there + _through_joints(of, "weights" in free))
    return there if name == "template" else csc_array(kron(there, np.ones((1, B))))


def _blocks(of: FreedSurface, width: int) -> csc_array:
    """Each of a vertex's coordinates by all of its own numbers, `width` of them."""
    n = len(of.chosen)
    own = width * of.chosen[:, None, None] + np.arange(width)
    columns = np.broadcast_to(own, (n, 3, width)).ravel()
    starts = np.arange(0, len(columns) + 1, width)
    shape = 3 * n, width * of.body.n_vertices
    return csc_array(csr_array((np.ones(len(columns)), columns, starts), shape=shape))


def _through_joints(of: FreedSurface, free_weights: bool) -> csr_array:
    """Each coordinate by those of the vertices behind the joints at and above which it hangs."""
    K = len(of.body.parents)
    below = csr_array(np.ones((len(of.chosen), K))) if free_weights else _below(of)
    means = csr_array(of.body.J_regressor)
    means = csr_array((np.ones(means.nnz), means.indices, means.indptr), shape=means.shape)
    return csr_array(kron(below @ means, np.ones((3, 3))))


def _below(of: FreedSurface) -> csr_array:
    """Which vertices (n,) hang at or below which joints (K,) by the body's own weights."""
    weights = np.asarray(of.body.weights[of.chosen] != 0, dtype=float)
    return csr_array((weights @ of.ancestors > 0).astype(float))
