"""Readers refuse pipes, which may never send anything, instead of waiting for them."""

import os
import signal
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from workbench.course.packs.handing_out import read_students
from workbench.errors import BadFile
from workbench.fitting.files.cameras import read_calibration
from workbench.fitting.files.keypoints import read_keypoints
from workbench.fitting.marker_files import read_markers
from workbench.motions import read_motion
from workbench.reading.facts import bounded, json_in
from workbench.training.folder import read_table

pytestmark = pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="there are no pipes here")

PATH_READERS: dict[str, Callable[[Path], object]] = {
    "a.json": json_in,
    "keypoints.json": read_keypoints,
    "cameras.toml": read_calibration,
    "walk.bvh": read_motion,
    "walk.glb": read_motion,
    "walk.npz": read_motion,
    "walk.c3d": read_markers,
    "walk.trc": read_markers,
    "subjects.csv": read_table,
    "students.csv": lambda path: read_students(str(path)),
}


class StillWaiting(Exception):
    pass


@pytest.fixture(autouse=True)
def killed_when_it_waits() -> Iterator[None]:
    def give_up(*_: object) -> None:
        raise StillWaiting

    before = signal.signal(signal.SIGALRM, give_up)
    signal.alarm(60)
    yield
    signal.alarm(0)
    signal.signal(signal.SIGALRM, before)


@pytest.mark.parametrize("name", PATH_READERS)
def test_reader_refuses_a_pipe(name: str, tmp_path: Path) -> None:
    path = tmp_path / name
    os.mkfifo(path)
    with pytest.raises(BadFile, match="pipe"):
        PATH_READERS[name](path)


def test_bytes_are_read_up_to_a_limit(tmp_path: Path) -> None:
    path = tmp_path / "five"
    path.write_bytes(b"12345")
    assert bounded(path, 5) == b"12345"
    with pytest.raises(BadFile, match="more than 4 bytes"):
        bounded(path, 4)
    with pytest.raises(BadFile, match="folder"):
        bounded(tmp_path)
    with pytest.raises(FileNotFoundError):
        bounded(tmp_path / "none")
