"""From C source to a loaded library: compiled once, kept on disk, checked before it is trusted.

WORKBENCH_COMPILE=0 switches compiling off, CC names the compiler, and WORKBENCH_CACHE (else
XDG_CACHE_HOME/workbench, else ~/.cache/workbench) the folder of libraries. What is loaded runs with
all rights of the user, so that a folder or a library which belongs to somebody else, or which
others can write to, is not used.
"""

import ctypes
import hashlib
import logging
import os
import shlex
import shutil
import stat
import subprocess
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from workbench.environment import home
from workbench.errors import BadFile, WorkbenchError
from workbench.writing import write_file

LOG = logging.getLogger(__name__)
NATIVE = ("-march=native", "-mcpu=native")  # what compilers call the processor they run on
FLAGS = ("-O2", "-ffp-contract=fast", "-fPIC", "-shared", "-fvisibility=hidden", "-w")
COMPILE_SECONDS = 60.0  # seconds that a compiler may take for a library
VERSION_SECONDS = 5.0  # seconds in which it says its version
CACHE_LINE = 64  # bytes of a cache line
WRITABLE_BY_OTHERS = stat.S_IWGRP | stat.S_IWOTH  # may write


class NoLibrary(WorkbenchError):
    """Why there is no compiled code: no compiler, or one that fails, or it is switched off."""


@dataclass(frozen=True)
class Compiler:
    """A C compiler that works."""

    command: tuple[str, ...]  # its path, and arguments that CC gives after that
    native: str  # the flag with which it compiles for this processor
    target: str  # the macros that it defines, which name its version and the processor

    @property
    def version(self) -> str:
        """The version, as the compiler states it."""
        lines = [line for line in self.target.splitlines() if "__VERSION__ " in line]
        return lines[0].split(maxsplit=2)[2].strip('"') if lines else "unknown"


def find_compiler() -> Compiler:
    """The compiler that CC names, or gcc, clang or cc. Raises NoLibrary if none works."""
    if os.environ.get("WORKBENCH_COMPILE") == "0":
        raise NoLibrary("switched off by WORKBENCH_COMPILE=0")
    if os.name != "posix":
        raise NoLibrary("only gcc and clang on Linux and macOS are known")
    from_variable = shlex.split(os.environ.get("CC", ""))
    candidates = (from_variable, ["gcc"], ["clang"], ["cc"])
    installed = [(path, *c[1:]) for c in candidates if c and (path := shutil.which(c[0]))]
    if not installed:
        raise NoLibrary("no C compiler on the PATH (gcc, clang, cc), and none named by CC")
    answer = _compiler_or_reason(tuple(installed[0]))
    if isinstance(answer, str):
        raise NoLibrary(answer)
    return answer


@cache  # a compiler that hangs costs its time once
def _compiler_or_reason(command: tuple[str, ...]) -> Compiler | str:
    """The compiler that this command is, or why it is none."""
    for native in NATIVE:  # its macros name its version and every instruction set
        try:
            dump = [*command, native, "-dM", "-E", "-x", "c", os.devnull]
            macros = _output(dump, VERSION_SECONDS)
            return Compiler(command, native, macros)
        except NoLibrary as error:
            why = error
            if isinstance(error.__cause__, subprocess.TimeoutExpired):
                break
    return str(why)


def cache_folder() -> Path:
    """The folder of libraries, which need not exist. Raises NoLibrary if no home is known."""
    if named := os.environ.get("WORKBENCH_CACHE"):
        return Path(named)
    if base := os.environ.get("XDG_CACHE_HOME"):
        return Path(base) / "workbench"
    try:
        return home() / ".cache" / "workbench"
    except BadFile as error:
        raise NoLibrary(f"no folder to keep libraries in ({error}); set WORKBENCH_CACHE") from error


def vectors() -> str:
    """The beginning of a C source that computes with the processor's vector registers."""
    return source_beside(__package__, "vectors.h")


def library(
    name: str, source: str, trusted: Callable[[ctypes.CDLL], bool], more_flags: Sequence[str] = ()
) -> ctypes.CDLL:
    """The compiled source, from the cache or anew; `trusted` says whether its numbers are right.

    The flags `more` follow FLAGS, and so overrule them.

    A file is called name-key-digest.so: the key of source, compiler, flags and processor, and the
    digest of the file itself, so that one which is damaged is never loaded. Raises NoLibrary.
    """
    compiler = find_compiler()
    flags = (*FLAGS, compiler.native, *more_flags)
    key = _digest("\0".join((source, *compiler.command, compiler.target, *flags)).encode())
    folder = cache_folder().resolve()
    for kept in sorted(folder.glob(f"{name}-{key}-*.so")):
        try:
            _check_own(folder)
            _check_own(kept)
            if _digest(kept.read_bytes()) != kept.stem.rsplit("-", 1)[-1]:
                raise NoLibrary("it is damaged")
            return _loaded(kept, trusted)
        except (NoLibrary, OSError) as error:
            LOG.warning("not using %s: %s", kept, error)
    LOG.info("compiling the %s with %s (once, a few seconds)", name, compiler.command[0])
    try:
        with tempfile.TemporaryDirectory(prefix="workbench-") as private:
            text, built = Path(private, f"{name}.c"), Path(private, f"{name}.so")
            text.write_text(source, encoding="utf-8")
            command = [*compiler.command, *flags, text.name, "-o", built.name]
            _output(command, COMPILE_SECONDS, private)
            loaded = _loaded(built, trusted)
            try:
                folder.mkdir(mode=0o700, parents=True, exist_ok=True)
                _check_own(folder)
                compiled = built.read_bytes()
                path = folder / f"{name}-{key}-{_digest(compiled)}.so"
                write_file(path, compiled)
                path.chmod(0o600)
            except (OSError, BadFile, NoLibrary) as error:
                LOG.warning("compiled for this process only: %s", error)
            return loaded
    except OSError as error:
        raise NoLibrary(f"no place to compile in: {error}") from error


def library_or_none(
    name: str,
    source: str,
    trusted: Callable[[ctypes.CDLL], bool],
    otherwise: str,
    more: Sequence[str] = (),
) -> ctypes.CDLL | None:
    """The `library`, or None where there is none: the log says why, and what is done instead."""
    try:
        return library(name, source, trusted, more)
    except NoLibrary as error:
        LOG.info("%s: %s", otherwise, error)
        return None


def function_of_addresses(library: ctypes.CDLL, name: str, count: int) -> Callable[..., None]:
    """A function of a library that takes so many addresses, or None for one, and returns nothing.

    What ctypes knows of a function's arguments it need not find out at every call.
    """
    function = getattr(library, name)
    function.argtypes, function.restype = (ctypes.c_void_p,) * count, None
    return function  # type: ignore[no-any-return]


def address(array: NDArray[np.generic]) -> int:
    """Where the numbers of an array begin in memory; whoever uses it must hold the array.

    ctypes finds the address of an array in one piece that can be written to in a fifth of the time
    of `array.ctypes`.
    """
    try:
        # an array is a buffer, as the stubs of Python 3.11 cannot say
        return ctypes.addressof(ctypes.c_char.from_buffer(array))  # type: ignore[arg-type]
    except (TypeError, ValueError, BufferError):  # read-only, in pieces, or without numbers
        return int(array.ctypes.data)


def source_beside(package: str, name: str) -> str:
    """The text of a C file of a package."""
    return files(package).joinpath(name).read_text(encoding="utf-8")


def _check_own(path: Path) -> None:
    """Raise NoLibrary if somebody else could have written this file or folder."""
    status = path.lstat()
    if status.st_uid != os.geteuid():
        raise NoLibrary("it belongs to another user; set WORKBENCH_CACHE to a folder of your own")
    if status.st_mode & WRITABLE_BY_OTHERS:
        raise NoLibrary(f"others can write to it; run chmod go-w {shlex.quote(str(path))}")


def _loaded(path: Path, trusted: Callable[[ctypes.CDLL], bool]) -> ctypes.CDLL:
    try:
        loaded = ctypes.CDLL(str(path))
        right = trusted(loaded)
    except (OSError, AttributeError) as error:  # not a library, or without our functions
        raise NoLibrary(f"it does not load: {error}") from error
    if not right:
        raise NoLibrary("its numbers are wrong")
    return loaded


def _output(command: list[str], seconds: float, folder: str | None = None) -> str:
    """The output of a command. Raises NoLibrary if it fails or takes longer."""
    try:
        process = subprocess.run(
            command, cwd=folder, capture_output=True, text=True, timeout=seconds, check=False
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        raise NoLibrary(f"{command[0]} does not run: {error}") from error
    if process.returncode:
        reason = (process.stderr.strip() or "it says nothing").splitlines()[0]
        raise NoLibrary(f"{command[0]} fails with exit code {process.returncode}: {reason}")
    return process.stdout


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()[:24]


def aligned_zeros(shape: tuple[int, ...], dtype: type[np.floating[Any]]) -> NDArray[Any]:
    """Zeros that begin where a cache line does: vectors that touch two lines take longer."""
    size = int(np.prod(shape)) * np.dtype(dtype).itemsize
    whole = np.zeros(size + CACHE_LINE, dtype=np.uint8)
    first = -whole.ctypes.data % CACHE_LINE
    return whole[first : first + size].view(dtype).reshape(shape)
