"""What users' files hold beside what a fit reads is read too, refused, or named in a sentence."""

import json
from dataclasses import replace
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rich.console import Console

from tests.bodies.random_bodies import entries
from tests.fitting.test_keypoint_files import TOML, person, written
from workbench.bodies.catalogue import load_body
from workbench.bodies.files.joint_names import HANDS as HAND_JOINTS
from workbench.bodies.files.smpl_layout import body_from
from workbench.cli.progress import print_outcome
from workbench.errors import BadFile
from workbench.experiments import Experiment, Outcome, Setup, run
from workbench.fitting.calibration_files import read_calibration
from workbench.fitting.detector_layouts import HANDS, WHOLE_BODY
from workbench.fitting.keypoint_files import read_keypoints, read_observations
from workbench.fitting.keypoints import keypoint_fit, unused
from workbench.fitting.meshes import own_mesh
from workbench.fitting.observations import COCO, FEET
from workbench.geometry.meshes import read_mesh, read_registered, write_mesh
from workbench.reports import write_report

SIZE = (640, 480)


def openpose(**parts: list[float]) -> dict[str, Any]:
    return {"people": [{"pose_keypoints_2d": person(25), **parts}]}


def whole_body(**parts: Any) -> dict[str, Any]:
    image = {"id": 1, "width": SIZE[0], "height": SIZE[1]}
    return {"images": [image], "annotations": [{"image_id": 1, "keypoints": person(17), **parts}]}


def test_hands_of_openpose_are_read_by_name(tmp_path: Path) -> None:
    hands = {
        f"hand_{side}_keypoints_2d": person(21, at=at)
        for side, at in (("left", 300.0), ("right", 500.0))
    }
    names, points, _ = read_keypoints(written(tmp_path / "a.json", openpose(**hands)))
    assert names[25:] == HANDS[0] + HANDS[1]
    assert len(set(names)) == 25 + 42
    assert points[names.index("left_index1")].tolist() == [305.0, 310.0, 0.9]
    assert points[names.index("right_pinky_tip")].tolist() == [520.0, 540.0, 0.9]
    assert {n for n in names if n in HAND_JOINTS} == set(HAND_JOINTS)  # as SMPL-H calls them


def test_whole_bodies_of_coco_are_read_in_parts_and_in_one_list(tmp_path: Path) -> None:
    parts = {
        "foot_kpts": person(6, at=200.0),
        "lefthand_kpts": person(21, at=300.0),
        "righthand_kpts": person(21, at=400.0),
        "face_kpts": person(68, at=500.0),
        "lefthand_valid": True,
        "face_box": [1, 2, 3, 4],
    }
    file = written(tmp_path / "a.json", whole_body(**parts))
    names, points, size = read_keypoints(file)
    assert size == SIZE
    assert set(names) == set(WHOLE_BODY)
    assert names[17:23] == FEET
    assert points[names.index("left_heel"), 0] == 202.0
    assert points[names.index("right_thumb1"), 0] == 401.0
    assert read_observations([file]).notes == ()
    one = whole_body(keypoints=person(133))
    names, points, _ = read_keypoints(written(tmp_path / "b.json", one))
    assert names == WHOLE_BODY
    assert points[names.index("right_pinky_tip"), 0] == 100.0 + 132


def test_points_that_are_not_read_are_named(tmp_path: Path) -> None:
    more = {
        "hand_left_keypoints_3d": [1.0] * 84,
        "hand_right_keypoints_2d": person(20),
        "face_keypoints_2d": [],
        "person_id": [-1],
    }
    file = written(tmp_path / "a.json", openpose(**more))
    (note,) = read_observations([file], size=SIZE).notes
    assert note == (
        "a.json: not read are hand_right_keypoints_2d (20 points), hand_left_keypoints_3d"
    )
    again = whole_body(keypoints=person(23), foot_kpts=person(6))
    (note,) = read_observations([written(tmp_path / "b.json", again)]).notes
    assert "foot_kpts (6 points)" in note


def test_other_people_of_a_file_are_counted(tmp_path: Path) -> None:
    people = [{"pose_keypoints_2d": person(25, confidence=c)} for c in (0.3, 0.8)]
    file = written(tmp_path / "a.json", {"people": [*people, {"pose_keypoints_2d": []}]})
    (note,) = read_observations([file], size=SIZE).notes
    assert note.startswith("a.json holds 2 people; the one seen best, number 1 counted from 0")
    assert read_observations([file], size=SIZE, person=0).notes == ()


def test_a_hand_that_one_camera_lacks_is_not_seen_there(tmp_path: Path) -> None:
    files = [
        written(tmp_path / "a.json", openpose(hand_left_keypoints_2d=person(21))),
        written(tmp_path / "b.json", openpose()),
    ]
    camera = {
        "K": [[500, 0, 320], [0, 500, 240], [0, 0, 1]],
        "R": np.eye(3).tolist(),
        "t": [0, 0, 3],
    }
    cameras = written(tmp_path / "c.json", {"a": camera, "b": camera})
    seen = read_observations(files, calibration=cameras, size=SIZE)
    at = [seen.names.index(name) for name in HANDS[0]]
    assert (seen.photographs[0].confidence[at] == 0.9).all()
    assert (seen.photographs[1].confidence[at] == 0).all()
    assert set(HANDS[0]) <= set(seen.observed())


def test_a_body_with_fingers_is_fitted_to_them_and_another_says_that_it_is_not(
    tmp_path: Path,
) -> None:
    hands = {f"hand_{side}_keypoints_2d": person(21) for side in ("left", "right")}
    seen = read_observations([written(tmp_path / "a.json", openpose(**hands))], size=SIZE)
    (said,) = unused(seen, load_body("small"))
    assert said == (
        "Of 67 observed keypoints, 23 are fitted; the landmarks 'coco' of the body 'small' do not "
        "include the others: 21 of the left hand, 21 of the right hand, neck, mid_hip"
    )
    smpl_h = body_from(entries(K=52), "with fingers", "b")
    (said,) = unused(seen, smpl_h)
    assert "6 of the left hand, 6 of the right hand" in said  # its root and five tips
    fitted = keypoint_fit(seen, smpl_h, "which?").views[0]
    names = smpl_h.landmark_names(fitted.landmarks)
    assert {n for n, c in zip(names, fitted.confidence, strict=True) if c} >= set(HAND_JOINTS)


@pytest.fixture(scope="module")
def outcome(tmp_path_factory: pytest.TempPathFactory) -> Outcome:
    """The keypoints of a body in one made-up image, and hands beside them."""
    body = load_body("small")
    points = body.landmark("coco", trans=[0.0, 0.0, 4.0]) * (1, -1, 1)  # v down
    pixels = points[:, :2] / points[:, 2:] * 500 + (320, 240)
    flat = np.column_stack([pixels, np.ones(len(pixels))])
    order = [body.landmark_names("coco").index(name) for name in (*COCO, *FEET)]
    data = whole_body(keypoints=flat[order].ravel().tolist(), lefthand_kpts=person(21))
    file = written(tmp_path_factory.mktemp("seen") / "a.json", data)
    setup = keypoint_fit(read_observations([file], focal=500.0), body, "which?")
    setup = replace(setup, synthetic="<all> of it")
    return run(Experiment("hands", lambda: setup, ""), compare=False)


def test_what_is_not_used_stands_in_the_terminal_the_page_and_the_summary(
    outcome: Outcome, tmp_path: Path
) -> None:
    console = Console(record=True, width=300, file=StringIO())
    print_outcome(console, outcome)
    page = write_report(outcome, tmp_path / "run")
    summary = json.loads((page.parent / "summary.json").read_text(encoding="utf-8"))
    (note,) = outcome.setup.notes
    assert note.endswith("do not include the others: 21 of the left hand")
    assert f"note: {note}" in console.export_text()
    assert note.replace("'", "&#39;") in page.read_text(encoding="utf-8")
    assert summary["notes"] == [note]


def test_synthetic_data_are_called_so_where_they_are_shown(
    outcome: Outcome, tmp_path: Path
) -> None:
    surface = outcome.surface
    assert surface is not None
    made_up = replace(outcome, setup=replace(outcome.setup, truth=surface + 0.001))
    measured = replace(made_up, setup=replace(made_up.setup, synthetic=""))
    for one, heading in (
        (made_up, "Distances to the synthetic truth"),
        (measured, "Distances to the truth"),
    ):
        page = write_report(one, tmp_path / "run")
        text = page.read_text(encoding="utf-8")
        assert f"{heading}</h2>" in text
        assert ("Synthetic data</strong>: &lt;all&gt; of it." in text) == (one is made_up)
        said = json.loads((page.parent / "summary.json").read_text(encoding="utf-8"))["synthetic"]
        assert said == one.setup.synthetic
        assert ("in the synthetic truth" in text) == (one is made_up)
        console = Console(record=True, width=200, file=StringIO())
        print_outcome(console, one)
        assert ("synthetic data: <all> of it" in console.export_text()) == (one is made_up)


# Cameras.


def test_a_fisheye_is_not_read_as_a_pinhole(tmp_path: Path) -> None:
    (tmp_path / "c.toml").write_text(TOML.replace("fisheye = false", "fisheye = true"))
    with pytest.raises(BadFile, match="camera 'left' is a fisheye"):
        read_calibration(tmp_path / "c.toml")


def test_half_a_camera_is_refused_and_unknown_keys_are_named(tmp_path: Path) -> None:
    (tmp_path / "c.toml").write_text(TOML.replace("matrix =", "matrices ="))
    with pytest.raises(BadFile, match=r"table \[cam_a\] has no matrix"):
        read_calibration(tmp_path / "c.toml")
    (tmp_path / "d.toml").write_text(TOML.replace("fisheye = false", "skew = 3"))
    assert read_calibration(tmp_path / "d.toml")["left"]["unread"] == ("skew",)
    keypoints = written(tmp_path / "a.json", openpose())
    (note,) = read_observations([keypoints], calibration=tmp_path / "d.toml").notes
    assert note == "d.toml: of camera 'left', not read are skew"


# Meshes.


def test_an_stl_has_no_vertex_that_a_body_knows(tmp_path: Path) -> None:
    """A soup of as many corners as the body has vertices would be fitted vertex by vertex."""
    body = load_body("small")
    N = body.n_vertices
    assert N % 3 == 0
    write_mesh(tmp_path / "a.stl", body.template, body.faces[: N // 3])
    assert len(read_mesh(tmp_path / "a.stl").vertices) == N
    for read in (read_registered, lambda path: own_mesh(path, body, 0.002)):
        with pytest.raises(BadFile, match=r"which vertex is which is lost; give the mesh as \.glb"):
            read(tmp_path / "a.stl")


def test_faces_of_another_mesh_are_said(tmp_path: Path) -> None:
    body = load_body("small")
    turned = np.roll(body.faces[::-1], 1, axis=1)  # the same faces, written otherwise
    write_mesh(tmp_path / "a.ply", body.template, turned)
    assert own_mesh(tmp_path / "a.ply", body, 0.002).notes == ()
    other = body.faces.copy()
    other[0] = other[0][[0, 2, 1]]
    write_mesh(tmp_path / "b.ply", body.template, other)
    setup: Setup = own_mesh(tmp_path / "b.ply", body, 0.002)
    assert "could not be checked" in setup.notes[0]
