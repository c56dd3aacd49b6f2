"""Nothing that a reader or a command is given may crash it, hang it or be believed unseen.

Part of every run are a few cases from a fixed seed, and the files that were found to do harm
before. `pytest -m fuzz` takes a new seed, which a failure tells, and WORKBENCH_FUZZ cases for
each format (1,000 if that is not set); `python -m tests.fuzz` does the same and prints a table.
"""

import os
import time
from pathlib import Path
from shutil import copyfile

import numpy as np
import pytest

from tests.fuzz.__main__ import FOUND
from tests.fuzz.attack import FAILED, REFUSED, Counts, attacked, judged
from tests.fuzz.broken_readers import BROKEN
from tests.fuzz.commands import drawn, wrong_with
from tests.fuzz.formats import FORMATS
from tests.fuzz.mutations import mutated

pytestmark = pytest.mark.skipif(
    not Path("/proc/self/clear_refs").exists(), reason="peaks of memory as Linux tells them"
)
FEW, FEW_COMMANDS = 25, 5
MANY = int(os.environ.get("WORKBENCH_FUZZ", "1000"))


def told(counts: Counts) -> str:
    return "\n".join(
        f"seed {f.seed}, case {f.number}, {f.file}: {f.what}" for f in counts.failures[:5]
    )


@pytest.mark.parametrize("name", FORMATS)
def test_files_are_read_or_refused(name: str, tmp_path: Path) -> None:
    counts = attacked(name, seed=0, cases=FEW, folder=tmp_path)
    assert counts.tried == FEW
    assert counts.refused > FEW / 4, "hardly any case was wrong"
    assert not counts.failures, told(counts)


@pytest.mark.parametrize("number", range(FEW_COMMANDS))
def test_commands_end_in_a_sentence(number: int, tmp_path: Path) -> None:
    arguments = drawn(0, number, tmp_path)
    wrong = wrong_with(arguments, tmp_path)
    assert not wrong, f"{arguments}: {wrong}"


@pytest.mark.thorough
@pytest.mark.parametrize("name", FORMATS)
def test_many_files_are_read_or_refused(name: str, tmp_path: Path) -> None:
    counts = attacked(name, seed=int(time.time()), cases=MANY, folder=tmp_path)
    assert not counts.failures, told(counts)


@pytest.mark.thorough
def test_many_commands_end_in_a_sentence(tmp_path: Path) -> None:
    seed = int(time.time())
    for number in range(MANY // 5):
        folder = tmp_path / str(number)
        folder.mkdir()
        arguments = drawn(seed, number, folder)
        wrong = wrong_with(arguments, folder)
        assert not wrong, f"seed {seed}, case {number}, {arguments}: {wrong}"


FILES = sorted(path for path in FOUND.rglob("*") if path.is_file())


@pytest.mark.parametrize("path", FILES, ids=lambda path: "-".join(path.parts[-3:-1]))
def test_what_did_harm_once_is_refused(path: Path, tmp_path: Path) -> None:
    name, digest = path.relative_to(FOUND).parts[:2]
    FORMATS[name].make(tmp_path)
    copyfile(path, tmp_path / path.relative_to(FOUND / name / digest))
    assert judged(name, tmp_path) == (REFUSED, "")


@pytest.mark.parametrize("name", BROKEN)
def test_an_attack_notices_a_reader_that(name: str, tmp_path: Path) -> None:
    counts = attacked(name, seed=0, cases=2, folder=tmp_path)
    wrong = [failure.what for failure in counts.failures]
    assert wrong
    assert all(BROKEN[name][1] in what for what in wrong)


@pytest.mark.parametrize("name", FORMATS)
def test_a_seed_gives_the_same_file_again(name: str, tmp_path: Path) -> None:
    FORMATS[name].make(tmp_path)
    for path in sorted(p for p in tmp_path.rglob("*") if p.is_file()):
        content = path.read_bytes()
        some = [mutated(path.name, content, np.random.default_rng(n)) for n in range(8)]
        same = [mutated(path.name, content, np.random.default_rng(n)) for n in range(8)]
        assert some == same
        assert sum(one != content for one in some) > 4


def test_a_valid_file_is_no_failure(tmp_path: Path) -> None:
    for name, format in FORMATS.items():
        folder = tmp_path / name
        folder.mkdir()
        format.make(folder)
        assert judged(name, folder)[0] != FAILED
