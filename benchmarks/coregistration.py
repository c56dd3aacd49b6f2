"""Coregistration on simulated scans: registrations and models, separate and together.

python -m benchmarks.coregistration             # the reported sets: clean, holes, holes and clutter
python -m benchmarks.coregistration --tuning    # variants, on people that are not reported

60 scans of 6 people, made of a body that is not the one coregistration starts from, each with a
shape of its own. Numbers go to `results/coregistration.json`, and COREGISTRATION.md is written
from them.
"""

import argparse
import json
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import casadi as cs
import numpy as np

from benchmarks.keeping import keep, write_between
from benchmarks.machine import description
from examples.studies.simulated_scans import (
    MM,
    START,
    TRUTH,
    Apart,
    ScannedSet,
    errors,
    ratio,
    scanned_set,
)
from workbench import load_body
from workbench.arrays import Array
from workbench.blocks import Points
from workbench.bodies import SkinnedBody
from workbench.fitting import Scan
from workbench.geometry.solids import vertex_normals
from workbench.registration.coregistration import (
    Coregistration,
    CoregistrationPlan,
    Fitted,
    hard,
)
from workbench.registration.free_vertices import CLOSE, PATCH
from workbench.residuals import Residual, geman_mcclure, model_to_scan, plane, scaled
from workbench.training.blocks import BLOCKS, BlockInput
from workbench.training.estimate import Estimate
from workbench.training.evaluation import errors_of, evaluate_held_out
from workbench.training.execution import Execution, Executor, Processes
from workbench.training.poses import VertexTerm, fitted_poses, poses_of_segments
from workbench.training.registrations import InMemory

HERE = Path(__file__).parent
RESULTS, PAGE = HERE / "results" / "coregistration.json", HERE / "COREGISTRATION.md"
BEGIN, END = "<!-- written by the benchmark from here on -->", "<!-- up to here -->"
PEOPLE, SCANS = 6, 60
SETS = {"clean": (0, 0.0), "holes": (12, 0.0), "holes and clutter": (12, 0.1)}
REPORTED, TUNED_ON = 1, 100  # seeds
ROUNDS = 4
MARKS, MARK_SIGMA = 12, 0.005


def trained_on(given: ScannedSet, first: Estimate, vertices: Array, by: Coregistration) -> Estimate:
    """The model's blocks and the poses of training, on registrations as they are."""
    estimate = first
    for _ in range(ROUNDS):
        objective = by.objective(InMemory(vertices, given.subject))
        ready = BlockInput(objective, by.body.faces, by.plan.options)
        for block in ("poses", *by.plan.blocks):
            estimate = BLOCKS[block](ready, estimate).estimate
    return estimate


def of_model(given: ScannedSet, estimate: Estimate, by: Coregistration) -> dict[str, Any]:
    """Errors of a model in mm: of the same people in new poses, by scan, and of other people."""
    body, data = by.body, given.same
    start = replace(estimate, poses=_rough_poses(body, data))
    found = fitted_poses(start, data, body.faces, VertexTerm(), 0.002, 30)
    left = errors_of(by.objective(data), found)
    learned = replace(
        body,
        template=estimate.templates.mean(axis=0),
        posedirs=estimate.posedirs,
        weights=estimate.weights,
        J_regressor=estimate.regressor if estimate.regressor is not None else body.J_regressor,
    )
    others = evaluate_held_out(learned, given.others)
    return {
        "same people": (MM * left.distances.mean(axis=1)).tolist(),
        "other people": MM * others.errors.mean,
    }


def _rough_poses(body: SkinnedBody, data: InMemory) -> Array:
    return np.stack(
        [
            poses_of_segments(body.template, body.weights, body.parents, V, np.ones(len(V)))
            for V in data.vertices
        ]
    )


def compared(given: ScannedSet, execution: Execution, variants: bool) -> dict[str, Any]:
    """Every method on one set."""
    begun = time.perf_counter()
    jobs = [(given.scans, j, start) for j, start in enumerate(given.starts)]
    alone = list(execution.executor(Apart(0), jobs))
    again = [(given.scans, j, values) for j, values in enumerate(alone)]
    control = list(execution.executor(Apart(ROUNDS), again))
    fits = [Fitted(one["pose"], one["betas"], one["trans"]) for one in alone]
    plan = CoregistrationPlan(rounds=ROUNDS)
    by = Coregistration(load_body(START), given.scans, plan)
    first = by.first(fits)
    V = {
        name: np.stack([one["vertices"] for one in each])
        for name, each in (("separate", alone), (CONTROL, control))
    }
    normals = np.stack([vertex_normals(m, by.body.faces) for m in given.meshes])
    across = np.einsum("jna,jna->jn", V["separate"] - given.meshes, normals)
    V["separate, tangential motion given"] = given.meshes + across[..., None] * normals
    V["true meshes"] = given.meshes
    found: dict[str, Any] = {}
    for name, vertices in V.items():
        estimate = trained_on(given, first.estimate, vertices, by)
        found[name] = errors(given, vertices) | of_model(given, estimate, by)
        _print(name, found[name])
    marks = {f"{MARKS} landmarks": replace(BASE, terms=(*BASE.terms, marked(given)))}
    for name, one in (VARIANTS | marks if variants else METHODS).items():
        began = time.perf_counter()
        state = Coregistration(by.body, given.scans, one).run(fits, execution=execution)
        found[name] = errors(given, state.vertices) | of_model(given, state.estimate, by)
        found[name]["costs"] = [sum(entry.after.values()) for entry in state.log]
        found[name]["seconds"] = time.perf_counter() - began
        _print(name, found[name])
    found["seconds"] = time.perf_counter() - begun
    return found


@dataclass(frozen=True)
class Backwards:
    """The other side of a two-sided distance: from the vertices to the scan's own mesh.

    Attributes:
        sigma: m, the noise.
        outlier: m, where outliers begin; vertices that the scan does not show are some.
        within: m, the gate.
    """

    sigma: float = 0.003
    outlier: float = 0.006
    within: float = 0.02

    def residual(self, points: Points | cs.MX, faces: Array, scan: Scan, area: float) -> Residual:
        """In m, of all vertices, which share the surface's area evenly."""
        assert isinstance(points, cs.MX), "the symbol of free vertices"
        return model_to_scan(
            points,
            scan.points,
            scan.faces,
            sigma=self.sigma,
            kernel=scaled(geman_mcclure, self.outlier / self.sigma),
            weights=np.full(points.shape[1], area / points.shape[1] / PATCH),
            within=self.within,
            name="backwards",
        )


@dataclass(frozen=True, eq=False)
class Marked:
    """Some vertices whose places somebody marked on each scan, hidden or not.

    Attributes:
        places: (J, L, 3) m, by the first coordinate of each scan.
        vertices: (L,) which.
        sigma: m, of each coordinate.
    """

    places: dict[float, Array]
    vertices: Array
    sigma: float = MARK_SIGMA

    def residual(self, points: Points | cs.MX, faces: Array, scan: Scan, area: float) -> Residual:
        """In m, three rows for each landmark."""
        assert isinstance(points, cs.MX), "the symbol of free vertices"
        there = self.places[float(scan.points[0, 0])]
        off = cs.vec(points[:, self.vertices.tolist()] - there.T)
        return Residual("marks", off, self.sigma, "m", rows_per_point=3)


def marked(given: ScannedSet) -> Marked:
    """MARKS vertices, spread by farthest points, each marked with noise."""
    rest, chosen = load_body(TRUTH).template, [0]
    while len(chosen) < MARKS:
        away = np.linalg.norm(rest[:, None] - rest[chosen], axis=2).min(axis=1)
        chosen.append(int(np.argmax(away)))
    rng, which = np.random.default_rng(11), np.array(chosen)
    places = given.meshes[:, which] + MARK_SIGMA * rng.standard_normal((SCANS, MARKS, 3))
    firsts = [float(given.scans.read(j).points[0, 0]) for j in range(SCANS)]
    return Marked(dict(zip(firsts, places, strict=True)), which)


CONTROL = "equal rounds, model unchanged"
BASE = CoregistrationPlan(rounds=ROUNDS)
METHODS = {
    "coregistration": BASE,
    "coregistration, hard registrations": replace(BASE, observe=hard),
    "coregistration, templates held by vertices": replace(BASE, edges=None),
}
VARIANTS = {
    "coregistration": BASE,
    "two-sided": replace(BASE, terms=(*BASE.terms, Backwards())),
    "plane": replace(BASE, terms=(replace(CLOSE, form=plane),)),
    "bends 2 mm": replace(BASE, curvature=0.002),
    "bends 0.5 mm": replace(BASE, curvature=0.0005),
    "bends 2 mm, edges 30 mm": replace(BASE, curvature=0.002, edges=0.03),
    "facing 0.8": replace(BASE, terms=(replace(CLOSE, facing=0.8),)),
    **{
        f"sigma_C {MM * s:g} mm": replace(BASE, sigmas=replace(BASE.sigmas, data=s))
        for s in (0.002, 0.005)
    },
    **{f"edges {MM * s:g} mm": replace(BASE, edges=s) for s in (0.005, 0.02)},
    **{
        f"posedirs {MM * s:g} mm": replace(BASE, sigmas=replace(BASE.sigmas, posedirs=s))
        for s in (0.0003, 0.003)
    },
    "templates alone": replace(BASE, blocks=("rest",)),
    "weights too": replace(BASE, blocks=("surfaces", "regressor", "weights")),
}


def _print(name: str, one: dict[str, Any]) -> None:
    told = {k: round(float(np.mean(v)), 2) for k, v in one.items() if k not in ("costs", "seconds")}
    print(
        f"{name:45}",
        told,
        {k: round(float(np.median(v)), 2) for k, v in one.items() if k in ("seen", "hidden")},
        flush=True,
    )


def share(rows: dict[str, Any], name: str, of: str, what: str = "hidden") -> tuple[float, ...]:
    """An error of one method over that of another, with its 90 % interval over people."""
    ours, theirs = rows[name][what], rows[of][what]
    return ratio(ours, theirs, np.arange(len(ours)) % PEOPLE)


def page(found: dict[str, Any]) -> str:
    """The tables, as Markdown."""
    text = ""
    for kind, rows in found["sets"].items():
        text += (
            f"\n## {kind.capitalize()}\n\nErrors in mm, means over {SCANS} scans of {PEOPLE} "
            "people; the third column has its 90 % interval over people.\n\n"
            "| | seen | hidden | hidden, of the control | along the skin | across it | "
            "model: same people, new poses | model: other people |\n"
            "| --- | --: | --: | --: | --: | --: | --: | --: |\n"
        )
        for name, one in rows.items():
            if name == "seconds":
                continue
            means = {k: float(np.mean(v)) for k, v in one.items() if k not in ("costs", "seconds")}
            ratio = "" if means["hidden"] == 0 else _told(share(rows, name, CONTROL))
            text += (
                f"| {name} | {means['seen']:.2f} | {means['hidden']:.2f} | {ratio} | "
                f"{means['tangential']:.2f} | {means['normal']:.2f} | {means['same people']:.2f} | "
                f"{means['other people']:.2f} |\n"
            )
    return text


def _told(ratio: tuple[float, ...]) -> str:
    return "{:.2f} ({:.2f} to {:.2f})".format(*ratio)


def main() -> None:
    """Measure, print and, except when tuning, write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--tuning", action="store_true")
    parser.add_argument("--sets", nargs="+", choices=list(SETS), default=list(SETS))
    parser.add_argument("--jobs", type=int, default=2)
    given = parser.parse_args()
    executor: Executor = Processes(given.jobs)
    execution = Execution(executor)
    known: dict[str, Any] = json.loads(RESULTS.read_text()) if RESULTS.exists() else {}
    for kind in given.sets:
        print(kind, flush=True)
        found = compared(
            scanned_set(TUNED_ON if given.tuning else REPORTED, PEOPLE, SCANS, *SETS[kind]),
            execution,
            given.tuning,
        )
        if not given.tuning:
            known.setdefault("sets", {})[kind] = found
            known["machine"] = description()
            keep(RESULTS, known, 5)
            write_between(PAGE, BEGIN, END, page(known))


if __name__ == "__main__":
    main()
