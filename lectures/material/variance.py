"""How much of people's shapes the first k shape directions explain, of SMPL and of SCAPE.

Of all affine spaces of k dimensions, the one through the mean along the first k principal
components is nearest to a set of points in the least-squares sense (Eckart and Young, The
Approximation of One Matrix by Another of Lower Rank, Psychometrika 1, 1936). Stitching k directions
of deformation gradients gives such a space of vertices too, so with the same centring it explains
at most what k components of vertices explain, for every k.
"""

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import ArrayLike

from workbench.arrays import Array, Index
from workbench.bodies import SkinnedBody
from workbench.bodies.triangles import TriangleBody
from workbench.geometry.triangles import Stitching, edges
from workbench.plots.palette import BLUE, FAINT, VERMILLION
from workbench.training.triangles import TriangleShapes, learn_gradient_shapes


def plot_left_over(left: Array, *, ax: Axes) -> Axes:
    """`left` (B + 1, P) m: what remains of P people without the first 0 ... B directions."""
    b = np.arange(len(left))
    ax.plot(b, 1e3 * left, color=FAINT, linewidth=0.9)
    ax.plot(b, 1e3 * left.mean(axis=1), color=VERMILLION, marker="o", label="mean of these people")
    ax.set(xlabel="shape directions used", ylabel="rms distance left (mm)", xlim=(0, b[-1]))
    ax.set_ylim(bottom=0)
    ax.legend()
    return ax


def caption_left_over(left: Array) -> str:
    """What `plot_left_over` shows."""
    mean = 1e3 * left.mean(axis=1)
    return (
        f"{left.shape[1]} held-out people at rest: the mean person is {mean[0]:.1f} mm off, one "
        f"direction leaves {mean[1]:.1f} mm, and {len(mean) - 1} leave {mean[-1]:.1f} mm. Thin "
        "lines are single people."
    )


def plot_variances(shares: Array, *, ax: Axes) -> Axes:
    """Bars of each direction's share of the variance of all, and their running sum, (B,)."""
    k = np.arange(1, len(shares) + 1)
    ax.bar(k, 100 * shares, color=BLUE, width=0.7, label="of one direction")
    ax.plot(k, 100 * np.cumsum(shares), color=VERMILLION, marker="o", label="of all up to it")
    ax.set_xticks(k)
    ax.set(xlabel="shape direction", ylabel="share of the population's variance (%)", ylim=(0, 103))
    ax.legend(loc="center right")
    return ax


def caption_variances(shares: Array) -> str:
    """What `plot_variances` shows."""
    return (
        f"Variance explained: the first direction {shares[0]:.0%}, the first two "
        f"{shares[:2].sum():.0%}, all {len(shares)} {shares.sum():.1%}. The population was made by "
        "a program; people vary in more ways."
    )


@dataclass(frozen=True, eq=False)
class ExplainedVariance:
    """How near k = 0, 1, ... shape directions come to people whose centroids were made to coincide.

    Attributes:
        share: (k + 1,), of the variance of the vertices.
        rms: (k + 1,) in metres, the distance that is left at a vertex.
    """

    share: Array
    rms: Array

    def count_for(self, share: float) -> int | None:
        """How many directions explain that share; None if all of them together do not."""
        enough = self.share >= share
        return int(np.argmax(enough)) if enough.any() else None


def explained_by_vertices(
    people: ArrayLike, most: int, others: ArrayLike | None = None
) -> ExplainedVariance:
    """What the first principal components of the vertices of people (P, N, 3) m explain.

    It is measured on `others` (Q, N, 3) about the same mean, or on the people themselves.
    """
    centred, mean = _centred(people)
    components = np.linalg.svd(centred, full_matrices=False)[2][:most]
    return _explained(_about(mean, people if others is None else others), components)


def explained_by_triangles(
    people: ArrayLike, faces: Index, most: int, others: ArrayLike | None = None
) -> ExplainedVariance:
    """The variance that principal components of deformation gradients explain, after stitching.

    Each person gets the betas that bring the vertices nearest, which explains more than betas
    trained on gradients would. The arguments are those of `explained_by_vertices`.
    """
    shapes = learn_gradient_shapes(people, faces, most)
    directions = stitched_directions(shapes, faces).reshape(-1, most).T  # centroids at 0
    _, mean = _centred(people)
    return _explained(_about(mean, people if others is None else others), directions)


def explained_gradients(people: ArrayLike, faces: Index, most: int) -> Array:
    """Shares (most + 1,) of the variance of the gradients themselves, before any stitching.

    It is what SCAPE's own principal components maximise: 9 numbers per face, where small faces
    count as much as large ones.
    """
    return np.append(0.0, np.cumsum(learn_gradient_shapes(people, faces, most).explained))


def _centred(people: ArrayLike) -> tuple[Array, Array]:
    v = np.asarray(people, dtype=float)
    v = v - v.mean(axis=1, keepdims=True)
    mean = v.mean(axis=0)
    return (v - mean).reshape(len(v), -1), mean


def _about(mean: Array, people: ArrayLike) -> Array:
    v = np.asarray(people, dtype=float)
    return np.asarray((v - v.mean(axis=1, keepdims=True) - mean).reshape(len(v), -1))


def _explained(deviations: Array, directions: Array) -> ExplainedVariance:
    """What the span of the first k rows of `directions` explains of the deviations, for every k."""
    Q = np.linalg.qr(directions.T)[0]
    along = np.cumsum((deviations @ Q) ** 2, axis=1).sum(axis=0)  # (k,)
    total = float((deviations**2).sum())
    left = np.maximum(total - np.append(0.0, along), 0.0)
    return ExplainedVariance(1 - left / total, np.sqrt(left / (deviations.size / 3)))


def additivity_gap(body: SkinnedBody | TriangleBody, pose: Array, betas: Array) -> Array:
    """What shape and pose do together minus what each does alone, (N, 3) m on the unposed surface.

    T(pose, betas) - T(pose, 0) - T(0, betas) + T(0, 0), T being the surface before the joints
    turn it. It is zero for SMPL, whose blend shapes are added, and (D - I)(Q - I) stitched for
    SCAPE, whose deformations are multiplied.
    """
    still, mean = np.zeros_like(pose), np.zeros_like(betas)
    both, bent, shaped, neither = (
        unposed(body, *at) for at in ((pose, betas), (pose, mean), (still, betas), (still, mean))
    )
    return both - bent - shaped + neither


def unposed(body: SkinnedBody | TriangleBody, pose: Array, betas: Array) -> Array:
    """The surface (N, 3) m deformed by pose and shape, before any joint turns it."""
    if isinstance(body, TriangleBody):
        at = body.arithmetic.evaluate(pose, betas)
        return np.asarray(at.of.placed(body.stitching.edge_sums(at.shaped)) + at.of.root)
    bent = body.posedirs @ body.kinematics.motion(pose, betas).features
    return np.asarray(body.template + body.shapedirs @ betas + bent)


def stitched_directions(shapes: TriangleShapes, faces: Index) -> Array:
    """How each beta moves the stitched vertices about their mean, (N, 3, B) m per unit."""
    stitching = Stitching(faces, len(shapes.template))
    e = edges(shapes.template, faces)
    moved = np.einsum("facb,fic->bfia", shapes.shapedirs, e, optimize=True)
    found = [stitching.vertices(one) for one in moved]
    return np.stack(found, axis=2) if found else np.zeros((*shapes.template.shape, 0))
