"""Fits that converged to something absurd are doubted, with the cause where it can be named."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from workbench import load_body
from workbench.arrays import Array
from workbench.blocks import Block
from workbench.fitting.body_priors import usual_priors
from workbench.fitting.conventions import ORDERS
from workbench.fitting.doubts import doubts, of_markers, of_person
from workbench.fitting.files.cameras import notes_on, read_calibration
from workbench.fitting.files.keypoints import read_observations
from workbench.fitting.images import depth_interval, image_fit
from workbench.fitting.keypoints import keypoint_fit
from workbench.fitting.known_points import mesh_fit
from workbench.fitting.marker_sets import MarkerSet, default_markers
from workbench.fitting.observations import (
    COCO,
    Clip,
    Film,
    Observations,
    photograph,
    pinhole,
)
from workbench.fitting.setup import Setup
from workbench.fitting.videos import video_fit
from workbench.geometry.camera import Camera
from workbench.geometry.rotation import matrix_from_vector, vector_from_matrix
from workbench.problem import Problem
from workbench.residuals.residual import Residual
from workbench.solvers import TrustRegion

SIZE = (1920, 1080)
K = np.array([[1500.0, 0, 960], [0, 1500, 540], [0, 0, 1]])
FLIP = np.diag([1.0, -1.0, -1.0])  # y down, z forwards


BODY = load_body("small")
Extrinsic = tuple[Array, Array]


def person() -> Array:
    """COCO's keypoints (17, 3) m of a person in an ordinary pose."""
    rng = np.random.default_rng(3)
    pose = 0.15 * rng.normal(size=(BODY.n_joints, 3))
    pose[0] = 0
    places = BODY.landmark("coco", pose, 0.5 * rng.normal(size=BODY.n_betas))
    return places[[BODY.landmark_names("coco").index(name) for name in COCO]]


def seen(R: Array, t: Array) -> Array:
    """The keypoints (17, 3) as u, v and confidence, with noise of 1.5 px."""
    camera = Camera("c/")
    pixels = camera.pixels(person(), camera.values(K=K, R=R, t=t))
    pixels = pixels + 1.5 * np.random.default_rng(int(1e3 * abs(t[0]))).normal(size=pixels.shape)
    return np.column_stack([pixels, np.full(len(pixels), 0.9)])


def ring() -> list[Extrinsic]:
    """Three cameras around the person, world to camera."""
    return [
        (FLIP @ matrix_from_vector([0.0, -angle, 0.0]), np.array([0.1 * angle, 0.05, distance]))
        for angle, distance in ((0.0, 3.2), (0.9, 3.4), (-1.1, 3.0))
    ]


def fitted(setup: Setup) -> tuple[str, ...]:
    solver = setup.strategy(None) if setup.strategy else TrustRegion(max_iterations=60)
    solution = solver.solve(setup.problem, setup.start)
    return doubts(setup, dict(setup.start) | solution.values, solution)


def from_one(
    points: Array,
    calibrated: tuple[int, int] = SIZE,
    focal: float = 1500.0,
    name: str = "camera",
) -> Setup:
    given = {"K": pinhole(focal, *calibrated), "R": np.eye(3), "t": np.zeros(3)}
    observed = Observations(tuple(COCO), (photograph(name, SIZE, points, given),))
    return image_fit(observed, BODY, "who?")


def from_three(
    told: Callable[[list[Extrinsic]], list[Extrinsic]] = list,
    read: Callable[[int, Array], Array] = lambda k, points: points,
) -> Setup:
    """Views by the true cameras, told with other extrinsics, or read in another way."""
    photos = tuple(
        photograph(f"c{k}", SIZE, read(k, seen(*true)), {"K": K, "R": R, "t": t})
        for k, (true, (R, t)) in enumerate(zip(ring(), told(ring()), strict=True))
    )
    return keypoint_fit(Observations(tuple(COCO), photos), BODY, "who?")


FRONT = (FLIP, np.array([0.0, 0.0, 3.2]))
POINTS = seen(*FRONT)


def test_fit_to_good_keypoints_is_not_doubted() -> None:
    assert fitted(from_one(POINTS)) == ()
    assert fitted(from_three()) == ()


def sides_exchanged(points: Array) -> Array:
    other = [n.replace("left", "#").replace("right", "left").replace("#", "right") for n in COCO]
    return points[[COCO.index(name) for name in other]]


UPWARDS, MIRRORED = ([1, -1, 1], [0, SIZE[1], 0]), ([-1, 1, 1], [SIZE[0], 0, 0])
BLURRED = np.random.default_rng(0).normal(0, 90, (17, 3)) * [1, 1, 0]
VIEWS: dict[str, Callable[[], Setup]] = {
    "not world-to-camera (--camera-to-world)": lambda: from_three(
        lambda ring: [(R.T, -R.T @ t) for R, t in ring]
    ),
    "translations of the cameras seem to be in mm": lambda: from_three(
        lambda ring: [(R, 1000 * t) for R, t in ring]
    ),
    "OpenGL's axes": lambda: from_three(lambda ring: [(FLIP @ R, FLIP @ t) for R, t in ring]),
    "not world-to-camera (--camera-to-world), with translations in mm": lambda: from_three(
        lambda ring: [(R.T, -1000 * R.T @ t) for R, t in ring]
    ),
    "in the order 2, 1, 3": lambda: from_three(lambda ring: [ring[1], ring[0], ring[2]]),
    "translations of the cameras seem to be in inches;": lambda: from_three(
        lambda ring: [(R, t / 0.0254) for R, t in ring]
    ),
    "y points up in the image": lambda: from_three(
        read=lambda k, points: points * UPWARDS[0] + UPWARDS[1]
    ),
    "if the images are mirrored": lambda: from_three(
        read=lambda k, points: points * MIRRORED[0] + MIRRORED[1]
    ),
    "if c1 is left out": lambda: from_three(read=lambda k, points: points + (k == 1) * BLURRED),
    "left and right were exchanged in c1": lambda: from_three(
        read=lambda k, points: sides_exchanged(points) if k == 1 else points
    ),
}


@pytest.mark.parametrize("words", VIEWS)
def test_what_makes_views_agree_is_named(words: str) -> None:
    found = fitted(VIEWS[words]())
    assert any(words in doubt for doubt in found), found


def test_residual_of_many_sigmas_is_doubted() -> None:
    slope = Block("slope", (), "m")
    line = Residual("line", slope.symbol * np.arange(9.0) - 5, sigma=0.1, unit="m")
    start = {"slope": np.zeros(())}
    best = 5 * np.arange(9.0).sum() / np.sum(np.arange(9.0) ** 2)
    for bounds, found in (({"slope": (0.0, 0.1)}, 0.1), (None, best)):
        problem = Problem([line], ["slope"], bounds, blocks=[slope])
        (doubt,) = fitted(Setup(problem, start, "which slope?"))
        sigmas = np.sqrt(np.mean((found * np.arange(9.0) - 5) ** 2)) / 0.1
        assert doubt.startswith(f"residual 'line' is {sigmas:.3g} times its sigma")
    noisy = Residual("line", slope.symbol * np.arange(9.0) - 5, sigma=5, unit="m")
    assert fitted(Setup(Problem([noisy], ["slope"], blocks=[slope]), start, "?")) == ()


def test_rotation_vectors_in_degrees_are_read_as_such(tmp_path: Path) -> None:
    path = tmp_path / "cameras.json"
    wanted = [R for R, _ in ring()]
    cameras = {
        f"c{i}": {"K": K.tolist(), "R": np.degrees(vector_from_matrix(R)).tolist(), "t": [0, 0, 3]}
        for i, R in enumerate(wanted)
    }
    path.write_text(json.dumps(cameras))
    found = read_calibration(path)
    np.testing.assert_allclose([camera["R"] for camera in found.values()], wanted, atol=1e-9)
    assert "degrees" in notes_on(path, found)[0]


def in_order(order: tuple[str, ...]) -> Array:
    """The keypoints in another order; those that COCO lacks are in the middle of its others."""
    middle = POINTS.mean(axis=0)
    return np.array([POINTS[COCO.index(name)] if name in COCO else middle for name in order])


def moved_leg() -> Array:
    leg = np.isin(COCO, ("right_knee", "right_ankle"))
    return POINTS + leg[:, None] * [500, -400, 0]


OPENPOSE = ORDERS["OpenPose's COCO-18 without the neck"]
ABSURD: dict[str, Callable[[], Setup]] = {
    "in the order of OpenPose": lambda: from_one(in_order(OPENPOSE)),
    "in the order of Human3.6M": lambda: from_one(in_order(ORDERS["Human3.6M"])),
    "y points up in the image": lambda: from_one(POINTS * UPWARDS[0] + UPWARDS[1]),
    "stands on their head": lambda: from_one(POINTS * [-1, -1, 1] + [*SIZE, 0]),
    "fractions of the image": lambda: from_one(POINTS / [*SIZE, 1]),
    "order of the points": lambda: from_one(np.roll(POINTS, 5, axis=0)),
    "right leg count as outliers": lambda: from_one(moved_leg()),
    "m from the camera": lambda: from_one(POINTS, focal=60_000.0),
    "the principal point of camera is 540, 960 px": lambda: from_one(POINTS, calibrated=SIZE[::-1]),
    "outside of the image of 1920x1080 px": lambda: from_one(POINTS * [2, 2, 1]),
}


@pytest.mark.parametrize("words", ABSURD)
def test_absurd_keypoints_of_one_camera_are_doubted(words: str) -> None:
    found = fitted(ABSURD[words]())
    assert any(words in doubt for doubt in found), found


def test_a_reading_that_fits_as_badly_is_not_named() -> None:
    anywhere = np.random.default_rng(5).uniform([600, 100, 0.9], [1300, 1000, 0.9], (17, 3))
    found = fitted(from_one(anywhere))
    assert found
    assert not any("would fit better" in doubt for doubt in found), found


def test_interval_of_a_camera_named_with_a_slash() -> None:
    setup = from_one(POINTS, name="cam/")
    found = depth_interval(setup, setup.start)
    assert found is not None
    assert found.low < found.mean < found.high


def dressed(betas: float = 0.0) -> tuple[MarkerSet, Array, dict[str, Array]]:
    """Markers on the small body, where they are seen in two frames, and the body's own values."""
    worn = default_markers(BODY)
    values = {
        "pose": np.zeros((2, 24, 3)),
        "betas": betas * np.eye(BODY.n_betas)[0],
        "trans": np.array([[0.0, 0, 0], [0.3, 0, 0]]),
        "offsets": worn.nominal,
    }
    dressed = worn.on(BODY)
    return worn, dressed.landmark("markers", *values.values()), values


def exchanged(worn: MarkerSet, places: Array, pairs: dict[str, str]) -> Array:
    order = np.arange(len(worn.names))
    for pair in pairs.items():
        rows = [worn.names.index(label) for label in pair]
        order[rows] = rows[::-1]
    return places[:, order]


MARKED: dict[str, Callable[[MarkerSet, Array], Array]] = {
    "mm were taken for m": lambda worn, places: 1000 * places,
    "inches were taken for m": lambda worn, places: places / 0.0254,
    "on the body: LELB, LKNE; check their labels": lambda worn, places: exchanged(
        worn, places, {"LELB": "LKNE"}
    ),
    "left and right of the markers are exchanged": lambda worn, places: exchanged(
        worn, places, {name: "R" + name[1:] for name in worn.names if name.startswith("L")}
    ),
}


@pytest.mark.parametrize("words", MARKED)
def test_absurd_markers_are_doubted(words: str) -> None:
    worn, places, values = dressed()
    found = [*of_markers(worn.on(BODY), worn, MARKED[words](worn, places), values)]
    assert any(words in doubt for doubt in found), found
    assert not [*of_markers(worn.on(BODY), worn, places, values)]


def test_improbable_shape_is_doubted_in_every_fit() -> None:
    worn, places, values = dressed(6.0)
    found = [*of_markers(worn.on(BODY), worn, places, values)]
    assert found == [*of_person(BODY, values["betas"])]
    assert "betas[0] is 6.0 standard deviations" in found[0]


def test_vertices_in_another_order_are_doubted() -> None:
    model, rng = BODY, np.random.default_rng(0)
    vertices = model.vertices() + 0.002 * rng.normal(size=(model.n_vertices, 3))
    for places, words in ((vertices, ""), (rng.permutation(vertices), "in the body's order")):
        setup = mesh_fit(model, places, "who?", sigma=0.002, priors=usual_priors(model))
        found = fitted(setup)
        assert any(words in doubt for doubt in found) if words else not found, found


def test_clip_in_fractions_is_doubted() -> None:
    points = np.array([POINTS] * 3)
    for by, words in ((1.0, None), (1 / 2000, "fractions of the image")):
        film = Film("camera", SIZE, by * points[..., :2], points[..., 2], K)
        setup = video_fit(Clip(tuple(COCO), (film,), 30.0), BODY, "who?", worth=1)
        found = fitted(setup)
        assert any(words in doubt for doubt in found) if words else not found, found


@pytest.mark.parametrize("score", [10.0, 90.0])
def test_scores_above_one_change_no_fit(tmp_path: Path, score: float) -> None:
    points = POINTS
    found = []
    for name, factor in (("one", 1 / 0.9), ("score", score)):
        path = tmp_path / f"{name}.json"
        keypoints = (points * [1, 1, factor]).ravel().tolist()
        path.write_text(json.dumps([{"image_id": 1, "category_id": 1, "keypoints": keypoints}]))
        found.append(read_observations([path], size=SIZE))
    np.testing.assert_array_equal(
        found[0].photographs[0].confidence, found[1].photographs[0].confidence
    )
    assert not found[0].notes
    assert any("scores" in note for note in found[1].notes)
