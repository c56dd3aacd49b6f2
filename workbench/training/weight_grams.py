"""The least-squares problem of each vertex's weights, everything else being held."""

from collections.abc import Sequence

import numpy as np

from workbench.arrays import Array
from workbench.training.estimate import Estimate
from workbench.training.objective import Objective, centred
from workbench.training.registrations import over_halves, pieces
from workbench.training.skinning_pass import SkinningPass


def weight_grams(objective: Objective, estimate: Estimate) -> tuple[Array, Array]:
    """Sums over registrations of B'B (N, K, K) and B'(v - trans) (N, K) for each vertex, whitened.

    Column k of B (3, K) is where joint k alone would take the vertex, so that posed_i = B w_i.
    """
    N, K = estimate.weights.shape

    def sums(some_of: Sequence[slice]) -> tuple[Array, Array]:
        grams, rights = np.zeros((N, K, K)), np.zeros((N, K))
        for some in some_of:
            batch = objective.registrations.read(some)
            passed = SkinningPass.of(estimate, batch.some, batch.subject)
            _, trans = centred(batch, batch.vertices - passed.points)
            B = passed.by_each()  # (c, N, K, 3)
            trusted = batch.confidence[..., None, None] * B
            flat = B.transpose(1, 2, 0, 3).reshape(N, K, -1)
            flat_trusted = trusted.transpose(1, 2, 0, 3).reshape(N, K, -1)
            grams += flat_trusted @ flat.swapaxes(1, 2)
            rights += np.einsum("jnka,jna->nk", trusted, batch.vertices - trans[:, None])
        return grams, rights

    found = over_halves(sums, pieces(objective.registrations))
    grams, rights = (np.sum([one[part] for one in found], axis=0) for part in (0, 1))
    scale = objective.sigmas.data**-2
    return scale * grams, scale * rights
