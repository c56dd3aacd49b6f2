"""Docstrings, documents, examples and licences as pages of the site."""

import ast
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from html import escape
from inspect import cleandoc
from pathlib import Path

import workbench
from workbench.course.process import environment
from workbench.errors import BadFile

Link = Callable[[str], str | None]  # a name, maybe dotted, to the address of its description

FIELDS = re.compile(r"(Attributes|Args|Arguments|Parameters|Members|Returns|Raises):\s*$")
FIELD = re.compile(r"(\*{0,2}[\w.`, /]+?)\s*(?:\([^)]*\))?:\s+(.*)", re.S)
BULLET = re.compile(r"(?:[-*•]|\d+[.)])\s+")
CODE = re.compile(r"(?<!`)(`{1,2})(?!`)(.+?)(?<!`)\1(?!`)", re.S)
CLASS = re.compile(r"\b(?:wb\.)?[A-Z]+[a-z]\w*\b")  # names of classes are links also without code
FRONT, START = "README.md", "index.md"
DOCUMENTS = (
    "COMMANDS.md",
    "howto/problem.md",
    "howto/residual.md",
    "howto/solver.md",
    "howto/experiment.md",
    "howto/diagnose.md",
    "howto/fit.md",
    "howto/formats.md",
    "howto/markers.md",
    "howto/motions.md",
    "howto/scan.md",
    "howto/train.md",
    "examples/README.md",
    "examples/studies/README.md",
    "ARCHITECTURE.md",
    "CHANGELOG.md",
    "CONTRIBUTING.md",
)
BENCHMARKS = "benchmarks/*.md"
TEXTS = ("LICENSE", "NOTICE")
LINK = re.compile(r"(!?\[[^\]]*\])\(([^)\s#:]+)(#[^)\s]*)?\)")
SECONDS = 600.0  # that an example may take
NUMBERED = "[0-9]*.py"
COVERED = re.compile(r"((?:\w+, )*\w+): (.*)", re.S)  # the names that a reference example shows


def rendered(docstring: str, link: Link) -> str:
    """The docstring in HTML: what is indented is a formula or code, and names are links."""
    return "\n".join(_block(block, link) for block in _blocks(cleandoc(docstring).splitlines()))


def summary(docstring: str) -> str:
    """The first sentence, as it was written."""
    first = " ".join(cleandoc(docstring).split("\n\n")[0].split())
    sentence = re.match(r".*?[.?!](?=\s+[A-Z`(]|$)", first)
    return sentence[0] if sentence else first


def inline(text: str, link: Link) -> str:
    """Words, with code between backticks and with names as links."""
    parts, end = [], 0
    for found in CODE.finditer(text):
        parts += [_words(text[end : found.start()], link), _code(found[2].strip(), link)]
        end = found.end()
    return "".join((*parts, _words(text[end:], link)))


def _words(text: str, link: Link) -> str:
    def linked(found: re.Match[str]) -> str:
        to = link(found[0])
        return f'<a href="{to}">{found[0]}</a>' if to else found[0]

    return CLASS.sub(linked, escape(text, quote=False))


def _code(text: str, link: Link) -> str:
    code = f"<code>{escape(text, quote=False)}</code>"
    to = link(re.sub(r"\(.*", "", text, flags=re.S))
    return f'<a href="{to}">{code}</a>' if to else code


def _blocks(lines: list[str]) -> list[list[str]]:
    """Runs of lines of one kind: a section of fields, a list, what is indented, a paragraph."""
    blocks: list[list[str]] = []
    open_kind = ""
    for k, line in enumerate(lines):
        kind = _kind(line)
        if not kind:
            following = next((after for after in lines[k:] if after.strip()), "")
            goes_on = open_kind in ("fields", "list", "indented") and following.startswith("  ")
            if goes_on:
                blocks[-1].append("")
            else:
                open_kind = ""
        elif (kind == "indented" and open_kind in ("fields", "list", "text")) or (
            kind == open_kind != "fields"
        ):
            blocks[-1].append(line)
        elif kind == "text" and open_kind == "list" and lines[k - 1].strip():
            blocks[-1].append(line)  # a line of the item above that is not indented
        else:
            blocks.append([line])
            open_kind = kind
    return blocks


def _kind(line: str) -> str:
    if not line.strip():
        return ""
    if FIELDS.match(line):
        return "fields"
    if line.startswith("  "):
        return "indented"
    return "list" if BULLET.match(line) else "text"


def _block(lines: list[str], link: Link) -> str:
    kind = _kind(lines[0])
    if kind == "fields":
        return _fields(lines[0].strip(": "), _items(lines[1:]), link)
    if kind == "list":
        items = [f"<li>{inline(item, link)}</li>" for item in _listed(lines)]
        return f"<ul>{''.join(items)}</ul>"
    if kind == "indented":
        return f"<pre>{escape(cleandoc(chr(10).join(['', *lines])), quote=False)}</pre>"
    return f"<p>{inline(' '.join(line.strip() for line in lines), link)}</p>"


def _listed(lines: list[str]) -> list[str]:
    items: list[str] = []
    for line in lines:
        if BULLET.match(line):
            items.append(BULLET.sub("", line, count=1))
        else:
            items[-1] += f" {line.strip()}"
    return items


def _items(lines: list[str]) -> list[str]:
    """Each field with the lines that belong to it: those that are indented further."""
    depth = min((len(line) - len(line.lstrip()) for line in lines if line.strip()), default=0)
    items: list[str] = []
    for line in lines:
        if line.strip() and not line[depth:].startswith(" "):
            items.append(line.strip())
        elif items and line.strip():
            items[-1] += f" {line.strip()}"
    return items


def _fields(title: str, items: list[str], link: Link) -> str:
    rows = []
    for item in items:
        found = FIELD.match(item)
        name, text = (found[1].strip("`* "), found[2]) if found else ("", item)
        term = f"<dt><code>{escape(name)}</code></dt>" if name else ""
        rows.append(f"{term}<dd>{inline(text, link)}</dd>")
    return f'<p class="part">{title}</p>\n<dl class="fields">{"".join(rows)}</dl>'


def checkout() -> Path:
    """The folder of the checkout. Raises BadFile for an installed wheel, which has no examples."""
    folder = Path(workbench.__file__).parents[1]
    for name in (FRONT, "examples", *DOCUMENTS):
        if not (folder / name).exists():
            raise BadFile(
                f"the site is built from a checkout, with its documents and examples; {folder} has "
                f"no {name}. `workbench lecture site FOLDER` writes the course alone"
            )
    return folder


def write_documents(source: Path, pages: Path) -> list[str]:
    """Write the front page and all documents; return the names of the documents' pages."""
    found = [source / name for name in DOCUMENTS] + sorted(
        source.glob(BENCHMARKS), key=lambda path: (path.name != FRONT, path.name)
    )
    for path in (source / FRONT, *found):
        place = path.relative_to(source)
        page = pages / (START if place == Path(FRONT) else place)
        page.parent.mkdir(parents=True, exist_ok=True)
        text = _linked(path.read_text(encoding="utf-8"), path.parent, source, pages)
        page.write_text(text, encoding="utf-8")
    return [path.relative_to(source).with_suffix("").as_posix() for path in found]


def contents(groups: dict[str, list[str]]) -> str:
    """The list of all pages beside each page, in groups with a title."""
    return "\n\n" + "\n\n".join(
        f"```{{toctree}}\n:hidden:\n:caption: {title}\n\n" + "\n".join(names) + "\n```"
        for title, names in groups.items()
    )


def _linked(text: str, here: Path, source: Path, pages: Path) -> str:
    """Links to examples lead to their pages; other files are copied; dead links become words."""

    def to(found: re.Match[str]) -> str:
        words, target, anchor = found[1], found[2], found[3] or ""
        path = Path(os.path.normpath(here / target))
        if not path.is_file() or source not in path.parents:
            return words.strip("![]")
        place = path.relative_to(source)
        if place == Path(FRONT):
            return f"{words}({os.path.relpath(source / START, here)}{anchor})"
        if path.parent == source / "examples" and path.suffix == ".py":
            return f"{words}({target.removesuffix('.py')}.md)"
        if path.suffix != ".md":
            copy = pages / place
            copy.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(path, copy)
        return found[0]

    parts = re.split(r"(^```.*?^```)", text, flags=re.S | re.M)
    return "".join(part if k % 2 else LINK.sub(to, part) for k, part in enumerate(parts))


@dataclass(frozen=True)
class ExampleRun:
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


def run_example(script: Path) -> ExampleRun:
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
    return ExampleRun(script.stem, source, done.stdout.rstrip(), tuple(figures))


def run_all(
    folder: Path, pattern: str, scratch: Path, tell: Callable[[str], None]
) -> list[ExampleRun]:
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


def write_example_pages(examples: list[ExampleRun], pages: Path) -> None:
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


def _page(example: ExampleRun) -> str:
    prose = rendered(example.docstring, lambda name: None)
    shown = [raw(prose)]
    shown += [f"![{figure.stem.replace('_', ' ')}]({figure.name})" for figure in example.figures]
    if example.printed:
        shown += ["## Printed output", fenced(example.printed, "text")]
    shown += ["## Source", f"`examples/{example.name}.py`", fenced(example.code, "python")]
    return f"# {_capital(example.title)}\n\n" + "\n\n".join(shown) + "\n"


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]


def write_licence_page(pages: Path, ours: tuple[str, ...], folder: Path) -> None:
    """Write a page with links to the workbench's own texts and to those in the folder."""
    texts = [*ours, *sorted(f"{folder.name}/{path.name}" for path in folder.iterdir())]
    items = "".join(f'<li><a href="{text}">{text}</a></li>' for text in texts)
    listed = raw(f"<ul>{items}</ul>")
    (pages / "licences.md").write_text(
        "# Licences\n\nThe licence of the workbench, its notices, and the licences of the "
        f"libraries whose style sheets, scripts and fonts are part of this site.\n\n{listed}\n",
        encoding="utf-8",
    )
