"""Nothing that a reader is given may crash it, hang it or be believed unseen.

The default run feeds each reader a few files that are damaged, claim too much, or try to run code,
and all files that were found to do harm before. The thorough run takes WORKBENCH_FUZZ mutations for
each format (40 if that is not set) of the seed WORKBENCH_FUZZ_SEED (1). `python -m tests.hostile`
takes more, prints a table and can keep what it finds.
"""

import os
from pathlib import Path

import pytest

from tests.hostile.__main__ import FOUND
from tests.hostile.attack import ask, attacked
from tests.hostile.formats import FORMATS, whole
from tests.hostile.limits import READ, REFUSED, Reader
from tests.hostile.mutations import overstated, trapped

FEW = 10
MANY = int(os.environ.get("WORKBENCH_FUZZ", "40"))
SEED = int(os.environ.get("WORKBENCH_FUZZ_SEED", "1"))
FRAGILE = (  # half of one is none
    *(".npz", ".npy", ".pkl", ".glb", ".stl", ".json", ".pcd", ".joblib", ".pt", ".smpl"),
)
UNCOUNTED = (
    *(".xyz", ".csv", ".bin", ".trc", ".joblib", ".pt", ".xml", ".txt"),
)  # say nothing of how much they hold, or are counted


@pytest.mark.parametrize("name", FORMATS)
def test_files_are_read_soundly_or_refused(name: str, reader: Reader, tmp_path: Path) -> None:
    valid = ask(reader, name, tmp_path)
    assert valid.outcome == READ, valid.what
    for file, content in whole(name).items():
        empty = ask(reader, name, tmp_path, file, b"")
        assert empty.outcome == REFUSED, f"{file}, empty: {empty.what}"
        half = ask(reader, name, tmp_path, file, content[: len(content) // 2])
        allowed = (REFUSED,) if file.endswith(FRAGILE) else (REFUSED, READ)
        assert half.outcome in allowed, f"{file}, half of it: {half.what}"
        large = ask(reader, name, tmp_path, file, overstated(file, content))
        allowed = (REFUSED, READ) if file.endswith(UNCOUNTED) else (REFUSED,)
        assert large.outcome in allowed, f"{file}, claiming too much: {large.what}"
        trap = trapped(file, content, tmp_path / "marker")
        if trap is not None:
            answer = ask(reader, name, tmp_path, file, trap)
            assert answer.outcome == REFUSED, f"{file}, with a pickle: {answer.what}"
            assert not (tmp_path / "marker").exists()
    counts = attacked(reader, name, tmp_path, seed=0, cases=FEW)
    assert not counts.failures, str(counts.failures[0])
    assert counts.refused > FEW / 4, "hardly any mutation was wrong"


FILES = sorted(path for path in FOUND.rglob("*") if path.is_file())


def test_files_found_before_are_refused(reader: Reader, tmp_path: Path) -> None:
    assert FILES
    for path in FILES:
        name, digest, *file = path.relative_to(FOUND).parts
        answer = ask(reader, name, tmp_path / digest, "/".join(file), path.read_bytes())
        assert answer.outcome == REFUSED, f"{path}: {answer.what}"


@pytest.mark.thorough
@pytest.mark.parametrize("name", FORMATS)
def test_many_mutations_are_read_or_refused(name: str, reader: Reader, tmp_path: Path) -> None:
    counts = attacked(reader, name, tmp_path, seed=SEED, cases=MANY)
    assert not counts.failures, "\n".join(map(str, counts.failures[:5]))
