"""The registrations of a round: each scan pulls at free vertices, its person's model holds them.

    E_j(V, pose, trans) = E_S(scan_j to V) + |V - M_s(pose) - trans|^2 / (2 sigma_C^2) + E_pose

with the person's template, joints, weights and pose blend shapes held. All scans are independent,
so that an executor may take them in any number of processes.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Protocol

import casadi as cs
import numpy as np

from workbench.arrays import Array, Index
from workbench.blocks import Block, Points, Values
from workbench.fitting.body_priors import pose_prior
from workbench.fitting.scans.scan import Scan
from workbench.problem import Problem
from workbench.registration.coregistration.softness import Pulled, pulled
from workbench.registration.free_vertices import CLOSE, TOGETHER, VERTICES, Settled
from workbench.residuals import Residual, vertices
from workbench.solvers import Solver
from workbench.training.estimate import Estimate
from workbench.training.poses import body_of_subjects

JOB_SIZE = 4  # scans that one job registers, with one symbolic body


class Scans(Protocol):
    """Where scans are read from, one at a time; it is sent to other processes as it is."""

    @property
    def subject(self) -> Index:
        """The number of each scan's subject, (J,), counted from 0."""

    def read(self, row: int) -> Scan:
        """The scan of a row."""


class ScanPull(Protocol):
    """How a scan pulls at a surface."""

    def residual(self, points: Points | cs.MX, faces: Index, scan: Scan, area: float) -> Residual:
        """In m, for vertices (N, 3) of triangles (F, 3); `area` in m^2 is the template's."""


@dataclass(frozen=True, eq=False)
class ScansInMemory:
    """Scans that are in memory.

    Attributes:
        scans: J of them.
        subject: (J,) the number of each scan's subject, counted from 0.
    """

    scans: tuple[Scan, ...]
    subject: Index

    def read(self, row: int) -> Scan:
        """The scan of a row."""
        return self.scans[row]


@dataclass(frozen=True, eq=False)
class Pull:
    """How scans pull at the vertices, and how strongly the model holds them.

    Attributes:
        faces: (F, 3) of the template.
        area: m^2, of the starting body's surface, which points without areas share evenly.
        coupling: sigma_C in m, of each coordinate of a vertex from the model's.
        terms: how the scan pulls.
        solver: what finds vertices, pose and translation.
        settled: a scan is done after a step that lowers its cost by less than this share of it.
    """

    faces: Index
    area: float
    coupling: float
    terms: tuple[ScanPull, ...] = (CLOSE,)
    solver: Solver = TOGETHER
    settled: float = 1e-3


@dataclass(frozen=True, eq=False)
class OnScan:
    """A surface on one scan.

    Attributes:
        vertices: (N, 3) m.
        pose: (K, 3) rad.
        trans: (3,) m.
        scan_cost: E_S of the vertices.
        pulled: where the scan alone would put the vertices, and how surely.
    """

    vertices: Array
    pose: Array
    trans: Array
    scan_cost: float
    pulled: Pulled


@dataclass(frozen=True, eq=False)
class Job:
    """Some scans of some subjects, whose arrays alone are in the estimate.

    Attributes:
        estimate: the subjects' templates and joints, and the poses (c, K, 3) of the scans.
        rows: (c,) the scans.
        subject: (c,) their subjects, as numbered in the estimate.
        vertices: (c, N, 3) m, from where to begin.
        trans: (c, 3) m.
    """

    estimate: Estimate
    rows: tuple[int, ...]
    subject: Index
    vertices: Array
    trans: Array


def jobs(estimate: Estimate, subject: Index, vertices: Array, trans: Array) -> Iterator[Job]:
    """All scans in jobs of a few."""
    for first in range(0, len(subject), JOB_SIZE):
        rows = np.arange(first, min(first + JOB_SIZE, len(subject)))
        theirs, numbered = estimate.of_rows(rows, subject[rows])
        yield Job(theirs, tuple(rows.tolist()), numbered, vertices[rows], trans[rows])


def registered(pull: Pull, scans: Scans, job: Job) -> list[OnScan]:
    """Vertices, pose and translation of every scan of a job; no cost is higher afterwards."""
    return [_on_scan(pull, one, _solved(pull, one)) for one in _each(pull, scans, job)]


def measured(pull: Pull, scans: Scans, job: Job) -> list[OnScan]:
    """The costs of every scan of a job where its vertices, pose and translation are."""
    return [_on_scan(pull, one, one.values) for one in _each(pull, scans, job)]


@dataclass(frozen=True, eq=False)
class _One:
    problem: Problem
    scan: tuple[Residual, ...]
    values: Values


def _each(pull: Pull, scans: Scans, job: Job) -> Iterator[_One]:
    estimate = job.estimate
    body = body_of_subjects(estimate, pull.faces)
    N = estimate.templates.shape[1]
    pose, betas, trans = (block.symbol for block in body.blocks())
    points = body.points(pose, betas, trans, vertices=range(N))
    block = Block(VERTICES, (N, 3), "m")
    coupling = vertices(points, block.symbol, sigma=pull.coupling, name="coupling")
    prior = pose_prior(body)
    for i, row in enumerate(job.rows):
        there = scans.read(row)
        scan = tuple(t.residual(block.symbol, pull.faces, there, pull.area) for t in pull.terms)
        problem = Problem((*scan, coupling, prior), ("pose", "trans", VERTICES), blocks=(block,))
        values = {
            "pose": estimate.poses[i],
            "betas": np.eye(len(estimate.templates))[job.subject[i]],
            "trans": job.trans[i],
            VERTICES: job.vertices[i],
        }
        yield _One(problem, scan, values)


def _solved(pull: Pull, one: _One) -> Values:
    ends = Settled(pull.settled) if pull.settled > 0 else None
    return one.values | pull.solver.solve(one.problem, one.values, callback=ends).values


def _on_scan(pull: Pull, one: _One, values: Values) -> OnScan:
    return OnScan(
        values[VERTICES],
        values["pose"],
        values["trans"],
        sum(cost_of_scan(residual, values) for residual in one.scan),
        pulled(one.scan, values[VERTICES], pull.coupling),
    )


def cost_of_scan(residual: Residual, values: Values) -> float:
    """The cost of a residual of vertices alone."""
    return Problem((residual,), (VERTICES,)).linearize({VERTICES: values[VERTICES]}).cost


Work = Callable[[Pull, Scans, Job], list[OnScan]]
