"""The normal equations of training, which are never formed: products and a preconditioner.

A `Linearization` stores its Jacobian, and `LevenbergMarquardt` factorizes J'J. In training every
pose is coupled with every number of every vertex, so the factors fill in: their size grows with
vertices times registrations. A product needs one piece of the registrations at a time.

They are solved by conjugate gradients within a trust region (Steihaug 1983), on named arrays. The
step grows with every iteration. It ends where it leaves the region, where the residual is small
enough, or where rounding leaves no curvature.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, cached_property, partial
from math import inf, sqrt

import numpy as np
import scipy.linalg

from workbench.arrays import Array, Mask
from workbench.geometry.rotation import crossed
from workbench.training.blend_shapes import MaskedCholesky
from workbench.training.estimate import Change, Estimate, SkinningPass
from workbench.training.objective import Objective, centred, trusted, weight_grams
from workbench.training.registrations import Batch, over_halves, pieces

Operator = Callable[[Change], Change]
KEPT_BYTES = 2**32  # kept between products; where more would be needed, it is computed anew
BYTES_PER_VERTEX = 160  # of a vertex in a pose: its blended rotation, place at rest, target
RIDGE = 1e-10  # of the mean diagonal, so that a block that nothing is known of has an inverse


@dataclass(frozen=True, eq=False)
class TrustRegionStep:
    """A step of conjugate gradients.

    Attributes:
        change: the change of each name.
        length: the length of the step in the norm of the preconditioner.
        predicted: the decrease of the cost that the linear model predicts.
        iterations: the number of products.
        inside: whether the step is shorter than the trust region's radius.
    """

    change: Change
    length: float
    predicted: float
    iterations: int
    inside: bool


def steihaug(
    product: Operator,
    preconditioned: Operator,
    negative_gradient: Change,
    *,
    radius: float = inf,
    tolerance: float = 1e-10,
    most: int = 500,
) -> TrustRegionStep:
    """The step x that minimises g . x + x . A x / 2 within the radius, for the gradient g.

    `tolerance` is on |r| / |g| in the norm of the preconditioner, `most` on the iterations.
    """
    x = {name: np.zeros_like(g) for name, g in negative_gradient.items()}
    r = negative_gradient
    z = preconditioned(r)
    p = z
    rz = first = dot(r, z)
    xx, xp, pp = 0.0, 0.0, rz  # squared lengths in the preconditioner's norm
    predicted, iterations = 0.0, 0
    while iterations < most and rz > tolerance**2 * first and rz > 0:
        Ap = product(p)
        curvature = dot(p, Ap)
        if curvature <= 0:
            break
        alpha = rz / curvature
        ahead = xx + 2 * alpha * xp + alpha**2 * pp
        iterations += 1
        if ahead > radius**2:
            alpha = (-xp + sqrt(max(xp**2 + pp * (radius**2 - xx), 0.0))) / pp
            x = plus(x, p, alpha)
            predicted += alpha * rz - 0.5 * alpha**2 * curvature
            return TrustRegionStep(x, radius, predicted, iterations, inside=False)
        x, r = plus(x, p, alpha), plus(r, Ap, -alpha)
        predicted += 0.5 * alpha * rz
        z = preconditioned(r)
        rz, before = dot(r, z), rz
        beta = rz / before
        xx, xp, pp = ahead, beta * (xp + alpha * pp), rz + beta**2 * pp
        p = plus(z, p, beta)
    return TrustRegionStep(x, sqrt(xx), predicted, iterations, inside=True)


def dot(a: Change, b: Change) -> float:
    """The inner product of two changes."""
    return sum(float(np.vdot(a[name], b[name])) for name in a)


def plus(a: Change, b: Change, share: float) -> Change:
    """The change a + share b."""
    return {name: a[name] + share * b[name] for name in a}


BatchPass = tuple[Batch, SkinningPass]


@dataclass(frozen=True, eq=False)
class NormalEquations:
    """(J'J) step = -gradient for the named parts of an estimate; a product passes over the data.

    Weights change only where they are above zero, and their sums stay one.
    """

    objective: Objective
    estimate: Estimate
    names: tuple[str, ...]

    @cached_property
    def support(self) -> Mask:
        """Where weights may change, (N, K)."""
        return self.estimate.weights > 0

    @cached_property
    def negative_gradient(self) -> Change:
        """Minus the gradient of the cost."""
        prior = self.objective.prior_negative_gradient(self.estimate, self.names)

        def of_data(some: Sequence[slice]) -> Change:
            data = self.estimate.zero_change(self.names)
            for skinning, cotangent, _ in self.objective.residuals(self.estimate, some):
                skinning.adjoint(cotangent, data)
            return data

        data = over_halves(of_data, pieces(self.objective.registrations))
        return self._sum(prior, data)

    def product(self, change: Change) -> Change:
        """J'J times a change."""

        def of_data(passes: Sequence[Callable[[], BatchPass]]) -> Change:
            data = self.estimate.zero_change(self.names)
            for evaluate in passes:
                batch, skinning = evaluate()
                moved, _ = centred(batch, skinning.tangent(change))
                skinning.adjoint(trusted(batch, moved), data)
            return data

        data = over_halves(of_data, self._passes)
        return self._sum(self.objective.prior_hessian_product(self.estimate, change), data)

    @cached_property
    def _passes(self) -> list[Callable[[], BatchPass]]:
        """A function for each pass, which returns it from memory or, if there are many, anew."""
        source = self.objective.registrations

        def evaluated(some: slice) -> BatchPass:
            batch = source.read(some)
            return batch, SkinningPass.of(self.estimate, some, batch.subject)

        anew: list[Callable[[], BatchPass]] = [partial(evaluated, some) for some in pieces(source)]
        small = len(source.subject) * source.n_vertices * BYTES_PER_VERTEX < KEPT_BYTES
        return [cache(evaluate) for evaluate in anew] if small else anew

    def _sum(self, prior: Change, of_data: list[Change]) -> Change:
        scale = self.objective.sigmas.data**-2
        total = {name: prior[name] + scale * sum(d[name] for d in of_data) for name in self.names}
        if "weights" in total:
            total["weights"] = within(total["weights"], self.support)
        if "posedirs" in total and self.objective.locality is not None:
            total["posedirs"] *= self.objective.locality[:, None]
        return total

    def preconditioned(self, change: Change) -> Change:
        """Approximately the inverse of J'J times a change.

        It would be exact if blended rotations were rotations, and if the names were independent.
        """
        step: Change = {}
        if {"templates", "posedirs"} & set(self.names):
            step |= self._surfaces(change)
        if "joints" in self.names:
            joints, X = change["joints"], self._template_response
            if X is not None:
                at_rest = change["templates"].reshape(len(X), -1, 1)
                joints = joints - (X.swapaxes(1, 2) @ at_rest).reshape(joints.shape)
            step["joints"] = _solved(self._joint_blocks, joints)
            if X is not None:
                answer = X @ step["joints"].reshape(len(X), -1, 1)
                step["templates"] = step["templates"] - answer.reshape(change["templates"].shape)
        if "poses" in self.names:
            step["poses"] = _solved(self._pose_blocks, change["poses"])
        if "weights" in self.names:
            pulled = within(change["weights"], self.support)
            solved = np.stack([L @ g for L, g in zip(self._weight_blocks, pulled, strict=True)])
            step["weights"] = solved
        return {name: step[name] for name in self.names}

    def _surfaces(self, change: Change) -> Change:
        """Templates and posedirs: one matrix for all coordinates of all vertices.

        Each vertex and its mirror image are split into their symmetric and antisymmetric parts.
        """
        columns = []
        if "templates" in self.names:
            columns.append(change["templates"].transpose(1, 2, 0))
        if "posedirs" in self.names:
            columns.append(change["posedirs"])
        x = np.concatenate(columns, axis=2)
        mirror = self.objective.mirror
        if self.objective.locality is not None and "posedirs" in self.names:
            solution = self._local_factors.solved(x)
        elif mirror is None or "templates" not in self.names:
            solution = _by_cholesky(self._gram_factors[0], x)
        else:
            other = mirror.directions(x)
            even, odd = self._gram_factors
            solution = _by_cholesky(even, (x + other) / 2) + _by_cholesky(odd, (x - other) / 2)
        if "templates" not in self.names:
            return {"posedirs": solution}
        S = len(self.estimate.templates)
        parts: Change = {"templates": solution[:, :, :S].transpose(2, 0, 1)}
        if "posedirs" in self.names:
            parts["posedirs"] = solution[:, :, S:]
        return parts

    @cached_property
    def _gram_factors(self) -> tuple[Array, Array]:
        """Cholesky factors without and with E_Y."""
        gram, odd = self._grams
        return scipy.linalg.cholesky(gram, lower=True), scipy.linalg.cholesky(odd, lower=True)

    @cached_property
    def _local_factors(self) -> MaskedCholesky:
        """Where posedirs are local: one factor for each set of features.

        It is that of the mean of the sums with E_Y and without.
        """
        own = self.objective.locality
        assert own is not None  # or nobody asks for these factors
        if "templates" in self.names:
            own = np.concatenate([np.ones((len(own), len(self.estimate.templates)), bool), own], 1)
        return MaskedCholesky.of(np.mean(self._grams, axis=0), own)

    @cached_property
    def _grams(self) -> tuple[Array, Array]:
        """The sums over registrations of [subject, features], without and with E_Y."""
        S, s = len(self.estimate.templates), self.objective.sigmas
        columns = []
        if "templates" in self.names:
            columns.append(np.eye(S)[self.objective.registrations.subject])
        if "posedirs" in self.names:
            columns.append(self.estimate.posing.features)
        A = np.concatenate(columns, axis=1)
        gram = A.T @ A / s.data**2
        surfaces = np.zeros(len(gram))
        surfaces[: S if "templates" in self.names else 0] = 1
        gram += np.diag((1 - surfaces) / s.posedirs**2)
        if self.objective.template is not None:
            free = self.objective.freedom
            gram += np.diag(surfaces * (s.subjects**-2 if free is None else free.scale))
        odd = gram + np.diag(4 * surfaces / s.symmetry**2)
        even, odd = (g + RIDGE * np.trace(g) / len(g) * np.eye(len(g)) for g in (gram, odd))
        return even, odd

    @cached_property
    def _joint_blocks(self) -> Array:
        """The inverse blocks of the joints, (S, 3 K, 3 K)."""
        S, K = self.estimate.joints.shape[:2]
        s = self.objective.sigmas
        below = self._subtree_weights
        D = self.estimate.posing.levers  # (J, K, 3, 3)
        counts = np.bincount(self.objective.registrations.subject)
        blocks = np.zeros((S, 3 * K, 3 * K))
        for j, subject in enumerate(self.objective.registrations.subject):
            flat = D[j].transpose(1, 0, 2).reshape(3, 3 * K)
            blocks[subject] += flat.T @ flat
        blocks *= np.kron(below.T @ below, np.ones((3, 3)))
        if self._template_response is not None:
            for n, block, X in zip(counts, blocks, self._template_response, strict=True):
                block -= n * (X.T @ X)
        blocks /= s.data**2
        precision = 1 / s.rings**2
        if self.objective.mirror is not None:
            precision += 2 / s.joint_symmetry**2
        inverses = _inverses(blocks + precision * np.eye(3 * K))
        if not precision:  # no registration shows about which point the root turns, so it stays
            inverses[:, :3] = inverses[:, :, :3] = 0
        return inverses

    @cached_property
    def _subtree_weights(self) -> Array:
        """Each vertex's weight at or below each joint, less the mean over vertices, (N, K)."""
        weights = self.estimate.subtree_weights
        return np.asarray(weights - weights.mean(axis=0))

    @cached_property
    def _template_response(self) -> Array | None:
        """How a template answers best when its joints move, (S, 3 N, 3 K), with opposite sign.

        Skinning shifts vertex i by sum_m c_im D_m j_m, and M_i t_i can compensate for that. The
        best t over a subject's n registrations is the mean of M_i' sum_m c_im D_m j_m, as M is
        nearly a rotation. Without this, joints and templates could only be found in turn.
        """
        if not {"templates", "joints"} <= set(self.names):
            return None
        W, subject = self.estimate.weights, self.objective.registrations.subject
        weights = self._subtree_weights
        (N, K), S = W.shape, len(self.estimate.templates)
        response = np.empty((S, N, 3, K, 3))
        D, R = self.estimate.posing.levers, self.estimate.posing.world
        for s in range(S):
            own = np.flatnonzero(subject == s)
            product = np.einsum("jkca,jmcb->kamb", R[own], D[own], optimize=True) / len(own)
            shifts = (W @ product.reshape(K, -1)).reshape(N, 3, K, 3)
            response[s] = shifts * weights[:, None, :, None]
        return response.reshape(S, 3 * N, 3 * K)

    @cached_property
    def _pose_blocks(self) -> Array:
        """The inverse blocks of the poses, for small turns of each joint, (J, 3 K, 3 K)."""
        J, K, _ = self.estimate.poses.shape
        blocks, prior = np.empty((J, 3 * K, 3 * K)), self.objective.pose_prior

        def fill(some_of: Sequence[slice]) -> None:
            for some in some_of:
                batch = self.objective.registrations.read(some)
                share = batch.trust
                for j in range(len(batch.subject)):
                    row = batch.some.start + j
                    own, subject = slice(row, row + 1), batch.subject[j : j + 1]
                    skinning = SkinningPass.of(self.estimate, own, subject)
                    arms = skinning.lever_arms()[0]
                    turns = -crossed(arms) @ skinning.posing.above[0]  # (N, K, 3, 3)
                    turns[:, 1:] += skinning.blend_shape_turn_derivatives()[0]
                    turns -= np.average(turns, axis=0, weights=share[j])
                    rows = turns.transpose(0, 2, 1, 3).reshape(-1, 3 * K)
                    blocks[row] = rows.T @ (np.repeat(share[j], 3)[:, None] * rows)

        over_halves(fill, pieces(self.objective.registrations))
        precision = 0.0 if prior is None else prior.blocks(self.estimate.poses)
        return _inverses(blocks / self.objective.sigmas.data**2 + precision)

    @cached_property
    def _weight_blocks(self) -> Array:
        """The inverse blocks of the weights, (N, K, K), within their support and sum."""
        grams = weight_grams(self.objective, self.estimate)[0]
        grams += np.eye(grams.shape[1]) / self.objective.sigmas.weights**2
        inverses = np.zeros_like(grams)
        for i, gram in enumerate(grams):
            own = np.flatnonzero(self.support[i])
            Z = np.eye(len(own)) - 1 / len(own)
            inner = Z @ gram[np.ix_(own, own)] @ Z
            inverses[i][np.ix_(own, own)] = np.linalg.pinv(inner, rcond=1e-10, hermitian=True)
        return inverses


def within(weights: Array, support: Mask) -> Array:
    """The change of weights (N, K) projected on its support and on row sums of zero."""
    kept = np.where(support, weights, 0.0)
    return np.where(
        support, kept - kept.sum(axis=1, keepdims=True) / support.sum(axis=1, keepdims=True), 0.0
    )


def _inverses(blocks: Array) -> Array:
    n = blocks.shape[-1]
    sizes = np.trace(blocks, axis1=1, axis2=2) / n
    ridge = np.where(sizes > 0, 1e-9 * sizes, 1.0)  # a block of which nothing is known is zero
    return np.asarray(np.linalg.inv(blocks + ridge[:, None, None] * np.eye(n)))


def _solved(inverses: Array, right: Array) -> Array:
    return (inverses @ right.reshape(len(right), -1, 1)).reshape(right.shape)


def _by_cholesky(L: Array, right: Array) -> Array:
    flat = right.reshape(-1, right.shape[2]).T
    return scipy.linalg.cho_solve((L, True), flat).T.reshape(right.shape)
