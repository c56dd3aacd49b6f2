"""A lecture as slides for a browser, from the same cells: reveal.js shows them, without a network.

Prose becomes slides of a few paragraphs, what a cell prints and each figure a slide of its own; the
code of a cell stands below its result ("down"). reveal.js comes with the package sphinx-revealjs,
and MathJax with sphinx-mathjax-offline; both are copied beside the slides.
"""

import re
import shutil
from collections.abc import Iterator
from contextlib import redirect_stdout, suppress
from dataclasses import dataclass
from html import escape
from importlib.metadata import PackageNotFoundError, distribution
from io import StringIO
from pathlib import Path
from typing import Any

from jinja2 import Environment

from workbench.course import Picture
from workbench.course.cells import carried_out
from workbench.course.notebooks import tool
from workbench.course.outline import Lecture
from workbench.course.showing import Source
from workbench.course.site import OTHERS
from workbench.environment import pip_install
from workbench.errors import BadFile
from workbench.writing import write_file

WIDTH, HEIGHT = 1280, 720  # px of a slide
LINES, WORDS = 12.0, 14  # that a slide of prose has room for, and words in a line
MOST_ROWS = 36  # of code on a slide
OURS = "<!-- slides of the workbench -->"  # in each file that may be written over
COLOURS = "default"  # of code, by Pygments' name


@dataclass(frozen=True)
class Slide:
    """A slide, as HTML.

    Attributes:
        section: the heading of the section to which it belongs.
        body: what it shows.
        below: the code that made it, or nothing.
        lines: how many lines it takes, about.
    """

    section: str
    body: str
    below: str = ""
    lines: float = LINES


def slides(lecture: Lecture) -> list[Slide]:
    """Run a lecture; its slides in order. What is short stands below the prose before it.

    Raises BadFile if a library is missing.
    """
    found: list[Slide] = []
    for one in _each(lecture):
        last = found[-1] if found else one
        if one.below and not last.below and last.lines + one.lines <= LINES:
            one = Slide(last.section, last.body + one.body, one.below, last.lines + one.lines)
            found.pop()
        found.append(one)
    return found


def _each(lecture: Lecture) -> Iterator[Slide]:
    section = lecture.title
    with redirect_stdout(StringIO()):
        for cell, value, printed in carried_out(lecture.folder / "lecture.py"):
            if cell.prose:
                for heading, body, lines in _of_prose(cell.text):
                    section = heading or section
                    yield Slide(section, body, lines=lines)
                continue
            code = _code(cell.text)
            if text := printed.rstrip():
                rows = text.count("\n") + 2.0
                yield Slide(section, _fixed(escape(text), text), code, rows)
            for shown in _shown(value):
                yield Slide(section, shown, code)
    yield Slide("Exercises", _exercises(lecture))


def _shown(value: Any) -> Iterator[str]:
    """The value of a cell's last line, on one slide or on several."""
    match value:
        case None:
            pass
        case Picture():
            yield re.sub(r'style="width: \d+px" ', "", value.still, count=1)
        case Source():
            rows = value.text.splitlines()
            pages = -(-len(rows) // MOST_ROWS)
            each = -(-len(rows) // pages)
            for k in range(pages):
                where = escape(value.where) + (f", {k + 1} of {pages}" if pages > 1 else "")
                some = "\n".join(rows[k * each : (k + 1) * each])
                yield f'<p class="where">{where}</p>{_code(some)}'
        case _:
            yield _fixed(escape(repr(value)), repr(value))


def _of_prose(text: str) -> Iterator[tuple[str, str, float]]:
    """Slides of a cell of prose: the heading if one begins, HTML, and about how many lines."""
    waiting: list[str] = []
    heading, lines = "", 0.0
    for block in _blocks(text):
        title = re.match(r"#{1,3} +(.+)", block)
        if title or (waiting and lines + _lines(block) > LINES):
            if waiting:
                yield heading, _html("\n\n".join(waiting)), lines
            heading, waiting, lines = "", [], 0.0
        if title:
            heading = title[1].strip()
            block = block[title.end() :].strip()
        if block:
            waiting.append(block)
            lines += _lines(block)
    if waiting or heading:
        yield heading, _html("\n\n".join(waiting)), lines


def _blocks(text: str) -> list[str]:
    """Paragraphs, lists, tables and formulas that stand alone; fenced code stays together."""
    found: list[str] = []
    fence = False
    for part in re.split(r"\n\s*\n", text):
        if fence:
            found[-1] += f"\n\n{part}"
        else:
            found.append(part.strip("\n"))
        fence ^= part.count("```") % 2 == 1
    return [part for part in found if part.strip()]


def _lines(block: str) -> float:
    """How many lines of a slide a block takes, about."""
    prose = re.sub(r"\$\$.+?\$\$", "", block, flags=re.S)
    formulas = block.count("$$") / 2
    rows = [row for row in prose.splitlines() if row.strip()]
    listed = [row for row in rows if re.match(r"\s*([-*|]|\d+\.)", row)]
    return max(len(prose.split()) / WORDS, float(len(listed))) + 2.5 * formulas + 0.8


def _html(text: str) -> str:
    markdown, dollars = tool("markdown_it"), tool("mdit_py_plugins.dollarmath")
    reader = markdown.MarkdownIt("commonmark").enable("table")

    def formula(content: str, options: dict[str, Any]) -> str:
        inside = escape(content.strip())
        return rf"\[{inside}\]" if options["display_mode"] else rf"\({inside}\)"

    reader.use(dollars.dollarmath_plugin, renderer=formula, allow_space=True)
    return str(reader.render(text))


def _code(text: str) -> str:
    pygments, lexers = tool("pygments"), tool("pygments.lexers")
    formatter = tool("pygments.formatters").HtmlFormatter(nowrap=True)
    return _fixed(pygments.highlight(text, lexers.PythonLexer(), formatter), text)


def _fixed(html: str, text: str) -> str:
    """Text of a fixed width, in the size in which it fits on a slide."""
    rows = text.splitlines() or [""]
    high, wide = 540 / (1.3 * len(rows)), (WIDTH - 120) / (0.61 * max(map(len, rows)) + 1)
    size = max(7.0, min(24.0, high, wide))
    return f'<pre style="font-size: calc({size:.1f}px * var(--fit, 1))">{html}</pre>'


def _exercises(lecture: Lecture) -> str:
    rows = []
    given = lecture.module("exercises")
    for k, name in enumerate(lecture.exercises, 1):
        task = (getattr(given, name).__doc__ or "").splitlines()[0]
        points = sum(check.points for check in lecture.checks if check.exercise == name)
        minutes = lecture.minutes_for(name)
        rows.append(
            f"<tr><td>{lecture.number}.{k}</td><td>{escape(task)}</td><td>{points}</td>"
            f"<td>{'' if minutes is None else f'about {minutes}'}</td></tr>"
        )
    head = "<tr><th></th><th>exercise</th><th>points</th><th>minutes</th></tr>"
    return f"<table>{head}{''.join(rows)}</table>"


def write_slides(lecture: Lecture, folder: str | Path) -> Path:
    """Write the slides of a lecture to a folder, which is made, and return their page.

    Slides of other lectures may be there already. Raises BadFile if a library is missing, or if
    there is a file of that name which is none of ours.
    """
    folder = Path(folder)
    sources = {
        "reveal": _folder("revealjs", "sphinx-revealjs"),
        "mathjax": _folder("mathjax", "sphinx-mathjax-offline"),
    }
    page = folder / f"{lecture.folder_name}.html"
    if page.exists() and OURS not in page.read_text(encoding="utf-8", errors="replace"):
        raise BadFile(f"{page} is no file of ours and was left as it was; name a new folder")
    here = Path(__file__).parent
    template = Environment(autoescape=False).from_string(
        (here / "slides.html").read_text(encoding="utf-8")
    )
    formatter = tool("pygments.formatters").HtmlFormatter(style=COLOURS)
    text = template.render(
        ours=OURS,
        lecture=lecture,
        title=escape(lecture.title),
        question=escape(lecture.question),
        slides=slides(lecture),
        style=(here / "slides.css").read_text(encoding="utf-8"),
        colours=formatter.get_style_defs("pre"),
        width=WIDTH,
        height=HEIGHT,
    )
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name, source in sources.items():
            if not (folder / name).exists():
                shutil.copytree(source, folder / name, ignore=shutil.ignore_patterns("*.map"))
        shutil.copytree(OTHERS, folder / "licences", dirs_exist_ok=True)
    except OSError as error:
        raise BadFile(f"cannot write {folder}: {error.strerror or error}") from error
    write_file(page, text)
    return page


def _folder(name: str, library: str) -> Path:
    """The folder of that name in a library. Raises BadFile if it is not installed."""
    with suppress(PackageNotFoundError):
        for path in distribution(library).files or ():
            for folder in Path(str(path.locate())).parents:
                if folder.name == name:
                    return folder
    raise BadFile(
        f"slides need the library {library}, which is not installed: {pip_install('course')}"
    )
