"""Disks that are full or cannot be written."""

import logging
import os
import signal
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import numpy as np
import pytest

from workbench import Block, Problem
from workbench.course.outline import hand_out, lecture
from workbench.errors import BadFile
from workbench.reports.folder import replacing_folder
from workbench.residuals import gaussian
from workbench.sampling import Posterior, sample
from workbench.writing import replacing

LIMITED = os.name == "posix" and hasattr(signal, "SIGXFSZ")
WITH_A_LIMIT = pytest.mark.skipif(not LIMITED, reason="a limit of the size of files")


@contextmanager
def full_disk(size: int = 1024) -> Iterator[None]:
    """Files end at `size` bytes, as on a disk that is full: writing more is an OSError."""
    import resource

    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    before = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
        signal.signal(signal.SIGXFSZ, before)


# Runs go on where what they keep on the way cannot be written.


def draw(checkpoint: Path | None) -> Posterior:
    x = Block("x", (2,))
    return sample(
        Problem([gaussian(x.symbol)], "x"),
        {"x": np.zeros(2)},
        steps=60,
        walkers=8,
        seed=1,
        every=0.0,
        checkpoint=checkpoint,
        stop_when_usable=False,
    )


@WITH_A_LIMIT
def test_sampling_goes_on_when_the_disk_is_full(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    path = tmp_path / "draws.npz"
    with caplog.at_level(logging.WARNING), full_disk():
        posterior = draw(path)
    np.testing.assert_array_equal(posterior.draws, draw(None).draws)
    assert [r.getMessage() for r in caplog.records] == [
        f"going on without what is kept on the way: cannot write {path}: File too large"
    ]
    assert posterior.unsaved == f"cannot write {path}: File too large"
    assert list(tmp_path.iterdir()) == []


@WITH_A_LIMIT
def test_failed_writing_keeps_the_file_before(tmp_path: Path) -> None:
    (tmp_path / "kept").write_text("before")
    with full_disk(), suppress(BadFile), replacing(tmp_path / "kept") as temporary:
        temporary.write_bytes(b"x" * 5000)
    assert (tmp_path / "kept").read_text() == "before"
    assert len(list(tmp_path.iterdir())) == 1


# What is promised, and cannot be written.


@WITH_A_LIMIT
def test_reports_and_exercises_are_written_whole_or_not_at_all(tmp_path: Path) -> None:
    def report() -> None:
        with replacing_folder(tmp_path / "report") as fresh:
            (fresh / "small.txt").write_text("x")
            (fresh / "index.html").write_text("x" * 5000)

    for write in (report, lambda: hand_out(lecture(1), tmp_path)):
        with full_disk(), pytest.raises(BadFile, match="File too large"):
            write()
        assert list(tmp_path.iterdir()) == []
    assert hand_out(lecture(1), tmp_path).is_file()
