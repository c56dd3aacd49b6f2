"""Gauss and Newton's equations of training, never formed: products and a preconditioner.

A `Linearization` stores its Jacobian, and `LevenbergMarquardt` factorizes J'J. Here the poses meet
every number of every vertex, so that the factors fill in: their size grows with vertices times
registrations, where a product needs one piece of the registrations at a time.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from workbench.training.estimate import Change, Estimate
from workbench.training.lanes import in_lanes
from workbench.training.noticing import ByPattern
from workbench.training.objective import Objective, centred
from workbench.training.posing import crossed
from workbench.training.registrations import Batch, pieces
from workbench.training.skinning_pass import SkinningPass
from workbench.training.weight_grams import weight_grams

Array = NDArray[np.float64]
Passed = tuple[Batch, SkinningPass]
KEPT_BYTES = 2**32  # of what is kept between products: it is computed anew where there is more
BYTES_EACH = 160  # of a vertex in a pose: its blended rotation, place at rest, target
RIDGE = 1e-10  # of the mean diagonal, so that a block that nothing is known of has an inverse


@dataclass(frozen=True, eq=False)
class NormalEquations:
    """(J'J) step = slope for the named parts of an estimate, one pass over the data a product.

    Weights move within their support, their sum kept.
    """

    objective: Objective
    estimate: Estimate
    names: tuple[str, ...]

    @cached_property
    def support(self) -> NDArray[np.bool_]:
        """Where weights may change, (N, K)."""
        return self.estimate.weights > 0

    @cached_property
    def slope(self) -> Change:
        """Minus the gradient of the cost."""
        found = self.objective.prior_slope(self.estimate, self.names)

        def lane(some: Sequence[slice]) -> Change:
            data = self.estimate.zero_change(self.names)
            for passed, pull, _ in self.objective.residuals(self.estimate, some):
                passed.adjoint(pull, data)
            return data

        return self._sum(found, in_lanes(lane, pieces(self.objective.registrations)))

    def product(self, change: Change) -> Change:
        """J'J times a change."""

        def lane(passes: Sequence[Callable[[], Passed]]) -> Change:
            data = self.estimate.zero_change(self.names)
            for one in passes:
                batch, passed = one()
                moved, _ = centred(batch, passed.tangent(change))
                passed.adjoint(batch.seen[..., None] * moved, data)
            return data

        data = in_lanes(lane, self._passes)
        return self._sum(self.objective.prior_curvature(self.estimate, change), data)

    def _passed(self, some: slice) -> Passed:
        batch = self.objective.registrations.read(some)
        return batch, SkinningPass(self.estimate, some, batch.subject)

    @cached_property
    def _passes(self) -> list[Callable[[], Passed]]:
        """How to come by each pass: kept with what it computed if they are few, else anew."""
        source = self.objective.registrations
        anew = [partial(self._passed, some) for some in pieces(source)]
        small = len(source.subject) * source.n_vertices * BYTES_EACH < KEPT_BYTES
        return [partial(_given, one()) for one in anew] if small else list(anew)

    def _sum(self, prior: Change, lanes: list[Change]) -> Change:
        scale = self.objective.sigmas.data**-2
        found = {name: prior[name] + scale * sum(d[name] for d in lanes) for name in self.names}
        if "weights" in found:
            found["weights"] = within(found["weights"], self.support)
        if "posedirs" in found and self.objective.noticed is not None:
            found["posedirs"] *= self.objective.noticed[:, None]
        return found

    def preconditioned(self, change: Change) -> Change:
        """About the inverse of J'J: exact where blending keeps lengths and parts are apart."""
        found: Change = {}
        if {"templates", "posedirs"} & set(self.names):
            found |= self._surfaces(change)
        if "joints" in self.names:
            pull, X = change["joints"], self._answers
            if X is not None:
                at_rest = change["templates"].reshape(len(X), -1, 1)
                pull = pull - (X.swapaxes(1, 2) @ at_rest).reshape(pull.shape)
            found["joints"] = _solved(self._joint_blocks, pull)
            if X is not None:
                answer = X @ found["joints"].reshape(len(X), -1, 1)
                found["templates"] = found["templates"] - answer.reshape(change["templates"].shape)
        if "poses" in self.names:
            found["poses"] = _solved(self._pose_blocks, change["poses"])
        if "weights" in self.names:
            pulled = within(change["weights"], self.support)
            solved = np.stack([L @ g for L, g in zip(self._weight_blocks, pulled, strict=True)])
            found["weights"] = solved
        return {name: found[name] for name in self.names}

    def _surfaces(self, change: Change) -> Change:
        """Templates and posedirs: one matrix for all coordinates of all vertices.

        A vertex and its mirror image are taken apart into what they agree in and what not.
        """
        both = []
        if "templates" in self.names:
            both.append(change["templates"].transpose(1, 2, 0))
        if "posedirs" in self.names:
            both.append(change["posedirs"])
        x = np.concatenate(both, axis=2)
        mirror = self.objective.mirror
        if self.objective.noticed is not None and "posedirs" in self.names:
            found = self._by_pattern.solved(x)
        elif mirror is None or "templates" not in self.names:
            found = _by_cholesky(self._gram_factors[0], x)
        else:
            other = mirror.directions(x)
            even, odd = self._gram_factors
            found = _by_cholesky(even, (x + other) / 2) + _by_cholesky(odd, (x - other) / 2)
        if "templates" not in self.names:
            return {"posedirs": found}
        S = len(self.estimate.templates)
        rest: Change = {"templates": found[:, :, :S].transpose(2, 0, 1)}
        if "posedirs" in self.names:
            rest["posedirs"] = found[:, :, S:]
        return rest

    @cached_property
    def _gram_factors(self) -> tuple[Array, Array]:
        """Without and with E_Y."""
        gram, odd = self._grams
        return scipy.linalg.cholesky(gram, lower=True), scipy.linalg.cholesky(odd, lower=True)

    @cached_property
    def _by_pattern(self) -> ByPattern:
        """Of the few features that each vertex notices, E_Y's halves taken alike."""
        own = self.objective.noticed
        assert own is not None  # else nothing is by pattern
        if "templates" in self.names:
            own = np.concatenate([np.ones((len(own), len(self.estimate.templates)), bool), own], 1)
        return ByPattern.of(np.mean(self._grams, axis=0), own)

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
            gram += np.diag(surfaces / s.subjects**2)
        odd = gram + np.diag(4 * surfaces / s.symmetry**2)
        even, odd = (g + RIDGE * np.trace(g) / len(g) * np.eye(len(g)) for g in (gram, odd))
        return even, odd

    @cached_property
    def _joint_blocks(self) -> Array:
        """(S, 3 K, 3 K), inverted."""
        S, K = self.estimate.joints.shape[:2]
        s = self.objective.sigmas
        carried = SkinningPass(self.estimate, slice(0), np.zeros(0, np.int64)).carried
        away = carried - carried.mean(axis=0)
        D = self.estimate.posing.levers  # (J, K, 3, 3)
        counts = np.bincount(self.objective.registrations.subject)
        blocks = np.zeros((S, 3 * K, 3 * K))
        for j, subject in enumerate(self.objective.registrations.subject):
            flat = D[j].transpose(1, 0, 2).reshape(3, 3 * K)
            blocks[subject] += flat.T @ flat
        blocks *= np.kron(away.T @ away, np.ones((3, 3)))
        if self._answers is not None:
            for n, block, X in zip(counts, blocks, self._answers, strict=True):
                block -= n * (X.T @ X)
        blocks /= s.data**2
        held = 1 / s.rings**2
        if self.objective.mirror is not None:
            held += 2 / s.joint_symmetry**2
        inverses = _inverses(blocks + held * np.eye(3 * K))
        if not held:  # about which point the root turns, no registration shows: it stays
            inverses[:, :3] = inverses[:, :, :3] = 0
        return inverses

    @cached_property
    def _answers(self) -> Array | None:
        """What a template does (S, 3 N, 3 K), less its sign, where its joints move: the least.

        Skinning shifts vertex i by sum_m c_im D_m j_m, and M_i t_i can make up for it; the best t
        over a subject's n registrations is the mean of M_i' sum_m c_im D_m j_m, M being nearly a
        rotation. Without this joints and templates would have to be found in turn.
        """
        if not {"templates", "joints"} <= set(self.names):
            return None
        W, subject = self.estimate.weights, self.objective.registrations.subject
        carried = SkinningPass(self.estimate, slice(0), np.zeros(0, np.int64)).carried
        away = carried - carried.mean(axis=0)
        (N, K), S = W.shape, len(self.estimate.templates)
        found = np.empty((S, N, 3, K, 3))
        D, R = self.estimate.posing.levers, self.estimate.posing.world
        for s in range(S):
            own = np.flatnonzero(subject == s)
            both = np.einsum("jkca,jmcb->kamb", R[own], D[own], optimize=True) / len(own)
            found[s] = (W @ both.reshape(K, -1)).reshape(N, 3, K, 3) * away[:, None, :, None]
        return found.reshape(S, 3 * N, 3 * K)

    @cached_property
    def _pose_blocks(self) -> Array:
        """(J, 3 K, 3 K), inverted: what small turns do."""
        J, K, _ = self.estimate.poses.shape
        blocks = np.empty((J, 3 * K, 3 * K))

        def lane(some_of: Sequence[slice]) -> None:
            for some in some_of:
                batch = self.objective.registrations.read(some)
                for j in range(len(batch.subject)):
                    at = batch.some.start + j
                    one = SkinningPass(self.estimate, slice(at, at + 1), batch.subject[j : j + 1])
                    turns = -crossed(one.arms()[0]) @ one.posing.above[0]  # (N, K, 3, 3)
                    turns[:, 1:] += one.bulging()[0]
                    turns -= np.average(turns, axis=0, weights=batch.seen[j])
                    rows = turns.transpose(0, 2, 1, 3).reshape(-1, 3 * K)
                    blocks[at] = rows.T @ (np.repeat(batch.seen[j], 3)[:, None] * rows)

        in_lanes(lane, pieces(self.objective.registrations))
        return _inverses(blocks / self.objective.sigmas.data**2)

    @cached_property
    def _weight_blocks(self) -> Array:
        """(N, K, K), inverted within the support and the sum."""
        grams = weight_grams(self.objective, self.estimate)[0]
        grams += np.eye(grams.shape[1]) / self.objective.sigmas.weights**2
        inverses = np.zeros_like(grams)
        for i, gram in enumerate(grams):
            own = np.flatnonzero(self.support[i])
            Z = np.eye(len(own)) - 1 / len(own)
            inner = Z @ gram[np.ix_(own, own)] @ Z
            inverses[i][np.ix_(own, own)] = np.linalg.pinv(inner, rcond=1e-10, hermitian=True)
        return inverses


def _given(passed: Passed) -> Passed:
    return passed


def within(weights: Array, support: NDArray[np.bool_]) -> Array:
    """A change of weights (N, K) within its support, keeping the sum."""
    kept = np.where(support, weights, 0.0)
    return np.where(
        support, kept - kept.sum(axis=1, keepdims=True) / support.sum(axis=1, keepdims=True), 0.0
    )


def _inverses(blocks: Array) -> Array:
    n = blocks.shape[-1]
    ridge = 1e-9 * np.trace(blocks, axis1=1, axis2=2)[:, None, None] / n * np.eye(n)
    return np.linalg.inv(blocks + ridge)


def _solved(inverses: Array, right: Array) -> Array:
    return (inverses @ right.reshape(len(right), -1, 1)).reshape(right.shape)


def _by_cholesky(L: Array, right: Array) -> Array:
    flat = right.reshape(-1, right.shape[2]).T
    return scipy.linalg.cho_solve((L, True), flat).T.reshape(right.shape)
