"""Disks that are full or cannot be written, and checkpoints of draws that are damaged or forged."""

import errno
import logging
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from tests.sampling.densities import gaussian
from workbench import compare, train
from workbench.comparison import Budget
from workbench.course.handing_out import hand_out
from workbench.course.outline import lecture
from workbench.errors import BadFile
from workbench.experiments import Experiment, Setup
from workbench.reports.folder import replacing_folder
from workbench.sampling import Posterior, sample
from workbench.sampling.checkpoint import (
    SEAL,
    SETTINGS,
    SavedEnsemble,
    image,
    load,
    refuse_unlike,
    sealed,
)
from workbench.solvers import GaussNewton, LevenbergMarquardt
from workbench.synthetic.made_up import draw_registrations, jointed_tube, random_smpl
from workbench.training.blocks import BlockOptions
from workbench.training.plan import Plan, alternation
from workbench.writing import Keeping, replacing

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


# Checkpoints of draws, as files that are read.


def saved(steps: int = 5, walkers: int = 4, k: int = 2) -> list[SavedEnsemble]:
    rng = np.random.default_rng(0)
    state = np.random.RandomState(1).get_state()
    return [
        SavedEnsemble(
            rng.normal(size=(steps, walkers, k)),
            rng.normal(size=(steps, walkers)),
            np.full(walkers, 2.0),
            state,
        )
        for _ in range(2)
    ]


WHOLE = image(saved(), {"seed": 1, "walkers": 4})
HDF5 = WHOLE.rpartition(SEAL)[0]


def test_what_is_written_is_read_again(tmp_path: Path) -> None:
    path = tmp_path / "draws.h5"
    path.write_bytes(WHOLE)
    found, settings = load(path)
    assert settings == {"seed": 1, "walkers": 4}
    for one, other in zip(found, saved(), strict=True):
        np.testing.assert_array_equal(one.chain, other.chain)
        np.testing.assert_array_equal(one.log_prob, other.log_prob)
        np.testing.assert_array_equal(one.accepted, other.accepted)
        np.testing.assert_array_equal(one.random_state[1], other.random_state[1])
        assert one.random_state[2:] == other.random_state[2:]


def refusal(path: Path) -> str:
    with pytest.raises(BadFile) as raised:
        load(path)
    said = str(raised.value)
    assert said.startswith(f"{path} is no checkpoint of `sample` (")
    assert said.endswith("; give another file, or remove it to begin anew")
    return said


DAMAGED = {
    "empty": b"",
    "text": b"no draws at all",
    "an HDF5 file without a seal": HDF5,
    "the first half": WHOLE[: len(WHOLE) // 2],
    "without its last byte": WHOLE[:-1],
    "with a byte behind it": WHOLE + b"\n",
    "a seal alone": SEAL,
    "the seal of nothing": sealed(b""),
    "another seal": HDF5 + SEAL + b"0" * 64,
    "zeros": bytes(len(WHOLE)),
    "twice": WHOLE + WHOLE,
    "a digest in capitals": HDF5 + WHOLE[len(HDF5) :].upper(),
}


@pytest.mark.parametrize("name", DAMAGED)
def test_damaged_files_are_refused(name: str, tmp_path: Path) -> None:
    path = tmp_path / "draws.h5"
    path.write_bytes(DAMAGED[name])
    refusal(path)


def test_every_changed_byte_is_noticed(tmp_path: Path) -> None:
    rng, path = np.random.default_rng(5), tmp_path / "draws.h5"
    for place in rng.integers(len(WHOLE), size=300):
        changed = bytearray(WHOLE)
        changed[place] ^= int(rng.integers(1, 256))
        path.write_bytes(changed)
        assert "damaged" in refusal(path)


def test_a_folder_and_a_file_that_is_not_there_are_refused(tmp_path: Path) -> None:
    refusal(tmp_path)
    refusal(tmp_path / "nowhere.h5")


def replaced(name: str, values: Any) -> Callable[[h5py.File], None]:
    def change(file: h5py.File) -> None:
        del file["ensemble 1"][name]
        file["ensemble 1"].create_dataset(name, data=values)

    return change


def told(settings: Any) -> Callable[[h5py.File], None]:
    def change(file: h5py.File) -> None:
        file.attrs[SETTINGS] = settings

    return change


def drawn(part: int, value: Any) -> Callable[[h5py.File], None]:
    def change(file: h5py.File) -> None:
        file["ensemble 1"].attrs[f"random_state_{part}"] = value

    return change


def without(name: str) -> Callable[[h5py.File], None]:
    def change(file: h5py.File) -> None:
        del file[name]

    return change


def without_settings(file: h5py.File) -> None:
    del file.attrs[SETTINGS]


def a_number(name: str, place: tuple[int, ...], value: float) -> Callable[[h5py.File], None]:
    def change(file: h5py.File) -> None:
        file["ensemble 1"][name][place] = value

    return change


def huge(file: h5py.File) -> None:
    """A dataset of 8 TB that takes no room in the file."""
    del file["ensemble 1"]["chain"]
    file["ensemble 1"].create_dataset("chain", (10**12, 1, 1), "f8", chunks=(1000, 1, 1))


def compressed(file: h5py.File) -> None:
    """80 MB of zeros in a few kB."""
    del file["ensemble 1"]["chain"]
    file["ensemble 1"].create_dataset("chain", data=np.zeros((10**5, 10, 10)), compression="gzip")


def a_group_for_a_dataset(file: h5py.File) -> None:
    del file["ensemble 1"]["chain"]
    file["ensemble 1"].create_group("chain")


def a_link_to_nowhere(file: h5py.File) -> None:
    del file["ensemble 1"]["chain"]
    file["ensemble 1"]["chain"] = h5py.ExternalLink("/etc/passwd", "chain")


def one_more_group(file: h5py.File) -> None:
    file.create_group("a diary")


FORGED: dict[str, tuple[Callable[[h5py.File], None], str]] = {
    "no settings": (without_settings, "is no text"),
    "null settings": (told("null"), "no settings by name"),
    "settings in a list": (told("[1, 2]"), "no settings by name"),
    "a number for settings": (told(3), "is no text"),
    "settings that are no JSON": (told("{seed"), "Expecting property name"),
    "deep settings": (told("[" * 50_000), ""),
    "empty settings": (told(h5py.Empty("S1")), "is no text"),
    "NaN among the draws": (a_number("chain", (0, 0, 0), np.nan), "chain holds numbers that"),
    "an infinite draw": (a_number("chain", (4, 3, 1), np.inf), "chain holds numbers that"),
    "a log density of NaN": (a_number("log_prob", (2, 1), np.nan), "log_prob holds numbers that"),
    "accepted moves below zero": (a_number("accepted", (0,), -1.0), "accepted more or less moves"),
    "more accepted moves than steps": (a_number("accepted", (0,), 6.0), "more or less moves"),
    "draws without steps": (replaced("chain", np.zeros((0, 4, 2))), "do not fit"),
    "draws of other walkers": (replaced("chain", np.zeros((5, 3, 2))), "do not fit"),
    "draws in a table": (replaced("chain", np.zeros((5, 8))), "no array of 3 dimensions"),
    "draws as text": (replaced("chain", "no numbers"), "no array of 3 dimensions"),
    "draws as integers": (replaced("chain", np.zeros((5, 4, 2), int)), "no array of 3"),
    "complex draws": (replaced("chain", np.zeros((5, 4, 2), complex)), "no array of 3"),
    "draws in single precision": (replaced("chain", np.zeros((5, 4, 2), "f4")), "no array of 3"),
    "log densities of other steps": (replaced("log_prob", np.zeros((6, 4))), "do not fit"),
    "null draws": (replaced("chain", h5py.Empty("f8")), "no array of 3 dimensions"),
    "draws that take 8 TB": (huge, "that are in the file"),
    "draws that are compressed zeros": (compressed, "that are in the file"),
    "a group for the draws": (a_group_for_a_dataset, "chain is missing"),
    "draws in another file": (a_link_to_nowhere, ""),
    "no draws": (without("ensemble 1/chain"), "chain is missing"),
    "no log densities": (without("ensemble 1/log_prob"), "log_prob is missing"),
    "no accepted moves": (without("ensemble 1/accepted"), "accepted is missing"),
    "the first ensemble missing": (without("ensemble 0"), "no group 'ensemble 0'"),
    "a group of somebody else": (one_more_group, "no group 'ensemble 2'"),
    "a generator of another kind": (drawn(0, "PCG64"), "no state of a random generator"),
    "a generator of few words": (drawn(1, np.zeros(3, np.uint32)), "it takes 624 words"),
    "a generator of text": (drawn(1, "words"), "it takes 624 words"),
    "a position far away": (drawn(2, 10**9), "out of range"),
    "a position that is text": (drawn(2, "here"), "no state of a random generator"),
    "a normal number that is none": (drawn(4, np.nan), "out of range"),
}


@pytest.mark.parametrize("name", FORGED)
def test_files_with_a_right_seal_and_wrong_contents_are_refused(name: str, tmp_path: Path) -> None:
    change, said = FORGED[name]
    path = tmp_path / "draws.h5"
    path.write_bytes(HDF5)
    with h5py.File(path, "r+") as file:
        change(file)
    path.write_bytes(sealed(path.read_bytes()))
    assert said in refusal(path)


def test_draws_of_other_shapes_than_the_settings_are_refused(tmp_path: Path) -> None:
    refuse_unlike(tmp_path, saved(), 2, (5, 4, 2))
    for count, shape in ((3, (5, 4, 2)), (2, (4, 4, 2)), (2, (5, 5, 2)), (2, (5, 4, 1))):
        with pytest.raises(BadFile, match="of other shapes than its settings say"):
            refuse_unlike(tmp_path, saved(), count, shape)


# Runs whose checkpoints cannot be written.


def draw(checkpoint: Path | None) -> Posterior:
    return sample(
        gaussian(np.eye(2)),
        {"x": np.zeros(2)},
        steps=60,
        walkers=8,
        seed=1,
        every=0.0,
        checkpoint=checkpoint,
        stop_when_usable=False,
    )


@WITH_A_LIMIT
def test_a_full_disk_does_not_end_the_sampling(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    path = tmp_path / "draws.h5"
    with caplog.at_level(logging.WARNING), full_disk():
        posterior = draw(path)
    np.testing.assert_array_equal(posterior.draws, draw(None).draws)
    assert [r.getMessage() for r in caplog.records] == [
        f"going on without what is kept on the way: cannot write {path}: File too large"
    ]
    assert posterior.unsaved == f"cannot write {path}: File too large"
    assert list(tmp_path.iterdir()) == []


@WITH_A_LIMIT
def test_what_was_kept_before_the_disk_was_full_is_still_there(tmp_path: Path) -> None:
    path = tmp_path / "draws.h5"
    assert draw(path).unsaved == ""
    before = path.read_bytes()
    with full_disk(), suppress(BadFile), replacing(path) as temporary:
        temporary.write_bytes(b"x" * 5000)
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


@WITH_A_LIMIT
def test_the_process_survives_its_full_disk(tmp_path: Path) -> None:
    """HDF5 itself ended the process when Python left, long after the disk was full."""
    code = (
        "import resource, sys, numpy as np\n"
        "from tests.hardening.test_disks import draw\n"
        "from pathlib import Path\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (4096, 4096))\n"
        "print(draw(Path(sys.argv[1])).draws.shape)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, str(tmp_path / "draws.h5")],
        cwd=Path(__file__).parents[2],
        capture_output=True,
        text=True,
        timeout=240,
        check=False,
    )
    assert (done.returncode, done.stdout[:3]) == (0, "(4,")
    assert done.stderr == (
        "going on without what is kept on the way: cannot write "
        f"{tmp_path / 'draws.h5'}: File too large\n"
    )
    assert list(tmp_path.iterdir()) == []


@WITH_A_LIMIT
def test_a_full_disk_does_not_end_the_training(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    first = jointed_tube(7, 5)
    data, _ = draw_registrations(random_smpl(first, 2, seed=3), 2, 4, seed=4)
    options = BlockOptions(linear_tolerance=1e-3, products=20, together_steps=1)
    plan = Plan(
        tuple(
            replace(stage, options=options, blocks=("surfaces",), rounds=1)
            for stage in alternation(rounds=1).stages
        )[:1]
    )
    with caplog.at_level(logging.WARNING), full_disk():
        found = train(data, first, plan=plan, folder=tmp_path)
    np.testing.assert_array_equal(found.body.template, train(data, first, plan=plan).body.template)
    assert [r.getMessage() for r in caplog.records] == [
        f"going on without what is kept on the way: cannot write {tmp_path / 'checkpoint.npz'}: "
        "File too large"
    ]
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(BadFile, match="there is no such folder"):
        train(data, first, plan=plan, folder=tmp_path / "nowhere")


def test_a_full_disk_does_not_end_a_comparison(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def setup() -> Setup:
        return Setup(gaussian(np.eye(2)), {"x": np.ones(2)}, "Where is the mean?")

    experiment = Experiment("a Gaussian", setup, "made up")
    solvers = {"gn": GaussNewton(), "lm": LevenbergMarquardt()}

    def no_room(self: object, key: str, stored: object) -> None:
        with replacing(tmp_path / "found" / "runs" / f"{key}.npz"):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr("workbench.comparison.store.Folder.put", no_room)
    with caplog.at_level(logging.WARNING):
        found = compare(experiment, solvers, budget=Budget(), folder=tmp_path / "found")
    assert len(found.records) == 2
    assert len([r for r in caplog.records if "No space left on device" in r.getMessage()]) == 1
    assert list((tmp_path / "found" / "runs").iterdir()) == []


def test_a_failure_is_said_once_and_forgotten_when_it_is_over(
    caplog: pytest.LogCaptureFixture,
) -> None:
    keep = Keeping()

    def fail() -> None:
        raise BadFile("cannot write it")

    with caplog.at_level(logging.WARNING):
        keep(fail)
        keep(fail)
        assert keep.failure == "cannot write it"
        keep(lambda: None)
        assert keep.failure == ""
        keep(fail)
    assert len(caplog.records) == 1
    with pytest.raises(LookupError):
        keep(lambda: {}["a mistake is none"])  # type: ignore[misc]


# What is promised, and cannot be written.


@WITH_A_LIMIT
@pytest.mark.parametrize("write", ["a report's file", "a solution"])
def test_a_report_on_a_full_disk_is_a_sentence_and_leaves_nothing(
    write: str, tmp_path: Path
) -> None:
    place = tmp_path / "report"

    def report() -> None:
        with replacing_folder(place) as fresh:
            if write == "a report's file":
                (fresh / "index.html").write_text("x" * 5000)
            with replacing(fresh / "solution.npz") as temporary:
                temporary.write_bytes(b"x" * 5000)

    with full_disk(), pytest.raises(BadFile) as raised:
        report()
    assert str(raised.value) == (
        f"cannot write {place}: File too large; choose a folder that you may write to"
    )
    assert list(tmp_path.iterdir()) == []


@WITH_A_LIMIT
def test_exercises_are_handed_out_whole_or_not_at_all(tmp_path: Path) -> None:
    with full_disk(), pytest.raises(BadFile, match="File too large"):
        hand_out(lecture(1), tmp_path)
    assert list(tmp_path.iterdir()) == []
    assert hand_out(lecture(1), tmp_path).is_file()


LINE = """
from workbench import Block, Problem, Residual
x = Block("x")
problem, start = Problem((Residual("r", x.symbol - 2.0, 1.0),), "x"), {"x": 0.0}
"""
LIMITS = """
import resource, sys
resource.setrlimit(resource.RLIMIT_FSIZE, (2048, 2048))
from workbench.cli import main
main()
"""


@WITH_A_LIMIT
def test_numbers_are_printed_before_the_report_fails(tmp_path: Path) -> None:
    (tmp_path / "line.py").write_text(LINE)
    done = subprocess.run(
        [sys.executable, "-B", "-c", LIMITS, "run", "line.py", "--no-compare"],
        cwd=tmp_path,
        env=os.environ | {"COLUMNS": "200", "WORKBENCH_COMPILE": "0"},
        capture_output=True,
        text=True,
        timeout=240,
        check=False,
    )
    assert done.returncode == 2
    assert "CONVERGED" in done.stdout
    assert "File too large" in done.stderr
    assert "Traceback" not in done.stderr
    assert list((tmp_path / "runs").iterdir()) == []


@pytest.mark.parametrize("verb", ["run", "diagnose"])
def test_a_place_that_cannot_be_written_is_refused(verb: str, tmp_path: Path) -> None:
    """Below a file, where not even the system's administrator can write."""
    (tmp_path / "line.py").write_text(LINE)
    done = subprocess.run(
        [
            sys.executable,
            "-c",
            "from workbench.cli import main; main()",
            verb,
            "line.py",
            "--out",
            "line.py/runs",
        ],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=240,
        check=False,
    )
    assert done.returncode == 2
    assert "Not a directory" in done.stderr
    assert "Traceback" not in done.stderr
    assert [path.name for path in tmp_path.iterdir() if path.name != "__pycache__"] == ["line.py"]
