"""Which variables of the lecturer's environment the process of a handed-in file gets: no others.

An environment may hold passwords, and a file that is marked can read its own.
"""

import os
from collections.abc import Mapping

NAMES = (
    "PATH", "HOME", "LANG", "LANGUAGE", "TZ", "TMPDIR", "TEMP", "TMP", "LD_LIBRARY_PATH",
    "DYLD_LIBRARY_PATH", "VIRTUAL_ENV", "CONDA_PREFIX", "CC",
    "PYTHONPATH", "PYTHONHOME", "PYTHONUSERBASE", "PYTHONNOUSERSITE", "PYTHONUTF8",
    "PYTHONIOENCODING", "PYTHONHASHSEED", "PYTHONDONTWRITEBYTECODE", "PYTHONWARNINGS",
    "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS",
    "NUMEXPR_NUM_THREADS", "BLIS_NUM_THREADS",
    "WORKBENCH_CACHE", "WORKBENCH_COMPILE", "WORKBENCH_THREADS", "XDG_CACHE_HOME",
    "SYSTEMROOT", "SYSTEMDRIVE", "WINDIR", "COMSPEC", "PATHEXT", "USERPROFILE", "APPDATA",
    "LOCALAPPDATA", "NUMBER_OF_PROCESSORS", "PROCESSOR_ARCHITECTURE",
)  # fmt: skip


def passed_on(variables: Mapping[str, str] = os.environ) -> dict[str, str]:
    """The variables that Python, its libraries and the workbench need to start and to compute."""
    return {
        name: text
        for name, text in variables.items()
        if name.upper() in NAMES or name.startswith("LC_")
    }
