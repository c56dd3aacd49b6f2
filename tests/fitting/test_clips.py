"""Clips as folders of keypoint files: their order, gaps, people, and what is wrong with them."""

import json
from pathlib import Path

import numpy as np
import pytest

from workbench.errors import BadArgument, BadFile, UnknownName
from workbench.fitting import read_clip

SIZE = (640, 480)


def person(u: float, sure: float = 0.9) -> list[float]:
    """COCO-18 keypoints around (u, 200) px."""
    return [n for k in range(18) for n in (u + 5 * (k % 4), 200 + 10 * k, sure)]


def write(folder: Path, number: str, *people: list[float]) -> None:
    """An OpenPose file of one frame."""
    folder.mkdir(parents=True, exist_ok=True)
    data = {"people": [{"pose_keypoints_2d": one} for one in people]}
    (folder / f"film_{number}_keypoints.json").write_text(json.dumps(data))


def places(folder: Path, **options: object) -> list[float]:
    """The u of the first keypoint in each frame; NaN in gaps."""
    film = read_clip(folder, fps=30, size=SIZE, **options).films[0]
    return [
        u if c else np.nan for u, c in zip(film.pixels[:, 0, 0], film.confidence[:, 0], strict=True)
    ]


def test_missing_and_empty_frames_are_gaps(tmp_path: Path) -> None:
    for number in (1, 2, 5):
        write(tmp_path, str(number), person(100))
    write(tmp_path, "4")
    np.testing.assert_array_equal(places(tmp_path), [100, 100, np.nan, np.nan, 100])
    clip = read_clip(tmp_path, fps=30, size=SIZE)
    assert clip.gaps == (2, 3)
    assert any("no files of frames 3" in note for note in clip.notes)


def test_constant_step_of_numbers_is_one_frame(tmp_path: Path) -> None:
    for number in (10, 20, 40):
        write(tmp_path, str(number), person(number))
    np.testing.assert_array_equal(places(tmp_path), [10, 20, np.nan, 40])


def test_one_person_is_followed(tmp_path: Path) -> None:
    write(tmp_path, "0", person(100, 0.9), person(400, 0.5))
    write(tmp_path, "1", person(390, 0.9), person(110, 0.3))
    write(tmp_path, "2", person(380, 0.9))
    np.testing.assert_array_equal(places(tmp_path), [100, 110, np.nan])
    assert places(tmp_path, person=1) == [400, 390, 380]
    notes = read_clip(tmp_path, fps=30, size=SIZE).notes
    assert any("2 frames hold several people" in note for note in notes)
    assert any("in 1 frames nobody is near" in note for note in notes)
    with pytest.raises(UnknownName):
        read_clip(tmp_path, fps=30, size=SIZE, person=5)


def test_what_is_not_read_of_many_frames_is_said_once(tmp_path: Path) -> None:
    for number in range(3):
        one = {"pose_keypoints_2d": person(100.0), "pose_keypoints_3d": [1.0] * 72}
        (tmp_path / f"film_{number}.json").write_text(json.dumps({"people": [one]}))
    (note,) = read_clip(tmp_path, fps=30, size=SIZE).notes
    assert note == "film_0.json: not read are pose_keypoints_3d (and so in 3 frames)"


def test_person_with_one_keypoint_is_followed(tmp_path: Path) -> None:
    single = person(100)[:3] + [0.0] * 51
    for number, one in enumerate((single, person(100), single, person(110), person(110))):
        write(tmp_path, str(number), one)
    assert places(tmp_path) == [100, 100, 100, 110, 110]


def test_cameras_have_folders(tmp_path: Path) -> None:
    for camera in ("left", "right"):
        for number in (0, 1):
            write(tmp_path / camera, str(number), person(100))
    matrix = {"K": np.eye(3).tolist(), "R": np.eye(3).tolist(), "t": [0, 0, 1]}
    file = tmp_path.parent / f"{tmp_path.name}-cameras.json"
    file.write_text(json.dumps({"right": {**matrix, "t": [0, 0, 7]}, "left": matrix}))
    clip = read_clip(tmp_path, fps=30, size=SIZE, calibration=file)
    assert [film.name for film in clip.films] == ["left", "right"]
    assert clip.films[1].t is not None
    assert clip.films[1].t[2] == 7
    with pytest.raises(BadFile, match="0 are calibrated"):
        read_clip(tmp_path, fps=30, size=SIZE)
    write(tmp_path, "3", person(1))
    with pytest.raises(BadFile, match="JSON files and folders"):
        read_clip(tmp_path, fps=30, size=SIZE)


def test_bad_folders_are_refused(tmp_path: Path) -> None:
    with pytest.raises(BadFile, match="is no folder"):
        read_clip(tmp_path / "none", fps=30)
    with pytest.raises(BadFile, match="holds no JSON"):
        read_clip(tmp_path, fps=30)
    write(tmp_path, "7", person(1))
    with pytest.raises(BadFile, match="--size"):
        read_clip(tmp_path, fps=30)
    with pytest.raises(BadArgument, match="fps of a clip"):
        read_clip(tmp_path, fps=0, size=SIZE)
    (tmp_path / "7.json").write_text("{}")
    with pytest.raises(BadFile, match="same number, 7"):
        read_clip(tmp_path, fps=30, size=SIZE)
    (tmp_path / "7.json").rename(tmp_path / "frame.json")
    with pytest.raises(BadFile, match="holds its number"):
        read_clip(tmp_path, fps=30, size=SIZE)


def test_images_of_several_sizes_are_refused(tmp_path: Path) -> None:
    for number, width in ((0, 640), (1, 320)):
        data = {
            "images": [{"id": 1, "width": width, "height": 200}],
            "annotations": [{"image_id": 1, "keypoints": [5.0, 6.0, 0.9] * 17}],
        }
        (tmp_path / f"{number}.json").write_text(json.dumps(data))
    with pytest.raises(BadFile, match="sizes"):
        read_clip(tmp_path, fps=30)


COCO_17 = [n for k in range(17) for n in (100.0 + 5 * (k % 4), 200.0 + 10 * k, 0.9)]


def of(u: float) -> list[float]:
    """COCO's 17 keypoints, moved to the right by u px."""
    return [n + u * (i % 3 == 0) for i, n in enumerate(COCO_17)]


def alphapose(form: str) -> object:
    """Frames 8, 10 and 11 in AlphaPose's three forms, and in COCO's; somebody else is in one."""
    seen = {"8.jpg": [of(0), of(300)], "10.jpg": [of(4)], "11.jpg": [of(6)]}
    if form == "people":
        return {
            image: {
                "version": 0.1,
                "people": [{"pose_keypoints_2d": one + [0] * 3} for one in some],
            }
            for image, some in seen.items()
        }
    each = [(image, one) for image, some in seen.items() for one in some]
    people = [
        {"image_id": image, "category_id": 1, "keypoints": one, "score": 2.0, "idx": 1}
        for image, one in each
    ]
    if form == "list":
        return people[::-1]
    images = [
        {"id": 50 + i, "file_name": f"a/{image}", "width": 640, "height": 480}
        for i, image in enumerate(seen)
    ]
    ids = {image: 50 + i for i, image in enumerate(seen)}
    return {"images": images, "annotations": [p | {"image_id": ids[p["image_id"]]} for p in people]}


@pytest.mark.parametrize("form", ["list", "people", "coco"])
def test_one_file_of_all_images_is_a_clip(tmp_path: Path, form: str) -> None:
    alone = form == "list"  # the others by their folder
    path = tmp_path / "alphapose-results.json"
    path.write_text(json.dumps(alphapose(form)))
    size = None if form == "coco" else SIZE
    clip = read_clip(path if alone else tmp_path, fps=30, size=size, person=0)
    (film,) = clip.films
    first = 300.0 if form == "list" else 0.0  # the list was turned round, and people with it
    sure = film.confidence[:, 0]
    assert (film.size, (sure > 0).tolist()) == (SIZE, [True, False, form != "list", form != "list"])
    assert film.pixels[0, 0, 0] == 100.0 + first
    assert any("nothing is said of frames 9, which are gaps" in note for note in clip.notes)
    assert any("1 frames hold several people" in note for note in clip.notes)


def test_damaged_clip_files_are_refused(tmp_path: Path) -> None:
    for data, said in [
        ([{"image_id": "a.jpg", "keypoints": COCO_17}], "is of image 'a.jpg', and the name of a"),
        ([{"keypoints": COCO_17}], "is of image None"),
        ([], "does not say which image"),
        ({"1.jpg": {"people": []}, "a1.png": {"people": []}}, "two images have the number 1"),
        ({"1.jpg": {"people": []}}, "no frame holds a person"),
    ]:
        (tmp_path / "a.json").write_text(json.dumps(data))
        with pytest.raises(BadFile, match=said):
            read_clip(tmp_path / "a.json", fps=30, size=SIZE)
