"""The command `python -m benchmarks.images.contact RECORDING`: bodies kept out of themselves.

Poses of the prior in which `default` penetrates itself are fitted to their joints, without anything
and with each term for self-contact; and the capsules' alarms are compared with penetrations on the
mesh (`workbench.bodies.penetrations`), in poses of the prior and of a recording's held-out clips.
Numbers go to `results/contact.json`, and the tables of IMAGES.md are written from them. With
`--tuning` other poses are taken and nothing is kept: settings were chosen there. `--parts` measures
some of the tables again; the others stay as they are.
"""

import argparse
import json
import time
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import machine
from benchmarks.keeping import keep, write_between
from workbench import SOLVERS, Block, Constraint, Problem, load_body
from workbench.arrays import Array
from workbench.blocks import Values
from workbench.bodies import SkinnedBody, capsule_gaps, capsule_points, capsules_of
from workbench.bodies.capsules import capsule_distances
from workbench.bodies.parts import part_of, parts_of_capsules, solid_of
from workbench.bodies.penetrations import BodySolids
from workbench.comparison.statistics import rate
from workbench.fitting.body_priors import pose_prior, shape_prior
from workbench.priors.poses import draw_poses, shipped_mixture
from workbench.priors.recordings import held_out_poses, read_recording
from workbench.reading.arrays import read_expected, reals, shipped
from workbench.residuals import apart, gaps, landmarks, spheres
from workbench.solvers import DEFAULT, Ipopt, Solver, Sqp

HERE = Path(__file__).parent.parent
RESULTS, PAGE = HERE / "results" / "contact.json", HERE / "IMAGES.md"
BEGIN = "<!-- from here on written by `python -m benchmarks.images.contact` -->"
END = "<!-- contact: up to here -->"
NOISE = 0.01  # m, of each joint's coordinates
FITS, LEAST, MOST = 10, 0.02, 0.1  # fits, and how deep their poses penetrate the body, m
HINGED = 50  # fits of other poses with the hinge alone
POSES = 60  # of the prior, and as many of the recording
# of one set of poses that settings were chosen with, of those reported, and of those `HINGED`
TUNED, SEED, FRESH = 100, 700, 800
DEEP = 0.01  # m: penetrations that must not be missed
SLACK = 1e-3  # m, the sigma of the hinge
SPHERES = 0.01  # sigma of SMPLify's term, the best of 1, 0.3, 0.1, 0.03 and 0.01 for the depth
LIMIT = 1e-4  # m, the tolerance of the constraint
Solids = tuple[str, str]  # the names of two, in one order


@dataclass(frozen=True, eq=False)
class Terms:
    """The problems that are compared: the same data and priors, and a term for self-contact."""

    body: SkinnedBody
    problems: dict[str, Problem]

    @staticmethod
    def of(body: SkinnedBody) -> "Terms":
        """Those of a body, by name."""
        symbols = [block.symbol for block in body.blocks()]
        free = [block.name for block in body.blocks()]
        observed = (Block("observed", (body.n_joints, 3), "m", body.joint_names),)
        joints = body.joint_points(*symbols)
        data = landmarks(joints, observed[0].symbol, sigma=NOISE, name="joints")
        base = (data, pose_prior(body), shape_prior(body))
        ends, capsules = capsule_points(body, *symbols), capsules_of(body)
        pairs, radii = capsules.pairs, capsules.radii_in(symbols[1])
        contact = {
            "nothing": (),
            "spheres": (spheres(ends, radii, pairs, sigma=SPHERES),),
            "hinge": (apart(ends, radii, pairs, sigma=SLACK),),
            "stiff": (apart(ends, radii, pairs, sigma=SLACK / 10),),
        }
        found = {
            name: Problem((*base, *one), free, blocks=observed) for name, one in contact.items()
        }
        limit = Constraint(
            "apart", gaps(ends, radii, pairs), 0.0, unit="m", points=(ends,), tolerance=LIMIT
        )
        found["limit"] = Problem(base, free, blocks=observed, constraints=(limit,))
        return Terms(body, found)


@dataclass(frozen=True, eq=False)
class Way:
    """How a fit goes on where the fit without anything, or another one, ended.

    Attributes:
        problem: the name of the problem.
        solver: what solves it.
        after: the way that it begins after; empty for the start.
    """

    problem: str
    solver: Solver
    after: str


WAYS = {
    "nothing": Way("nothing", SOLVERS[DEFAULT], ""),
    "SMPLify's spheres": Way("spheres", SOLVERS[DEFAULT], "nothing"),
    "hinge": Way("hinge", SOLVERS[DEFAULT], "nothing"),
    "hinge, Levenberg-Marquardt": Way("hinge", SOLVERS["levenberg-marquardt"], "nothing"),
    "hinge, sigma 0.1 mm": Way("stiff", SOLVERS[DEFAULT], "hinge"),
    "SQP after the hinge": Way("limit", Sqp(max_seconds=30), "hinge"),
    "IPOPT after the hinge": Way("limit", Ipopt(max_iterations=1_000, max_seconds=30), "hinge"),
    "SQP": Way("limit", Sqp(max_seconds=30), "nothing"),
    "IPOPT": Way("limit", Ipopt(max_iterations=1_000, max_seconds=30), "nothing"),
}
HINGES = {name: WAYS[name] for name in ("nothing", "hinge")} | {
    "hinge, dogleg": Way("hinge", SOLVERS["dogleg"], "nothing")
}


def penetrating_poses(body: SkinnedBody, count: int, seed: int) -> list[Array]:
    """So many draws of the prior in which the body penetrates itself by 20 to 100 mm.

    The mesh alone decides, so that none is left out because no capsules overlap.
    """
    solids, found = BodySolids.of(body), []
    for pose in draw_poses(shipped_mixture(), 50 * count, np.random.default_rng(seed)):
        deep = solids.penetrations(body.vertices(pose))
        if deep and LEAST < deep[0].depth < MOST:
            found.append(pose)
        if len(found) == count:
            break
    return found


def fits(
    body: SkinnedBody, poses: list[Array], ways: Mapping[str, Way] = WAYS
) -> dict[str, dict[str, list[float]]]:
    """For each way and pose: depth on the mesh (mm), worst gap (mm), costs, and CPU seconds.

    `seconds` are those of the way itself, after the one that it begins after. Every problem is
    solved once before, so that no time contains what problems share.
    """
    terms, solids = Terms.of(body), BodySolids.of(body)
    base = terms.problems["nothing"]
    found: dict[str, dict[str, list[float]]] = {}
    for k, pose in enumerate([poses[0], *poses]):
        joints = body.joints(pose)
        noise = NOISE * np.random.default_rng(k).standard_normal(joints.shape)
        ends: dict[str, Values] = {"": body.start() | {"observed": joints + noise}}
        for name, way in ways.items():
            problem, start = terms.problems[way.problem], ends[way.after]
            began = time.process_time()
            solution = way.solver.solve(problem, start)
            took = time.process_time() - began
            ends[name] = at = start | solution.values
            if k == 0:
                continue
            shape = [at[block.name] for block in body.blocks()]
            deep = solids.penetrations(body.vertices(*shape))
            residual = base.residual(*base.split(at))
            said = {
                "depth": 1e3 * deep[0].depth if deep else 0.0,
                "gap": 1e3 * float(capsule_gaps(body, *shape).min()),
                "cost": 0.5 * float(residual @ residual),
                "own": solution.cost,
                "seconds": took,
                "converged": float(solution.converged),
            }
            for key, value in said.items():
                found.setdefault(name, {}).setdefault(key, []).append(value)
            print(
                f"{k:3} {name:28}",
                *(f"{v:9.3f}" for v in said.values()),
                solution.status.name,
                *(f"{p.part}>{p.within} {1e3 * p.depth:.0f}" for p in deep[:2]),
                flush=True,
            )
    return found


def alarms(body: SkinnedBody, poses: Array) -> dict[str, list[list[float]]]:
    """For each pose and each two solids that may meet: the depth on the mesh, the gap, and the
    least gap of one of them and a solid that is joined to the other, in mm.

    Solids are those of `penetrations`, which tells parts by the corners nearest to a place. Pairs
    that are neither within each other nor overlap are left out; the gap of those that no capsules
    stand for is infinite.
    """
    solids, capsules = BodySolids.of(body), capsules_of(body)
    of_pair = [_pair(capsules.names[i], capsules.names[j]) for i, j in capsules.pairs]
    rows = []
    for number, (pose, gap) in enumerate(zip(poses, capsule_gaps(body, poses), strict=True)):
        least: dict[Solids, float] = {}
        for pair, value in zip(of_pair, gap, strict=True):
            least[pair] = min(value, least.get(pair, np.inf))
        deepest: dict[Solids, float] = {}
        for one in solids.penetrations(body.vertices(pose)):
            pair = _pair(one.part, one.within)
            deepest[pair] = max(one.depth, deepest.get(pair, 0.0))
        for pair in {*deepest, *(p for p, g in least.items() if g < 0)}:
            if pair[0] != pair[1]:
                near = [g for p, g in least.items() if beside(solids.joined, pair, p)]
                found = deepest.get(pair, 0.0), least.get(pair, 1e6), min(near, default=1e6)
                rows.append([float(number), *(1e3 * np.array(found)).tolist()])
    return {"rows": rows}


def beside(joined: Collection[frozenset[str]], pair: Solids, other: Solids) -> bool:
    """Whether two pairs of solids share one, and their other ones are two that are joined."""
    return any(
        pair[i] == other[j]
        and pair[1 - i] != other[1 - j]
        and frozenset((pair[1 - i], other[1 - j])) in joined
        for i in (0, 1)
        for j in (0, 1)
    )


def _pair(one: str, other: str) -> Solids:
    """The solids of two parts, in one order."""
    first, second = sorted(solid_of(part_of(name)) for name in (one, other))
    return first, second


def nearness(body: SkinnedBody, people: Array, betas: Array) -> float:
    """How far the vertices of people at rest (M, N, 3) m, of betas (M, B), are from their capsules,
    in mm rms.
    """
    capsules = capsules_of(body)
    parts = parts_of_capsules(body)
    squares = []
    for vertices, shape in zip(people, betas, strict=True):
        found = capsule_distances(vertices, capsules.ends_of(shape), capsules.radii_of(shape))
        for name, distances in zip(capsules.names, found, strict=True):
            squares.append(distances[parts[name]] ** 2)
    return 1e3 * float(np.sqrt(np.concatenate(squares).mean()))


def draws(body: SkinnedBody, seed: int) -> float:
    """The same of 100 people drawn from the shape space."""
    betas = np.random.default_rng(seed).standard_normal((100, body.n_betas))
    people = body.template + np.einsum("ncb,mb->mnc", body.shapedirs, betas)
    return nearness(body, people, betas)


def others(body: SkinnedBody, name: str) -> dict[str, float | None]:
    """The same of people from whom the shape space was not learned, and of the bodies of the shape
    space that are nearest to them; None if there are none.
    """
    with shipped("bodies/held_out_people.npz", "file of held-out people") as archive:
        if name not in archive.headers:
            return {"others": None, "nearest": None}
        people = read_expected(archive, {name: reals("people", body.n_vertices, 3)})[name]
    directions = body.shapedirs.reshape(-1, body.n_betas)
    flat = (people - body.template).reshape(len(people), -1).T
    betas = np.asarray(np.linalg.lstsq(directions, flat, rcond=None)[0].T)
    nearest = body.template + np.einsum("ncb,mb->mnc", body.shapedirs, betas)
    return {
        "others": nearness(body, people, betas),
        "nearest": nearness(body, np.asarray(nearest), betas),
    }


def linearizations(body: SkinnedBody) -> dict[str, float]:
    """CPU milliseconds (median) of a linearization of each problem, and of the limit's Hessian."""
    terms, rng = Terms.of(body), np.random.default_rng(0)
    at = body.start() | {"observed": body.joints(0.2 * rng.standard_normal((body.n_joints, 3)))}
    found = {}
    for name in ("nothing", "spheres", "hinge", "limit"):
        problem = terms.problems[name]
        x, fixed = problem.split(at)
        places = [x + 1e-3 * rng.standard_normal(len(x)) for _ in range(50)]
        found[name] = _median_ms(partial(problem.linearize_at, fixed=fixed), places)
        if there := problem.stacked_constraints:
            ones = np.ones(there.size)
            hessian = partial(there.hessian, fixed=fixed, multipliers=ones)
            found["the limit's Hessian"] = _median_ms(hessian, places[:10])
    return found


def _median_ms(call: Callable[[Array], object], places: list[Array]) -> float:
    call(places[0])
    times = []
    for place in places:
        began = time.process_time()
        call(place)
        times.append(1e3 * (time.process_time() - began))
    return float(np.median(times))


BODIES = "small", "default", "default-male", "default-female"


PARTS = "linearizations", "capsules", "alarms", "fits", "hinged"


def run(recording: Path, tuning: bool, parts: Sequence[str] = PARTS) -> dict[str, Any]:
    """The numbers of these parts."""
    body = load_body("default")
    assert isinstance(body, SkinnedBody)
    seed = TUNED if tuning else SEED
    clips = read_recording(recording).split()[0].poses if tuning else held_out_poses(recording)
    rng = np.random.default_rng(seed)
    found: dict[str, Any] = {"machine": machine.description()}
    if "linearizations" in parts:
        found["linearizations"] = linearizations(body)
    if "capsules" in parts:
        found["capsules"] = {}
        for name in BODIES:
            model = load_body(name)
            assert isinstance(model, SkinnedBody)
            found["capsules"][name] = {"draws": draws(model, seed)} | others(model, name)
    print(found, flush=True)
    if "alarms" in parts:
        drawn = draw_poses(shipped_mixture(), POSES, rng)
        recorded = clips[rng.choice(len(clips), POSES, replace=False)]
        fine = load_body("full")
        assert isinstance(fine, SkinnedBody)
        found["alarms"] = {
            f"`{model.name}`, {name}": alarms(model, poses)
            for model in (body, fine)
            for name, poses in (("prior", drawn), ("recording", recorded))
        }
        for name, each in found["alarms"].items():
            print(name, counted(each["rows"]), flush=True)
    if "fits" in parts:
        found["fits"] = fits(body, penetrating_poses(body, FITS, seed))
    if "hinged" in parts:
        fresh = penetrating_poses(body, HINGED, TUNED if tuning else FRESH)
        found["hinged"] = fits(body, fresh, HINGES)
    return found


def counted(rows: list[list[float]]) -> dict[str, int]:
    """How often two solids are within each other, and how often their capsules say so."""
    depth, gap, near = np.array(rows)[:, 1:].T
    alarmed = gap < 0
    return {
        "deep": int((depth > 1e3 * DEEP).sum()),
        "missed": int(((depth > 1e3 * DEEP) & ~alarmed).sum()),
        "missed beside, too": int(((depth > 1e3 * DEEP) & ~alarmed & (near >= 0)).sum()),
        "alarms": int(alarmed.sum()),
        "false": int((alarmed & (depth == 0)).sum()),
        "false by more than 10 mm": int(((gap < -10) & (depth == 0)).sum()),
    }


def line(found: dict[str, list[float]]) -> str:
    """The cells of a row of the table of fits."""
    depth = found["depth"]
    cells = [f"{np.mean(depth):.1f}", f"{np.max(depth):.1f}", f"{np.min(found['gap']):.1f}"]
    cells += [f"{np.mean(found['cost']):.1f}"]
    cells += [f"{np.mean(found['seconds']):.3f}", f"{np.max(found['seconds']):.2f}"]
    cells.append(f"{sum(found['converged']):.0f}")
    return " | ".join(cells)


def tables(found: dict[str, Any]) -> str:
    """The tables of the page."""
    n = len(found["fits"]["nothing"]["depth"])
    head = (
        "mean depth, mm | largest, mm | worst gap, mm | cost of the rest | CPU s | most | converged"
    )
    lines = ["", f"{n} poses that penetrate themselves:", "", f"| fit | {head} |"]
    lines += ["| --- | --: | --: | --: | --: | --: | --: | --: |"]
    lines += [f"| {name} | {line(each)} |" for name, each in found["fits"].items()]
    n = len(found["hinged"]["hinge"]["depth"])
    lines += ["", f"{n} other poses:", "", f"| fit | {head} | above 10 mm (95 %) |"]
    lines += ["| --- | --: | --: | --: | --: | --: | --: | --: | --: |"]
    for name, each in found["hinged"].items():
        above = int((np.array(each["depth"]) > 1e3 * DEEP).sum())
        lines.append(f"| {name} | {line(each)} | {_share(above, n)} |")
    head = "above 10 mm on the mesh | missed (95 %) | missed beside, too | alarms | false (95 %)"
    lines += ["", f"{POSES} poses each:", "", f"| poses | {head} |"]
    lines += ["| --- | --: | --: | --: | --: | --: |"]
    for name, each in found["alarms"].items():
        k = counted(each["rows"])
        cells = [k["deep"], _share(k["missed"], k["deep"]), k["missed beside, too"], k["alarms"]]
        cells.append(_share(k["false"], k["alarms"]))
        lines.append(f"| {name} | {' | '.join(map(str, cells))} |")
    lines += [
        "",
        "| body | drawn people, mm rms | held-out people, mm rms | nearest to these, mm rms |",
        "| --- | --: | --: | --: |",
    ]
    for name, each in found["capsules"].items():
        rms = ("" if x is None else f"{x:.1f}" for x in each.values())
        lines.append(f"| {name} | {' | '.join(rms)} |")
    lines += ["", "| a linearization | ms |", "| --- | --: |"]
    lines += [f"| {name} | {ms:.2f} |" for name, ms in found["linearizations"].items()]
    return "\n".join(lines) + "\n"


def _share(part: int, whole: int) -> str:
    share = rate(part, whole)
    return f"{part} ({100 * share.low:.0f} to {100 * share.high:.0f} %)"


def main() -> None:
    """Run, keep the numbers, and write the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("recording", type=Path, help="motion capture (.npz)")
    parser.add_argument("--tuning", action="store_true", help="other poses; keep nothing")
    parser.add_argument("--parts", nargs="*", default=list(PARTS), choices=list(PARTS))
    options = parser.parse_args()
    found = run(options.recording, options.tuning, options.parts)
    if not options.tuning:
        keep(RESULTS, json.loads(RESULTS.read_text()) | found, 4)
        write_between(PAGE, BEGIN, END, tables(json.loads(RESULTS.read_text())))


if __name__ == "__main__":
    main()
