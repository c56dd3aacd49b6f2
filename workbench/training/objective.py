"""The cost of training: E_D + E_Y + E_J + E_P + E_W + E_T, each half a sum of whitened squares.

E_T is not in the lectures. It keeps the subjects' templates near the first template. Without it
the zero pose is not determined: each subject would find its own, bent towards the poses in which
it was scanned.

The translation of each registration is always the one that makes E_D least.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import inf

import numpy as np
from scipy.sparse import csr_array

from workbench.arrays import Array, Mask
from workbench.bodies.body import regressed
from workbench.geometry.mirror import REFLECTION, Mirror
from workbench.training.estimate import Change, Estimate, Sigmas, SkinningPass
from workbench.training.priors import PosePrior, TemplatePrior
from workbench.training.registrations import Batch, Registrations, over_halves, pieces


@dataclass(frozen=True, eq=False)
class Objective:
    """What training minimises over an `Estimate`.

    Attributes:
        registrations: the data of E_D.
        rings: (K, N) the first guess of the joints, for E_J; rows sum to one.
        first_weights: (N, K) the initial skinning weights, for E_W.
        mirror: the vertices and joints on the other side, for E_Y; None switches E_Y off.
        sigmas: the standard deviation of each term.
        template: (N, 3) in metres, the first template, for E_T; None switches E_T off.
        locality: (N, F) which posedirs may differ from zero; None allows all.
        freedom: how a template may differ from the first one; None holds every vertex for itself,
            by `sigmas.subjects`.
        first_posedirs: (N, 3, F) what E_P compares posedirs with; None compares them with zero.
        pose_prior: of every registration's pose, E_pose; None for none, as training on meshes has.
    """

    registrations: Registrations
    rings: csr_array
    first_weights: Array
    mirror: Mirror | None
    sigmas: Sigmas
    template: Array | None = None
    locality: Mask | None = None
    freedom: TemplatePrior | None = None
    first_posedirs: Array | None = None
    pose_prior: PosePrior | None = None

    @property
    def active_mirror(self) -> Mirror | None:
        """The mirror, unless the symmetry of templates is switched off."""
        return self.mirror if self.sigmas.symmetry < inf else None

    def cost(self, estimate: Estimate) -> float:
        """The sum of all terms."""
        return sum(self.costs(estimate).values())

    def costs(self, estimate: Estimate) -> dict[str, float]:
        """The terms E_D, E_Y, E_J, E_P, E_W and E_T, each half a sum of whitened squares.

        With a prior on poses there is E_pose too.
        """
        s = self.sigmas
        terms = {"E_D": float(self.by_registration(estimate).sum())}
        terms["E_Y"] = 0.0
        if self.mirror is not None:
            uneven = estimate.templates - self.mirror.points(estimate.templates)
            joints = estimate.joints - reflected_joints(estimate.joints, self.mirror)
            terms["E_Y"] = half(uneven, s.symmetry) + half(joints, s.joint_symmetry)
        expected = regressed(self.regressor(estimate), estimate.templates)
        terms["E_J"] = half(expected - estimate.joints, s.rings)
        posedirs = estimate.posedirs
        if self.first_posedirs is not None:
            posedirs = posedirs - self.first_posedirs
        terms["E_P"] = half(posedirs, s.posedirs)
        terms["E_W"] = half(estimate.weights - self.first_weights, s.weights)
        if self.template is not None:
            away = estimate.templates - self.template
            terms["E_T"] = 0.5 * float(np.vdot(away, self._template_precision(away)))
        if self.pose_prior is not None:
            terms["E_pose"] = float(self.pose_prior.costs(estimate.poses).sum())
        return terms

    def rms(self, estimate: Estimate) -> float:
        """The root mean square of the data's residuals per coordinate, in metres."""
        count = 3 * len(self.registrations.subject) * self.registrations.n_vertices
        return self.sigmas.data * float(np.sqrt(2 * self.by_registration(estimate).sum() / count))

    def by_registration(self, estimate: Estimate) -> Array:
        """E_D of each registration, (J,)."""
        costs = np.empty(len(self.registrations.subject))

        def fill(some: Sequence[slice]) -> None:
            for skinning, cotangent, residual in self.residuals(estimate, some):
                costs[skinning.some] = np.einsum("jna,jna->j", cotangent, residual)

        over_halves(fill, pieces(self.registrations))
        return 0.5 * costs / self.sigmas.data**2

    def residuals(
        self, estimate: Estimate, some: Sequence[slice] | None = None
    ) -> Iterator[tuple[SkinningPass, Array, Array]]:
        """For each batch its pass, the residuals times their confidence, and the residuals
        (c, N, 3) in metres.
        """
        for rows in pieces(self.registrations) if some is None else some:
            batch = self.registrations.read(rows)
            skinning = SkinningPass.of(estimate, batch.some, batch.subject)
            residual, _ = centred(batch, batch.vertices - skinning.points)
            yield skinning, trusted(batch, residual), residual

    def regressor(self, estimate: Estimate) -> csr_array:
        """The regressor (K, N) that E_J compares joints with: the rings until one is learned."""
        return self.rings if estimate.regressor is None else estimate.regressor

    def prior_negative_gradient(self, estimate: Estimate, names: tuple[str, ...]) -> Change:
        """Minus the gradient of all terms but E_D by each name."""
        away = {name: getattr(estimate, name) for name in names if name != "poses"}
        if "weights" in away:
            away["weights"] = away["weights"] - self.first_weights
        if "posedirs" in away and self.first_posedirs is not None:
            away["posedirs"] = away["posedirs"] - self.first_posedirs
        whole = {"templates": estimate.templates, "joints": estimate.joints} | away
        curved = self.prior_hessian_product(estimate, whole)
        if self.template is not None:
            first = np.broadcast_to(self.template, estimate.templates.shape)
            curved["templates"] = curved["templates"] - self._template_precision(first)
        zero = estimate.zero_change(names)
        if "poses" in names and self.pose_prior is not None:
            zero["poses"] = self.pose_prior.negative_gradient(estimate.poses)
        return {name: -curved[name] if name in away else zero[name] for name in names}

    def prior_hessian_product(self, estimate: Estimate, change: Change) -> Change:
        """The Hessian of all terms but E_D times a change."""
        s, R = self.sigmas, self.regressor(estimate)
        product = {name: np.zeros_like(d) for name, d in change.items()}
        if self.mirror is not None:
            if "templates" in change:
                T = change["templates"]
                product["templates"] += 2 * (T - self.mirror.points(T)) / s.symmetry**2
            if "joints" in change:
                J = change["joints"]
                product["joints"] += (
                    2 * (J - reflected_joints(J, self.mirror)) / s.joint_symmetry**2
                )
        if s.rings < inf and change.keys() & {"templates", "joints"}:
            gap = -change.get("joints", np.zeros(1))
            if "templates" in change:
                gap = regressed(R, change["templates"]) + gap
            if "joints" in change:
                product["joints"] -= gap / s.rings**2
            if "templates" in change:
                product["templates"] += regressed(csr_array(R.T), gap) / s.rings**2
        if self.template is not None and "templates" in change:
            product["templates"] += self._template_precision(change["templates"])
        if "posedirs" in change:
            product["posedirs"] += change["posedirs"] / s.posedirs**2
        if "weights" in change:
            product["weights"] += change["weights"] / s.weights**2
        if "poses" in change and self.pose_prior is not None:
            product["poses"] += self.pose_prior.hessian_product(estimate.poses, change["poses"])
        return product

    def _template_precision(self, displacements: Array) -> Array:
        """The precision of E_T times displacements (S, N, 3) of templates."""
        if self.freedom is not None:
            return self.freedom.precision_product(displacements)
        return np.asarray(displacements / self.sigmas.subjects**2)


def half(residual: Array, sigma: float) -> float:
    """Half the sum of squares of residual / sigma."""
    return 0.5 * float(np.vdot(residual, residual)) / sigma**2


def reflected_joints(joints: Array, mirror: Mirror) -> Array:
    """The mirror image of joints (..., K, 3)."""
    reflected: Array = joints[..., mirror.joints, :] * REFLECTION
    return reflected


def centred(batch: Batch, points: Array) -> tuple[Array, Array]:
    """Points (c, N, 3) minus their mean, weighted by confidence; and that mean (c, 3)."""
    total = batch.confidence.sum(axis=1)
    weighted = trusted(batch, points).sum(axis=1)
    if total.ndim == 1:
        mean = weighted / total[:, None]
    else:
        mean = np.linalg.solve(total, weighted[..., None])[..., 0]
    return points - mean[:, None], mean


def trusted(batch: Batch, vectors: Array) -> Array:
    """Vectors (c, N, 3, ...) times their confidence, numbers or matrices."""
    C = batch.confidence
    if C.ndim == 4:
        return np.asarray(np.einsum("jnab,jnb...->jna...", C, vectors))
    return np.asarray(C.reshape(*C.shape, *(1,) * (vectors.ndim - 2)) * vectors)


def weight_grams(objective: Objective, estimate: Estimate) -> tuple[Array, Array]:
    """Sums over registrations of B'B (N, K, K) and B'(v - trans) (N, K) for each vertex, whitened.

    Column k of B (3, K) is where joint k alone would take the vertex, so that posed_i = B w_i.
    """
    N, K = estimate.weights.shape

    def sums(some_of: Sequence[slice]) -> tuple[Array, Array]:
        grams, rights = np.zeros((N, K, K)), np.zeros((N, K))
        for some in some_of:
            batch = objective.registrations.read(some)
            skinning = SkinningPass.of(estimate, batch.some, batch.subject)
            _, trans = centred(batch, batch.vertices - skinning.points)
            B = skinning.by_joint()  # (c, N, K, 3)
            weighed = trusted(batch, B.swapaxes(2, 3)).swapaxes(2, 3)
            flat = B.transpose(1, 2, 0, 3).reshape(N, K, -1)
            flat_weighed = weighed.transpose(1, 2, 0, 3).reshape(N, K, -1)
            grams += flat_weighed @ flat.swapaxes(1, 2)
            rights += np.einsum("jnka,jna->nk", weighed, batch.vertices - trans[:, None])
        return grams, rights

    halves = over_halves(sums, pieces(objective.registrations))
    grams, rights = (np.sum(parts, axis=0) for parts in zip(*halves, strict=True))
    scale = objective.sigmas.data**-2
    return scale * grams, scale * rights
