"""The command line with arguments drawn from a seed: plausible ones, and such as nobody expects.

Every command is a process of its own in an empty folder that holds a few valid and a few broken
files. It must end by itself with one of its exit codes, or, when it is still at work after some
seconds, on an interrupt; it must not print a traceback, and nobody that it started may outlive it.
"""

import os
import resource
import signal
import subprocess
import sys
import time
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import typer

from tests.hostile.formats import whole
from tests.hostile.mutations import NUMBERS, mutated
from workbench.bodies.catalogue import BODIES
from workbench.cli.app import app
from workbench.experiments import EXPERIMENTS
from workbench.solvers import SOLVERS

pytestmark = pytest.mark.thorough
MANY = int(os.environ.get("WORKBENCH_FUZZ", "40")) // 5
SEED = int(os.environ.get("WORKBENCH_FUZZ_SEED", "1"))
Rng = np.random.Generator
PATIENCE = 8.0  # s at work before it is interrupted
LEAVING = 30.0  # s from then on; a loaded machine needs less
ENDINGS = (0, 1, 2, 130)  # done; not what was hoped for; refused; interrupted
FILES = (
    *("openpose.json", "coco.json", "cameras.toml", "SMPL.npz", "SMPL.pkl", "training-folder"),
    *("training-start", "mesh.obj", "motion-files", "marker-files"),
)
AT_MOST = 6 * 2**30  # bytes of address space
PROBLEM = """
import casadi as cs
from workbench import Block, Problem, Residual
x = Block("x", (2,), "m")
problem = Problem([Residual("r", x.symbol - 1, sigma=1.0)], free=("x",))
start = {"x": [0.0, 0.0]}
"""


def prepared(folder: Path, rng: Rng) -> list[str]:
    """Valid files and broken ones in a folder; their names."""
    for name in FILES:
        for file, content in whole(name).items():
            (folder / file).write_bytes(content)
    (folder / "mine.py").write_text(PROBLEM)
    (folder / "empty folder").mkdir()
    for path in [p for p in sorted(folder.iterdir()) if p.is_file()]:
        broken = folder / f"broken {path.name}"
        broken.write_bytes(mutated(path.name, path.read_bytes(), rng))
    return sorted(path.name for path in folder.iterdir())


@cache
def _verbs() -> tuple[tuple[tuple[str, ...], tuple[Any, ...]], ...]:
    found: list[tuple[tuple[str, ...], tuple[Any, ...]]] = []

    def walk(command: Any, path: tuple[str, ...]) -> None:
        command = getattr(command, "whole", command)
        if not hasattr(command, "commands"):
            found.append((path, tuple(command.params)))
        for name, below in getattr(command, "commands", {}).items():
            walk(below, (*path, name))

    walk(typer.main.get_command(app), ())
    return tuple(found)


def drawn(seed: int, number: int, folder: Path) -> list[str]:
    """The arguments of one case, in whose folder the files are."""
    rng = np.random.default_rng((seed, number))
    names = prepared(folder, rng)
    verbs = _verbs()
    path, params = verbs[rng.integers(len(verbs))]
    arguments = list(path)
    for one in params:
        if type(one).__name__ == "TyperArgument":
            if one.required or rng.random() < 0.8:
                many = 1 if one.nargs == 1 else int(rng.integers(1, 4))
                arguments += [_value(one, names, rng) for _ in range(many)]
        elif rng.random() < 0.3:
            arguments.append(str(rng.choice([*one.opts, *one.secondary_opts])))
            if not one.is_flag:
                arguments.append(_value(one, names, rng))
    if rng.random() < 0.05:
        arguments.insert(int(rng.integers(len(arguments) + 1)), "--unheard-of")
    return arguments


def _value(one: Any, names: list[str], rng: Rng) -> str:
    """What one may think of giving there, or something else."""
    kind = rng.random()
    if kind < 0.15:
        return str(rng.choice([*NUMBERS[:22], "é", "a b", "--", "/", "/dev/null", "a" * 300]))
    if kind < 0.25:
        return str(rng.choice(names))
    sizes = [str(n) for n in (-1, 0, 1, 2, 3, 5, 40)]
    match one.name:
        case "name" | "names":
            return str(rng.choice([*EXPERIMENTS, *BODIES, "mine.py", "broken mine.py", *names]))
        case "solver" | "against":
            return str(rng.choice([*SOLVERS, "mine.py"]))
        case "body" | "start":
            return str(rng.choice([*BODIES, "SMPL.npz", "broken SMPL.pkl", "start.npz"]))
        case "setting":
            key = rng.choice(["body", "seed", "noise", "person", "degree", "sigma", "keypoints"])
            return f"{key}={rng.choice([*sizes, 'small', '[1, 2]', '{', 'null', 'NaN'])}"
        case "block":
            return str(rng.choice(["trans", "betas", "pose", "pose[pelvis]", "x", "betas[0:3]"]))
        case "size":
            return str(rng.choice(["1000x800", "0x0", "1000", "-1x5", "1e9x1e9"]))
        case "out" | "folder":
            return str(rng.choice(["out", "a b/é", "empty folder", "coco.json", "/proc/x", "."]))
        case "files" | "cameras" | "mocap" | "wheel" | "held_out":
            return str(rng.choice(names))
        case "number":
            return str(rng.choice([*sizes, "14", "15"]))
        case "move" | "gender":
            return str(rng.choice(["de", "stretch", "female", "male", "other"]))
        case _:
            return str(rng.choice(sizes))


def wrong_with(arguments: list[str], folder: Path) -> str:
    """What was wrong with how a command ended; empty if nothing was."""
    command = [sys.executable, "-m", "workbench", *(a.replace("\0", "") for a in arguments)]
    environment = os.environ | {"PYTHONPATH": str(Path(__file__).parents[2]), "COLUMNS": "200"}
    with (folder / ".out").open("w+") as out:
        child = subprocess.Popen(
            command,
            cwd=folder,
            stdin=subprocess.DEVNULL,
            stdout=out,
            stderr=out,
            env=environment,
            start_new_session=True,
            preexec_fn=_limited,
        )
        wrong = _waited_for(child)
        out.seek(0)
        text = out.read()
    if not wrong and child.returncode not in ENDINGS:
        wrong = f"it ended with {child.returncode}"
    if not wrong and "Traceback (most recent call last)" in text:
        wrong = "a traceback"
    if not wrong and "Warning:" in text:
        wrong = "a warning of Python"
    return f"{wrong}\n{text[-3000:]}" if wrong else ""


def _limited() -> None:
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's `&` has it ignored
    resource.setrlimit(resource.RLIMIT_AS, (AT_MOST, AT_MOST))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def _waited_for(child: subprocess.Popen[bytes]) -> str:
    try:
        child.wait(PATIENCE)
    except subprocess.TimeoutExpired:
        child.send_signal(signal.SIGINT)
        try:
            child.wait(LEAVING)
        except subprocess.TimeoutExpired:
            os.killpg(child.pid, signal.SIGKILL)
            child.wait()
            return f"an interrupt did not end it within {LEAVING:g} s"
    deadline = time.monotonic() + 10.0
    while time.monotonic() < deadline:
        try:
            os.killpg(child.pid, 0)
        except ProcessLookupError:
            return ""
        time.sleep(0.1)
    os.killpg(child.pid, signal.SIGKILL)
    return "a process that it had started outlived it by 10 s"


def test_commands_end_in_a_sentence(tmp_path: Path) -> None:
    for number in range(MANY):
        folder = tmp_path / str(number)
        folder.mkdir()
        arguments = drawn(SEED, number, folder)
        wrong = wrong_with(arguments, folder)
        assert not wrong, f"seed {SEED}, case {number}, {arguments}: {wrong}"
