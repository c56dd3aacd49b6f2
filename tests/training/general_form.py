"""Training as one sentence: Phi = argmin over Phi of sum_j min over theta_j, beta_j (lecture 5.1).

This is a `Problem` in which the body's own arrays are free as well. For a tiny body it can be
solved, differentiated and diagnosed as it is; `training.blocks` does the same for a body of
thousands of vertices, whose Jacobian is too large to store.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite

import numpy as np

from workbench.arrays import Array
from workbench.blocks import Values
from workbench.bodies import SkinnedBody
from workbench.problem import Problem
from workbench.residuals import gaussian, vertices
from workbench.solvers import LevenbergMarquardt, Solver


@dataclass(frozen=True, eq=False)
class GeneralForm:
    """The problem over Phi and everybody's theta and beta.

    Attributes:
        problem: in which all are free.
        start: a value of each name.
        shared: the names of Phi.
        own: the names of everybody's theta, beta and trans.
    """

    problem: Problem
    start: Values
    shared: tuple[str, ...]
    own: tuple[str, ...]

    def inner(self, values: Values, solver: Solver | None = None) -> Values:
        """The minimum over theta and beta at fixed Phi, beginning at the given values."""
        chosen = LevenbergMarquardt(gradient_tolerance=1e-12) if solver is None else solver
        return values | chosen.solve(self.problem.freeing(*self.own), values).values

    def projected(self, values: Values) -> tuple[float, Values]:
        """min over theta, beta of the cost at this Phi, and its gradient by Phi.

        The minimum moves with Phi, but to first order that costs nothing: the gradient is the
        partial one, at the inner minimum (envelope theorem; Golub and Pereyra 2003).
        """
        at = self.inner(values)
        outer = self.problem.freeing(*self.shared)
        cost, slope = outer.cost_and_gradient(*outer.split(at))
        return cost, outer.free.unpack(slope)


def general_form(
    body: SkinnedBody,
    meshes: Sequence[Array],
    *,
    freed: Sequence[str] = ("template",),
    sigma: float = 0.002,
    shape_sigma: float = 1.0,
) -> GeneralForm:
    """The general form of meshes (N, 3) m of different people, and a body whose arrays are freed.

    Blocks are called `scan 0/pose`, `scan 0/betas`, `scan 0/trans` and so on; betas are ordinary
    at `shape_sigma` standard deviations, infinite for no prior. Raises UnknownName for an array
    that cannot be freed.
    """
    learning = body.freed(*freed)
    residuals, start = [], learning.start()
    shared = tuple(block.name for block in learning.free.values())
    start = {name: start[name] for name in shared}
    own: list[str] = []
    for j, mesh in enumerate(meshes):
        prefix = f"scan {j}/"
        blocks = learning.blocks(prefix)
        symbols = [block.symbol for block in blocks]
        points = learning.points(*symbols)
        residuals.append(vertices(points, mesh, sigma=sigma, name=f"scan {j}"))
        if isfinite(shape_sigma) and body.n_betas:
            prior = gaussian(symbols[1], covariance=shape_sigma**2, name=f"shape {j}")
            residuals.append(prior)
        of_scan = learning.start(prefix)
        start |= {block.name: of_scan[block.name] for block in blocks}
        start[f"{prefix}trans"] = mesh.mean(axis=0) - body.template.mean(axis=0)
        own += [block.name for block in blocks]
    return GeneralForm(Problem(residuals, (*shared, *own)), start, shared, tuple(own))


def gauges(form: GeneralForm, values: Values, n_betas: int) -> dict[str, Values]:
    """Changes of the names that change no mesh to first order, so that training cannot find them.

    For a form with `template` free, and maybe `shapedirs`, without a shape prior. Each is a
    direction at `values`, by names; names that it does not move are left out.
    """
    shapedirs = values.get("shapedirs")
    scans = [name for name in form.own if name.endswith("betas")]
    found: dict[str, Values] = {}
    for axis, letter in enumerate("xyz"):
        along = np.eye(3)[axis]
        template = np.broadcast_to(along, values["template"].shape).copy()
        against = {n.replace("betas", "trans"): -along for n in scans}
        found[f"the template moves along {letter}, everybody back"] = {
            "template": template
        } | against
        if shapedirs is None:
            continue
        for b in range(n_betas):
            moved = np.zeros_like(shapedirs)
            moved[:, axis, b] = 1.0
            back = {n.replace("betas", "trans"): -values[n][b] * along for n in scans}
            found[f"shape direction {b} moves along {letter}, everybody back"] = {
                "shapedirs": moved
            } | back
    if shapedirs is None:
        return found
    for b in range(n_betas):
        less = {n: -np.eye(n_betas)[b] for n in scans}
        found[f"the mean moves along shape direction {b}"] = {
            "template": shapedirs[:, :, b].copy()
        } | less
        for c in range(n_betas):
            mixed = np.zeros_like(shapedirs)
            mixed[:, :, c] = shapedirs[:, :, b]
            name = f"shape direction {b} grows, its betas shrink"
            if b != c:
                name = f"shape direction {c} takes from {b}, beta {b} gives"
            found[name] = {"shapedirs": mixed} | {
                n: -values[n][c] * np.eye(n_betas)[b] for n in scans
            }
    return found
