"""Nothing that a reader is given may crash it, hang it or be believed unseen.

The default run feeds each reader a few files that are damaged, claim too much, or try to run code,
and all files that were found to do harm before. The thorough run takes WORKBENCH_FUZZ mutations for
each format (40 if that is not set) of the seed WORKBENCH_FUZZ_SEED (1). What makes a reader fail
belongs into found/FORMAT/NAME/, with the name that the file has.
"""

import os
from pathlib import Path

import numpy as np
import pytest

from tests.hostile.formats import FORMATS, ask, whole
from tests.hostile.limits import FAILED, READ, REFUSED, Reader
from tests.hostile.mutations import mutated, overstated, trapped

FOUND = Path(__file__).parent / "found"
FEW = 10
MANY = int(os.environ.get("WORKBENCH_FUZZ", "40"))
SEED = int(os.environ.get("WORKBENCH_FUZZ_SEED", "1"))
FRAGILE = (  # half of one is none
    *(".npz", ".npy", ".pkl", ".glb", ".stl", ".json", ".pcd", ".joblib", ".pt", ".smpl"),
)
UNCOUNTED = (
    *(".xyz", ".csv", ".bin", ".trc", ".joblib", ".pt", ".xml", ".txt"),
)  # say nothing of how much they hold, or are counted


def attack(reader: Reader, name: str, folder: Path, seed: int, cases: int) -> int:
    """Try so many mutations of a format; how many were refused. None may fail."""
    refused = 0
    for number in range(cases):
        rng = np.random.default_rng((seed, number))
        file = sorted(whole(name))[rng.integers(len(whole(name)))]
        with np.errstate(all="ignore"):
            content = mutated(file, whole(name)[file], rng)
        answer = ask(reader, name, folder, file, content)
        assert answer.outcome != FAILED, f"seed {seed}, case {number}, {file}: {answer.what}"
        refused += answer.outcome == REFUSED
    return refused


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
    assert attack(reader, name, tmp_path, 0, FEW) > FEW / 4, "hardly any mutation was wrong"


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
    attack(reader, name, tmp_path, SEED, MANY)
