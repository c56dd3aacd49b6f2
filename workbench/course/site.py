"""The course as a static site: the executed notebooks, by Sphinx and MyST-NB, with no network."""

import shutil
import warnings
from collections.abc import Callable
from importlib.util import find_spec
from io import StringIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from workbench.course.notebooks import executed, notebook, tool, write_notebook
from workbench.course.outline import Lecture, course, root
from workbench.errors import BadFile

STYLE = Path(__file__).with_name("site.css")
NEEDED = ("sphinx", "myst_nb", "sphinx-mathjax-offline")  # beside those of notebooks
PAGES = ("GUIDE", "AUTHORS")  # beside the lectures
TABLE = "<!-- the outline -->"  # where a page has it
LIGHT, DARK = "default", "github-dark"  # of code, by Pygments' names
MADE_BY_US = "searchindex.js"  # a folder with it is a site, which may be made anew

Tell = Callable[[str], None]


def write_site(folder: str | Path, tell: Tell = lambda said: None) -> Path:
    """Run every lecture and write the site; its first page.

    `tell` hears what is going on. Raises BadFile where a tool is missing, a lecture fails, Sphinx
    warns, or the folder holds something else; CellFailed is one of them.
    """
    folder = Path(folder)
    for name in NEEDED:
        if find_spec(name) is None:
            tool(name)
    if folder.exists() and not folder.is_dir():
        raise BadFile(f"{folder} is a file; give a folder for the site")
    if folder.exists() and any(folder.iterdir()) and not (folder / MADE_BY_US).is_file():
        raise BadFile(f"{folder} holds something that is no site of ours; give a new folder")
    with TemporaryDirectory(prefix="workbench-site-") as scratch:
        pages, files = Path(scratch) / "pages", Path(scratch) / "files"
        static, out = Path(scratch) / "static", Path(scratch) / "out"
        for each in (pages, files, static):
            each.mkdir()
        there = [one for one in course() if one.there]
        for one in there:
            tell(f"running lecture {one.number}, {one.title}")
            _add(one, pages, files, Path(scratch))
        (pages / "index.md").write_text(_index(there), encoding="utf-8")
        for page in PAGES:
            text = (root() / f"{page}.md").read_text(encoding="utf-8")
            (pages / f"{page}.md").write_text(text.replace(TABLE, _table()), encoding="utf-8")
        (static / "course.css").write_text(_style(), encoding="utf-8")
        tell("writing pages")
        _build(pages, files, static, out, Path(scratch) / "doctrees")
        _put(out, folder)
    return folder / "index.html"


def _add(one: Lecture, pages: Path, files: Path, scratch: Path) -> None:
    made = notebook(one)
    write_notebook(made, files / f"{one.folder_name}.ipynb")
    shutil.copy(one.folder / "exercises.py", files / f"{one.folder_name}.py")
    done = executed(made, one, scratch)
    first = done.cells[0]
    head, _, rest = first.source.partition("\n")
    name = one.folder_name
    facts = (
        f'<p class="facts">Lecture {one.number}, {one.minutes} minutes. Assumes {one.assumes}. '
        f'<a href="{name}.ipynb">notebook</a>, <a href="{name}.py">exercises</a></p>'
    )
    first.source = f"{head}\n\n{facts}\n{rest}"
    write_notebook(done, pages / f"{name}.ipynb")


def _index(there: list[Lecture]) -> str:
    """The first page: every lecture with its question."""
    rows = [
        f"| {one.number} | [{one.title}]({one.folder_name}.ipynb)<br>{one.question} "
        f"| {one.minutes} | {sum(check.points for check in one.checks)} |"
        if one.there
        else f"| {one.number} | {one.title} (to come) | | |"
        for one in course()
    ]
    names = [one.folder_name for one in there]
    return (
        "# Body models, from a function to a posterior\n\n"
        "A course on the workbench: every figure and number on these pages was computed when they "
        "were made, by code that stands beside it.\n\n"
        "| | lecture | minutes | points |\n| --- | --- | --- | --- |\n" + "\n".join(rows) + "\n\n"
        "```{toctree}\n:hidden:\n\n" + "\n".join((*names, *PAGES)) + "\n```\n"
    )


def _table() -> str:
    """What each lecture assumes and teaches, and how long it takes."""
    rows = [
        f"| {one.number} | {one.title}{'' if one.there else ' (to come)'} | {one.minutes} "
        f"| {one.assumes} | {one.teaches} |"
        for one in course()
    ]
    head = "| | lecture | minutes | assumes | teaches |\n| --- | --- | --- | --- | --- |"
    return "\n".join((head, *rows))


def _style() -> str:
    """Ours, and colours of code for either kind of screen."""
    formatter = tool("pygments.formatters").HtmlFormatter(style=DARK)
    dark = formatter.get_style_defs(".highlight")
    return (
        f"{STYLE.read_text(encoding='utf-8')}\n@media (prefers-color-scheme: dark) {{\n{dark}\n}}\n"
    )


def _build(pages: Path, files: Path, static: Path, out: Path, doctrees: Path) -> None:
    said = StringIO()
    settings: dict[str, Any] = {
        "project": "Body models",
        "extensions": ["myst_nb", "sphinx-mathjax-offline"],
        "myst_enable_extensions": ["dollarmath", "amsmath"],
        # the bar of a transpose is thinner than a pixel on many screens
        "mathjax3_config": {"tex": {"macros": {"top": r"\mathsf{T}"}}},
        "nb_execution_mode": "off",  # they were run above, where an error can be told
        "html_theme": "basic",
        "html_title": "Body models",
        "html_css_files": ["course.css"],
        "html_static_path": [str(static)],
        "html_extra_path": [str(files)],
        "html_sidebars": {"**": ["searchbox.html", "globaltoc.html"]},
        "html_copy_source": False,
        "html_show_sphinx": False,
        "html_show_copyright": False,
        "html_use_index": False,
        "html_domain_indices": False,
        "pygments_style": LIGHT,
        "suppress_warnings": ["myst.header"],  # lectures need not go down level by level
    }
    sphinx, namespaces = tool("sphinx.application"), tool("sphinx.util.docutils")
    try:
        with (
            warnings.catch_warnings(),
            namespaces.patch_docutils(),
            namespaces.docutils_namespace(),
        ):
            # what the libraries have to say to each other about their next versions
            warnings.simplefilter("ignore", DeprecationWarning)
            warnings.simplefilter("ignore", PendingDeprecationWarning)
            app = sphinx.Sphinx(
                pages, None, out, doctrees, "html", settings, status=None, warning=said
            )
            app.build()
    except Exception as error:
        raise BadFile(f"Sphinx could not build the site: {error}\n{said.getvalue()}") from error
    if app.statuscode or said.getvalue().strip():
        raise BadFile(f"Sphinx is not content with the site: {said.getvalue().strip()}")


def _put(out: Path, folder: Path) -> None:
    """In the place of what was there."""
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        if folder.exists():
            shutil.rmtree(folder)
        shutil.copytree(out, folder, ignore=shutil.ignore_patterns(".buildinfo", "_sources"))
    except OSError as error:
        raise BadFile(f"cannot write {folder}: {error.strerror or error}") from error
