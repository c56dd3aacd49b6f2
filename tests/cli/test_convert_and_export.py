"""`workbench convert`, `workbench motion --out` as glTF, and `workbench body code`."""

import json
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import workbench as wb
from tests.cli.conftest import Run
from tests.clips_made_up import clip
from tests.conversion.made_skeletons import KINDS, write_skeleton
from workbench.motions import Trajectories, write_trc


@cache
def small() -> wb.SkinnedBody:
    return wb.load_body("small")


def points() -> tuple[str, ...]:
    return tuple(small().landmark_names("coco"))


def motion_file(folder: Path, frames: int = 3) -> wb.Motion:
    motion = clip(small(), frames)
    wb.save_motion(folder / "walk.npz", motion)
    return motion


def test_convert_moves_a_motion_to_a_body(tmp_path: Path, workbench: Run) -> None:
    motion = motion_file(tmp_path)
    arguments = "walk.npz", "--from", "small", "--to", "small", "--out", "other.npz"
    code, out, _ = workbench("convert", *arguments)
    assert code == 0
    assert "the same triangles: 369 vertices correspond one to one" in out
    assert "left_forearm" in out
    assert "vertices are 0.0" in out
    found = wb.read_motion(tmp_path / "other.npz")
    off = np.linalg.norm(found.vertices(small()) - motion.vertices(small()), axis=2)
    assert 1e3 * off.mean() < 0.1


def test_convert_fits_a_body_to_named_points(tmp_path: Path, workbench: Run) -> None:
    motion = clip(small(), 3)
    places = 1e3 * motion.landmark(small(), "coco")
    write_trc(tmp_path / "points.trc", Trajectories(places, points(), 30.0, "mm"))
    arguments = "points.trc", "--to", "small", "--out", "found.bvh", "--from", "default"
    code, out, _ = workbench("convert", *arguments)
    assert code == 0
    assert "--from changes nothing: points.trc holds points" in out
    assert "23 of 23 points are coco of body 'small'" in out
    assert "mm from those of the body on average" in out
    assert len(wb.read_motion(tmp_path / "found.bvh")) == 3


def test_convert_fits_a_body_to_a_skeleton(tmp_path: Path, workbench: Run) -> None:
    body, kind = wb.load_body("default-male"), KINDS["LAFAN1"]
    write_skeleton(tmp_path / "walk.bvh", clip(body, 3, seed=6), body, kind)
    code, out, _ = workbench("convert", "walk.bvh", "--to", "small")
    assert code == 0
    assert "22 of 22 points are joints of body 'small' by the names of LAFAN1" in out
    assert any(line.split()[:2] == ["left_knee", "LeftLeg"] for line in out.splitlines())
    assert len(wb.read_motion(tmp_path / "walk-small.npz")) == 3
    text, lines = (tmp_path / "walk.bvh").read_text(), ["name;joint"]
    for k, (name, _, joint) in enumerate(kind.tree()):
        text = text.replace(f" {name}\n", f" Bone{k:02}\n")
        lines += [f"Bone{k:02};{joint}"] * ("spine" not in joint)
    (tmp_path / "walk.bvh").write_text(text)
    (tmp_path / "names.csv").write_text("\n".join(lines))
    code, _, wrong = workbench("convert", "walk.bvh", "--to", "small")
    assert code == 2
    assert "a table of names says which are which (--names)" in " ".join(wrong.split())
    code, out, _ = workbench("convert", "walk.bvh", "--to", "small", "--names", "names.csv")
    assert code == 0
    assert "19 of 22 points are joints of body 'small'" in out
    (mean,) = [line for line in out.splitlines() if line.startswith("joints are ")]
    assert float(mean.split()[2]) < 10


@pytest.mark.thorough
def test_motion_says_the_error_of_correctives(tmp_path: Path, workbench: Run) -> None:
    motion_file(tmp_path)
    for correctives, count in (("1", 1), ("exact", 3), ("0", 0)):
        options = "--body", "small", "--out", "walk.glb", "--correctives", correctives
        code, out, _ = workbench("motion", "walk.npz", *options, "--shapes", "10")
        assert code == 0
        assert f"10 shape directions, {count} correctives: vertices are off by" in out
        raw = (tmp_path / "walk.glb").read_bytes()
        document = json.loads(raw[20 : 20 + int.from_bytes(raw[12:16], "little")])
        assert document["asset"]["extras"]["correctives"] == count


def test_body_code_writes_a_function(tmp_path: Path, workbench: Run) -> None:
    code, out, _ = workbench("body", "code", "hand", "--points", "tips", "--out", "tips.c")
    assert code == 0
    assert "code: tips.c" in out
    assert "int tips(" in (tmp_path / "tips.h").read_text()


def test_convert_and_code_refuse_what_they_cannot_do(tmp_path: Path, workbench: Run) -> None:
    motion_file(tmp_path)
    places = np.random.default_rng(0).normal(scale=0.4, size=(2, 23, 3))
    write_trc(tmp_path / "points.trc", Trajectories(places, points(), 30.0, "m"))
    for arguments, said in (
        ("convert walk.npz --to small --out a.npz", "say with --from which body"),
        (
            "convert walk.npz --from small --to hand --out a.npz",
            "'small' and 'hand' have 0 joints of the same names",
        ),
        ("convert walk.npz --from small --to small --out a.fbx", "and not as a.fbx"),
        ("convert points.trc --to small --out a.npz --points face", "there are coco, joints"),
        ("motion walk.npz --out a.glb --correctives many", "a whole number from 0, not 'many'"),
        ("body code --points face --out a.c", "no landmark set is called 'face'"),
        ("body code --out a.cpp", "--out takes a file that ends in .c"),
    ):
        code, _, wrong = workbench(*arguments.split())
        assert code == 2
        assert said in " ".join(wrong.split())
    assert {path.name for path in tmp_path.iterdir()} == {"walk.npz", "points.trc"}
