"""Running a user's own Python file.

Whatever such a file raises becomes a sentence with the line to blame, and what CasADi says of
shapes one that says what to do (`user_errors`).
"""

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

from workbench.errors import BadFile
from workbench.experiments.user_errors import user_errors

# What such a file may define, for --help and for the error of one that defines nothing.
ENOUGH = (
    "`problem` and `start`, or `setup` (a Setup, or a function that returns one), or `experiment`"
)
BESIDE = (
    "beside `problem` and `start`, `priors` names the residuals that are not data, `body` is the "
    "body to draw, `compared` names solvers to run as well, `candidates` are residuals by name "
    "that could be measured next, and `gauges` are motions (Gauge) that change no residual"
)


def run_file(path: Path, instead: str) -> tuple[ModuleType, str]:
    """Run a file. Returns its module and its full path; raises BadFile with the line that failed.

    `instead` says what else could have been given, for the error about a missing file.
    """
    if not path.is_file():
        raise BadFile(f"there is no file {path}; give the path of a Python file, or {instead}")
    source = str(path.resolve())
    spec = importlib.util.spec_from_file_location(path.stem, source)
    assert spec is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules.setdefault(path.stem, module)
    folder = str(path.resolve().parent)  # where its own imports are, as under `python FILE.py`
    if folder not in sys.path:
        sys.path.insert(0, folder)
    with user_errors(source):
        # what Python keeps of a file is that of another one of the same size and second
        exec(compile(path.read_bytes(), source, "exec"), vars(module))
    return module, source
