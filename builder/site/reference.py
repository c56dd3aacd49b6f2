"""The pages of the API reference: a room's index, and a page for every public name."""

import ast
import re
from collections import defaultdict
from html import escape
from pathlib import Path

from builder.site.docstrings import Link, inline, rendered, summary
from builder.site.examples import Example, fenced, raw
from builder.site.inventory import Entry, inventory, listed, resolve, tree
from builder.site.signatures import fields, is_property, of_class, of_function

WORD = re.compile(r"[A-Za-z_]\w*")
PLOT, CAPTION = "plot_", "caption_"  # the names of a figure's functions begin so
INTRODUCTION = (
    "Every public name of the workbench has a page, under the package that defines it. The "
    "names in the first table are what most programs need: after `import workbench as wb` they are "
    "`wb.solve` and so on, and each has an example that was run when this site was built."
)


class Reference:
    """The public names, their pages, and the examples that show them."""

    def __init__(self, examples: list[Example]) -> None:
        self.entries = inventory()
        self.rooms: dict[str, list[Entry]] = defaultdict(list)
        for entry in self.entries:
            self.rooms[entry.room].append(entry)
        self.examples = {name: example for example in examples for name in example.names}
        self.pages: dict[Entry, str] = {}
        taken: set[str] = set()
        for entry in self.entries:
            page = f"{entry.room}/{entry.name}"
            while page.casefold() in taken or page.endswith("/index"):
                page += "_"  # `Start` and `start` are one file on some machines
            taken.add(page.casefold())
            self.pages[entry] = page

    def write(self, folder: Path) -> None:
        """Write all pages into a folder of their own."""
        folder.mkdir(parents=True)
        rooms = list(self.rooms)
        (folder / "index.md").write_text(self._index(rooms), encoding="utf-8")
        for room in rooms:
            (folder / room).mkdir()
            (folder / room / "index.md").write_text(self._room(room), encoding="utf-8")
        for entry, page in self.pages.items():
            (folder / f"{page}.md").write_text(self._page(entry), encoding="utf-8")

    def link(self, entry: Entry) -> Link:
        """The links of an entry's page: names of its own room come first, then public ones."""

        def to(name: str) -> str | None:
            head, _, member = name.removeprefix("workbench.").removeprefix("wb.").partition(".")
            if name in _members(entry):
                return f"#{name}"
            found = [one for one in self.entries if one.name == head]
            if head.islower() and not member:  # a word of the language, or an argument, more often
                near = [one for one in found if one.public or one.room == entry.room]
                found = [] if head in _arguments(entry) else near
            found.sort(key=lambda one: (one.room != entry.room, not one.public))
            if not found:
                return None
            other = found[0]
            if member in _members(other):
                return f"../{self.pages[other]}.html#{member}"
            return None if other is entry or member else f"../{self.pages[other]}.html"

        return to

    def _index(self, rooms: list[str]) -> str:
        public = [entry for entry in self.entries if entry.public]
        table = "".join(
            f'<tr><td><a href="{self.pages[entry]}.html"><code>{entry.name}</code></a></td>'
            f"<td>{inline(entry.summary, _nowhere)}</td></tr>"
            for entry in sorted(public, key=lambda one: one.name.casefold())
        )
        floors = "".join(
            f'<tr><td><a href="{room}/index.html">{room}</a></td>'
            f"<td>{inline(_about(room), _nowhere)}</td><td>{len(self.rooms[room])}</td></tr>"
            for room in rooms
        )
        return (
            f"# Reference\n\n{INTRODUCTION}\n\n"
            + raw(f'<table class="names">{table}</table>')
            + "\n\n"
            + raw(
                '<h2>Rooms</h2><table class="names"><tr><th>room</th><th></th><th>names</th></tr>'
                f"{floors}</table>"
            )
            + "\n\n```{toctree}\n:hidden:\n\n"
            + "\n".join(f"{room}/index" for room in rooms)
            + "\n```\n"
        )

    def _room(self, room: str) -> str:
        captions = {e.name: e for e in self.rooms[room] if e.name.startswith(CAPTION)}
        drawn = {e.name.replace(PLOT, CAPTION, 1) for e in self.rooms[room]} & captions.keys()
        rows = ""
        for entry in self.rooms[room]:
            if entry.name in drawn:
                continue  # it has no row of its own: it stands beside the figure
            about = inline(entry.summary, _nowhere)
            caption = captions.get(entry.name.replace(PLOT, CAPTION, 1))
            if caption is not None:
                to = f"../{self.pages[caption]}.html"
                about += f' Its caption: <a href="{to}">{caption.name}</a>.'
            rows += (
                f'<tr><td><a href="../{self.pages[entry]}.html"><code>{entry.name}</code></a></td>'
                f"<td>{about}</td></tr>"
            )
        names = "\n".join(Path(self.pages[entry]).name for entry in self.rooms[room])
        table = f'<p>{inline(_about(room), _nowhere)}</p><table class="names">{rows}</table>'
        return f"# {room}\n\n{raw(table)}\n\n```{{toctree}}\n:hidden:\n\n{names}\n```\n"

    def _page(self, entry: Entry) -> str:
        link, node = self.link(entry), entry.definition
        call = f"wb.{entry.name}" if entry.public else f"from {entry.exported} import {entry.name}"
        head = [f'<p class="facts"><code>{call}</code></p>']
        if isinstance(node, ast.ClassDef):
            head.append(_linked(of_class(node), link))
            if node.bases and not of_class(node):
                bases = ", ".join(inline(f"`{ast.unparse(base)}`", link) for base in node.bases)
                head.append(f'<p class="facts">A kind of {bases}.</p>')
        elif isinstance(node, ast.FunctionDef):
            head.append(_linked(of_function(node, node.name, method=False), link))
        elif node is not None:
            head.append(_linked(ast.unparse(node), link))
        head.append(rendered(entry.docstring, link))
        parts = [f"# {entry.name}", raw("\n".join(head))]
        if example := self.examples.get(entry.name) if entry.public else None:
            parts += [
                raw(f"<h2>Example</h2>\n<p>{inline(example.purpose, link)}</p>"),
                fenced(example.code, "python"),
                fenced(example.printed, "text"),
            ]
        if isinstance(node, ast.ClassDef):
            parts.append(raw(_described(node, link)))
        elif node is None:
            parts.append(raw(self._contents(entry, link)))
        return "\n\n".join(parts) + "\n"

    def _contents(self, entry: Entry, link: Link) -> str:
        """The names of a module that is itself a public name."""
        rows = []
        for name in listed(entry.module):
            place = resolve(entry.module, name)[0]
            found = next(e for e in self.entries if (e.module, e.name) == (place, name))
            about = inline(found.summary, _nowhere)
            rows.append(f"<tr><td>{inline(f'`{name}`', link)}</td><td>{about}</td></tr>")
        return f"<table>{''.join(rows)}</table>"


def _described(node: ast.ClassDef, link: Link) -> str:
    """The members of a class that it defines itself: what is read, then what is called."""
    read, called = [], []
    undocumented = [each for each in fields(node) if not of_class(node)]
    for field in undocumented:
        text = f"{ast.unparse(field.target)}: {ast.unparse(field.annotation)}"
        read.append(_member(ast.unparse(field.target), text, "", link))
    for each in node.body:
        if isinstance(each, ast.Assign) and _is_enumeration(node):
            read.append(_member(ast.unparse(each.targets[0]), ast.unparse(each), "", link))
        if not isinstance(each, ast.FunctionDef) or each.name.startswith("_"):
            continue
        docstring = ast.get_docstring(each) or ""
        if is_property(each):
            kind = "" if each.returns is None else f": {ast.unparse(each.returns)}"
            read.append(_member(each.name, each.name + kind, docstring, link))
        else:
            text = of_function(each, each.name, method=True)
            called.append(_member(each.name, text, docstring, link))
    parts = [("Values" if _is_enumeration(node) else "Properties", read), ("Methods", called)]
    return "\n".join(f"<h2>{title}</h2>\n" + "\n".join(found) for title, found in parts if found)


def _member(name: str, text: str, docstring: str, link: Link) -> str:
    about = f'<div class="about">{rendered(docstring, link)}</div>' if docstring else ""
    return f'<div class="member" id="{name}">{_linked(text, link)}{about}</div>'


def _linked(signature: str, link: Link) -> str:
    """A signature with its types as links."""

    def word(found: re.Match[str]) -> str:
        to = link(found[0]) if found[0][0].isupper() else None
        return f'<a href="{to}">{found[0]}</a>' if to else found[0]

    text = WORD.sub(word, escape(signature, quote=False).replace("&gt;", ">"))
    return f'<pre class="signature">{text}</pre>' if signature else ""


def _members(entry: Entry) -> set[str]:
    node = entry.definition
    if not isinstance(node, ast.ClassDef):
        return set()
    bare = [] if of_class(node) else [ast.unparse(each.target) for each in fields(node)]
    return {
        *bare,
        *(
            each.name
            for each in node.body
            if isinstance(each, ast.FunctionDef) and not each.name.startswith("_")
        ),
    }


def _arguments(entry: Entry) -> set[str]:
    node = entry.definition
    if isinstance(node, ast.ClassDef):
        made = [each for each in node.body if isinstance(each, ast.FunctionDef)]
        inside = {arg.arg for each in made for arg in ast.walk(each) if isinstance(arg, ast.arg)}
        return inside | {ast.unparse(each.target) for each in fields(node)}
    return {arg.arg for arg in ast.walk(node) if isinstance(arg, ast.arg)} if node else set()


def _is_enumeration(node: ast.ClassDef) -> bool:
    return any("Enum" in ast.unparse(base) for base in node.bases)


def _about(room: str) -> str:
    return summary(ast.get_docstring(tree(f"workbench.{room}")) or "")


def _nowhere(name: str) -> str | None:
    return None
