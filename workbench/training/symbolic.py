"""The cost of training written as one `Problem`: every term is a residual on symbols.

`train` minimises the same cost by blocks, with products that are derived by hand, because the
Jacobian of thousands of vertices cannot be stored. Here the Jacobian of a small body can be looked
at: its size and sparsity, its rank, and the names of what the terms leave open.

    E_D  registrations           subjects' templates, joints, poses and places, posedirs, weights
    E_Y  symmetry                templates and joints against their mirror images
    E_J  joints                  against the means of the rings of vertices around them
    E_P  pose blend shapes       against zero
    E_W  skinning weights        against the first ones
    E_T  templates               against the first template (not in the source)

(Loper et al., SMPL, 2015, section 4.1; the lectures Body Models II of the authors.) The skinning
weights of a vertex are bounded below by zero, and constrained to sum to one.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from math import inf

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csr_array

from workbench.arrays import Array
from workbench.blocks import Values
from workbench.bodies import SkinnedBody
from workbench.errors import BadArgument, check_known
from workbench.problem import Constraint, Problem
from workbench.residuals import Residual, gaussian, mirrored, regressed, vertices
from workbench.training.estimate import Estimate
from workbench.training.objective import Objective
from workbench.training.registrations import in_memory

TERMS = ("E_D", "E_Y", "E_J", "E_P", "E_W", "E_T")


@dataclass(frozen=True, eq=False)
class SymbolicTraining:
    """An `Objective` in symbols.

    Attributes:
        objective: the registrations, the sigmas and what the terms compare with.
        body: the body without shape directions; its `posedirs` and `weights` are unknowns.
        subjects: for each subject the body with `subject s/template` and `subject s/joints`.
    """

    objective: Objective
    body: SkinnedBody
    subjects: tuple[SkinnedBody, ...]

    @staticmethod
    def of(
        body: SkinnedBody, objective: Objective, regressor: csr_array | None = None
    ) -> "SymbolicTraining":
        """The terms of an objective on the arrays of a body; its shape directions are dropped.

        `regressor` (K, N) is that of an estimate once one is learned: E_J compares joints with it,
        and with the objective's rings until then. Raises BadArgument for registrations whose
        confidence depends on the direction.
        """
        if regressor is not None:
            objective = replace(objective, rings=regressor)
        if objective.registrations.read(slice(0, 1)).confidence.ndim > 2:
            raise BadArgument(
                "confidences that depend on the direction are not written in symbols; give "
                "registrations with one number for each vertex"
            )
        plain = replace(body, shapedirs=body.shapedirs[:, :, :0], rest_joints=None)
        learning = plain.freed("posedirs", "weights")
        count = int(objective.registrations.subject.max()) + 1
        subjects = [
            learning.freed("template", "joints", prefix=f"subject {s}/") for s in range(count)
        ]
        return SymbolicTraining(objective, learning, tuple(subjects))

    @property
    def names(self) -> tuple[str, ...]:
        """The names of all unknowns: the body's, the subjects', and the registrations'."""
        shared = [block.name for block in self.body.free.values()]
        own = [
            f"subject {s}/{n}" for s in range(len(self.subjects)) for n in ("template", "joints")
        ]
        each = [f"scan {j}/{n}" for j in range(self._count) for n in ("pose", "trans")]
        return (*shared, *own, *each)

    @property
    def _count(self) -> int:
        return len(self.objective.registrations.subject)

    def residuals(self, term: str) -> list[Residual]:
        """The residuals of one term, E_D to E_T; none if the objective has it switched off.

        Raises UnknownName for a term that does not exist.
        """
        posedirs, weights = self.objective.first_posedirs, self.objective.first_weights
        s = self.objective.sigmas
        writers: dict[str, Callable[[], Iterable[Residual]]] = {
            "E_D": self._data,
            "E_Y": self._symmetry,
            "E_J": self._rings,
            "E_P": lambda: self._close_to("posedirs", posedirs, s.posedirs, "E_P"),
            "E_W": lambda: self._close_to("weights", weights, s.weights, "E_W"),
            "E_T": self._templates,
        }
        check_known("term of training", term, writers)
        return list(writers[term]())

    def problem(self, terms: Iterable[str] = TERMS) -> Problem:
        """The problem of some terms, or of all, in which everything that they read is free.

        Weights are not below zero and sum to one, and posedirs that the locality of the objective
        does not allow stay zero.
        """
        residuals = [residual for term in terms for residual in self.residuals(term)]
        read = {name for residual in residuals for name in residual.reads}
        free = [name for name in self.names if name in read]
        bounds: dict[str, tuple[ArrayLike, ArrayLike]] = {}
        constraints = []
        if "weights" in free:
            bounds["weights"] = (0.0, inf)
            sums = cs.sum1(self.body.free["weights"].symbol).T
            constraints.append(Constraint("weights of a vertex sum to one", sums, 1.0, 1.0))
        allowed = self.objective.locality
        if "posedirs" in free and allowed is not None:
            reach = np.where(allowed, inf, 0.0)[:, None].repeat(3, axis=1)
            bounds["posedirs"] = (-reach, reach)
        described = [block for body in (self.body, *self.subjects) for block in body.free.values()]
        return Problem(residuals, free, bounds, described, constraints)

    def values(self, estimate: Estimate) -> Values:
        """The values of an estimate, each registration being placed where E_D is least.

        Raises BadArgument if the estimate has learned a regressor that E_J does not compare with.
        """
        learned = estimate.regressor
        if learned is not None and abs(learned - self.objective.rings).max() > 0:
            raise BadArgument(
                "the estimate has learned a joint regressor, and E_J compares with the rings; make "
                "the form by SymbolicTraining.of(body, objective, estimate.regressor)"
            )
        values: Values = {"posedirs": estimate.posedirs, "weights": estimate.weights}
        for s in range(len(self.subjects)):
            values[f"subject {s}/template"] = estimate.templates[s]
            values[f"subject {s}/joints"] = estimate.joints[s]
        batch = in_memory(self.objective.registrations).read(slice(0, self._count))
        for j, person in enumerate(batch.subject):
            pose, betas, trans = self.subjects[person].blocks(f"scan {j}/")
            values[pose.name] = estimate.poses[j]
            values[betas.name] = np.zeros(0)
            posed = self.subjects[person].with_values(values).vertices(estimate.poses[j])
            trusted = batch.confidence[j]
            values[trans.name] = np.average(batch.vertices[j] - posed, axis=0, weights=trusted)
        return values

    def _data(self) -> Iterable[Residual]:
        """E_D: the registrations against the posed bodies of their subjects."""
        batch = in_memory(self.objective.registrations).read(slice(0, self._count))
        for j, person in enumerate(batch.subject.tolist()):
            pose, betas, trans = (b.symbol for b in self.subjects[person].blocks(f"scan {j}/"))
            points = self.subjects[person].points(pose, betas, trans)
            sigma = self.objective.sigmas.data
            residual = vertices(points, batch.vertices[j], sigma=sigma, name=f"E_D scan {j}")
            yield replace(residual, weights=batch.confidence[j])

    def _symmetry(self) -> Iterable[Residual]:
        """E_Y: templates and joints against their mirror images."""
        mirror, s = self.objective.mirror, self.objective.sigmas
        if mirror is None:
            return
        sides = {
            "template": (mirror.vertices, s.symmetry),
            "joints": (mirror.joints, s.joint_symmetry),
        }
        for i, subject in enumerate(self.subjects):
            for name, (opposite, sigma) in sides.items():
                if sigma < inf:
                    placed = subject.free[name].symbol
                    yield mirrored(placed, opposite, sigma=sigma, name=f"E_Y subject {i}/{name}")

    def _rings(self) -> Iterable[Residual]:
        """E_J: joints against the means of the rings around them."""
        sigma = self.objective.sigmas.rings
        for i, subject in enumerate(self.subjects):
            if sigma < inf:
                joints, template = (subject.free[n].symbol for n in ("joints", "template"))
                rings = self.objective.rings
                yield regressed(joints, template, rings, sigma=sigma, name=f"E_J subject {i}")

    def _templates(self) -> Iterable[Residual]:
        """E_T: templates against the first template."""
        first, free = self.objective.template, self.objective.freedom
        for i, subject in enumerate(self.subjects if first is not None else ()):
            name, sigma = f"E_T subject {i}", self.objective.sigmas.subjects
            covariance = sigma**2 if free is None else free.covariance()
            yield from self._close_to("template", first, sigma, name, subject, covariance)

    def _close_to(
        self,
        array: str,
        mean: Array | None,
        sigma: float,
        name: str,
        body: SkinnedBody | None = None,
        covariance: float | Array | None = None,
    ) -> Iterable[Residual]:
        """An array of a body against its first one, or against zero."""
        if sigma < inf:
            block = (self.body if body is None else body).free[array]
            expected = np.zeros(block.shape) if mean is None else mean
            yield gaussian(
                cs.vec(block.symbol),
                mean=expected.ravel(),
                covariance=sigma**2 if covariance is None else covariance,
                unit=block.unit,
                name=name,
            )
