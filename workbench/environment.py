"""The environment that the workbench runs in: its distribution, a browser or not, the user's home.

The distribution is called `smpl-workbench`, because `workbench` is another project's on the package
index; the package and the command are called `workbench`. In a browser (Pyodide) there are no other
processes, no threads and few compiled packages: emcee, arviz-stats and corner are imported where
they are needed (`optional_library`), and what would start processes asks `in_browser` first.
"""

import sys
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from types import ModuleType

from workbench.errors import BadFile, WorkbenchError

DISTRIBUTION = "smpl-workbench"
VERSION = "0.1.0"  # pyproject.toml reads it from here, so that a checkout knows it uninstalled

# What only sampling needs, as pyproject.toml has it: a browser, where compiled packages are few,
# runs everything else without them, and ArviZ is an extra.
SAMPLING = {
    "emcee": "emcee>=3.1.6",
    "arviz": "arviz>=0.20,<2",
    "arviz_stats.base": "arviz-stats>=0.8,<2",
    "corner": "corner>=2.2.2",
}


class MissingLibrary(WorkbenchError):
    """A library that this part of the workbench needs cannot be imported."""


def optional_library(name: str, purpose: str) -> ModuleType:
    """One of the libraries of `SAMPLING`, imported when it is needed.

    `purpose` begins the sentence of the error: "drawing a posterior". Raises MissingLibrary.
    """
    try:
        return import_module(name)
    except ImportError as error:
        raise MissingLibrary(
            f"{purpose} needs {name}, which cannot be imported here ({error}); install it by "
            f"`pip install '{SAMPLING[name]}'`. Everything else works without it"
        ) from error


def version_of(distribution: str) -> str | None:
    """The version of an installed distribution, or None if it is not installed.

    That of `smpl-workbench` is the version of the code that runs, installed or not.
    """
    if distribution == DISTRIBUTION:
        return VERSION
    try:
        return version(distribution)
    except PackageNotFoundError:
        return None


def pip_install(extra: str) -> str:
    """The command that installs the libraries of an extra, for the end of an error message.

    The first form needs an installation, from a wheel or editable: pip then reads the extra from
    that. The second form installs from the folder of a checkout.
    """
    return (
        f"pip install '{DISTRIBUTION}[{extra}]', or in the folder of a checkout "
        f"pip install '.[{extra}]'"
    )


PLATFORMS = ("emscripten", "wasi")  # what `sys.platform` is there; the first is Pyodide's


def in_browser() -> bool:
    """Whether this is Python in WebAssembly, where no process and no thread can be started."""
    return sys.platform in PLATFORMS


def home() -> Path:
    """The home folder of the user. Raises BadFile if neither HOME nor the system names it."""
    return expanded("~")


def expanded(path: str | Path) -> Path:
    """A path whose `~` or `~name` is replaced by a folder. Raises BadFile if there is none."""
    try:
        return Path(path).expanduser()
    except RuntimeError as error:
        raise BadFile(
            f"no home folder is known for {path}; give a whole path, or set the variable HOME"
        ) from error
