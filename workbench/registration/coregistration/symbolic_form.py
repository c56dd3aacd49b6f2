"""A coregistration as one `Problem` in which everything is free, for small meshes.

`Coregistration` minimises the same cost in turn. Here its Jacobian can be looked at, and the
diagnosis says what the scans leave open: how templates, pose blend shapes and registrations slide.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.sparse import csr_array

from workbench.blocks import Block, Values
from workbench.fitting.body_priors import pose_prior
from workbench.geometry.solids import area
from workbench.problem import Problem
from workbench.registration.coregistration.coregistering import Coregistration, State
from workbench.residuals import Residual, vertices
from workbench.training.registrations import InMemory
from workbench.training.symbolic import TERMS, SymbolicTraining

OF_SCANS = ("E_S", "E_C", "E_pose")
OF_MODEL = tuple(term for term in TERMS if term != "E_D")  # E_C is in its place


@dataclass(frozen=True, eq=False)
class SymbolicCoregistration:
    """The joint cost in symbols: `scan j/vertices`, `scan j/pose`, `subject s/template`, ...

    Attributes:
        coregistration: the scans, the body and the sigmas.
        regressor: (K, N) what E_J compares joints with; that of the body at first.
    """

    coregistration: Coregistration
    regressor: csr_array

    @staticmethod
    def at(coregistration: Coregistration, state: State) -> "SymbolicCoregistration":
        """The joint cost as it is when the blocks have come to a state."""
        learned = state.estimate.regressor
        first = coregistration.body.J_regressor
        return SymbolicCoregistration(coregistration, first if learned is None else learned)

    def residuals(self, terms: Iterable[str] = (*OF_SCANS, *OF_MODEL)) -> list[Residual]:
        """The residuals of some terms, or of all."""
        wanted, form = tuple(terms), self._form
        found = [one for term in OF_MODEL if term in wanted for one in form.residuals(term)]
        by = self.coregistration
        for j, person in enumerate(by.scans.subject.tolist()):
            subject, block = form.subjects[person], self._vertices(j)
            blocks = subject.blocks(f"scan {j}/")
            model = subject.points(*(one.symbol for one in blocks))
            if "E_S" in wanted:
                whole = area(by.body.template, by.body.faces)
                scan, faces = by.scans.read(j), by.body.faces
                for n, term in enumerate(by.plan.terms):
                    scanned = term.residual(block.symbol, faces, scan, whole)
                    found.append(replace(scanned, name=f"E_S scan {j}" + n * "'"))
            if "E_C" in wanted:
                sigma = by.plan.sigmas.data
                found.append(vertices(model, block.symbol, sigma=sigma, name=f"E_C scan {j}"))
            if "E_pose" in wanted:
                prior = pose_prior(subject, blocks[0].symbol)
                found.append(replace(prior, name=f"E_pose scan {j}"))
        return found

    def problem(
        self, terms: Iterable[str] = (*OF_SCANS, *OF_MODEL), held: Iterable[str] = ("weights",)
    ) -> Problem:
        """The problem of some terms, or of all, in which all that they read is free but `held`."""
        residuals, fixed = self.residuals(terms), set(held)
        read = dict.fromkeys(name for one in residuals for name in one.reads)
        form = self._form
        described = [b for who in (form.body, *form.subjects) for b in who.free.values()]
        described += [self._vertices(j) for j in range(len(self.coregistration.scans.subject))]
        free = [name for name in read if name not in fixed and not name.endswith("/betas")]
        return Problem(residuals, free, blocks=described)

    def values(self, state: State) -> Values:
        """The values of a state, by the names of the blocks."""
        found = self._form.values(state.estimate)
        for j, (vertices_there, trans) in enumerate(zip(state.vertices, state.trans, strict=True)):
            found |= {self._vertices(j).name: vertices_there, f"scan {j}/trans": trans}
        return found

    def _vertices(self, j: int) -> Block:
        return Block(f"scan {j}/vertices", (self.coregistration.body.n_vertices, 3), "m")

    @cached_property
    def _form(self) -> SymbolicTraining:
        by = self.coregistration
        subject = by.scans.subject
        nothing = InMemory(np.tile(by.body.template, (len(subject), 1, 1)), subject)
        objective = replace(by.objective(nothing), rings=self.regressor)
        return SymbolicTraining.of(by.body, objective)
