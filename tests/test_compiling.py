"""Compiled libraries are loaded only from a cache that nobody else can write to."""

import ctypes
import logging
import os
from pathlib import Path

import pytest

from tests.compilers import NEEDS_A_COMPILER
from workbench.compiling import NoLibrary, find_compiler, library

SOURCE = '__attribute__((visibility("default"))) int answer(void) { return 42; }\n'


def answer(loaded: ctypes.CDLL) -> bool:
    return bool(loaded.answer() == 42)


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = tmp_path / "cache"
    monkeypatch.setenv("WORKBENCH_CACHE", str(folder))
    return folder


@NEEDS_A_COMPILER
def test_library_is_kept_for_its_owner_alone(cache: Path) -> None:
    library("answer", SOURCE, answer)
    (kept,) = cache.iterdir()
    assert kept.stat().st_mode & 0o077 == 0
    assert cache.stat().st_mode & 0o077 == 0
    before = kept.stat().st_mtime_ns
    library("answer", SOURCE, answer)
    assert kept.stat().st_mtime_ns == before


@NEEDS_A_COMPILER
@pytest.mark.parametrize("mode", [0o777, 0o770])
def test_cache_that_others_can_write_is_not_used(
    cache: Path, caplog: pytest.LogCaptureFixture, mode: int
) -> None:
    library("answer", SOURCE, answer)
    (planted,) = cache.iterdir()  # as whoever may write there could have left it
    cache.chmod(mode)
    loaded: list[str] = []

    def noted(found: ctypes.CDLL) -> bool:
        loaded.append(str(found._name))
        return answer(found)

    with caplog.at_level(logging.WARNING, logger="workbench"):
        library("answer", SOURCE, noted)
    assert loaded != [str(planted)]
    assert "others can write to it" in caplog.text
    assert "compiled for this process only" in caplog.text


@NEEDS_A_COMPILER
def test_planted_library_is_not_loaded(cache: Path, caplog: pytest.LogCaptureFixture) -> None:
    library("answer", SOURCE, answer)
    (kept,) = cache.iterdir()
    whole = kept.read_bytes()
    kept.unlink()
    kept.write_bytes(whole)
    kept.chmod(0o666)
    with caplog.at_level(logging.WARNING, logger="workbench"):
        library("answer", SOURCE, answer)
    assert "others can write to it" in caplog.text
    assert [path.stat().st_mode & 0o022 for path in cache.iterdir()] == [0]


@NEEDS_A_COMPILER
@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() != 0, reason="only root gives away")
def test_cache_of_another_user_is_not_used(cache: Path, caplog: pytest.LogCaptureFixture) -> None:
    library("answer", SOURCE, answer)
    os.chown(cache, 12345, 12345)
    with caplog.at_level(logging.WARNING, logger="workbench"):
        library("answer", SOURCE, answer)
    assert "belongs to another user" in caplog.text


@pytest.mark.skipif(os.name != "posix", reason="a shell script")
def test_compiler_that_hangs_is_asked_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    script = tmp_path / "slow-cc"
    script.write_text(f"#!/bin/sh\necho asked >> {tmp_path}/asked\nexec sleep 600\n")
    script.chmod(0o755)
    monkeypatch.setenv("CC", str(script))
    monkeypatch.setattr("workbench.compiling.VERSION_SECONDS", 0.3)
    for _ in range(3):
        with pytest.raises(NoLibrary, match="does not run"):
            find_compiler()
    assert (tmp_path / "asked").read_text().split() == ["asked"]
