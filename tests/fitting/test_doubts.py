"""Fits that converged to something absurd are doubted, with the cause where it can be named."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from workbench import load_body
from workbench.arrays import Array
from workbench.bodies import SkinnedBody
from workbench.fitting.body_priors import usual_priors
from workbench.fitting.conventions import ORDERS
from workbench.fitting.doubts import doubts, of_markers, of_person
from workbench.fitting.files.cameras import notes_on, read_calibration
from workbench.fitting.files.keypoints import read_observations
from workbench.fitting.images import depth_interval, image_fit
from workbench.fitting.keypoints import keypoint_fit
from workbench.fitting.known_points import mesh_fit
from workbench.fitting.marker_sets import MarkerSet, default_markers
from workbench.fitting.observations import COCO, Clip, Film, Observations, photograph
from workbench.fitting.setup import Setup
from workbench.fitting.videos import video_fit
from workbench.geometry.camera import Camera
from workbench.geometry.rotation import vector_from_matrix
from workbench.solvers import TrustRegion

SIZE = (1920, 1080)
K = np.array([[1500.0, 0, 960], [0, 1500, 540], [0, 0, 1]])
FLIP = np.diag([1.0, -1.0, -1.0])  # y down, z forwards


def body() -> SkinnedBody:
    return load_body("small")


def person() -> Array:
    """COCO's keypoints (17, 3) m of a person in an ordinary pose."""
    rng = np.random.default_rng(3)
    values = body().start()
    pose = values["pose"] + 0.15 * rng.normal(size=values["pose"].shape)
    pose[0] = 0
    names = body().landmark_names("coco")
    places = body().landmark("coco", pose, 0.5 * rng.normal(size=values["betas"].shape))
    return places[[names.index(name) for name in COCO]]


def seen(R: Array, t: Array, noise: float = 1.5) -> Array:
    """The keypoints (17, 3) as u, v and confidence, with noise in px."""
    camera = Camera("c/")
    pixels = camera.pixels(person(), camera.values(K=K, R=R, t=t))
    pixels = pixels + noise * np.random.default_rng(int(1e3 * abs(t[0]))).normal(size=pixels.shape)
    return np.column_stack([pixels, np.full(len(pixels), 0.9)])


def ring() -> list[tuple[Array, Array]]:
    """Three cameras around the person, world to camera."""
    found = []
    for angle, distance in ((0.0, 3.2), (0.9, 3.4), (-1.1, 3.0)):
        turn = np.array(
            [
                [np.cos(angle), 0, -np.sin(angle)],
                [0, 1, 0],
                [np.sin(angle), 0, np.cos(angle)],
            ]
        )
        found.append((FLIP @ turn, np.array([0.1 * angle, 0.05, distance])))
    return found


def fitted(setup: Setup) -> tuple[str, ...]:
    solver = setup.strategy(None) if setup.strategy else TrustRegion(max_iterations=60)
    solution = solver.solve(setup.problem, setup.start)
    return doubts(setup, dict(setup.start) | solution.values, solution)


def from_one(points: Array, size: tuple[int, int] = SIZE, focal: float | None = 1500.0) -> Setup:
    given: dict[str, Any] = {} if focal is None else {"K": K * [focal / 1500, focal / 1500, 1]}
    if focal is not None:
        given["K"] = np.array([[focal, 0, size[0] / 2], [0, focal, size[1] / 2], [0, 0, 1]])
        given |= {"R": np.eye(3), "t": np.zeros(3)}
    photo = photograph("camera", size, points, given)
    return image_fit(Observations(tuple(COCO), (photo,)), body(), "who?")


def from_three(extrinsics: list[tuple[Array, Array]], noise: float = 1.5) -> Setup:
    """Views by the true cameras, given with these extrinsics."""
    photos = tuple(
        photograph(f"c{i}", SIZE, seen(*true, noise), {"K": K, "R": R, "t": t})
        for i, (true, (R, t)) in enumerate(zip(ring(), extrinsics, strict=True))
    )
    return keypoint_fit(Observations(tuple(COCO), photos), body(), "who?")


FRONT = (FLIP, np.array([0.0, 0.0, 3.2]))


def test_fit_to_good_keypoints_is_not_doubted() -> None:
    assert fitted(from_one(seen(*FRONT))) == ()
    assert fitted(from_three(ring())) == ()


def exchanged(extrinsics: list[tuple[Array, Array]]) -> list[tuple[Array, Array]]:
    return [extrinsics[1], extrinsics[0], extrinsics[2]]


CONVENTIONS = {
    "not world-to-camera (--camera-to-world)": lambda R, t: (R.T, -R.T @ t),
    "translations of the cameras seem to be in mm": lambda R, t: (R, 1000 * t),
    "OpenGL's axes": lambda R, t: (FLIP @ R, FLIP @ t),
    "camera-to-world, not world-to-camera, with translations in mm": lambda R, t: (
        R.T,
        -1000 * R.T @ t,
    ),
}


@pytest.mark.parametrize("words", CONVENTIONS)
def test_convention_that_makes_views_agree_is_named(words: str) -> None:
    setup = from_three([CONVENTIONS[words](R, t) for R, t in ring()])
    assert any(words in doubt for doubt in fitted(setup)), fitted(setup)


def test_order_of_cameras_that_makes_views_agree_is_named() -> None:
    assert any("in the order 2, 1, 3" in d for d in fitted(from_three(exchanged(ring()))))


READINGS: dict[str, Callable[[int, Array], Array]] = {
    "y points up in the image": lambda k, p: p * [1, -1, 1] + [0, SIZE[1], 0],
    "if the images are mirrored": lambda k, p: p * [-1, 1, 1] + [SIZE[0], 0, 0],
    "if c1 is left out": lambda k, p: (
        p + (k == 1) * np.random.default_rng(0).normal(0, 90, (17, 3)) * [1, 1, 0]
    ),
}


@pytest.mark.parametrize("words", READINGS)
def test_reading_of_images_that_makes_views_agree_is_named(words: str) -> None:
    photos = tuple(
        photograph(f"c{i}", SIZE, READINGS[words](i, seen(R, t)), {"K": K, "R": R, "t": t})
        for i, (R, t) in enumerate(ring())
    )
    found = fitted(keypoint_fit(Observations(tuple(COCO), photos), body(), "who?"))
    assert any(words in doubt for doubt in found), found


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


def test_exchanged_sides_in_one_view_are_named() -> None:
    photos = [seen(*one) for one in ring()]
    photos[1] = photos[1][[COCO.index(swap(name)) for name in COCO]]
    observed = tuple(
        photograph(f"c{i}", SIZE, points, {"K": K, "R": R, "t": t})
        for i, (points, (R, t)) in enumerate(zip(photos, ring(), strict=True))
    )
    setup = keypoint_fit(Observations(tuple(COCO), observed), body(), "who?")
    assert any("left and right were exchanged in c1" in doubt for doubt in fitted(setup))


def swap(name: str) -> str:
    return name.replace("left", "#").replace("right", "left").replace("#", "right")


def changed(points: Array, **how: Any) -> Array:
    points = points.copy()
    if "by" in how:
        points[:, :2] = points[:, :2] * how["by"] + how.get("plus", 0)
    if "order" in how:
        points = points[how["order"]]
    return points


def moved_leg(points: Array) -> Array:
    points = points.copy()
    names = list(COCO)
    points[[names.index("right_knee"), names.index("right_ankle")], :2] += [500, -400]
    return points


def in_order(points: Array, order: tuple[str, ...]) -> Array:
    """COCO's keypoints in another order; those that COCO lacks are in the middle of its others."""
    rows = [points[COCO.index(name)] if name in COCO else points.mean(axis=0) for name in order]
    return np.array(rows)


def turned(points: Array) -> Array:
    return points * [-1, -1, 1] + [SIZE[0], SIZE[1], 0]


ABSURD = {
    "in the order of OpenPose": lambda p: from_one(
        in_order(p, ORDERS["OpenPose's COCO-18 without the neck"])
    ),
    "in the order of Human3.6M": lambda p: from_one(in_order(p, ORDERS["Human3.6M"])),
    "y points up in the image": lambda p: from_one(p * [1, -1, 1] + [0, SIZE[1], 0]),
    "stands on their head": lambda p: from_one(turned(p)),
    "fractions of the image": lambda p: from_one(changed(p, by=1 / np.array(SIZE))),
    "order of the points": lambda p: from_one(changed(p, order=np.roll(np.arange(17), 5))),
    "right leg count as outliers": lambda p: from_one(moved_leg(p)),
    "m from the camera": lambda p: from_one(p, focal=60_000.0),
}


@pytest.mark.parametrize("words", ABSURD)
def test_absurd_keypoints_of_one_camera_are_doubted(words: str) -> None:
    found = fitted(ABSURD[words](seen(*FRONT)))
    assert any(words in doubt for doubt in found), found


@pytest.mark.parametrize("score", [10.0, 90.0])
def test_scores_above_one_change_no_fit(tmp_path: Path, score: float) -> None:
    points = seen(*FRONT)
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


def test_negative_and_missing_confidences_are_not_seen(tmp_path: Path) -> None:
    points = seen(*FRONT)
    points[3, 2], points[4, 0] = -0.02, np.nan
    path = tmp_path / "odd.json"
    path.write_text(json.dumps([{"keypoints": points.ravel().tolist()}]))
    photo = read_observations([path], size=SIZE).photographs[0]
    assert photo.confidence[3] == photo.confidence[4] == 0
    assert (photo.confidence > 0).sum() == 15


def test_small_and_large_images_of_a_person_give_one_body() -> None:
    points, found = seen(*FRONT), []
    for times in (0.1, 1.0):
        size = (int(times * SIZE[0]), int(times * SIZE[1]))
        setup = from_one(points * [times, times, 1], size, 1500 * times)
        assert setup.strategy is not None
        solution = setup.strategy(None).solve(setup.problem, setup.start)
        values = dict(setup.start) | solution.values
        found.append(body().joints(*(values[block.name] for block in body().blocks())))
    assert np.linalg.norm(found[0] - found[1], axis=1).max() < 0.02  # m


def test_interval_of_a_camera_named_with_a_slash() -> None:
    photo = photograph("cam/", SIZE, seen(*FRONT), {"K": K, "R": np.eye(3), "t": np.zeros(3)})
    setup = image_fit(Observations(tuple(COCO), (photo,)), body(), "who?")
    found = depth_interval(setup, setup.start)
    assert found is not None
    assert found.low < found.mean < found.high


def dressed(betas: float = 0.0) -> tuple[MarkerSet, Array, dict[str, Array]]:
    """Markers on the small body, where they are seen in two frames, and the body's own values."""
    worn = default_markers(body())
    values = {
        "pose": np.zeros((2, 24, 3)),
        "betas": betas * np.eye(body().n_betas)[0],
        "trans": np.array([[0.0, 0, 0], [0.3, 0, 0]]),
        "offsets": worn.nominal,
    }
    dressed = worn.on(body())
    return worn, dressed.landmark("markers", *values.values()), values


def rows(worn: MarkerSet, label: str) -> int:
    return worn.names.index(label)


def exchanged_labels(worn: MarkerSet, places: Array, pairs: dict[str, str]) -> Array:
    order = np.arange(len(worn.names))
    for a, b in pairs.items():
        order[[rows(worn, a), rows(worn, b)]] = rows(worn, b), rows(worn, a)
    return places[:, order]


MARKED: dict[str, Callable[[MarkerSet, Array], Array]] = {
    "mm were taken for m": lambda worn, places: 1000 * places,
    "inches were taken for m": lambda worn, places: places / 0.0254,
    "LELB and LKNE seem to be exchanged": lambda worn, places: exchanged_labels(
        worn, places, {"LELB": "LKNE"}
    ),
    "left and right of the markers are exchanged": lambda worn, places: exchanged_labels(
        worn, places, {name: "R" + name[1:] for name in worn.names if name.startswith("L")}
    ),
}


@pytest.mark.parametrize("words", MARKED)
def test_absurd_markers_are_doubted(words: str) -> None:
    worn, places, values = dressed()
    found = [*of_markers(worn.on(body()), worn, MARKED[words](worn, places), values)]
    assert any(words in doubt for doubt in found), found
    assert not [*of_markers(worn.on(body()), worn, places, values)]


def test_improbable_shape_is_doubted_in_every_fit() -> None:
    worn, places, values = dressed(6.0)
    found = [*of_markers(worn.on(body()), worn, places, values)]
    assert found == [*of_person(body(), values["betas"])]
    assert "betas[0] is 6.0 standard deviations" in found[0]


def test_vertices_in_another_order_are_doubted() -> None:
    model, rng = body(), np.random.default_rng(0)
    vertices = model.vertices() + 0.002 * rng.normal(size=(model.n_vertices, 3))
    for places, words in ((vertices, ""), (rng.permutation(vertices), "in the body's order")):
        setup = mesh_fit(model, places, "who?", sigma=0.002, priors=usual_priors(model))
        found = fitted(setup)
        assert any(words in doubt for doubt in found) if words else not found, found


def test_clip_in_fractions_is_doubted() -> None:
    points = np.array([seen(*FRONT)] * 3)
    for by, words in ((1.0, None), (1 / 2000, "fractions of the image")):
        film = Film("camera", SIZE, by * points[..., :2], points[..., 2], K)
        setup = video_fit(Clip(tuple(COCO), (film,), 30.0), body(), "who?", worth=1)
        found = fitted(setup)
        assert any(words in doubt for doubt in found) if words else not found, found
