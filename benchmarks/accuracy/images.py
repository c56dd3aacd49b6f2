"""Bodies fitted to keypoints of one image and of a video of one camera, against the truth.

The person of `balance` was seen by four cameras: the truth is the fit to all four. Synthetic people
in poses that are held out of the priors (`held_out_poses`) are fitted as well, with and without
gross outliers among their keypoints.
"""

import time
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import islice
from typing import Any

import numpy as np

from benchmarks.accuracy import RECORDING, needed, share, taken
from benchmarks.measuring import table
from builder.geometry import umeyama
from builder.recordings import held_out_poses
from workbench import load_body, solve
from workbench.arrays import Array
from workbench.blocks import Values
from workbench.bodies import SkinnedBody
from workbench.bodies.capsules import capsule_gaps
from workbench.errors import check_known
from workbench.experiments.balance import balance, balance_clip, observations, published
from workbench.fitting import keypoint_fit, photograph
from workbench.fitting.body_priors import apart_prior, mixture_prior
from workbench.fitting.images import (
    ByHeight,
    ImageFits,
    RecipeOf,
    Smplify,
    WithPosePrior,
    WithStature,
    image_mean,
)
from workbench.fitting.keypoints import KeypointProblem, keypoint_setup
from workbench.fitting.observations import LIMBS, SIDES, Observations
from workbench.fitting.setup import Setup
from workbench.fitting.videos import EVIDENCE, landmarks_of, video_fit, video_mean
from workbench.geometry.camera import Camera
from workbench.geometry.rotation import matrix_from_vector
from workbench.problem import Problem
from workbench.sampling import posterior_mean
from workbench.solvers import Solution, TrustRegion

NAMES = tuple(f"{side}_{part}" for side in SIDES for part in LIMBS)
HIPS = [NAMES.index(f"{side}_hip") for side in SIDES]
FAILED = 150.0  # mm: a fit that is farther off on average
REPORTED = range(0, 100, 4)  # frames of `balance`; recipes were chosen on 2, 10, ..., 98
SPREAD = range(0, 100, 8)  # frames by which the standard deviations of the mean are judged
STATURE = 1.72  # m, of the person of `balance`, by the fits to four cameras
PEOPLE = 200
NOISE = 5.0  # px
SIGMA = 4.0  # px, of all rows but one
BY_HEIGHT = "regressed start, sigma by height"  # what a fit has unless another sigma is given
OUTLIERS, FAR = 4, 150.0  # how many keypoints are wrong, and by how many px
TITLES = {
    "balance": "The person of `balance`, one camera",
    "people": f"Synthetic people, {NOISE:g} px of noise",
    "outliers": f"The same people, {OUTLIERS} keypoints {FAR:g} px off",
    "apart": "Synthetic people who do not go through themselves",
}
THROUGH, TOUCHING = 10.0, 5.0  # mm: two capsules that overlap more go through each other
APART = 100  # people
UNSEEN = range(55, 100)  # frames of the video; smoothness was chosen on 0 to 44
SOLVER = TrustRegion(max_iterations=30, gradient_tolerance=1e-3)


def limbs(body: SkinnedBody, landmarks: Array) -> Array:
    """The twelve limb landmarks (..., 12, 3) of all (..., M, 3)."""
    names = body.landmark_names("coco")
    return landmarks[..., [names.index(name) for name in NAMES], :]


def mean_distance(found: Array, true: Array) -> float:
    """The mean distance of points (..., 3) m, in mm."""
    return 1e3 * float(np.linalg.norm(found - true, axis=-1).mean())


def mpjpe(found: Array, true: Array) -> float:
    """The same for limbs (..., 12, 3) m after the middles of the hips were brought together."""
    found, true = (x - x[..., HIPS, :].mean(axis=-2, keepdims=True) for x in (found, true))
    return mean_distance(found, true)


# One image


@dataclass(frozen=True, eq=False)
class Case:
    """One image: what was observed, what was held out, and the true landmarks (M, 3) m; `made_of`
    are pose, betas and trans of the true body.
    """

    observed: Observations
    held_out: tuple[str, ...]
    truth: Array
    made_of: Values | None = None


Fit = Callable[[Case], tuple[Solution, Setup]]


def as_before(body: SkinnedBody) -> Fit:
    """The fit without a robust kernel and stages."""
    of = KeypointProblem(body)

    def fit(case: Case) -> tuple[Solution, Setup]:
        setup = keypoint_setup(of, case.observed, "", case.held_out)
        return solve(setup.problem, setup.start), setup

    return fit


def in_stages(fits: ImageFits) -> Fit:
    """The fit by a recipe."""

    def fit(case: Case) -> tuple[Solution, Setup]:
        setup = fits.setup(case.observed, "", held_out=case.held_out)
        assert setup.strategy is not None
        return setup.strategy(None).solve(setup.problem, setup.start), setup

    return fit


def averaged(fits: ImageFits) -> Fit:
    """The same, and then the mean of the posterior in place of its mode."""
    likeliest = in_stages(fits)

    def fit(case: Case) -> tuple[Solution, Setup]:
        solution, setup = likeliest(case)
        mean = posterior_mean(setup.problem, setup.start | solution.values)
        return replace(solution, values=mean.values), setup

    return fit


def from_the_truth(fits: ImageFits) -> Fit:
    """The last stage of a recipe alone, from where the synthetic person is."""

    def fit(case: Case) -> tuple[Solution, Setup]:
        setup = fits.setup(case.observed, "", held_out=case.held_out)
        assert case.made_of is not None
        return ByHeight().solver.solve(setup.problem, setup.start | case.made_of), setup

    return fit


def balance_cases(body: SkinnedBody, frames: Iterable[int] = REPORTED) -> Iterator[Case]:
    """Each camera alone, in each of these frames."""
    for frame in frames:
        observed, _ = observations(frame)
        whole = keypoint_fit(observed, body, "")
        values = solve(whole.problem, whole.start).values
        known = {block.name: values[block.name] for block in body.blocks()}
        truth = body.landmark("coco", *known.values())
        names = [photo.name for photo in observed.photographs]
        for name in names:
            yield Case(observed, tuple(other for other in names if other != name), truth, known)


def synthetic_cases(body: SkinnedBody, poses: Array, seeds: range, outliers: int) -> Iterator[Case]:
    """A person in a held-out pose, seen from a random direction at a height of 400 to 900 px."""
    names = body.landmark_names("coco")
    for seed in seeds:
        rng = np.random.default_rng((seed, 27))
        pose = poses[rng.integers(len(poses))]
        betas = rng.normal(size=body.n_betas)
        values = {"pose": pose, "betas": betas, "trans": np.zeros(3)}
        values["trans"] = -body.joints(pose, betas).mean(axis=0)
        focal, size = 1200.0, 1100
        depth = focal * 1.7 / rng.uniform(400, 900)
        up = np.diag([1.0, -1.0, -1.0])
        tilt = matrix_from_vector([rng.uniform(-0.1, 0.4), 0.0, 0.0])
        R = tilt @ up @ matrix_from_vector([0.0, rng.uniform(-np.pi, np.pi), 0.0])
        K = np.array([[focal, 0, size / 2], [0, focal, size / 2], [0, 0, 1]])
        lens = Camera("c/").values(K=K, R=R, t=(0, 0, depth))
        truth = body.landmark("coco", *values.values())
        pixels = Camera("c/").pixels(truth, lens)
        pixels = pixels + NOISE * rng.normal(size=pixels.shape)
        wrong = rng.choice(len(names), outliers, replace=False)
        turn = rng.uniform(0, 2 * np.pi, outliers)
        pixels[wrong] += FAR * np.column_stack([np.cos(turn), np.sin(turn)])
        points = np.column_stack([pixels, np.ones(len(pixels))])
        shot = photograph("one", (size, size), points, {"K": K, "R": R, "t": [0, 0, depth]})
        yield Case(Observations(tuple(names), (shot,)), (), truth, values)


def errors(found: Array, truth: Array) -> dict[str, float]:
    """Mean distances in mm of limbs (12, 3) m: from the middle of the hips, after Procrustes, and
    in space.
    """
    return {
        "MPJPE": mpjpe(found, truth),
        "PA": mean_distance(umeyama(found, truth)(found), truth),
        "absolute": mean_distance(found, truth),
    }


def judged(body: SkinnedBody, fit: Fit, cases: list[Case]) -> dict[str, Any]:
    """Mean errors in mm, median CPU milliseconds, and how many fits failed; the first case is
    fitted twice, to warm up.
    """
    each: dict[str, list[float]] = {"MPJPE": [], "PA": [], "absolute": [], "ms": [], "overlap": []}
    for case in [cases[0], *cases]:
        began = time.process_time()
        solution, _ = fit(case)
        took = 1e3 * (time.process_time() - began)
        at = [solution.values[block.name] for block in body.blocks()]
        told = errors(limbs(body, body.landmark("coco", *at)), limbs(body, case.truth))
        told |= {"ms": took, "overlap": deepest(body, at)}
        for name, value in told.items():
            each[name].append(value)
    kept = {name: values[1:] for name, values in each.items()}
    return {
        "fits": len(cases),
        **{name: float(np.mean(kept[name])) for name in ("MPJPE", "PA", "absolute")},
        "failed": sum(value > FAILED for value in kept["MPJPE"]),
        "ms": float(np.median(kept["ms"])),
        "overlap": float(np.mean(kept["overlap"])),
        "through": sum(value > THROUGH for value in kept["overlap"]),
    }


def deepest(body: SkinnedBody, at: Sequence[Array]) -> float:
    """How deep two capsules of a body overlap at most, mm."""
    return 1e3 * max(0.0, -float(capsule_gaps(body, *at).min()))


def by_terms(quick: bool) -> dict[str, Any]:
    """The default beside the mixture of poses, contact, and SMPLify whole; on `balance`, and on
    synthetic people who do not go through themselves.
    """
    body = load_body("default")
    recipes: dict[str, RecipeOf] = {
        "default": ByHeight(),
        "mixture of poses": ByHeight(priors=WithPosePrior(mixture_prior)),
        "contact": ByHeight(priors=WithPosePrior(others=(apart_prior,))),
        "SMPLify": Smplify(),
    }
    scenes = {"balance": list(balance_cases(body, (0,) if quick else REPORTED))}
    if taken(quick, RECORDING):
        poses = held_out_poses(needed(RECORDING))
        drawn = synthetic_cases(body, poses, range(20_000, 30_000), 0)
        whole = (c for c in drawn if c.made_of and deepest(body, [*c.made_of.values()]) < TOUCHING)
        scenes["apart"] = list(islice(whole, 2 if quick else APART))
    return {
        scene: {
            name: judged(body, in_stages(ImageFits(body, recipe)), cases)
            for name, recipe in recipes.items()
        }
        for scene, cases in scenes.items()
    }


def spread(body: SkinnedBody, frames: Iterable[int] = SPREAD) -> dict[str, float]:
    """How many times as far landmarks of the mean are from the truth as `image_mean` says, their
    middles brought together: root mean square over the images and landmarks, and the least and the
    largest of a landmark.
    """
    fit, off, said = in_stages(ImageFits(body)), [], []
    for case in balance_cases(body, frames):
        solution, setup = fit(case)
        mean = image_mean(setup, setup.start | solution.values)
        apart = mean.landmarks - case.truth
        off.append(np.sum((apart - apart.mean(axis=0)) ** 2, axis=1))
        said.append(mean.sd**2)
    each = np.sqrt(np.mean(off, axis=0) / np.mean(said, axis=0))
    whole = float(np.sqrt(np.mean(off) / np.mean(said)))
    ends = {"least": float(each.min()), "largest": float(each.max())}
    return {"images": len(off), "ratio": whole, **ends}


def one_image(quick: bool, only: Collection[str] = ()) -> dict[str, Any]:
    """Every recipe on every scene, or some recipes alone. Raises UnknownName."""
    body, recorded = load_body("default"), taken(quick, RECORDING)
    in_px = partial(ByHeight, sigma=SIGMA)
    fits = ImageFits(body, in_px())
    recipes: dict[str, Fit] = {
        "as before": as_before(body),
        "regressed start": in_stages(fits),
        "regressed start, mean of the posterior": averaged(fits),
        BY_HEIGHT: in_stages(ImageFits(body)),
    }
    tall = in_stages(ImageFits(body, in_px(priors=WithStature(STATURE))))
    further = {
        "balance": {"regressed start, stature known": tall},
        "people": (truth := {"from the truth": from_the_truth(fits)}),
        "outliers": truth,
    }
    for name in only:
        check_known("row", name, recipes | further["balance"] | truth)
    scenes = {"balance": list(balance_cases(body, (0,) if quick else REPORTED))}
    if recorded:
        poses, seeds = held_out_poses(needed(RECORDING)), range(2 if quick else PEOPLE)
        for scene, wrong in (("people", 0), ("outliers", OUTLIERS)):
            scenes[scene] = list(synthetic_cases(body, poses, seeds, wrong))
    found: dict[str, Any] = {}
    for scene, cases in scenes.items():
        for name, fit in (recipes | further[scene]).items():
            if not only or name in only:
                found.setdefault(scene, {})[name] = judged(body, fit, cases)
                print(scene, name, found[scene][name], flush=True)
    return found


# A video


def by_four_cameras(body: SkinnedBody, frames: Sequence[int]) -> tuple[Array, float]:
    """Limb landmarks (T, 12, 3) m and the mean stature in mm of the fits to four cameras."""
    places, statures = [], []
    for frame in frames:
        setup = balance(frame)
        values = setup.start | TrustRegion().solve(setup.problem, setup.start).values
        at = [values[block.name] for block in body.blocks()]
        places.append(limbs(body, body.landmark("coco", *at)))
        statures.append(stature(body, values["betas"]))
    return np.array(places), float(np.mean(statures))


def stature(body: SkinnedBody, betas: Array) -> float:
    """The height of the body at rest, mm."""
    return 1e3 * float(np.ptp(body.vertices(betas=betas)[:, 1]))


def sd_of_stature(body: SkinnedBody, problem: Problem, values: Values) -> float:
    """Laplace's standard deviation of the stature, mm."""
    free, betas, size = problem.free, values["betas"], 1e-3
    direction, middle = np.zeros((free.size, 1)), stature(body, betas)
    steps = size * np.eye(len(betas))
    direction[free.slices["betas"], 0] = [
        (stature(body, betas + step) - middle) / size for step in steps
    ]
    solved = problem.linearize(values).inverse_times(direction)
    assert solved is not None  # priors determine everything
    return float(np.sqrt(np.sum(direction * solved)))


def solved(setup: Setup, body: SkinnedBody) -> tuple[Values, Array, float]:
    """The values at the end, limb landmarks (T, 12, 3) m, and CPU seconds."""
    begin = time.process_time()
    values = setup.start | SOLVER.solve(setup.problem, setup.start).values
    seconds = time.process_time() - begin
    assert setup.moving is not None
    return values, limbs(body, landmarks_of(setup.moving, values)), seconds


def film(body: SkinnedBody, camera: str, frames: Sequence[int], known: Any) -> dict[str, Any]:
    """One camera: frame by frame (`apart`), together, its mean, and with independent frames."""
    true, tall = known
    begin = time.process_time()
    apart = [
        solved(video_fit(balance_clip([frame], (camera,)), body, ""), body)[1][0]
        for frame in frames
    ]
    row: dict[str, Any] = {"camera": camera, "apart": {"mpjpe": mpjpe(np.array(apart), true)}}
    row["apart"]["CPU seconds"] = time.process_time() - begin
    begin = time.process_time()
    setup = video_fit(balance_clip(frames, (camera,)), body, "")
    started = time.process_time() - begin
    values, found, seconds = solved(setup, body)
    row["together"] = {
        "mpjpe": mpjpe(found, true),
        "acceleration": 1e3 * float(np.linalg.norm(np.diff(found, 2, axis=0), axis=-1).mean()),
        "stature": stature(body, values["betas"]) - tall,
        "stature sd": sd_of_stature(body, setup.problem, values),
        "CPU seconds": started + seconds,
    }
    assert setup.moving is not None
    begin = time.process_time()
    mean = limbs(body, landmarks_of(setup.moving, video_mean(setup, values)))
    row["mean"] = {"mpjpe": mpjpe(mean, true), "CPU seconds": time.process_time() - begin}
    setup.start[EVIDENCE] = np.ones(1)
    row["independent"] = {"mpjpe": mpjpe(solved(setup, body)[1], true)}
    return row


def videos(quick: bool) -> list[dict[str, Any]]:
    """Each of the four cameras alone, on frames on which nothing was chosen."""
    body, frames = load_body("default"), range(55, 58) if quick else UNSEEN
    known = by_four_cameras(body, frames)
    return [film(body, str(name), frames, known) for name in published()["camera"]]


def measured(quick: bool) -> dict[str, object]:
    """Errors of recipes on images, of standard deviations of the mean, and on videos."""
    return {
        "images": one_image(quick),
        "terms": by_terms(quick),
        "spread": spread(load_body("default"), (0,) if quick else SPREAD),
        "videos": videos(quick),
    }


def tables(found: dict[str, Any]) -> str:
    """All three."""
    text = ""
    head: tuple[str, ...] = (
        "fit",
        "MPJPE, mm",
        "PA, mm",
        "in space, mm",
        f"above {FAILED:g} mm (95 %)",
        "CPU ms",
    )
    for scene, recipes in found["images"].items():
        rows: list[tuple[object, ...]] = []
        for name, one in recipes.items():
            errors = [f"{one[key]:.1f}" for key in ("MPJPE", "PA", "absolute")]
            rows.append((name, *errors, share(one["failed"], one["fits"]), f"{one['ms']:.0f}"))
        fits = next(iter(recipes.values()))["fits"]
        text += f"{TITLES[scene]} ({fits} fits):\n\n{table(head, rows)}\n"
    head = ("terms", "MPJPE, mm", "PA, mm", "overlap, mm", f"over {THROUGH:g} mm (95 %)", "CPU ms")
    for scene, recipes in found.get("terms", {}).items():
        rows = []
        for name, one in recipes.items():
            errors = [f"{one[key]:.1f}" for key in ("MPJPE", "PA", "overlap")]
            rows.append((name, *errors, share(one["through"], one["fits"]), f"{one['ms']:.0f}"))
        fits = next(iter(recipes.values()))["fits"]
        text += f"{TITLES[scene]}, by terms ({fits} fits):\n\n{table(head, rows)}\n"
    ratio, least, largest = (f"{found['spread'][n]:.1f}" for n in ("ratio", "least", "largest"))
    text += (
        f"On {found['spread']['images']} images of `balance`, landmarks of the mean were {ratio} "
        f"times as far from the truth as their standard deviations say ({least} to {largest} "
        "times, by landmark).\n\nVideos, MPJPE in mm:\n\n"
    )
    head = (
        *("camera", "frame by frame", "together", "mean", "as if independent"),
        *("acceleration, mm a frame squared", "stature off, mm (sd)", "CPU s", "CPU s of mean"),
    )
    rows = []
    for row in found["videos"]:
        one = row["together"]
        rows.append(
            (
                row["camera"],
                *(f"{row[n]['mpjpe']:.1f}" for n in ("apart", "together", "mean", "independent")),
                f"{one['acceleration']:.1f}",
                f"{one['stature']:+.0f} ({one['stature sd']:.0f})",
                *(f"{row[name]['CPU seconds']:.1f}" for name in ("together", "mean")),
            )
        )
    return text + table(head, rows)
