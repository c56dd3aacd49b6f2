"""A registration whose vertices are all free: one Gauss-Newton step, and the memory that it takes.

Data pull every vertex, edges keep the shape of a body's mesh, and a coupling keeps it near: three
unknowns a vertex, each of which meets a few others. The problem is linear, so that whoever writes
the step by hand may keep the Jacobian; only the linear algebra is left to do then.
"""

import json
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import casadi as cs
import numpy as np
from scipy.sparse import csc_array
from scipy.sparse.linalg import lsmr, spsolve

import workbench as wb
from benchmarks.scaling import peak
from benchmarks.timing import side_by_side
from workbench.arrays import Array

BODIES = ("small", "default", "full")
OURS, DIRECT, KRYLOV = "workbench", "by hand, spsolve", "by hand, lsmr"
DIGITS = 1e-10  # of lsmr
AGREE = 1e-8  # m: by how much steps may differ


def registration(name: str) -> tuple[wb.Problem, Array, Array]:
    """The problem for the mesh of an embedded body, and its free and fixed numbers (synthetic)."""
    body, rng = wb.load_body(name), np.random.default_rng(0)
    mesh = wb.Block("vertices", (body.n_vertices, 3), "m")
    ends = np.sort(np.concatenate([np.roll(body.faces, k, axis=1)[:, :2] for k in range(3)]))
    edges = np.unique(np.sort(ends, axis=1), axis=0)
    seen = body.template + rng.normal(scale=0.01, size=body.template.shape)
    away = mesh.symbol - cs.DM(body.template.T)
    terms = (
        wb.residuals.vertices(mesh.symbol, seen, sigma=0.005, name="data"),
        wb.residuals.edges(mesh.symbol, body.template, edges, sigma=0.005, name="edges"),
        wb.Residual("coupling", cs.vec(away), 0.02, "m"),
    )
    problem = wb.Problem(terms, ("vertices",), blocks=(mesh,))
    return problem, *problem.split({"vertices": body.template})


@dataclass(frozen=True, eq=False)
class Candidates:
    """Three ways to one step (3 N,) at x, of a problem whose Jacobian is J everywhere."""

    problem: wb.Problem
    fixed: Array
    J: csc_array

    def ours(self, x: Array) -> Array:
        """As a solver takes it."""
        return self.problem.linearize_at(x, self.fixed).step()

    def direct(self, x: Array) -> Array:
        """The normal equations, solved by SuperLU as it is."""
        return spsolve(self.J.T @ self.J, -self.J.T @ self.problem.residual(x, self.fixed))

    def krylov(self, x: Array) -> Array:
        """By products with the Jacobian."""
        return lsmr(self.J, -self.problem.residual(x, self.fixed), atol=DIGITS, btol=DIGITS)[0]


def measure(rounds: int, bodies: Sequence[str] = BODIES) -> dict[str, Any]:
    """By body: unknowns, rows, seconds by candidate, bytes of a process that does one step."""
    found: dict[str, Any] = {}
    for name in bodies:
        problem, x, fixed = registration(name)
        each = Candidates(problem, fixed, csc_array(problem.linearize_at(x, fixed).jacobian))
        candidates = {OURS: each.ours, DIRECT: each.direct, KRYLOV: each.krylov}
        inputs = [x + 1e-3 * k for k in range(4)]
        for one in candidates.values():
            np.testing.assert_allclose(one(inputs[1]), each.ours(inputs[1]), rtol=0, atol=AGREE)
        found[name] = {
            "unknowns": problem.free.size,
            "rows": problem.size,
            "seconds": side_by_side(candidates, inputs, rounds),
            "bytes": _asked(name),
        }
    return found


def memory_of(name: str) -> dict[str, int]:
    """Bytes of this process, which should have done nothing else: before, and at the worst."""
    before = peak()
    problem, x, fixed = registration(name)
    problem.linearize_at(x, fixed).step()
    return {"before": before, "peak": peak()}


def _asked(name: str) -> dict[str, int]:
    """memory_of in a process of its own."""
    command = [sys.executable, "-m", "benchmarks", "memory", name, "vertices"]
    here = Path(__file__).parents[1]
    done = subprocess.run(command, cwd=here, check=True, capture_output=True, text=True)
    found: dict[str, int] = json.loads(done.stdout.splitlines()[-1])
    return found
