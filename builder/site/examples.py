"""Examples that are run for the site: what each printed, drew, and its source."""

import ast
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from builder.site.docstrings import inline, rendered, summary
from workbench.course.process import environment
from workbench.errors import BadFile

SECONDS = 600.0  # that an example may take
NUMBERED = "[0-9]*.py"
COVERED = re.compile(r"((?:\w+, )*\w+): (.*)", re.S)  # the names that a reference example shows


@dataclass(frozen=True)
class Example:
    """One script, with what it printed and the figures it drew.

    Attributes:
        name: the file's name without its suffix.
        source: the whole script.
        printed: what it wrote to the standard output.
        figures: the PNG files that it made.
    """

    name: str
    source: str
    printed: str
    figures: tuple[Path, ...]

    @property
    def docstring(self) -> str:
        """The docstring of the script."""
        return ast.get_docstring(ast.parse(self.source)) or ""

    @property
    def title(self) -> str:
        """The name in words: `a video` of `12_a_video`."""
        return self.name.lstrip("0123456789_").replace("_", " ").replace("smpl", "SMPL")

    @property
    def code(self) -> str:
        """The script below its docstring."""
        first, *_ = ast.parse(self.source).body
        return "".join(self.source.splitlines(keepends=True)[first.end_lineno :]).strip("\n")

    @property
    def names(self) -> tuple[str, ...]:
        """The public names that an example of the reference shows."""
        found = COVERED.match(self.docstring)
        return tuple(found[1].split(", ")) if found else ()

    @property
    def purpose(self) -> str:
        """What an example of the reference shows of its names, in words."""
        found = COVERED.match(self.docstring)
        text = found[2] if found else self.docstring
        return _capital(text)


def run_example(script: Path) -> Example:
    """Run a script in the folder that it lies in.

    Raises BadFile if it stops with an error, or takes more than ten minutes.
    """
    before = set(script.parent.glob("*.png"))
    settings = environment() | {"MPLBACKEND": "Agg"}
    try:
        done = subprocess.run(
            [sys.executable, script.name],
            cwd=script.parent,
            env=settings,
            capture_output=True,
            encoding="utf-8",
            timeout=SECONDS,
            check=False,
        )
    except subprocess.TimeoutExpired as error:
        raise BadFile(f"the example {script.name} takes more than {SECONDS:.0f} s") from error
    if done.returncode:
        raise BadFile(f"the example {script.name} stops with an error:\n{done.stderr}")
    figures = sorted(set(script.parent.glob("*.png")) - before, key=os.path.getmtime)
    source = script.read_text(encoding="utf-8")
    return Example(script.stem, source, done.stdout.rstrip(), tuple(figures))


def run_all(
    folder: Path, pattern: str, scratch: Path, tell: Callable[[str], None]
) -> list[Example]:
    """Run the scripts of a folder that match the pattern, each from a copy in `scratch`."""
    scratch.mkdir(parents=True, exist_ok=True)
    found = []
    for script in sorted(folder.glob(pattern)):
        if script.name == "__init__.py":
            continue
        tell(f"running example {script.stem}")
        shutil.copy(script, scratch / script.name)
        found.append(run_example(scratch / script.name))
    return found


def write_example_pages(examples: list[Example], pages: Path) -> None:
    """Write a page for each example, and their index."""
    pages.mkdir(parents=True, exist_ok=True)
    rows = []
    for example in examples:
        for figure in example.figures:
            shutil.copy(figure, pages / figure.name)
        (pages / f"{example.name}.md").write_text(_page(example), encoding="utf-8")
        sentence = inline(summary(example.docstring), lambda name: None)
        rows.append(
            f'<tr><td><a href="{example.name}.html">{_capital(example.title)}</a></td>'
            f"<td>{sentence}</td></tr>"
        )
    table = raw(f'<table class="names">{"".join(rows)}</table>')
    (pages / "index.md").write_text(
        "# Examples\n\nEach example shows one idea by a script, with the figures that it drew and "
        "the text that it printed when this site was built.\n\n" + table + "\n\n"
        "```{toctree}\n:hidden:\n\n" + "\n".join(example.name for example in examples) + "\n```\n",
        encoding="utf-8",
    )


def raw(html: str) -> str:
    """HTML within Markdown; nothing in it is read as Markdown."""
    return f"{'`' * 12}{{raw}} html\n{html}\n{'`' * 12}" if html.strip() else ""


def fenced(text: str, language: str) -> str:
    """A block of code; nothing in it ends the block."""
    return f"{'`' * 12}{language}\n{text}\n{'`' * 12}"


def _page(example: Example) -> str:
    prose = rendered(example.docstring, lambda name: None)
    shown = [raw(prose)]
    shown += [f"![{figure.stem.replace('_', ' ')}]({figure.name})" for figure in example.figures]
    if example.printed:
        shown += ["## Printed output", fenced(example.printed, "text")]
    shown += ["## Source", f"`examples/{example.name}.py`", fenced(example.code, "python")]
    return f"# {_capital(example.title)}\n\n" + "\n\n".join(shown) + "\n"


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]
