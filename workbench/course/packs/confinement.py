"""What the process of a handed-in file may not do, as far as Python reports what it does.

Python reports what its own library does ("audit events"); what other code in C does by itself is
not reported, and whoever searches the memory of the process can take the guard away. This keeps
files that mean no harm from doing any, and makes cheating an effort. It is no sandbox: files of
people whom nobody knows belong into a container.
"""

import os
import sys
import sysconfig
import tempfile
from contextlib import suppress
from pathlib import Path
from typing import Any

import workbench
from workbench.course.withheld_files import Withheld, withhold

MEMORY, LARGEST = "WORKBENCH_MEMORY", 16 * 2**20  # variable with bytes; bytes of a file
KEPT = 20  # refusals that are told
DEVICES = ("/dev/null", "/dev/urandom", "/dev/random", "/dev/zero")
ABOUT_ITSELF = (
    "/proc/self",
    "/proc/cpuinfo",
    "/proc/meminfo",
    "/proc/stat",
    f"/proc/{os.getpid()}",
)
SYSTEM = ("/usr", "/lib", "/lib64", "/bin", "/etc", "/sys", "/opt", "/System", "/Library")
WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND

REFUSED = {  # the beginnings of the names of audit events
    "starting another program": (
        "subprocess.", "os.system", "os.exec", "os.posix_spawn", "os.spawn", "os.fork",
        "os.startfile", "pty.",
    ),
    "the network": (
        "socket.", "urllib.", "http.", "ftplib.", "smtplib.", "imaplib.", "poplib.", "telnetlib.",
        "nntplib.", "webbrowser.",
    ),
    "a signal to a process": ("os.kill", "os.killpg", "signal.pthread_kill"),
    "a database": ("sqlite3.",),
}  # fmt: skip
CHANGES = (
    "os.remove", "os.rename", "os.mkdir", "os.rmdir", "os.link", "os.symlink", "os.truncate",
    "os.chmod", "os.chown", "os.utime", "os.chflags", "os.setxattr", "os.removexattr",
)  # fmt: skip
LISTS = ("os.listdir", "os.scandir")


def confine(file: str) -> list[str]:
    """Refuse from now on what a handed-in file has no need of, and return the refusals to come.

    Files may be read that belong to Python, the system or the workbench (no solutions), and read
    and written beside the handed-in file, which has to be alone in its folder.
    """
    here = os.path.realpath(Path(file).parent)
    for name in ("TMPDIR", "TEMP", "TMP", "HOME", "MPLCONFIGDIR"):
        os.environ[name] = here
    tempfile.tempdir = here
    _limit()
    refusals = withhold(file)
    package = Path(workbench.__file__).parent
    folders = [os.path.realpath(path) for path in (*sys.path, str(package.parent)) if path]
    readable = [here, *(os.path.realpath(str(x)) for x in (package, package.parent / "lectures"))]
    readable += [
        folder for folder in folders if Path(folder).name in ("site-packages", "dist-packages")
    ]
    prefixes = (sys.prefix, sys.base_prefix, sys.exec_prefix, *sysconfig.get_paths().values())
    readable += [os.path.realpath(str(path)) for path in prefixes]
    readable += [*SYSTEM, *DEVICES, *ABOUT_ITSELF]

    def refuse(what: str) -> None:
        if len(refusals) < KEPT and what not in refusals:
            refusals.append(what)
        raise Withheld(f"{what} is refused to a file that is being marked")

    def inside(path: str, these: list[str]) -> bool:
        return any(path == one or path.startswith(one.rstrip(os.sep) + os.sep) for one in these)

    def audit(event: str, arguments: tuple[Any, ...]) -> None:
        if event == "open":
            path, mode, flags = arguments
            if not isinstance(path, str | bytes):
                return  # a file that is open already
            name = os.path.realpath(os.fsdecode(path))
            if (isinstance(mode, str) and set(mode) & set("wax+")) or (flags or 0) & WRITING:
                if not inside(name, [here, *DEVICES]):
                    refuse(f"writing {Path(name).name}")
            elif not inside(name, readable) or (os.path.isdir(name) and not inside(name, [here])):
                refuse(f"reading {Path(name).name}")  # a folder would lead to files by its handle
        elif event in LISTS:
            path = arguments[0]
            if isinstance(path, int):
                return
            name = os.path.realpath(os.fsdecode(path or "."))
            if not inside(name, readable) and name not in folders:
                refuse(f"listing {Path(name).name}")
        elif event in CHANGES:
            names = [os.fsdecode(x) for x in arguments if isinstance(x, str | bytes | os.PathLike)]
            if not all(inside(os.path.realpath(name), [here]) for name in names):
                refuse(f"changing {Path(names[0]).name}")
        else:
            for what, begins in REFUSED.items():
                if event.startswith(begins):
                    refuse(what)

    def start(*arguments: Any) -> None:
        refuse("starting another program")

    with suppress(ImportError):  # Windows starts programs in another way, which is reported
        import _posixsubprocess

        # multiprocessing calls it, and nothing reports that
        vars(_posixsubprocess)["fork_exec"] = start
    sys.addaudithook(audit)
    return refusals


def _limit() -> None:
    """Limits of the system, where it has them: of memory, and of the size of a written file."""
    with suppress(ImportError, ValueError, OSError):
        import resource

        memory = int(os.environ.pop(MEMORY, 0))
        if memory:
            resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
        resource.setrlimit(resource.RLIMIT_FSIZE, (LARGEST, LARGEST))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
