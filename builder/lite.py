"""Write the course for JupyterLite: notebooks that run in a browser, from any web server.

    python -m builder.lite FOLDER --wheel dist/smpl_workbench-....whl

This is an opt-in: it needs a checkout, the extra `course`, and
`pip install jupyterlite-core jupyterlite-pyodide-kernel`. Python itself (Pyodide) and its builds of
CasADi, NLopt, NumPy, SciPy and Matplotlib are no part of what is written. A reader's browser loads
them from Pyodide's server when a notebook is opened, or from `--pyodide`.
"""

import argparse
import importlib.util
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.markup import escape

from workbench.cli import explain
from workbench.course.notebooks import code_cell, notebook, without_results, write_notebook
from workbench.course.outline import Lecture, course
from workbench.environment import DISTRIBUTION
from workbench.errors import BadFile, WorkbenchError

NEEDED = ("jupyterlite_core", "jupyterlite_pyodide_kernel")
LAST = 8  # the lectures that are tried with what a browser has: the first eight
FROM_PYODIDE = ("casadi", "nlopt", "numpy", "scipy", "matplotlib")  # in C, built by it
PURE = ("trimesh", "typer", "rich", "jinja2", "threadpoolctl", "joblib", "cloudpickle")  # Python
INSTALLATION = f"""\
# Once for each notebook; it takes a minute. The package asks for a newer CasADi than a browser has,
# and for libraries that a browser lacks, so that its own list of requirements is left out.
import piplite

await piplite.install({[*FROM_PYODIDE, *PURE]!r})
await piplite.install({DISTRIBUTION!r}, deps=False)"""


def for_browsers(lecture: Lecture) -> Any:
    """The notebook of a lecture, not run, with the installation in its first cell of code."""
    made = without_results(notebook(lecture))
    cell = code_cell(INSTALLATION, {"tags": ["install"]}) | {"id": "install"}
    made["cells"].insert(1, cell)
    kernel = {"display_name": "Python (Pyodide)", "name": "python"}
    return made | {"metadata": made["metadata"] | {"kernelspec": kernel}}


def write_lite(folder: Path, wheel: Path, pyodide: str | None = None) -> Path:
    """Write the site into a new folder, and return its page. Raises BadFile."""
    if not wheel.is_file() or wheel.suffix != ".whl":
        raise BadFile(f"{wheel} is no wheel; build one with: pip wheel --no-deps -w dist .")
    missing = [name for name in NEEDED if importlib.util.find_spec(name) is None]
    if missing:
        raise BadFile(
            f"{' and '.join(missing)} are not installed; type: pip install "
            + " ".join(name.replace("_", "-") for name in NEEDED)
        )
    if folder.exists() and any(folder.iterdir()):
        raise BadFile(f"{folder} is not empty; name a new folder")
    with tempfile.TemporaryDirectory() as place:
        contents = Path(place) / "contents"
        contents.mkdir()
        for one in course():
            if one.number <= LAST:
                write_notebook(for_browsers(one), contents / f"{one.folder_name}.ipynb")
        command = [sys.executable, "-m", "jupyterlite_core", "build", "--contents", str(contents)]
        command += ["--output-dir", str(folder.resolve()), "--piplite-wheels", str(wheel.resolve())]
        command += ["--no-sourcemaps", *(["--pyodide", pyodide] if pyodide else [])]
        done = subprocess.run(command, cwd=place, capture_output=True, text=True, check=False)
    if done.returncode:
        said = (done.stderr or done.stdout).strip().splitlines()[-12:]
        raise BadFile("jupyter lite build failed:\n" + "\n".join(said))
    return folder / "lab" / "index.html"


def main(given: Sequence[str] | None = None) -> int:
    """Parse the arguments, write the site, and return the exit code: 2 after an error."""
    parser = argparse.ArgumentParser(
        prog="python -m builder.lite",
        description=f"Write lectures 1 to {LAST} for JupyterLite, which runs them in a browser.",
        epilog="Pyodide and its packages are loaded from Pyodide's server by the reader's browser.",
    )
    parser.add_argument("folder", type=Path, help="where to write; a new folder")
    parser.add_argument("--wheel", type=Path, required=True, help="a wheel of this package")
    parser.add_argument("--pyodide", help="another address of Pyodide, or an archive to put beside")
    asked = parser.parse_args(given)
    console = Console()
    try:
        page = write_lite(asked.folder, asked.wheel, asked.pyodide)
    except WorkbenchError as error:
        explain(error)
        return 2
    console.print(f"JupyterLite: [bold]{escape(str(page))}[/]", soft_wrap=True)
    console.print(f"[dim]look at it: python -m http.server --directory {asked.folder}[/]")
    return 0


if __name__ == "__main__":
    sys.exit(main())
