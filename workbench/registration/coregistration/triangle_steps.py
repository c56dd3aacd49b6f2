"""The steps of D and Q in a coregistration of triangles, with the registrations moving along.

A subject's D, and the Q of all, reach the edges of a scan's registration by a linear map T_j. With
contacts held, the cost of the scan is a quadratic in its vertices, and so is the joint cost

    sum over j of [ g_j'v_j + v_j'H_j v_j / 2 + |A (V_j + v_j) - (e_j + T_j x)|^2 / (2 sigma^2) ]
        + prior(x)

in the change x of D or Q and the changes v_j of the vertices. If x alone moved, registrations that
repeat the model where nothing was scanned would hold it where it is. Here the vertices are
eliminated (a Schur complement): what is left says of x what the scans say, and nothing else.
Conjugate gradients find x; they are preconditioned by what x would be if the vertices were held.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.sparse import block_diag, csc_array, csr_array, eye_array, kron
from scipy.sparse.linalg import LinearOperator, cg, splu

from workbench.arrays import Array
from workbench.bodies.triangles import TriangleBody
from workbench.bodies.triangles.surface import TriangleSurface
from workbench.errors import BadArgument
from workbench.geometry.triangles import edges
from workbench.training.triangles import neighbour_differences

PLACE_PRECISION = 1e-6  # of the coupling's: holds the place of vertices that nothing else holds
TOLERANCE, MOST_ITERATIONS = 1e-2, 60  # of the gradient, and iterations


@dataclass(frozen=True, eq=False)
class PersonDeformations:
    """D of one subject; `surfaces` are the body at the pose of each of the subject's scans,
    `neighbours` is sigma_D, and `fitted` (F, 3, 3) is the D from which the differences of
    neighbours are counted.
    """

    body: TriangleBody
    surfaces: Sequence[TriangleSurface]
    neighbours: float
    fitted: Array

    @cached_property
    def prior(self) -> csr_array:
        """E_D: differences of neighbours, the same for each of the nine entries of D_f."""
        return differing(self.body, self.neighbours)

    @property
    def prior_gradient(self) -> Array:
        """The gradient of E_D."""
        return np.asarray(self.prior @ (self.surfaces[0].D - self.fitted).ravel())

    def forth(self, j: int, x: Array) -> Array:
        """The change B dD (Q e) of every edge, for a change dD (9 F,) of the deformations."""
        surface = self.surfaces[j]
        B, dD, bent = surface.B, x.reshape(-1, 3, 3), surface.bent
        moved = np.einsum("fab,fbc,fic->fia", B, dD, bent, optimize=True)
        return np.asarray(moved.reshape(-1, 3))

    def back(self, j: int, cotangent: Array) -> Array:
        """The sum over edges of B' cotangent (Q e)'."""
        surface, cotangents = self.surfaces[j], cotangent.reshape(-1, 2, 3)
        B, bent = surface.B, surface.bent
        on_D = np.einsum("fab,fia,fic->fbc", B, cotangents, bent, optimize=True)
        return np.asarray(on_D.ravel())

    def grams(self, j: int) -> Array:
        """The Kronecker product of B'B and the sum over edges of (Q e)(Q e)'."""
        surface = self.surfaces[j]
        left = surface.B.transpose(0, 2, 1) @ surface.B
        right = surface.bent.transpose(0, 2, 1) @ surface.bent
        return np.asarray(np.einsum("fab,fcd->facbd", left, right).reshape(-1, 9, 9))


@dataclass(frozen=True, eq=False)
class PoseDeformations:
    """Q of all subjects, by `posedirs`; `surfaces` are the body at the pose and subject of each
    scan, `bends` is sigma_Q per rad, and `first` are the posedirs from which the change is counted.
    """

    body: TriangleBody
    surfaces: Sequence[TriangleSurface]
    bends: float
    first: Array

    @cached_property
    def prior(self) -> csr_array:
        """E_Q: each entry of posedirs for itself."""
        return csr_array(eye_array(self.body.posedirs.size) / self.bends**2)

    @property
    def prior_gradient(self) -> Array:
        """The gradient of E_Q."""
        return np.asarray((self.body.posedirs - self.first).ravel() / self.bends**2)

    def forth(self, j: int, x: Array) -> Array:
        """The change B D dP e of every edge, dP being the change of posedirs times the twists."""
        surface, e = self.surfaces[j], self.body.arithmetic.packed.edges
        turned = np.einsum("facj,fj->fac", x.reshape(self.body.posedirs.shape), surface.twists)
        moved = (surface.B @ surface.D @ turned) @ e.transpose(0, 2, 1)  # (F, 3, 2)
        return np.asarray(moved.transpose(0, 2, 1).reshape(-1, 3))

    def back(self, j: int, cotangent: Array) -> Array:
        """The sum over edges of (B D)' cotangent e' twists'."""
        surface, e = self.surfaces[j], self.body.arithmetic.packed.edges
        cotangents = cotangent.reshape(-1, 2, 3)
        by_turn = (surface.B @ surface.D).transpose(0, 2, 1) @ (cotangents.transpose(0, 2, 1) @ e)
        return np.asarray(np.einsum("fac,fj->facj", by_turn, surface.twists).ravel())

    def grams(self, j: int) -> Array:
        """The Kronecker product of (B D)'B D, the sum of e e', and twists twists'."""
        surface, e = self.surfaces[j], self.body.arithmetic.packed.edges
        BD = surface.B @ surface.D
        left, middle = BD.transpose(0, 2, 1) @ BD, e.transpose(0, 2, 1) @ e
        products = np.einsum("fab,fcd,fi,fj->facibdj", left, middle, surface.twists, surface.twists)
        return np.asarray(products.reshape(len(e), 9 * surface.twists.shape[1], -1))


Unknown = PersonDeformations | PoseDeformations
"""D of a subject or Q of all, with the same methods.

`prior` is the precision (n, n) of the prior on a change, and `prior_gradient` the gradient (n,) of
its cost where the unknown is; `forth(j, x)` is the change (2 F, 3) m of the edges that the model
gives scan j, `back` its adjoint, and `grams(j)` its T_j'T_j: a block (F, q, q) for each face."""


@dataclass(frozen=True, eq=False)
class OfScan:
    """What a scan says of the vertices (N, 3) m of its registration, with contacts held: the
    gradient (3 N,) of E_S and its Gauss-Newton Hessian (3 N, 3 N).
    """

    vertices: Array
    gradient: Array
    normal: csc_array


@dataclass(frozen=True, eq=False)
class JointStep:
    """The quadratic in an unknown and the vertices of all scans that it reaches.

    `model` (2 F, 3) m are the edges that the model gives each scan, `coupling` is sigma_C in m, and
    the faces and stitching are those of `body`; the iterations end at a `tolerance` of the
    gradient, relative to the first one.
    """

    unknown: Unknown
    scans: Sequence[OfScan]
    model: Sequence[Array]
    coupling: float
    body: TriangleBody
    tolerance: float = TOLERANCE
    most: int = MOST_ITERATIONS

    def solve(self) -> tuple[Array, list[Array]]:
        """The change (n,) of the unknown, and that (N, 3) m of the vertices of each scan."""
        u, s2 = self.unknown, self.coupling**2
        gaps = [
            edges(scan.vertices, self.body.faces).reshape(-1, 3) - model
            for scan, model in zip(self.scans, self.model, strict=True)
        ]
        right = -np.asarray(u.prior_gradient)
        for j, gap in enumerate(gaps):
            first = self._vertices(j, self._onto(gap / s2) + self.scans[j].gradient)
            right = right + u.back(j, (gap - self._edges(first)) / s2)
        n = len(right)

        def product(x: Array) -> Array:
            total = np.asarray(u.prior @ x)
            for j in range(len(self.scans)):
                moved = u.forth(j, x)
                follows = self._edges(self._vertices(j, self._onto(moved / s2)))
                total = total + u.back(j, (moved - follows) / s2)
            return total

        x, _ = cg(
            LinearOperator((n, n), matvec=product, dtype=np.float64),
            right,
            rtol=self.tolerance,
            maxiter=self.most,
            M=LinearOperator((n, n), matvec=self._preconditioner(), dtype=np.float64),
        )
        changes = []
        for j, gap in enumerate(gaps):
            right = self._onto((u.forth(j, x) - gap) / s2) - self.scans[j].gradient
            changes.append(self._vertices(j, right).reshape(-1, 3))
        return x, changes

    def _edges(self, v: Array) -> Array:
        return np.asarray(self.body.stitching.A @ v.reshape(-1, 3))

    def _onto(self, cotangent: Array) -> Array:
        return np.asarray(self.body.stitching.A.T @ cotangent).ravel()

    def _vertices(self, j: int, right: Array) -> Array:
        """(H_j + A'A / sigma^2)^-1 times a right-hand side (3 N,)."""
        return np.asarray(self._factors[j](right))

    @cached_property
    def _factors(self) -> list[Callable[[Array], Array]]:
        A = self.body.stitching.A
        stiff = kron(A.T @ A, eye_array(3)) / self.coupling**2
        held = eye_array(stiff.shape[0]) * (PLACE_PRECISION / self.coupling**2)
        return [_solver(scan.normal + stiff + held) for scan in self.scans]

    def _preconditioner(self) -> Callable[[Array], Array]:
        blocks = sum(self.unknown.grams(j) for j in range(len(self.scans)))
        prior, grams = self.unknown.prior, np.asarray(blocks) / self.coupling**2
        if prior.nnz == prior.shape[0]:  # of each face for itself
            q = grams.shape[1]
            inverse = np.linalg.inv(grams + prior.diagonal().reshape(-1, q)[:, :, None] * np.eye(q))
            return lambda x: np.asarray(inverse @ x.reshape(-1, q, 1)).ravel()
        held = PLACE_PRECISION * eye_array(prior.shape[0])
        return _solver(block_diag(list(grams), format="csc") + prior + held)


def model_edges(surface: TriangleSurface) -> Array:
    """The edges X_f e_fi (2 F, 3) m of the triangles of a posed body, not stitched."""
    return np.asarray(np.einsum("fab,fib->fia", surface.B, surface.shaped).reshape(-1, 3))


def differing(body: TriangleBody, neighbours: float) -> csr_array:
    """The precision (9 F, 9 F) of D by differences of neighbouring faces of sigma `neighbours`."""
    tied = neighbour_differences(body.faces)
    return csr_array(kron(tied.T @ tied, eye_array(9)) / neighbours**2)


def learned_bends(body: TriangleBody, poses: Array, meshes: Array, ratio: float) -> TriangleBody:
    """The body with the posedirs whose triangles, before stitching, fit meshes best.

    `poses` (M, K, 3) rad and `meshes` (M, N, 3) m are of a person with zero betas; `ratio` is
    sigma_C / sigma_Q in m rad. Raises BadArgument for a ratio that is not above zero.

    Posedirs that were fitted to stitched meshes do not serve here: what cancels in stitching may
    be large in single triangles.
    """
    if not 0 < ratio < np.inf:
        raise BadArgument(f"the ratio of the sigmas is above 0 m rad, not {ratio:g}")
    plain = replace(body, posedirs=np.zeros_like(body.posedirs))
    surfaces = [plain.arithmetic.evaluate(pose, np.zeros(body.n_betas)) for pose in poses]
    unknown = PoseDeformations(plain, surfaces, 1 / ratio, plain.posedirs)
    gaps = [
        edges(mesh, body.faces).reshape(-1, 3) - model_edges(surface)
        for mesh, surface in zip(meshes, surfaces, strict=True)
    ]
    T = 9 * surfaces[0].twists.shape[1]
    grams, right = ratio**2 * np.eye(T), np.zeros(body.posedirs.size)
    for j, gap in enumerate(gaps):
        grams, right = grams + unknown.grams(j), right + unknown.back(j, gap)
    posedirs = np.linalg.solve(grams, right.reshape(-1, T, 1))
    return replace(body, posedirs=np.asarray(posedirs).reshape(body.posedirs.shape))


def _solver(A: csc_array) -> Callable[[Array], Array]:
    """The solution of A x = b by factors of a symmetric, positive definite A."""
    factors = splu(csc_array(A), permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True})
    return lambda b: np.asarray(factors.solve(b))
