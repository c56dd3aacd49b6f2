"""`workbench new`: a commented file to begin with, which runs as it is written."""

import re
import shutil
import sys
from importlib.util import find_spec
from keyword import iskeyword
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.markup import escape

from workbench.cli.console import print_page, say
from workbench.course.outline import course
from workbench.errors import BadArgument, BadFile, check_known
from workbench.writing import write_new

TEMPLATES = Path(__file__).parent / "templates"
LONGEST = 40  # characters of a name, which folders of results repeat


USUAL_COMMANDS = "run FILE", "diagnose FILE", "compare FILE", "sample FILE"
SCAFFOLDS = {  # what a kind of file holds, and commands that it works with as written
    "problem": ("blocks, residuals, the names that are free, and a start", USUAL_COMMANDS),
    "residual": ("an error term of points, with a problem to try it on", USUAL_COMMANDS),
    "solver": (
        "an algorithm that stops, counts and reports as all solvers do",
        (
            "run FILE --solver FILE",
            "diagnose FILE --solver FILE",
            "compare FILE --solver FILE --solver trust-region",
            "sample FILE --solver FILE",
        ),
    ),
    "experiment": (
        "a problem with arguments, made-up data, and numbers by which it is judged",
        ("run FILE --set noise=0.1", "diagnose FILE", "compare FILE --seeds 3", "sample FILE"),
    ),
    "lecture": (
        "a folder: text and code, exercises, solutions, checks, its line in the outline",
        ("lecture list FILE", "lecture run FILE", "lecture start FILE .", "lecture check FILE"),
    ),
}


def write_scaffold(kind: str, name: str, folder: str | Path = ".") -> Path:
    """Write a commented file (of a lecture, a folder) called `name` that runs as it is.

    Returns its path. Nothing is overwritten. Raises UnknownName for a kind that does not exist,
    BadArgument for a name that would be none in Python or that hides a library, and BadFile for a
    path that exists or cannot be written.
    """
    check_known("kind of file", kind, SCAFFOLDS)
    check_name(name)
    template, words = TEMPLATES / f"{kind}.py", {"NAME": name}
    path = Path(folder) / f"{name}.py"
    if kind == "lecture":
        number = 1 + max(lecture.number for lecture in course())
        template, path = TEMPLATES / kind, Path(folder) / f"lec{number:02}_{name}"
        words = {
            "lec00_NAME": path.name,
            "lecture 0": f"lecture {number}",
            "    0,  #": f"    {number},  #",
        } | words
    if path.exists():
        raise BadFile(f"{path} exists already and was left as it is; give another name or folder")
    try:
        for source in template.glob("*.py") if template.is_dir() else [template]:
            text = source.read_text(encoding="utf-8")
            for word, instead in words.items():
                text = text.replace(word, instead)
            write_new(path / source.name if template.is_dir() else path, text)
    except BadFile:
        shutil.rmtree(path, ignore_errors=True)  # half a lecture is of no use
        raise
    return path


def check_name(name: str) -> None:
    """Raise BadArgument unless a file of that name can be imported and hides no library."""
    example = "write a name such as `my_problem`, without folder and without .py"
    if not re.fullmatch(r"[a-z][a-z0-9_]*", name, re.ASCII) or iskeyword(name):
        raise BadArgument(
            f"{name!r} cannot be the name: a name begins with a small letter, goes on with small "
            f"letters, digits and underscores, and is not a keyword of Python; {example}"
        )
    if len(name) > LONGEST:
        raise BadArgument(f"a name has at most {LONGEST} characters, not {len(name)}; {example}")
    if name in sys.stdlib_module_names or _installed(name):
        raise BadArgument(
            f"{name!r} is the name of a library that Python imports, which a file of that name "
            f"would hide; {example}"
        )


def _installed(name: str) -> bool:
    """Whether a library of that name is installed, and not a file of the user's own."""
    spec = find_spec(name)
    if spec is None:
        return False
    places = Path(spec.origin or "").parts
    return name == "workbench" or bool({"site-packages", "dist-packages"} & {*places})


KINDS = "; ".join(f"{kind}: {what}" for kind, (what, _) in SCAFFOLDS.items())


def new(
    kind: Annotated[str, typer.Argument(help=f"One of {', '.join(SCAFFOLDS)}. {KINDS}.")],
    name: Annotated[
        str, typer.Argument(help="Its name: small letters, digits and underscores, without .py.")
    ],
    folder: Annotated[
        Path, typer.Option(help="Folder to write into; it is made if it does not exist.")
    ] = Path(),
) -> None:
    """Write a commented file of your own that works as it is: NAME.py, or a lecture's folder.

    Nothing is overwritten. The commands to try it with are printed.
    """
    console = Console()
    path = write_scaffold(kind, name, folder)
    print_page(console, kind, path)
    for command in SCAFFOLDS[kind][1]:
        line = f"workbench {command}".replace("FILE", str(path))
        say(console, f"[dim]try[/] {escape(line)}")
