"""Writing files whole or not at all.

A checkpoint or stored result that cannot be written is reported once, as a warning in the log, and
the work goes on (`Keeping`); an output that a command promised is an error.
"""

import hashlib
import logging
import os
import platform
import re
import tempfile
import time
import zipfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from glob import escape
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from workbench.environment import expanded
from workbench.errors import BadFile

LOG = logging.getLogger(__name__)
STALE_AFTER = 3600.0  # s: nothing of ours takes that long to write
UNCOMPRESSED_FROM = 2**27  # bytes
LONGEST_NAME = 100  # bytes of a name that its temporaries repeat; file systems take 255


@contextmanager
def replacing(path: str | Path) -> Iterator[Path]:
    """A temporary file beside `path` that takes its place when the block ends without an error.

    It has the same suffix, and a `~` at the start of `path` is the home folder. Raises BadFile if
    the folder is missing or cannot be written, or the disk is full; what was at `path` before is
    then still there.
    """
    path = expanded(path)
    for left in leftovers(path):
        with suppress(OSError):
            left.unlink()
    try:
        handle, name = tempfile.mkstemp(
            dir=path.parent, prefix=temporary_prefix(path), suffix=path.suffix
        )
        os.close(handle)
    except OSError as error:
        raise BadFile(
            f"cannot write {path}: {error.strerror}; choose an existing folder that you may "
            "write to"
        ) from error
    temporary = Path(name)
    try:
        yield temporary
        mask = os.umask(0)
        os.umask(mask)
        temporary.chmod(0o666 & ~mask)  # mkstemp is private to its owner
        temporary.replace(path)
    except OSError as error:
        raise BadFile(f"cannot write {path}: {error.strerror or error}") from error
    finally:
        temporary.unlink(missing_ok=True)


def write_file(path: str | Path, content: str | bytes) -> None:
    """Write a text, as UTF-8, or bytes, whole or not at all. Raises BadFile as `replacing` does."""
    with replacing(path) as temporary:
        temporary.write_bytes(content.encode("utf-8") if isinstance(content, str) else content)


def write_new(path: Path, text: str) -> None:
    """Write a text to a file that is new, into a folder that is made. Raises BadFile."""
    if path.exists():
        raise BadFile(f"{path} exists already and was left as it is; give another name or folder")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        reason = error.strerror or error
        raise BadFile(f"cannot write {path}: {reason}; give another folder") from error
    write_file(path, text)


def write_arrays(path: str | Path, named: Mapping[str, NDArray[Any]]) -> None:
    """Write arrays as `np.savez_compressed` does, but under any names, and whole or not at all.

    NumPy takes names as keyword arguments, and so cannot save an array that is called `file`.
    Large arrays are not compressed: a file that unpacks to hundreds of times its size, as zeros
    do, is not read again (`reading/archive.py`). Raises BadFile as `replacing` does.
    """
    with (
        replacing(path) as temporary,
        zipfile.ZipFile(temporary, "w", zipfile.ZIP_DEFLATED) as archive,
    ):
        for name, array in named.items():
            info = zipfile.ZipInfo(f"{name}.npy")
            large = array.nbytes > UNCOMPRESSED_FROM
            info.compress_type = zipfile.ZIP_STORED if large else zipfile.ZIP_DEFLATED
            with archive.open(info, "w", force_zip64=True) as member:
                np.lib.format.write_array(member, np.asanyarray(array), allow_pickle=False)


class Keeping:
    """Writes what a long run keeps on its way but can do without: checkpoints, results by key.

    A write that fails does not end the run. The first such failure is reported as a warning in
    the log; `failure` says why the last write failed, and is empty if it did not.
    """

    def __init__(self) -> None:
        self.failure = ""
        self._warned = False

    def __call__(self, write: Callable[[], None]) -> None:
        """Carry out a write, which raises BadFile if it fails."""
        try:
            write()
        except BadFile as error:
            self.failure = str(error)
            if not self._warned:
                self._warned = True
                LOG.warning("going on without what is kept on the way: %s", error)
        else:
            self.failure = ""


def temporary_prefix(path: Path) -> str:
    """The beginning of the name of a temporary for `path`, which is hidden and names its writer.

    For example: `.run.workbench-host-4711-`.
    """
    return f"{_hidden_stem(path)}{_host()}-{os.getpid()}-"


def leftovers(path: Path) -> list[Path]:
    """Temporaries for `path` that nobody will finish: their writer died, or they are an hour old.

    A process that is killed cannot remove them; the next one that writes to the same place does.
    """
    temporaries = path.parent.glob(escape(_hidden_stem(path)) + "*")
    return [file for file in temporaries if _abandoned(file)]


def _hidden_stem(path: Path) -> str:
    name = os.fsencode(path.name)
    readable = path.name if len(name) <= LONGEST_NAME else hashlib.sha256(name).hexdigest()
    return f".{readable}.workbench-"


def _abandoned(temporary: Path) -> bool:
    writer = re.search(r"\.workbench-([^-]*)-(\d+)-", temporary.name)
    try:
        status = temporary.lstat()
    except OSError:
        return False
    old = time.time() - max(status.st_mtime, status.st_ctime) > STALE_AFTER
    return writer is not None and (old or (writer[1] == _host() and not _alive(int(writer[2]))))


def _alive(process: int) -> bool:
    """Whether a process of this machine runs; True where that cannot be known."""
    if os.name != "posix":  # there, signal 0 is not a question
        return True
    try:
        os.kill(process, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except OSError:
        return True
    return True


def _host() -> str:
    return re.sub(r"[^A-Za-z0-9_.]", "_", platform.node())[:60]
