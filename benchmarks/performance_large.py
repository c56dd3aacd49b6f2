"""Problems of many unknowns or many points, beside the same written by hand and peers.

- Meshes to parameters: people of `default`, whose vertices are known exactly or with 5 mm of
  noise, by the workbench and by smplfitter.
- NLopt's L-BFGS through `solve` and by hand, on noisy vertices: the same derivatives and scaling,
  and by hand as many evaluations as ours took. By hand it is told when to stop, which nobody knows.
- One Gauss-Newton step of a registration whose vertices are all free: three unknowns a vertex, each
  of which meets a few others. The problem is linear, so that whoever writes the step by hand may
  keep the Jacobian; only the linear algebra is left to do then.
- A video of `default` as one problem: every frame has a pose and a place of its own, 75 unknowns,
  four cameras see its joints or its keypoints to one pixel, and all frames share ten betas.
- Closest places on the surface of `full`: compiled, in NumPy, and by libigl's AABB tree.
"""

import tempfile
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property, partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import casadi as cs
import nlopt
import numpy as np
import trimesh
from scipy.sparse import csc_array, diags_array
from scipy.sparse.linalg import lsmr, spsolve

import workbench as wb
from benchmarks import candidates
from benchmarks.candidates import COMPILED, NUMPY, Disagreement
from benchmarks.measuring import (
    digits,
    in_a_process_of_its_own,
    milliseconds,
    peak,
    ratio,
    side_by_side,
    table,
    timing,
)
from benchmarks.problems import SIGMA, Case, body_called, case_of
from workbench.arrays import Array, Index
from workbench.bodies.catalogue import load_skinned
from workbench.geometry.rotation import matrix_from_vector
from workbench.geometry.surface_search import IN_NUMPY, SearchBackend
from workbench.geometry.surface_tree import SurfaceTree, compiled, quickest
from workbench.problem.storage import by_nonzeros

BODY = "default"

# Meshes to parameters

NOISES = {"exact": 0.0, "5 mm": 0.005}  # m, standard deviation
ITERATIONS = (1, 4, 20)  # of smplfitter: its default, the most that it calls reasonable, and more
PEOPLE = 20


def meshes(quick: bool) -> dict[str, Any]:
    """By noise and method: the mean distance of vertices from the truth, mm, and seconds a fit."""
    case = case_of(BODY, load_skinned(BODY))
    methods: dict[str, Callable[[Array, Array], Array]] = {
        NUMPY: lambda seen, _: _fitted(case, seen),
        **_smplfitter(case.body),
    }
    rng, found = np.random.default_rng(0), dict[str, Any]()
    people = case.people(2 if quick else PEOPLE)
    joints = [case.body.joints(*case.problem.free.unpack(x).values()) for x in people]
    for noise, sigma in NOISES.items():
        truths = [case.vertices(x) for x in people]
        seen = [v + sigma * rng.standard_normal(v.shape) for v in truths]
        found[noise] = {}
        for name, fit in methods.items():
            fit(seen[0], joints[0])  # compiles
            away, seconds = [], []
            for v, J, truth in zip(seen, joints, truths, strict=True):
                began = time.perf_counter()
                fitted = fit(v, J)
                seconds.append(time.perf_counter() - began)
                away.append(1e3 * float(np.linalg.norm(fitted - truth, axis=1).mean()))
            found[noise][name] = {"mm": float(np.mean(away)), **timing(seconds)}
    return {"people": len(people), "vertices": case.body.n_vertices, "found": found}


def _fitted(case: Case, seen: Array) -> Array:
    """(N, 3) m, of the fit from zero by the default solver."""
    solution = wb.solve(case.problem, case.body.start() | {"observed": seen})
    return case.body.vertices(*(solution.values[name] for name in ("pose", "betas", "trans")))


def _smplfitter(body: wb.SkinnedBody) -> dict[str, Callable[[Array, Array], Array]]:
    """smplfitter with NumPy, of vertices alone and with the true joints; it reads a body from a
    file in the form of SMPL-H's.
    """
    if find_spec("smplfitter") is None:
        print("skipped smplfitter: not installed")
        return {}
    from smplfitter.np import BodyFitter, BodyModel

    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "neutral").mkdir()
        np.savez(
            Path(folder) / "neutral" / "model.npz",
            v_template=body.template,
            shapedirs=body.shapedirs,
            posedirs=body.posedirs,
            J_regressor=body.J_regressor.toarray(),
            weights=body.weights,
            f=body.faces,
            kintree_table=np.array([body.parents, range(body.n_joints)]),
        )
        np.save(Path(folder) / "kid_template.npy", np.zeros_like(body.template))
        model = BodyModel("smplh16", "neutral", model_root=folder)
    fitter = BodyFitter(model)

    def fit(iterations: int, with_joints: bool, seen: Array, joints: Array) -> Array:
        found = fitter.fit(
            seen[None].astype(np.float32),
            joints[None].astype(np.float32) if with_joints else None,
            num_iter=iterations,
            beta_regularizer=0,  # its default, 1, is farther from the truth
            requested_keys=["vertices"],
        )
        return np.asarray(found["vertices"][0], dtype=float)

    each = {f"smplfitter, num_iter {n}": partial(fit, n, False) for n in ITERATIONS}
    return {**each, "smplfitter, num_iter 4, true joints": partial(fit, 4, True)}


def table_of_meshes(found: Mapping[str, Any]) -> str:
    """The methods, with distance and time by noise."""
    heads = [head for noise in found["found"] for head in (f"{noise}: mm", "ms")]
    methods = list(next(iter(found["found"].values())))
    rows = [
        (
            name,
            *(
                cell
                for of in found["found"].values()
                for cell in (f"{of[name]['mm']:.3f}", milliseconds(of[name]))
            ),
        )
        for name in methods
    ]
    return table((f"{found['people']} people, N = {found['vertices']:,}", *heads), rows)


# What `solve` adds to NLopt's L-BFGS

LBFGS = wb.Nlopt("LD_LBFGS")
SAME = 1e-6  # of the cost
SLACK = 1  # evaluations: NLopt does not look at its limit after every one
BY_HAND = " by hand"


def lbfgs(quick: bool, people: int = 3) -> dict[str, Any]:
    """Seconds per fit of some people; raises Disagreement if both end apart."""
    rounds, body = (1, "40") if quick else (18, BODY)
    fits: dict[str, Callable[[Any], Any]] = {}
    vertices = 0
    for way, case in candidates.cases(body, body_called(body)).items():
        rng = np.random.default_rng(0)
        seen = [case.seeing(x) for x in case.people(people)]
        seen = [
            replace(one, observed=one.observed + rng.normal(0, SIGMA, one.observed.shape))
            for one in seen
        ]
        vertices = case.body.n_vertices
        found = [_solved(one) for one in seen]
        limits = [one.evaluations.gradient for one in found]
        for one, limit, solution in zip(seen, limits, found, strict=True):
            cost, evaluations = by_hand(one, limit)
            if not abs(cost / solution.cost - 1) <= SAME or abs(evaluations - limit) > SLACK:
                raise Disagreement(
                    f"by hand the cost is {cost:.9g} after {evaluations} evaluations, ours is "
                    f"{solution.cost:.9g} after {limit}"
                )
        fits[way] = partial(_each, _solved, [(one,) for one in seen])
        fits[way + BY_HAND] = partial(_each, by_hand, list(zip(seen, limits, strict=True)))
    seconds = side_by_side(fits, [None], rounds, parts=people)
    return {"body": body, "vertices": vertices, "seconds": seconds}


def _each(run: Callable[..., Any], arguments: list[tuple[Any, ...]], _: object) -> None:
    for one in arguments:
        run(*one)


def _solved(case: Case) -> wb.Solution:
    solution = wb.solve(case.problem, case.body.start() | {"observed": case.observed}, LBFGS)
    if not solution.converged:
        raise Disagreement(f"{solution.solver} did not converge: {solution.message}")
    return solution


def by_hand(case: Case, evaluations: int) -> tuple[float, int]:
    """L-BFGS in variables scaled by the columns of the Jacobian at the start, like ours.

    It counts, and keeps the best point. Returns the least cost and the number of evaluations.
    """
    problem, fixed = case.problem, case.fixed
    start = np.zeros(problem.free.size)
    scale = problem.linearize_at(start, fixed).column_norms
    costs, best = [np.inf], start

    def cost(y: Array, gradient: Array) -> float:
        nonlocal best
        x = y / scale
        found, derivative = problem.cost_and_gradient(x, fixed)
        gradient[:] = derivative / scale
        if found < min(costs):
            best = x.copy()
        costs.append(found)
        return found

    optimizer = nlopt.opt(nlopt.LD_LBFGS, scale.size)
    optimizer.set_min_objective(cost)
    optimizer.set_maxeval(evaluations)
    optimizer.optimize(start * scale)
    return min(costs), len(costs) - 1


def table_of_lbfgs(found: Mapping[str, Any]) -> str:
    """Ours and by hand, by way of computing."""
    seconds = found["seconds"]
    rows = [
        (way, milliseconds(seconds[way]), milliseconds(hand), digits(ratio(seconds, way, label)))
        for label, hand in seconds.items()
        if (way := label.removesuffix(BY_HAND)) != label
    ]
    head = f"{found['body']}, N = {found['vertices']:,}"
    return table((head, "fit, ms", "by hand, ms", "× by hand"), rows)


# A step with free vertices

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


def vertices(quick: bool) -> dict[str, Any]:
    """By body: unknowns, rows, seconds by candidate, bytes of a process that does one step."""
    bodies = ("small",) if quick else ("small", "default", "full")
    return {name: _vertices(name, 1 if quick else 12) for name in bodies}


def _vertices(name: str, rounds: int) -> dict[str, Any]:
    """Three ways to one step, of a problem whose Jacobian J is the same everywhere."""
    problem, start, fixed = registration(name)
    J: Any = problem.linearize_at(start, fixed).jacobian
    steps: dict[str, Callable[[Array], Array]] = {
        OURS: lambda x: problem.linearize_at(x, fixed).step(),
        DIRECT: lambda x: spsolve(J.T @ J, -J.T @ problem.residual(x, fixed)),
        KRYLOV: lambda x: lsmr(J, -problem.residual(x, fixed), atol=DIGITS, btol=DIGITS)[0],
    }
    inputs = [start + 1e-3 * k for k in range(4)]
    expected = steps[OURS](inputs[1])
    for step in steps.values():
        np.testing.assert_allclose(step(inputs[1]), expected, rtol=0, atol=AGREE)
    return {
        "unknowns": problem.free.size,
        "rows": problem.size,
        "seconds": side_by_side(steps, inputs, rounds),
        "bytes": in_a_process_of_its_own(memory_of_a_step, name),
    }


def memory_of_a_step(name: str) -> dict[str, int]:
    """Bytes of this process, which should have done nothing else: before, and at the worst."""
    before = peak()
    problem, x, fixed = registration(name)
    problem.linearize_at(x, fixed).step()
    return {"before": before, "peak": peak()}


def table_of_vertices(found: Mapping[str, Any]) -> str:
    """By mesh; memory without that of the imports."""
    rows = []
    for name, one in found.items():
        seconds, taken = one["seconds"], one["bytes"]["peak"] - one["bytes"]["before"]
        cells = [f"{one['unknowns']:,}", f"{one['rows']:,}", milliseconds(seconds[OURS])]
        cells += [digits(taken / 1e6)]
        for by in (DIRECT, KRYLOV):
            cells += [milliseconds(seconds[by]), digits(ratio(seconds, by, OURS))]
        rows.append((name, *cells))
    times = ("ours, ms", "memory, MB", "spsolve, ms", "× ours", "lsmr, ms", "× ours")
    return table(("mesh", "unknowns", "rows", *times), rows)


# A video as one problem

JOINTS, COCO = "24 joints", "COCO landmarks"
APART, WHOLE, STEP, STEP_BY_HAND = "frames one by one", "linearize", "step", "step by hand, spsolve"
ITERATION = "LM iteration"
PIXEL, DAMPING = 1.0, 1e-3  # px; of the steps that are compared


@dataclass(frozen=True, eq=False)
class Film:
    """A video, where a fit of it begins, and a frame of it.

    What is timed begins at points that differ from call to call by a number.
    """

    frame: wb.Problem
    video: wb.Problem
    values: wb.Values

    @cached_property
    def start(self) -> tuple[Array, Array]:
        """The free and the fixed numbers of the video."""
        return self.video.split(self.values)

    @cached_property
    def frames(self) -> list[tuple[Array, Array]]:
        """Those of every frame alone."""
        own = {name for name, block in self.video.known.items() if block.framed}
        return [
            self.frame.split({n: v[t] if n in own else v for n, v in self.values.items()})
            for t in range(len(self.values["trans"]))
        ]

    @cached_property
    def here(self) -> wb.Linearization:
        """The video where a fit begins."""
        return self.video.linearize_at(*self.start)

    @cached_property
    def J(self) -> csc_array:
        """Its Jacobian, for whoever solves by hand."""
        J: Any = self.here.jacobian
        return csc_array(J if isinstance(J, np.ndarray) else by_nonzeros(J))

    def one_by_one(self, shift: float) -> None:
        """Residual and Jacobian of every frame alone."""
        for x, fixed in self.frames:
            self.frame.linearize_at(x + shift, fixed)

    def linearize(self, shift: float) -> None:
        """Those of the video."""
        x, fixed = self.start
        self.video.linearize_at(x + shift, fixed)

    def step(self, shift: float) -> Array:
        """Normal equations and a damped step, of a Jacobian that is there."""
        return wb.Linearization(self.here.residual + shift, self.here.jacobian).step(DAMPING)

    def step_by_hand(self, shift: float) -> Array:
        """The same by SciPy's SuperLU as it is."""
        N = self.J.T @ self.J + DAMPING * diags_array(np.ones(self.J.shape[1]))
        return np.asarray(spsolve(csc_array(N), -self.J.T @ (self.here.residual + shift)))

    def iterations(self) -> list[float]:
        """Seconds of each of a few iterations of a solve: linearize, step, judge, record."""
        found = wb.LevenbergMarquardt(max_iterations=6).solve(self.video, self.values)
        return [float(s) for s in np.diff([iterate.seconds for iterate in found.trace])]


def film(frames: int, seen: str = JOINTS) -> Film:
    """A body that bends and turns slowly (synthetic)."""
    body, rng = wb.load_body(BODY), np.random.default_rng(0)
    pose, betas, trans = (block.symbol for block in body.blocks())
    of_joints = seen == JOINTS
    points = (
        body.joint_points(pose, betas, trans)
        if of_joints
        else body.landmark_points("coco", pose, betas, trans)
    )
    times = np.arange(frames)[:, None, None] / 30  # s
    turns = 0.2 * rng.standard_normal((24, 3)) * np.sin(2 * times + rng.uniform(0, 6, (24, 3)))
    shape = rng.standard_normal(body.n_betas)
    way = np.stack([0.1 * np.sin(times[:, 0, 0] + k) for k in range(3)], axis=1)
    place = body.joints if of_joints else lambda *at: body.landmark("coco", *at)
    where = [place(one, shape, t) for one, t in zip(turns, way, strict=True)]
    terms, cameras = [], list[str]()
    numbers: dict[str, Array] = {}
    for i in range(4):
        camera = wb.Camera(f"camera {i + 1}/")
        K = np.array([[1000.0, 0, 500], [0, 1000.0, 500], [0, 0, 1]])  # px
        R = np.diag([1.0, -1, -1]) @ matrix_from_vector([0, -np.pi / 2 * i, 0])
        known = camera.values(K=K, R=R, t=[0, 0, 4])
        pixels = np.array([camera.pixels(one, known) for one in where])
        observed = wb.Block(f"camera {i + 1}/observed", pixels.shape[1:], "px")
        numbers |= known | {observed.name: pixels + PIXEL * rng.standard_normal(pixels.shape)}
        sure = np.ones(points.count)
        terms.append(
            wb.residuals.keypoints(
                points, camera, observed.symbol, sure, sigma=PIXEL, name=f"camera {i + 1}"
            )
        )
        cameras += [block.name for block in camera.blocks]
    priors = (
        wb.residuals.gaussian(pose, covariance=0.3**2, unit="rad", name="pose prior"),
        wb.residuals.gaussian(betas, name="shape prior"),
    )
    frame = wb.Problem([*terms, *priors], ("trans", "pose", "betas"))
    between = (wb.residuals.smooth("pose", sigma=0.05), wb.residuals.smooth("trans", sigma=0.02))
    video = wb.sequence([frame] * frames, shared=("betas", *cameras), between=between)
    begin = body.start()
    start = {n: np.repeat(begin[n][None], frames, axis=0) for n in ("pose", "trans")}
    return Film(frame, video, begin | numbers | start)


def videos(quick: bool) -> dict[str, Any]:
    """By what is seen: unknowns, rows and seconds by candidate; by the number of frames, seconds
    and bytes of a process of its own.
    """
    frames, rounds = (4, 1) if quick else (200, 6)
    found: dict[str, Any] = {"seen": {}, "frames": {}}
    for name in (JOINTS, COCO):
        made = film(frames, name)
        expected = made.step_by_hand(1e-3)
        near = 1e-8 * np.abs(expected).max()
        np.testing.assert_allclose(made.step(1e-3), expected, rtol=0, atol=near)
        ways: dict[str, Callable[[float], object]] = {
            APART: made.one_by_one,
            WHOLE: made.linearize,
            STEP: made.step,
            STEP_BY_HAND: made.step_by_hand,
        }
        seconds = side_by_side(ways, [1e-4 * k for k in range(1, 5)], rounds)
        # alternately, so that a disturbance meets both
        both = [(_timed(made.one_by_one, 1e-5 * k), made.iterations()) for k in range(rounds)]
        seconds[APART] = timing([one for one, _ in both])
        seconds[ITERATION] = timing([s for _, several in both for s in several])
        sizes = {"unknowns": made.video.free.size, "rows": made.video.size}
        found["seen"][name] = {"frames": frames, **sizes, "seconds": seconds}
    for count in (3,) if quick else (200, 500, 1000, 2000):
        found["frames"][str(count)] = in_a_process_of_its_own(memory_of_a_video, count)
    return found


def memory_of_a_video(frames: int) -> dict[str, Any]:
    """Of this process, which should have done nothing else: bytes, before and at the worst, and
    seconds of iterations.
    """
    before = peak()
    made = film(frames)
    made.video.prepare()
    each, unknowns = made.iterations(), made.video.free.size
    return {"unknowns": unknowns, "before": before, "peak": peak(), ITERATION: timing(each)}


def _timed(run: Callable[[Any], object], argument: Any) -> float:
    began = time.perf_counter()
    run(argument)
    return time.perf_counter() - began


def table_of_videos(found: Mapping[str, Any]) -> str:
    """By what is seen, and by the number of frames; memory without that of the imports."""
    parts = (APART, WHOLE, ITERATION, STEP, STEP_BY_HAND)
    seen = [
        (
            f"{name}, {one['frames']} frames",
            f"{one['unknowns']:,}",
            *(milliseconds(one["seconds"][part]) for part in parts),
            digits(ratio(one["seconds"], ITERATION, APART)),
        )
        for name, one in found["seen"].items()
    ]
    frames = []
    for count, one in found["frames"].items():
        taken, n = (one["peak"] - one["before"]) / 1e6, int(count)
        each = digits(1e3 * one[ITERATION]["least"] / n), digits(taken), digits(taken / n)
        frames.append((f"{n:,}", f"{one['unknowns']:,}", milliseconds(one[ITERATION]), *each))
    heads = (*(f"{part}, ms" for part in parts), "iteration × one by one")
    memory = ("unknowns", f"{ITERATION}, ms", "a frame, ms", "memory, MB", "a frame, MB")
    return f"{table(('seen', 'unknowns', *heads), seen)}\n{table(('frames', *memory), frames)}"


# Closest places on a surface

IGL = "libigl"
NOISE, CLUTTER, ROOM, OFF = 0.005, 0.2, 0.2, 0.15  # m, share, m around the body, m
DIFFERENT = 4  # sets of points of each kind
FEW = 3  # turns of NumPy
AGREE_CLOSEST = 1e-12  # m: by how much distances may differ
PLACES = {"near": "near", "clutter": "20 % clutter", "off": "15 cm off"}
REFIT = "refit"


def points_about(mesh: trimesh.Trimesh, kind: str, count: int, seed: int) -> Array:
    """Points (count, 3) m, in no order: near the surface, with clutter, or all of them off."""
    rng = np.random.default_rng(seed)
    corners = mesh.vertices[mesh.faces[rng.integers(len(mesh.faces), size=count)]]
    found = np.einsum("ik,ikj->ij", rng.dirichlet(np.ones(3), count), corners)
    found += NOISE * rng.standard_normal(found.shape)
    if kind == "clutter":
        low, high = mesh.bounds + [[-ROOM], [ROOM]]
        some = rng.random(count) < CLUTTER
        found[some] = rng.uniform(low, high, (int(some.sum()), 3))
    return np.asarray(found + [OFF if kind == "off" else 0, 0, 0])


def closest(quick: bool) -> dict[str, Any]:
    """By kind of points: seconds by candidate; and those of a refit. All agree on distances."""
    name, count, rounds = ("small", 200, 1) if quick else ("full", 40_000, 12)
    body = wb.load_body(name)
    mesh = trimesh.Trimesh(body.template, body.faces, process=False)
    V, F = np.array(mesh.vertices), np.array(mesh.faces)
    backends: dict[str, Callable[[], SearchBackend]] = {NUMPY: lambda: IN_NUMPY}
    if compiled():
        backends = {COMPILED: quickest, **backends}
    trees = {way: SurfaceTree(V, F, backend) for way, backend in backends.items()}
    searches: dict[str, Callable[[Array], Array]] = {
        way: partial(_distances, tree) for way, tree in trees.items()
    } | _libigl(V, F)
    seconds: dict[str, Any] = {}
    for kind in PLACES:
        inputs = [points_about(mesh, kind, count, seed) for seed in range(DIFFERENT)]
        expected = searches[NUMPY](inputs[0])
        for search in searches.values():
            np.testing.assert_allclose(search(inputs[0]), expected, rtol=0, atol=AGREE_CLOSEST)
        slow = {NUMPY: searches[NUMPY]}  # not among the others, whose turns would be far apart
        others = {way: run for way, run in searches.items() if way not in slow}
        seconds[kind] = side_by_side(others, inputs, rounds)
        seconds[kind] |= side_by_side(slow, inputs, min(rounds, FEW))
    moved = [V * (1 + 0.01 * k) for k in range(DIFFERENT)]
    seconds[REFIT] = side_by_side({way: t.moved for way, t in trees.items()}, moved, rounds)
    return {"body": name, "faces": len(F), "points": count, "seconds": seconds}


def _distances(tree: SurfaceTree, points: Array) -> Array:
    """(M,) m, never negative."""
    return np.abs(tree.closest(points).distances)


def _libigl(V: Array, F: Index) -> dict[str, Callable[[Array], Array]]:
    if find_spec("igl") is None:
        print("skipped libigl: igl not installed")
        return {}
    import igl

    tree = igl.AABB()
    tree.init(V, F)
    return {IGL: lambda points: np.sqrt(tree.squared_distance(V, F, points)[0])}


def table_of_closest(found: Mapping[str, Any]) -> str:
    """By candidate: milliseconds by kind of points with ratios, and of a refit."""
    kinds = {**PLACES, REFIT: REFIT}
    rows = []
    for name in found["seconds"][next(iter(kinds))]:
        cells: list[str] = []
        for kind in kinds:
            seconds = found["seconds"][kind]
            both = COMPILED in seconds and name in seconds
            cells += [milliseconds(seconds[name]) if name in seconds else ""]
            cells += [digits(ratio(seconds, name, COMPILED)) if both else ""]
        rows.append((name, *cells))
    heads = [head for kind in kinds.values() for head in (f"{kind}, ms", "× compiled")]
    return table((f"{found['points']:,} points, {found['faces']:,} triangles", *heads), rows)
