"""Files that are written whole or not at all, and what killed writers leave."""

import os
import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest

from workbench import writing
from workbench.writing import leftovers, replacing, temporary_prefix

KILLED = """
import os, signal, sys
from pathlib import Path
from workbench.writing import replacing
with replacing(Path(sys.argv[1])) as temporary:
    temporary.write_text("half")
    os.kill(os.getpid(), signal.SIGKILL)
"""


def write(path: Path, text: str) -> None:
    with replacing(path) as temporary:
        temporary.write_text(text)


@pytest.mark.skipif(os.name != "posix", reason="SIGKILL")
def test_leftovers_of_killed_writers_are_removed(tmp_path: Path) -> None:
    path = tmp_path / "me [1].obj"
    subprocess.run([sys.executable, "-c", KILLED, str(path)], timeout=60, check=False)
    (left,) = tmp_path.iterdir()
    assert left.name.startswith(".me [1].obj.workbench-")
    (tmp_path / ".me.obj.workbench-elsewhere-1-x.obj").write_text("of another target")
    write(path, "whole")
    assert path.read_text() == "whole"
    assert not left.exists()
    assert len(list(tmp_path.iterdir())) == 2


def test_interrupted_writers_leave_nothing(tmp_path: Path) -> None:
    with pytest.raises(KeyboardInterrupt), replacing(tmp_path / "file.txt") as temporary:  # noqa: PT012
        temporary.write_text("half")
        raise KeyboardInterrupt
    assert not list(tmp_path.iterdir())


def test_temporary_files_of_living_writers_stay(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "me.obj"
    with replacing(path) as first:
        first.write_text("first")
        write(path, "second")
        assert first.exists()
        elsewhere = tmp_path / ".me.obj.workbench-elsewhere-1-x.obj"
        elsewhere.write_text("of another machine, whose processes are not known here")
        assert leftovers(path) == []
        monkeypatch.setattr(writing, "STALE_AFTER", -1.0)
        assert set(leftovers(path)) == {first, elsewhere}
    assert path.read_text() == "first"


def test_long_file_names_have_short_temporary_names(tmp_path: Path) -> None:
    path = tmp_path / ("长" * 80 + ".txt")
    write(path, "whole")
    assert [found.name for found in tmp_path.iterdir()] == [path.name]
    assert len(os.fsencode(temporary_prefix(path))) < 200


def test_large_arrays_are_stored_uncompressed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Zeros shrink a thousand times, and what grows as much when it is read is refused."""
    monkeypatch.setattr(writing, "UNCOMPRESSED_FROM", 1000)
    named = {"file": np.zeros(10), "much": np.zeros(200)}
    writing.write_arrays(tmp_path / "a.npz", named)
    with zipfile.ZipFile(tmp_path / "a.npz") as archive:
        kinds = {info.filename: info.compress_type for info in archive.infolist()}
    assert kinds == {"file.npy": zipfile.ZIP_DEFLATED, "much.npy": zipfile.ZIP_STORED}
    with np.load(tmp_path / "a.npz") as found:
        assert {name: found[name].tolist() for name in found} == {
            name: array.tolist() for name, array in named.items()
        }
