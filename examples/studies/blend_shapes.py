"""What does skinning get wrong, and which predictor repairs it?

    python -m examples.studies.blend_shapes [--mocap FILE] [--body small] ...

All predictors are fitted to the same poses of a synthetic teacher, a finer rig that spreads twist
along the limbs and blends dual quaternions. Without a recording they are tested on further draws
of the pose prior. This takes several minutes, or one minute with --body small.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path

import casadi as cs
import numpy as np
from matplotlib.axes import Axes
from scipy.sparse import csr_array

from builder.geometry import along_edges
from builder.recordings import held_out_poses
from builder.ridge import RidgeSums, solve_ridge
from examples.studies.output import Drawing, Report, arguments, report, write_study
from workbench.arrays import Array, Mask
from workbench.bodies import SkinnedBody, dual_quaternion_blend
from workbench.bodies.ablations import without_blend_weights, without_pose_blend_shapes
from workbench.bodies.catalogue import load_skinned
from workbench.bodies.forward import surface
from workbench.bodies.forward.surface import (
    Features,
    quaternion_elements,
    rotation_elements,
    rotation_vectors,
)
from workbench.errors import BadArgument
from workbench.geometry.solids import mesh_edges
from workbench.lectures.material.blend_shapes import (
    Correctives,
    PosedSurfaces,
    TrainingData,
    feature_matrix,
    rms_error,
    rms_length,
    with_blend_shapes,
)
from workbench.lectures.material.kernel_features import Powers, products
from workbench.lectures.material.teacher import body_on_teachers_rig, teacher_of
from workbench.plots.palette import BLUE, DASHES, FAINT, INK, LINES, VERMILLION
from workbench.plots.style import plain
from workbench.priors.poses import draw_poses, shipped_gaussian
from workbench.reports.page import Columns, Table
from workbench.training.estimate import bent

STEPS = 400  # of the accelerated proximal gradient method, at most
SETTLED = 1e-5  # a step that changes |P| by less ends it: within a thousandth of the minimum
REFIT_RIDGE = 1e-4  # per pose
FAR = 0.2  # m from the joint: what counts as far in `far_share`
NEAREST = 6  # vertices that stand for a joint whose part does not touch its parent's
DISTANCE_PENALTY = 0.1  # per m^2 and pose: far blend shapes shrink, the error hardly grows
GROUP_PENALTY = 1e-4  # m: leaves about one number in fourteen
LINEAR = "linear blending (LBS)"
WITHOUT_BONES: Mapping[str, Features] = {
    "linear in theta, no bones": rotation_vectors,
    "cubic in theta, no bones": Powers(3),
    "quadratic in theta, no bones": products,
}
LINEAR_IN: Mapping[str, Features] = {
    "LBS + theta": rotation_vectors,
    "LBS + quaternions": quaternion_elements,
    "LBS + rotation elements (SMPL)": rotation_elements,
}
NORMALISED, INTERPOLATION = "LBS + normalised kernel", "LBS + exact RBF"
SPARSE_BELOW = 0.2  # of all numbers: there a sparse product is the faster one
DISTANCE_PENALTIES = (1e-3, 1e-2, 1e-1, 1.0, 10.0)  # per m^2 and pose
GROUP_PENALTIES = (1e-5, 3e-5, 1e-4, 3e-4, 1e-3)  # m
RIDGE = 1e-3  # per pose, of all blend shapes beside the penalty on distance
EXAGGERATED = 20  # poses that are multiplied by FACTORS
FACTORS = np.linspace(0, 6, 25)
TURNS = np.radians(np.arange(0, 721, 5))
EXAMPLE_COUNTS = (25, 50, 100, 200, 400, 800)
EVERY = 4  # of the test poses: where many predictors are tested, only every fourth is used
TURNED = "neck"  # the joint of the lecture's demonstration
LENGTH = "rms length of the blend shapes (mm)"
ROUND = [d * 10.0**e for e in range(-2, 3) for d in (1, 2, 5)]  # ticks, mm or ms


def group_lasso(features: Array, wanted: Array, per_joint: int, penalty: float) -> Array:
    """Posedirs (N, 3, F) m, many of them zero: STAR (Osman, Bolkart, Black, ECCV 2020) as a
    group lasso (Yuan and Lin, J. Royal Statistical Society B 68(1), 2006).

    It minimises 1/2 |A P - D|^2 / n + penalty sum over joints k and vertices i of |P_ki|, P_ki
    being a joint's numbers at a vertex, for feature matrices (n, F), correctives `wanted`
    (n, N, 3) m, and the penalty in m. The method is FISTA (Beck and Teboulle, SIAM J. Imaging
    Sciences 2(1), 2009), restarted where it overshoots (O'Donoghue and Candes, Foundations of
    Computational Mathematics 15, 2015).
    """
    n, N = len(wanted), wanted.shape[1]
    gram = features.T @ features / n
    products = features.T @ wanted.reshape(n, -1) / n  # (F, 3 N)
    step = 1 / float(np.linalg.eigvalsh(gram)[-1])
    P = ahead = np.zeros_like(products)
    t = 1.0
    for _ in range(STEPS):
        new = _shrunk(ahead - step * (gram @ ahead - products), N, per_joint, step * penalty)
        change = new - P
        if np.vdot(ahead - new, change) > 0:
            t = 1.0  # it overshoots: start the acceleration again
        t_new = (1 + np.sqrt(1 + 4 * t**2)) / 2
        ahead = new + (t - 1) / t_new * change
        P, t = new, t_new
        if np.linalg.norm(change) <= SETTLED * np.linalg.norm(P):
            break
    return np.ascontiguousarray(P.reshape(-1, N, 3).transpose(1, 2, 0))


def refitted(features: Array, wanted: Array, posedirs: Array) -> Array:
    """Least squares on the numbers that are not zero, all of which the lasso made too small."""
    nonzero: Mask = np.any(posedirs, axis=1)
    return solve_ridge(RidgeSums.of([(features, wanted)]), nonzero, REFIT_RIDGE)


def nonzero_share(posedirs: Array) -> float:
    """The share of the numbers that are not zero."""
    return float(np.count_nonzero(posedirs) / posedirs.size)


def _shrunk(P: Array, N: int, per_joint: int, by: float) -> Array:
    """Every group of (F, 3 N) shortened by `by`, or zero if it is shorter than that."""
    groups = P.reshape(-1, per_joint, N, 3)
    length = np.sqrt(np.einsum("kfic,kfic->ki", groups, groups))
    factor = np.maximum(0, 1 - by / np.maximum(length, 1e-300))
    shrunk: Array = (groups * factor[:, None, :, None]).reshape(P.shape)
    return shrunk


def joint_distances(body: SkinnedBody) -> Array:
    """From every joint but the root to every vertex along the mesh, (K - 1, N) m.

    A joint is the ring of vertices where its part meets that of its parent.
    """
    part = body.weights.argmax(axis=1)
    joints, pairs = body.joints(), mesh_edges(body.faces)
    rings = []
    for k, parent in enumerate(body.parents[1:], start=1):
        across = (part[pairs] == k).any(axis=1) & (part[pairs] == parent).any(axis=1)
        ring = np.unique(pairs[across])
        if not len(ring):
            away = np.linalg.norm(body.template - joints[k], axis=1)
            ring = np.argsort(away)[:NEAREST]
        rings.append(ring)
    return along_edges(body.template, body.faces, rings)


def local_ridge(
    features: Array, wanted: Array, distances: Array, penalty: float, ridge: float
) -> Array:
    """Posedirs (N, 3, F) m by ridge regression, with a larger ridge farther from the joint.

    Per pose the ridge of joint k's features at vertex i is penalty d(k, i)^2 + ridge, for feature
    matrices (n, F) with as many features for each joint, correctives `wanted` (n, N, 3) m, and
    distances (K - 1, N) m.
    """
    n, N = len(wanted), wanted.shape[1]
    per_joint = features.shape[1] // len(distances)
    ridges = n * (ridge + penalty * np.repeat(distances.T**2, per_joint, axis=1))
    gram, products = features.T @ features, np.tensordot(wanted, features, (0, 0))  # (N, 3, F)
    solved = (np.linalg.solve(gram + np.diag(ridges[i]), products[i].T).T for i in range(N))
    return np.stack(list(solved))


def far_share(posedirs: Array, distances: Array) -> float:
    """The norm of blend shapes further than FAR from their joint, over the norm of all of them."""
    per_joint = posedirs.shape[2] // len(distances)
    far = np.repeat(distances.T > FAR, per_joint, axis=1)[:, None]
    return float(np.linalg.norm(posedirs * far) / np.linalg.norm(posedirs))


@dataclass(frozen=True)
class Result:
    """What was measured of one predictor.

    Attributes:
        name: its name.
        parameters: how many numbers were fitted, beside template and weights, and are not zero.
        accuracy: its distances to the teacher in the test poses, and its time.
    """

    name: str
    parameters: int
    accuracy: Accuracy


def fit_predictors(
    data: TrainingData, n_examples: int, report: Report
) -> Iterator[tuple[str, SkinnedBody, int]]:
    """Name, body and number of parameters of every predictor, each fitted when it is its turn.

    Two of them interpolate `n_examples` poses.
    """
    body = data.body
    linear = without_pose_blend_shapes(body)
    dual = replace(linear, skinning=dual_quaternion_blend)
    yield LINEAR, linear, 0
    yield "rigid parts", without_blend_weights(linear), 0
    yield "dual quaternions (DQB)", dual, 0
    for name, features in WITHOUT_BONES.items():
        report(name)
        found = data.fit_without_bones(features)
        yield name, found, found.posedirs.size + found.template.size
    report("computing the correctives of linear blending")
    wanted = data.correctives(linear)

    def predictor(
        name: str, features: Features, posedirs: Array, more: int = 0
    ) -> tuple[str, SkinnedBody, int]:
        body = with_blend_shapes(linear, features, posedirs)
        return name, body, int(np.count_nonzero(posedirs)) + more

    for name, features in LINEAR_IN.items():
        report(name)
        posedirs, ridge = data.fit(features, wanted)
        yield predictor(name, features, posedirs)
    report("LBS + rotation elements, near")  # with the last ridge, that of all rotation elements
    A, distances = data.features(rotation_elements)[0], joint_distances(body)
    near = local_ridge(A, wanted.training, distances, DISTANCE_PENALTY, ridge)
    yield predictor("LBS + rotation elements, near (MANO)", rotation_elements, near)
    report("LBS + quaternions, sparse")
    A = data.features(quaternion_elements)[0]
    chosen = group_lasso(A, wanted.training, 4, GROUP_PENALTY)
    sparse = refitted(A, wanted.training, chosen)
    yield predictor("LBS + quaternions, sparse (STAR)", quaternion_elements, sparse)
    report(f"LBS + {n_examples} examples")
    blended, posedirs = data.blended_examples(n_examples, wanted)
    places = blended.examples.places.size
    yield predictor(f"{NORMALISED} of {n_examples} examples", blended, posedirs, places)
    exact, posedirs = data.interpolation(n_examples, wanted)
    yield predictor(f"{INTERPOLATION} of {n_examples} examples", exact, posedirs, places)
    report("DQB + rotation elements")
    posedirs, _ = data.fit(rotation_elements, data.correctives(dual))
    name, body = "DQB + rotation elements", with_blend_shapes(dual, rotation_elements, posedirs)
    yield name, body, int(np.count_nonzero(posedirs))


@dataclass(frozen=True)
class Accuracy:
    """Distances to the teacher's vertices over all test poses.

    Attributes:
        mean: in mm.
        rms: in mm.
        largest: in mm.
        milliseconds: the least time that one pose took.
    """

    mean: float
    rms: float
    largest: float
    milliseconds: float


class Evaluation:
    """A function from pose (K, 3) rad to surface (N, 3) m, of the mean person at the origin."""

    def __init__(self, body: SkinnedBody) -> None:
        pose, rest = cs.MX.sym("pose", 3, body.n_joints), cs.MX.sym("rest", 3, body.n_vertices)
        at = surface.posture(body, pose, cs.MX.zeros(body.n_betas))
        G, _ = surface.motions(body, at)
        self._features = cs.Function("features", [pose], [cs.densify(body.features(at))])
        skinned = body.skinning(rest, G, surface.weights(body))
        self._skinned = cs.Function("skinned", [pose, rest], [skinned])
        flat, self._moved = body.posedirs.reshape(3 * body.n_vertices, -1), body.posedirs.any()
        sparse = self._moved and nonzero_share(flat) < SPARSE_BELOW
        self._posedirs = csr_array(flat) if sparse else flat
        self._template = body.template.ravel()

    def __call__(self, pose: Array) -> Array:
        """The surface (N, 3) m."""
        rest = self._template
        if self._moved:
            rest = rest + self._posedirs @ np.asarray(self._features(pose.T)).ravel()
        return np.asarray(self._skinned(pose.T, rest.reshape(-1, 3).T)).T


def accuracy(body: SkinnedBody, test: PosedSurfaces) -> Accuracy:
    """A body's distances to the teacher's surfaces in the test poses."""
    evaluate = Evaluation(body)
    evaluate(test.poses[0])
    distances, seconds = [], []
    for pose, truth in zip(test.poses, test.vertices, strict=True):
        began = time.perf_counter()
        found = evaluate(pose)
        seconds.append(time.perf_counter() - began)
        distances.append(1e3 * np.linalg.norm(found - truth, axis=1))
    return Accuracy(
        mean=float(np.mean(distances)),
        rms=float(np.sqrt(np.mean(np.square(distances)))),
        largest=float(np.max(distances)),
        milliseconds=1e3 * min(seconds),
    )


@dataclass(frozen=True)
class ByExamples:
    """The test of interpolation between n examples.

    Attributes:
        n: how many examples there are.
        normalised: the errors with normalised kernels.
        exact: the errors with kernels that reproduce the examples exactly.
    """

    n: int
    normalised: Accuracy
    exact: Accuracy


@dataclass(frozen=True)
class ByPenalty:
    """Blend shapes fitted with one penalty.

    Attributes:
        penalty: the strength of the penalty, per m^2 and pose, or in m.
        share: the remaining share of what is penalised: of the norm far from the joint, or of the
            numbers that are not zero.
        training_rms: in mm, the rms error of the blend shapes at rest in the training poses.
        test_mean: in mm, the mean distance of posed vertices in the test poses.
    """

    penalty: float
    share: float
    training_rms: float
    test_mean: float


def by_examples(
    data: TrainingData,
    wanted: Correctives,
    test: PosedSurfaces,
    counts: Sequence[int],
    report: Report,
) -> list[ByExamples]:
    """The cost and the errors of interpolation for growing numbers of examples."""
    rows = []
    for n in counts:
        report(f"  {n} examples")
        normalised, exact = (
            accuracy(with_blend_shapes(data.body, *fitted), test)
            for fitted in (data.blended_examples(n, wanted), data.interpolation(n, wanted))
        )
        rows.append(ByExamples(n, normalised, exact))
    return rows


def by_factor(data: TrainingData, wanted: Correctives, n_examples: int) -> dict[str, Array]:
    """What is predicted far from the training poses: the rms length of blend shapes, by predictor.

    In mm, at validation poses multiplied by each of FACTORS.
    """
    predictors: dict[str, tuple[Features, Array]] = {
        **_linear_predictors(data, wanted),
        f"{NORMALISED} of examples": data.blended_examples(n_examples, wanted),
        f"{INTERPOLATION} of examples": data.interpolation(n_examples, wanted),
    }
    poses = data.validation.poses[:EXAGGERATED]
    return {
        name: np.array([rms_length(_offsets(data, *fitted, f * poses)) for f in FACTORS])
        for name, fitted in predictors.items()
    }


def by_angle(data: TrainingData, wanted: Correctives, joint: str) -> dict[str, Array]:
    """The rms length of blend shapes, mm, at each of TURNS of a joint about the vertical."""
    poses = np.tile(data.body.bind_pose, (len(TURNS), 1, 1))
    poses[:, data.body.joint_names.index(joint), 1] = TURNS
    return {
        name: np.array([rms_length(each) for each in _offsets(data, *fitted, poses)])
        for name, fitted in _linear_predictors(data, wanted).items()
    }


def by_distance_penalty(
    data: TrainingData, wanted: Correctives, test: PosedSurfaces, report: Report
) -> list[ByPenalty]:
    """How far blend shapes reach with more and more of MANO's penalty, and what that costs."""
    A, distances = data.features(rotation_elements)[0], joint_distances(data.body)
    rows = []
    for penalty in DISTANCE_PENALTIES:
        report(f"  a penalty of {penalty:g} per square metre")
        P = local_ridge(A, wanted.training, distances, penalty, RIDGE)
        body = with_blend_shapes(data.body, rotation_elements, P)
        training = 1e3 * rms_error(A, wanted.training, P)
        rows.append(
            ByPenalty(penalty, far_share(P, distances), training, accuracy(body, test).mean)
        )
    return rows


def by_group_penalty(
    data: TrainingData, wanted: Correctives, test: PosedSurfaces, report: Report
) -> list[ByPenalty]:
    """How many numbers of STAR's features are needed: fewer and fewer of them are kept."""
    A = data.features(quaternion_elements)[0]
    rows = []
    for penalty in GROUP_PENALTIES:
        report(f"  a penalty of {1e3 * penalty:g} mm for a joint at a vertex")
        P = refitted(A, wanted.training, group_lasso(A, wanted.training, 4, penalty))
        body = with_blend_shapes(data.body, quaternion_elements, P)
        training = 1e3 * rms_error(A, wanted.training, P)
        rows.append(ByPenalty(penalty, nonzero_share(P), training, accuracy(body, test).mean))
    return rows


def _linear_predictors(
    data: TrainingData, wanted: Correctives
) -> dict[str, tuple[Features, Array]]:
    return {name: (f, data.fit(f, wanted)[0]) for name, f in LINEAR_IN.items()}


def _offsets(data: TrainingData, features: Features, posedirs: Array, poses: Array) -> Array:
    """What pose blend shapes add to the rest surface, (n, N, 3) mm, in poses (n, K, 3) rad."""
    return 1e3 * bent(posedirs, feature_matrix(data.body, features, poses))


@dataclass(frozen=True)
class PredictorPlan:
    """How many poses of each kind the study takes.

    Raises BadArgument for counts with which it cannot be carried out.

    Attributes:
        body: `default` or `small`.
        training: poses to fit to, drawn from the pose prior.
        validation: further draws, on which ridges and kernel widths are chosen.
        test: draws once more, if there is no recording.
        examples: training poses between which two of the predictors interpolate.
        seed: of every draw.
    """

    body: str = "default"
    training: int = 1500
    validation: int = 200
    test: int = 400
    examples: int = 800
    seed: int = 0

    def __post_init__(self) -> None:
        if not 10 <= self.examples <= self.training:
            raise BadArgument(
                f"{self.examples} examples cannot be taken from {self.training} training poses; "
                "take at least 10 and at most as many as there are"
            )
        if min(self.validation, self.test) < 20:
            raise BadArgument("validation and test need at least 20 poses each")


@dataclass(frozen=True, eq=False)
class PredictorStudy:
    """All that was measured; distances are to the teacher's vertices.

    Attributes:
        plan: what was asked for.
        recorded: whether the test poses are recorded, of clips that nothing was learned from.
        n_test: how many test poses there are.
        results: of every predictor, the best first.
        by_examples: a row for each number of examples.
        by_factor: name -> (FACTORS,) mm.
        by_angle: name -> (TURNS,) mm.
        by_distance_penalty: a row for each penalty.
        by_group_penalty: likewise.
    """

    plan: PredictorPlan
    recorded: bool
    n_test: int
    results: tuple[Result, ...]
    by_examples: tuple[ByExamples, ...]
    by_factor: Mapping[str, Array]
    by_angle: Mapping[str, Array]
    by_distance_penalty: tuple[ByPenalty, ...]
    by_group_penalty: tuple[ByPenalty, ...]


def predictor_study(plan: PredictorPlan, mocap: Path | None, report: Report) -> PredictorStudy:
    """Fit every predictor to the same data and test them on the held-out clips of `mocap`.

    Without a recording they are tested on further draws of the pose prior. Raises BadFile for a
    body without a teacher, or a file that is no recording.
    """
    mean, prior = load_skinned(plan.body), shipped_gaussian()
    teacher, linear = teacher_of(mean), body_on_teachers_rig(mean)
    rng = np.random.default_rng(plan.seed)
    training, validation, test = (
        draw_poses(prior, n, rng) for n in (plan.training, plan.validation, plan.test)
    )
    if mocap is not None:
        test = held_out_poses(mocap)
    report(f"the teacher poses {len(training) + len(validation) + len(test)} times")
    data = TrainingData(
        linear, PosedSurfaces.of(teacher, training), PosedSurfaces.of(teacher, validation)
    )
    tested = PosedSurfaces.of(teacher, test)
    results = [
        Result(name, parameters, accuracy(body, tested))
        for name, body, parameters in fit_predictors(data, plan.examples, report)
    ]
    report("computing the correctives for further questions")
    wanted = data.correctives(linear)
    fewer = tested.some(slice(None, None, EVERY))
    report("questions about a single choice")
    counts = [n for n in EXAMPLE_COUNTS if n < plan.examples] + [plan.examples]
    return PredictorStudy(
        plan,
        mocap is not None,
        len(tested),
        tuple(sorted(results, key=lambda result: result.accuracy.mean)),
        tuple(by_examples(data, wanted, fewer, counts, report)),
        by_factor(data, wanted, plan.examples),
        by_angle(data, wanted, TURNED),
        tuple(by_distance_penalty(data, wanted, fewer, report)),
        tuple(by_group_penalty(data, wanted, fewer, report)),
    )


def plot_predictors(results: Sequence[Result], *, ax: Axes) -> Axes:
    """Mean distances as bars, the largest as dots, best at the top, on a logarithmic scale."""
    rows = np.arange(len(results))[::-1]
    colours = [VERMILLION if r.name == LINEAR else BLUE for r in results]
    means = [r.accuracy.mean for r in results]
    bars = ax.barh(rows, means, color=colours, height=0.65)
    ax.plot([r.accuracy.largest for r in results], rows, "o", color=INK, markersize=4)
    ax.bar_label(bars, fmt="%.2f", padding=4, fontsize=8.5)
    ax.set_xscale("log")
    ax.set_yticks(rows, [plain(r.name) for r in results])
    ax.set_xlabel("distance to the teacher's vertices (mm): mean (bar), largest (dot)")
    ax.grid(axis="x", color=FAINT, alpha=0.3, linewidth=0.6)
    return ax


def plot_by_examples(rows: Sequence[ByExamples], *, ax: Axes) -> Axes:
    """Error and time of interpolation against the number of examples."""
    n = [row.n for row in rows]
    for name, found, colour, marker in (
        ("exact RBF", [row.exact for row in rows], BLUE, "o"),
        ("normalised kernel", [row.normalised for row in rows], VERMILLION, "s"),
    ):
        label, times = f"{name}: mean distance (mm)", [each.milliseconds for each in found]
        ax.plot(n, [each.mean for each in found], color=colour, marker=marker, label=label)
        label = f"{name}: time for one pose (ms)"
        ax.plot(n, times, "--", color=colour, marker=marker, alpha=0.7, label=label)
    ax.set(xscale="log", yscale="log")
    ax.set_xticks(n, [str(x) for x in n])
    low, high = ax.get_ylim()
    shown = [y for y in ROUND if low <= y <= high]
    ax.set_yticks(shown, [f"{y:g}" for y in shown])
    ax.minorticks_off()
    ax.set(xlabel="examples", ylabel="mm, or ms")
    ax.legend()
    return ax


def plot_by_factor(found: Mapping[str, Array], *, ax: Axes) -> Axes:
    """How long blend shapes become when poses are exaggerated."""
    for i, (name, sizes) in enumerate(found.items()):
        ax.plot(FACTORS, sizes, color=LINES[i], linestyle=DASHES[i % 4], label=plain(name))
    ax.axvspan(0, 1, color=FAINT, alpha=0.15, linewidth=0)
    ax.set(xlim=(FACTORS[0], FACTORS[-1]), ylim=(0, None))
    ax.set(xlabel="factor on theta (1: the pose as drawn)", ylabel=LENGTH)
    ax.legend()
    return ax


def plot_by_angle(found: Mapping[str, Array], *, ax: Axes) -> Axes:
    """How long blend shapes are while the neck turns twice around."""
    for i, (name, sizes) in enumerate(found.items()):
        ax.plot(np.degrees(TURNS), sizes, DASHES[i % 4], color=LINES[i], label=plain(name))
    for turn in (360, 720):
        ax.axvline(turn, color=FAINT, linewidth=0.8)
    ax.set_xticks(range(0, 721, 90))
    ax.set(xlim=(0, 720), ylim=(0, 1.3 * max(float(sizes.max()) for sizes in found.values())))
    ax.set(xlabel="turn of the neck about the vertical (degrees)", ylabel=LENGTH)
    ax.legend(loc="upper left")
    return ax


def plot_by_penalty(rows: Sequence[ByPenalty], what: str, *, ax: Axes) -> Axes:
    """Errors against the share that a penalty leaves, whose name is `what`."""
    shares = [100 * row.share for row in rows]
    training, test = [r.training_rms for r in rows], [r.test_mean for r in rows]
    ax.plot(shares, training, "o-", color=BLUE, label="training poses, at rest (rms)")
    ax.plot(shares, test, "s--", color=VERMILLION, label="test poses, posed (mean)")
    ax.set_xscale("log")
    ax.minorticks_off()
    ax.set_xticks(shares, [f"{x:.2g}" for x in shares])
    ax.set(xlabel=plain(what), ylabel="distance (mm)", ylim=(0, None))
    ax.legend()
    return ax


def table(s: PredictorStudy) -> Table:
    """All predictors, the best first. Times are the least that one pose took."""
    linear = next(r.accuracy.mean for r in s.results if r.name == LINEAR)
    columns: Columns[Result] = {
        "predictor": lambda r: r.name,
        "parameters": lambda r: f"{r.parameters:,}",
        "mean mm": lambda r: f"{r.accuracy.mean:.2f}",
        "rms mm": lambda r: f"{r.accuracy.rms:.2f}",
        "max mm": lambda r: f"{r.accuracy.largest:.1f}",
        "repaired": lambda r: f"{1 - r.accuracy.mean / linear:.0%}",
        "ms": lambda r: f"{r.accuracy.milliseconds:.2f}",
    }
    return Table.of(s.results, columns, tuple(range(1, len(columns))))


def main() -> None:
    """Carry out the study and write its folder."""
    plan, chosen = arguments(PredictorPlan, __doc__, "--mocap")
    s = predictor_study(plan, chosen.mocap, report)
    far = "norm of the blend shapes beyond 0.2 m of their joint (%)"
    nonzero = "numbers that are not zero (%)"
    figures: dict[str, Drawing] = {
        "predictors": (8.0, 5.2, partial(plot_predictors, s.results)),
        "by_examples": (6.2, 4.0, partial(plot_by_examples, s.by_examples)),
        "by_factor": (6.2, 4.0, partial(plot_by_factor, s.by_factor)),
        "by_angle": (7.0, 4.0, partial(plot_by_angle, s.by_angle)),
        "by_distance_penalty": (6.2, 4.0, partial(plot_by_penalty, s.by_distance_penalty, far)),
        "by_group_penalty": (6.2, 4.0, partial(plot_by_penalty, s.by_group_penalty, nonzero)),
    }
    data = {"kind": "blend shapes", "name": "blendshapes", **asdict(s)}
    write_study(chosen.out / "blendshapes", [table(s)], data, figures)


if __name__ == "__main__":
    main()
