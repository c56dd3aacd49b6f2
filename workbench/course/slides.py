"""A lecture as slides for a browser, made of its slide cells, which need no network.

A cell `# %% slide [markdown]` is a slide: a headline, at most three bullets, and the figure that
was drawn since the slide before it. A figure that moves does so on the slide; after a cell
`# %% slide still [markdown]`, which shows the still one, it does so on the next slide. The prose
becomes the speaker's notes. Code is shown where a slide quotes it. reveal.js comes with the package
sphinx-revealjs, and MathJax with sphinx-mathjax-offline; both are copied beside the slides.
"""

import re
import shutil
from contextlib import redirect_stdout, suppress
from dataclasses import dataclass, replace
from html import escape
from importlib.metadata import PackageNotFoundError, distribution
from io import StringIO
from pathlib import Path
from typing import Any

from jinja2 import Environment

from workbench.course import Picture
from workbench.course.cells import Cell, run_cells
from workbench.course.notebooks import tool
from workbench.course.outline import Lecture
from workbench.course.showing import Source, framed
from workbench.course.site import DARK, LIGHT, OTHERS
from workbench.environment import pip_install
from workbench.errors import BadFile
from workbench.writing import write_file

WIDTH, HEIGHT = 1280, 720  # px of a slide
MOST_BULLETS, MOST_ROWS, LONGEST_ROW = 3, 12, 92  # rows and letters of code
WIDE_FIGURE = 1.55  # a still figure stands below the bullets if it is as many times as wide as high
SLIDES_MARK = "<!-- slides of the workbench -->"  # in each file that may be written over


@dataclass(frozen=True)
class Slide:
    """A slide; its texts are HTML.

    Attributes:
        headline: what it says, in a line.
        words: bullets, formulas, and code.
        notes: what the speaker reads.
        still: the figure.
        moving: the figure in a frame that answers to the hand; `still` then stands for it on paper.
        wide: whether the figure stands below the words, and not beside them.
    """

    headline: str
    words: str
    notes: str = ""
    still: str = ""
    moving: str = ""
    wide: bool = False


def slides(lecture: Lecture) -> list[Slide]:
    """Run a lecture; its slides in order, and one with its exercises.

    Raises BadFile if a slide is not one, or if a library is missing.
    """
    path = lecture.folder / "lecture.py"
    deck: list[Slide] = []
    notes, shown = "", ""
    picture: Picture | None = None
    with redirect_stdout(StringIO()):
        for cell, value, _ in run_cells(path, slides=True):
            if cell.slide:
                deck.append(_slide(cell, picture, shown, notes, path))
                notes, picture = "", picture if cell.slide == "still" else None
            elif cell.prose:
                notes += _html(cell.text)
            else:
                shown += f"{cell.text}\n{value.text if isinstance(value, Source) else ''}\n"
                picture = value if isinstance(value, Picture) else picture
    if not deck:
        raise BadFile(f"{path} has no slides; a cell `# %% slide [markdown]` is one")
    deck[-1] = replace(deck[-1], notes=deck[-1].notes + notes)
    return [*deck, Slide("Exercises", _exercises(lecture))]


def _slide(cell: Cell, picture: Picture | None, shown: str, notes: str, path: Path) -> Slide:
    """The slide of a cell. Raises BadFile if it has no headline, or too much of anything."""
    headline, _, rest = cell.text.partition("\n")
    quoted = "\n".join(re.findall(r"```python\n(.*?)```", rest, re.S)).splitlines()
    shown_lines = {line.strip() for line in shown.splitlines()}
    troubles = {
        "begins with its headline: `# ## ...`": headline.startswith("## "),
        f"has at most {MOST_BULLETS} bullets": len(re.findall(r"^- ", rest, re.M)) <= MOST_BULLETS,
        f"has at most {MOST_ROWS} rows of code": len(quoted) <= MOST_ROWS,
        f"has rows of at most {LONGEST_ROW} letters": all(len(q) <= LONGEST_ROW for q in quoted),
        "quotes rows of code that the lecture has shown, or `...`": shown_lines | {"..."}
        >= {line.strip() for line in quoted},
    }
    for rule, followed in troubles.items():
        if not followed:
            raise BadFile(f"{path}, line {cell.line}: a slide {rule}")
    words, title = _html(rest), _inline(headline.removeprefix("## "))
    if picture is None:
        return Slide(title, words, notes)
    moves = picture.page if cell.slide == "moving" else None
    wide, high = picture.figure.get_size_inches()
    return Slide(
        title,
        words,
        f"{notes}<p>{escape(picture.caption if moves is None else moves.caption)}</p>",
        picture.image,
        "" if moves is None else framed(moves.html.replace("</head>", f"{SLIDE_STYLE}</head>", 1)),
        moves is None and bool(wide >= WIDE_FIGURE * high),
    )


SLIDE_STYLE = """
<style>
main .replay figcaption { display: none; } /* it is in the notes */
main .replay figure figcaption { display: block; }
main .replay-stage { height: 27rem; }
</style>
"""


def _reader() -> Any:
    """A reader of Markdown that leaves formulas to MathJax, and colours code."""
    markdown, dollars = tool("markdown_it"), tool("mdit_py_plugins.dollarmath")

    def formula(content: str, options: dict[str, Any]) -> str:
        inside = escape(content.strip())
        return rf"\[{inside}\]" if options["display_mode"] else rf"\({inside}\)"

    def coloured(code: str, language: str, attributes: str) -> str:
        pygments, lexers = tool("pygments"), tool("pygments.lexers")
        formatter = tool("pygments.formatters").HtmlFormatter(nowrap=True)
        size = min(28.0, (WIDTH - 160) / (0.61 * max(len(row) for row in code.splitlines())))  # px
        inside = pygments.highlight(code, lexers.PythonLexer(), formatter)
        return f'<pre style="font-size: {size:.0f}px">{inside}</pre>'

    reader = markdown.MarkdownIt("commonmark", {"highlight": coloured}).enable("table")
    return reader.use(dollars.dollarmath_plugin, renderer=formula, allow_space=True)


def _html(text: str) -> str:
    return str(_reader().render(text))


def _inline(text: str) -> str:
    return str(_reader().renderInline(text))


def _exercises(lecture: Lecture) -> str:
    rows = []
    exercises = lecture.module("exercises")
    for k, name in enumerate(lecture.exercises, 1):
        task = (getattr(exercises, name).__doc__ or "").splitlines()[0]
        points = sum(check.points for check in lecture.checks if check.exercise == name)
        minutes = lecture.minutes_for(name)
        rows.append(
            f"<tr><td>{lecture.number}.{k}</td><td>{escape(task)}</td><td>{points}</td>"
            f"<td>{'' if minutes is None else f'about {minutes}'}</td></tr>"
        )
    head = "<tr><th></th><th>exercise</th><th>points</th><th>minutes</th></tr>"
    return f'<table class="exercises">{head}{"".join(rows)}</table>'


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
    if page.exists() and SLIDES_MARK not in page.read_text(encoding="utf-8", errors="replace"):
        raise BadFile(f"{page} is no file of ours and was left as it was; name a new folder")
    here = Path(__file__).parent
    template = Environment(autoescape=False).from_string(
        (here / "slides.html").read_text(encoding="utf-8")
    )
    formatter = tool("pygments.formatters").HtmlFormatter
    text = template.render(
        ours=SLIDES_MARK,
        lecture=lecture,
        title=escape(lecture.title),
        question=escape(lecture.question),
        slides=slides(lecture),
        style=(here / "slides.css").read_text(encoding="utf-8"),
        light=formatter(style=LIGHT).get_style_defs("pre"),
        dark=formatter(style=DARK).get_style_defs("pre"),
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
