"""A body on the keypoints of one image: terms, stages, starts, folders of images, distance."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from workbench import LevenbergMarquardt, Problem, Solution, Status, Values, load_body
from workbench.arrays import Array
from workbench.bodies.capsules import capsule_gaps, capsule_points
from workbench.errors import BadArgument, BadBody
from workbench.experiments.balance import observations
from workbench.fitting.body_priors import apart_prior, mixture_prior, stature, stature_prior
from workbench.fitting.images import (
    INTERVAL_NOTE,
    LAMBDA_POSE,
    LAMBDA_SHAPE,
    SMPLIFY_SIGMA,
    Z90,
    Appearance,
    ByHeight,
    Smplify,
    WithPosePrior,
    WithStature,
    depth_interval,
    depth_spread,
    image_fit,
    image_priors,
    smplify_stages,
)
from workbench.fitting.jobs import (
    ImageReading,
    ImageWork,
    image_jobs,
)
from workbench.fitting.keypoints import (
    MARKED_SD,
    TYPICAL_SD,
    KeypointProblem,
    alike,
    as_marked,
    height_in_view,
    keypoint_fit,
    usual_sigma,
)
from workbench.fitting.observations import COCO, Observations, photograph
from workbench.fitting.placing import turned_about
from workbench.fitting.setup import Setup
from workbench.geometry.camera import Camera
from workbench.geometry.rotation import matrix_from_vector
from workbench.priors.poses import draw_poses, shipped_gaussian, shipped_mixture
from workbench.problem.problem import in_stage
from workbench.residuals import gaussian, spheres
from workbench.residuals.kernels import geman_mcclure, quadratic, scaled
from workbench.solvers import Staged, TrustRegion

BODY = load_body("small")
SIZE = (1080, 1080)
K = np.array([[1100.0, 0, 540], [0, 1100, 540], [0, 0, 1]])
R = np.diag([1.0, -1.0, -1.0])


def person(seed: int) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(seed)
    pose = draw_poses(shipped_gaussian(), 1, rng)[0]
    pose[0] = [0.0, 0.4 * rng.normal(), 0.0]
    return {"pose": pose, "betas": rng.normal(size=BODY.n_betas), "trans": np.array([0, 0, 0.2])}


def seen(
    values: dict[str, np.ndarray], noise: float = 0.0, seed: int = 0, name: str = "one"
) -> Observations:
    """A photograph of a person, 4 m away."""
    camera = Camera("c/")
    lens = camera.values(K=K, R=R, t=(0, 0, 4.0))
    names = BODY.landmark_names("coco")
    pixels = camera.pixels(BODY.landmark("coco", *values.values()), lens)
    pixels = pixels + noise * np.random.default_rng(seed).normal(size=pixels.shape)
    keypoints = np.column_stack([pixels, np.ones(len(pixels))])
    given = photograph(name, SIZE, keypoints, {"K": K, "R": R, "t": [0, 0, 4.0]})
    return Observations(tuple(names), (given,))


def solved(setup: Setup) -> Solution:
    """By the strategy of the setup."""
    assert setup.strategy is not None
    return setup.strategy(None).solve(setup.problem, setup.start)


def joints_of(values: Values) -> Array:
    return BODY.joints(*(values[name] for name in ("pose", "betas", "trans")))


def distance(values: Values, truth: Values) -> float:
    """The mean distance of joints in m, the roots brought together."""
    apart = joints_of(values) - joints_of(truth)
    return float(np.linalg.norm(apart - apart[0], axis=1).mean())


def test_person_is_recovered_from_one_image() -> None:
    truth = person(1)
    setup = image_fit(seen(truth), BODY, "q", recipe=ByHeight(solver=LevenbergMarquardt()))
    solution = solved(setup)
    assert solution.converged
    off = np.array([m.value for m in setup.measures(setup.start | solution.values)])
    assert off[0] < 2.0  # px, held off zero by the priors
    assert distance(solution.values, truth) < 0.08


def test_keypoint_of_confidence_zero_is_ignored() -> None:
    one = seen(person(1), noise=3.0)
    (shot,) = one.photographs
    doubt = shot.confidence.copy()
    doubt[3] = 0.0
    away = shot.pixels.copy()
    away[3] += 500.0
    ends = []
    for pixels in (shot.pixels, away):
        given = Observations(one.names, (replace(shot, confidence=doubt, pixels=pixels),))
        ends.append(solved(image_fit(given, BODY, "q")).values["pose"])
    np.testing.assert_array_equal(*ends)


@pytest.mark.thorough
def test_image_fit_resists_outliers() -> None:
    """Two keypoints are nearly half a person's height off; means over three people."""
    errors: dict[str, list[float]] = {"clean": [], "robust": [], "quadratic": []}
    for seed in range(4, 7):
        truth = person(seed)
        clean = seen(truth, noise=3.0)
        (shot,) = clean.photographs
        wrong = shot.pixels.copy()
        wrong[[7, 16]] += [[150.0, -120.0], [-170.0, 90.0]]
        dirty = Observations(clean.names, (replace(shot, pixels=wrong),))
        for name, given, recipe in (
            ("clean", clean, ByHeight()),
            ("robust", dirty, ByHeight()),
            ("quadratic", dirty, ByHeight(outlier=1e6, strict=1e6)),
        ):
            found = solved(image_fit(given, BODY, "q", recipe=recipe)).values
            errors[name].append(distance(found, truth))
    means = {name: np.mean(each) for name, each in errors.items()}
    assert means["robust"] < 0.3 * means["quadratic"]
    assert means["robust"] < means["clean"] + 0.05


# Stages.


def test_smplify_stages_have_published_weights() -> None:
    """Relative to the keypoints, which its code does not weight at all."""
    setup = image_fit(seen(person(1)), BODY, "q", recipe=Smplify())
    stages = Smplify()(Appearance(500.0, 1000.0)).stages_of(setup.problem.rows, None)
    parts = [in_stage(setup.problem, None, stage.weights) for stage in stages[1:]]
    here = setup.start | {"pose": np.zeros((24, 3)), "betas": np.full(BODY.n_betas, 0.7)}
    x, fixed = setup.problem.split(here)
    plain = Problem(
        KeypointProblem(BODY, 1.0, scaled(geman_mcclure, 100.0))
        .of(setup_photographs(), (), "coco")[0]
        .residuals,
        setup.problem.free.names,
        blocks=tuple(setup.problem.known.values()),
    )
    wide = plain.residual(x, fixed)
    keypoints = float(wide[plain.rows["keypoints(one)"]] @ wide[plain.rows["keypoints(one)"]])
    ends = capsule_points(BODY, *(block.symbol for block in BODY.blocks()))
    each = spheres(ends, BODY.capsules.radii, BODY.capsules.pairs, sigma=1.0)
    overlap = 2 * Problem([each], ("pose", "betas", "trans")).linearize(here).cost
    assert overlap > 0  # E_sp
    for (pose, shape), part in zip(
        zip(LAMBDA_POSE, LAMBDA_SHAPE, strict=True), [*parts, setup.problem], strict=True
    ):
        r = part.residual(x, fixed)
        square = {name: float(r[rows] @ r[rows]) for name, rows in part.rows.items()}
        scale = square["keypoints(one)"] / keypoints  # their energy in px^2 times this
        assert square["shape prior"] / scale == pytest.approx(shape**2 * 0.49 * BODY.n_betas)
        at_rest = 4 * (3.17 * pose) ** 2  # all four hinges are straight
        assert square["bending"] / scale == pytest.approx(at_rest)
        assert scale == pytest.approx(2 / pose**2)
        assert square["contact"] / scale == pytest.approx(1e6 * overlap)
    assert pytest.approx(4.78 / np.sqrt(2)) == SMPLIFY_SIGMA


@pytest.mark.parametrize(("name", "root"), [("small", "pelvis"), ("hand", "wrist")])
def test_smplify_places_the_root_of_any_body_first(name: str, root: str) -> None:
    body = load_body(name)
    place = gaussian(body.blocks()[2].symbol, name="place")
    problem = Problem((*image_priors(body), place), ("pose", "trans"), blocks=body.blocks())
    first = in_stage(problem, smplify_stages()[0].free, {}).free.single_labels
    assert {*first} == {f"pose[{root}, {axis}]" for axis in "xyz"} | {f"trans[{x}]" for x in "xyz"}


def test_the_mixture_is_the_prior_of_its_likeliest_component() -> None:
    mixture, rng = shipped_mixture(), np.random.default_rng(0)
    problem = Problem([mixture_prior(BODY)], ("pose",))
    assert list(problem.rows) == ["pose prior"]
    for pose in draw_poses(mixture, 5, rng):
        likeliest = mixture.log_density(pose[1:].reshape(1, -1)).max()
        best = max(mixture.log_density(mean[None])[0, c] for c, mean in enumerate(mixture.means))
        cost = problem.linearize({"pose": pose}).cost
        assert cost == pytest.approx(best - likeliest, rel=1e-9)
    with pytest.raises(BadArgument, match="mixture of poses is one of SMPL's 24 joints"):
        mixture_prior(load_body("hand"))


def crossed() -> Observations:
    """One image of a drawn pose in which the body goes 3 cm through itself."""
    poses = draw_poses(shipped_mixture(), 200, np.random.default_rng(3))
    overlap = -capsule_gaps(BODY, poses).min(axis=1)
    pose = poses[np.argmin(abs(overlap - 0.03))]
    return seen({"pose": pose, "betas": np.zeros(BODY.n_betas), "trans": np.array([0, 0, 0.2])})


def test_contact_keeps_limbs_out_of_each_other() -> None:
    deepest = {}
    for name, terms in (("plain", image_priors), ("contact", WithPosePrior(others=(apart_prior,)))):
        values = solved(image_fit(crossed(), BODY, "q", recipe=ByHeight(priors=terms))).values
        at = (values[block.name] for block in BODY.blocks())
        deepest[name] = -capsule_gaps(BODY, *at).min()
    assert deepest["plain"] > 0.02  # m
    assert deepest["contact"] < 0.005
    with pytest.raises(BadBody, match="has no capsules"):
        apart_prior(replace(BODY, capsules=None))


def setup_photographs() -> tuple:
    return seen(person(1)).ordered(BODY.landmark_names("coco")).photographs


def test_stages_end_at_the_problem_itself() -> None:
    recipe = Smplify()
    setup = image_fit(seen(person(1), 3.0), BODY, "q", recipe=recipe)
    assert setup.strategy is not None
    solver = setup.strategy(None)
    assert isinstance(solver, Staged)
    solution = solver.solve(setup.problem, setup.start)
    assert len(solution.stages) == 5
    assert solution.stages[-1] == len(solution.trace) - 1
    x, fixed = setup.problem.split(setup.start | solution.values)
    r = setup.problem.residual(x, fixed)
    assert solution.cost == pytest.approx(0.5 * float(r @ r))
    other = setup.strategy(LevenbergMarquardt(max_iterations=7))
    assert isinstance(other, Staged)
    assert all(stage.solver == LevenbergMarquardt(max_iterations=7) for stage in other.each[:-1])


# Starts.


@pytest.mark.parametrize("root", [0.0, 0.7], ids=["plain", "turned bind pose"])
def test_starts_turn_the_body_about_its_middle(root: float) -> None:
    body = replace(BODY, bound_in=np.vstack([[root, 0, 0], np.zeros((23, 3))]))
    starts = turned_about(body, body.start() | {"trans": np.array([0.3, 0.1, -0.2])}, 8)
    joints = np.array([body.joints(s["pose"], s["betas"], s["trans"]) for s in starts])
    np.testing.assert_allclose(joints.mean(axis=1), [joints[0].mean(axis=0)] * 8, atol=1e-9)
    np.testing.assert_allclose(joints[..., 1], [joints[0, :, 1]] * 8, atol=1e-9)
    left, right = (body.joint_names.index(f"{side}_shoulder") for side in ("left", "right"))
    across = joints[:, left] - joints[:, right]
    np.testing.assert_allclose(across[1], -across[0], atol=1e-9)
    assert len({tuple(np.round(a, 6)) for a in across}) == 8
    with pytest.raises(BadArgument, match="1 to 8"):
        turned_about(body, starts[0], 9)


# Stature.


@pytest.mark.parametrize("name", ["small", "default"])
def test_stature_matches_the_mesh(name: str) -> None:
    body = load_body(name)
    betas = np.random.default_rng(0).normal(size=(50, body.n_betas))
    exact = np.ptp(body.vertices(betas=betas)[..., 1], axis=1)
    np.testing.assert_allclose(stature(body, betas), exact, atol=0.01)


def test_a_known_stature_is_kept() -> None:
    truth = person(4)
    recipe = ByHeight(priors=WithStature(1.5))
    found = solved(image_fit(seen(truth, 2.0), BODY, "q", recipe=recipe)).values
    assert stature(BODY, found["betas"]) == pytest.approx(1.5, abs=0.02)
    for wrong in (3.0, 0.1, 172.0, np.nan):
        with pytest.raises(BadArgument, match="stature is between"):
            stature_prior(BODY, wrong)


# Files.


def written(folder: Path, count: int) -> list[Path]:
    found = []
    for i in range(count):
        (shot,) = seen(person(i), 2.0, i).ordered(COCO).photographs
        numbers = np.column_stack([shot.pixels, shot.confidence]).ravel().tolist()
        found.append(folder / f"frame{i}.json")
        found[-1].write_text(json.dumps([{"keypoints": numbers}]))
    return found


def test_interrupted_image_fit_ends_the_work(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Solvers keep it for their own end; what they found until then is no fit to be kept."""
    jobs = image_jobs(written(tmp_path, 1))
    as_usual = LevenbergMarquardt.solve

    def interrupted(
        solver: LevenbergMarquardt, problem: Problem, start: Values, **_: object
    ) -> Solution:
        return replace(as_usual(solver, problem, start), status=Status.STOPPED)

    monkeypatch.setattr(LevenbergMarquardt, "solve", interrupted)
    with pytest.raises(KeyboardInterrupt):
        ImageWork(BODY, reading=ImageReading(SIZE, 1100.0))(jobs)


def test_files_of_the_same_name_are_refused() -> None:
    with pytest.raises(BadArgument, match="same name"):
        image_jobs([Path("a/one.json"), Path("b/One.json")])


def test_the_usual_sigma_follows_the_person_and_the_image() -> None:
    assert usual_sigma(300.0, (400, 900)) == pytest.approx(1.6)  # 0.32 % of 500 px
    person = Appearance(300.0, 400.0)
    assert ByHeight()(person).sigma == usual_sigma(300.0, (400, 900))
    assert ByHeight(sigma=7.0)(person).sigma == 7.0
    several = keypoint_fit(observations(40)[0], BODY, "q", sigma=None)
    rows = {residual.name: residual for residual in several.problem.residuals}
    for view in several.views:
        expected = usual_sigma(height_in_view(BODY, view, several.start), view.size)
        assert float(rows[f"keypoints({view.name})"].sigma) == pytest.approx(expected)


def test_gross_outliers_in_several_cameras_hardly_move_the_body() -> None:
    """As in one image, beside a least-squares fit that they move by decimetres."""
    truth, names, photographs = person(3), BODY.landmark_names("coco"), []
    points = BODY.landmark("coco", *truth.values())
    for i, turn in enumerate((0.0, 1.5, 3.0)):
        turned = R @ matrix_from_vector([0.0, turn, 0.0])
        pixels = Camera("c/").pixels(points, Camera("c/").values(K=K, R=turned, t=(0, 0, 4.0)))
        pixels[[2 + i, 8 + i]] += [150.0, -120.0]
        given = {"K": K, "R": turned, "t": [0, 0, 4.0]}
        keypoints = np.column_stack([pixels, np.ones(len(pixels))])
        photographs.append(photograph(f"c{i}", SIZE, keypoints, given))
    observed, off = Observations(tuple(names), tuple(photographs)), []
    for kernel in (None, quadratic):
        setup = keypoint_fit(observed, BODY, "q", sigma=None, kernel=kernel, relative=as_marked)
        values = setup.start | TrustRegion().solve(setup.problem, setup.start).values
        found = BODY.landmark("coco", *(values[name] for name in ("pose", "betas", "trans")))
        off.append(np.linalg.norm(found - points, axis=1).mean())
    assert off[0] < 0.005
    assert off[1] > 5 * off[0]


def test_keypoints_are_weighed_by_precision() -> None:
    """Eyes count more than hips, as much as their variances say, and a typical keypoint as 1."""
    names = BODY.landmark_names("coco")
    relative = as_marked(names)
    of = dict(zip(names, relative, strict=True))
    assert of["left_eye"] == pytest.approx(np.sqrt((0.025**2 + 0.08**2) / 2 / 0.08**2))
    assert of["left_eye"] < of["left_wrist"] < of["left_elbow"] < of["left_hip"]
    assert of["left_hip"] == pytest.approx(1.181, abs=1e-3)
    assert of["right_heel"] == of["left_small_toe"] == as_marked(["left_index1"])[0] == 1
    assert np.array_equal(alike(names), np.ones(len(names)))
    marked = [s for name in names for end, s in MARKED_SD.items() if name.endswith(end)]
    assert pytest.approx(np.median(marked)) == TYPICAL_SD
    setup = image_fit(seen(person(1)), BODY, "q")
    plain = image_fit(seen(person(1)), BODY, "q", recipe=ByHeight(relative=alike, outlier=1e6))
    whitened = image_fit(seen(person(1)), BODY, "q", recipe=ByHeight(outlier=1e6))
    rows = next(rows for name, rows in setup.problem.rows.items() if name.startswith("keypoints("))
    both = [one.problem.residual(*one.problem.split(one.start))[rows] for one in (plain, whitened)]
    np.testing.assert_allclose(both[0], both[1] * np.repeat(relative, 2), rtol=1e-4)


# The distance, and how uncertain it is.


PRECISE = LevenbergMarquardt(gradient_tolerance=1e-9)


def fitted(observed: Observations, recipe: ByHeight | None = None) -> tuple[Setup, Values]:
    setup = image_fit(observed, BODY, "q", recipe=recipe or ByHeight(solver=PRECISE))
    return setup, setup.start | solved(setup).values


def root_depth(setup: Setup, values: Values) -> float:
    return float(setup.views[0].camera.depths(joints_of(values)[:1], values)[0])


@pytest.fixture(scope="module")
def one() -> tuple[Setup, Values]:
    return fitted(seen(person(1)))


def test_depth_without_offsets_is_laplace(one: tuple[Setup, Values]) -> None:
    """The camera looks along -z from 4 m: depth is 4 - root_z, linear in betas and trans."""
    setup, values = one
    found = depth_interval(setup, values, 0.0)
    assert found is not None
    assert found.mean == pytest.approx(root_depth(setup, values))
    free = setup.problem.free
    gradient = np.zeros(free.size)
    gradient[free.slices["trans"]] = [0, 0, -1]
    rest = BODY.joints(betas=np.zeros(BODY.n_betas))[0, 2]
    gradient[free.slices["betas"]] = [
        rest - BODY.joints(betas=unit)[0, 2] for unit in np.eye(BODY.n_betas)
    ]
    covariance = setup.problem.linearize(values).covariance
    assert found.sd == pytest.approx(np.sqrt(gradient @ covariance @ gradient), rel=1e-6)
    assert found.high - found.low == pytest.approx(2 * Z90 * found.sd)
    wider = depth_interval(setup, values)
    assert wider is not None
    assert wider.sd > found.sd
    assert f"{wider.low:.2f} to {wider.high:.2f} m" in str(wider)


@pytest.mark.thorough
def test_depth_lever_matches_refits(one: tuple[Setup, Values]) -> None:
    """Keypoints are moved one after another, and the Gauss-Newton step follows them; the whole
    fit does so up to the curvature that this method leaves out.
    """
    setup, values = one
    view, free = setup.views[0], setup.problem.free
    found, _, lever = depth_spread(setup, view, values)
    before, moves, refitted = root_depth(setup, values), [], []
    for k, axis in np.ndindex(*view.observed.shape):
        observed = values["one/observed"].copy()
        observed[k, axis] += 0.01
        start = values | {"one/observed": observed}
        step = setup.problem.linearize(start).step(0.0)
        after = values | free.unpack(free.pack(values) + step, values)
        moves.append((root_depth(setup, after) - before) / 0.01)
        if k < 3:
            again = start | PRECISE.solve(setup.problem, start).values
            refitted.append((root_depth(setup, again) - before) / 0.01)
    of_a_metre = values["one/focal"].mean() / before  # px
    assert found == pytest.approx(before)
    relative = np.repeat(as_marked(BODY.landmark_names("coco")), 2)  # all have the confidence 1
    expected = of_a_metre * np.linalg.norm(relative * moves)
    assert lever == pytest.approx(expected, rel=1e-2)
    assert np.linalg.norm(moves[:6]) == pytest.approx(np.linalg.norm(refitted), rel=0.25)


def test_two_images_have_no_depth_interval() -> None:
    truth = person(2)
    shots = [seen(truth, name=name).photographs[0] for name in ("one", "two")]
    both = Observations(tuple(BODY.landmark_names("coco")), tuple(shots))
    setup = image_fit(both, BODY, "q")
    assert depth_interval(setup, setup.start) is None
    assert INTERVAL_NOTE not in setup.notes
    out = image_fit(both, BODY, "q", held_out=("two",))
    assert depth_interval(out, out.start) is not None
