"""The pages of the API reference: a package's index, and a page for every public name."""

import ast
import re
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from html import escape
from itertools import chain, repeat
from pathlib import Path

import workbench
from builder.site.pages import ExampleRun, Link, fenced, inline, raw, rendered, summary

FRONT_DOOR = "workbench"
ARRAYS = "workbench.arrays"  # the kinds of arrays need no page
SHORT = 60  # characters of a value that stands for a description
PACKAGE = Path(workbench.__file__).parent
Definition = ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef | ast.Assign | ast.AnnAssign
WIDEST = 76  # characters of a signature on one line
LONGEST = 60  # characters of a default that is shown
WORD = re.compile(r"[A-Za-z_]\w*")
PLOT, CAPTION = "plot_", "caption_"  # the names of a figure's functions begin so
INTRODUCTION = (
    "Every public name of the workbench has a page, under the package that defines it. The "
    "names in the first table are what most programs need: after `import workbench as wb` they are "
    "`wb.solve` and so on, and each has an example that was run when this site was built."
)


@dataclass(frozen=True, eq=False)
class PublicName:
    """A public name and its definition.

    Attributes:
        name: the name itself.
        module: the full name of the module that defines it.
        definition: its statement in the source; None of a module.
        public: whether `workbench.__all__` has it.
        exported: the package that users import it from.
    """

    name: str
    module: str
    definition: Definition | None
    public: bool
    exported: str

    @property
    def package(self) -> str:
        """The package or module of `workbench` that it lives in."""
        return self.module.split(".")[1]

    @property
    def docstring(self) -> str:
        """The docstring, or the comment at the definition of a constant or a type alias."""
        if self.definition is None:
            return ast.get_docstring(tree(self.module)) or ""
        if isinstance(self.definition, ast.Assign | ast.AnnAssign):
            return _comment(self.module, self.definition)
        return ast.get_docstring(self.definition) or ""

    @property
    def summary(self) -> str:
        """The first sentence of the docstring; of a constant without one, its type or value."""
        node = self.definition
        if not self.docstring and isinstance(node, ast.AnnAssign):
            return f"`{ast.unparse(node.annotation)}`"
        if not self.docstring and isinstance(node, ast.Assign):
            value = ast.unparse(node.value)
            return f"`{value}`" if len(value) <= SHORT else ""
        return summary(self.docstring)


def inventory() -> list[PublicName]:
    """All public names, by package and name.

    These are the names in the `__all__` of every package, all errors, and the types that the
    arguments and results of `workbench.__all__` are annotated with.
    """
    found: dict[tuple[str, str], PublicName] = {}
    for package, name in _exported():
        module, definition = resolve(package, name)
        place = (module, name)
        foreign = definition is None and not module.endswith(f".{name}")
        if place in found or foreign:
            continue
        public = package == FRONT_DOOR
        found[place] = PublicName(name, module, definition, public, package)
    for entry in [entry for entry in found.values() if entry.public]:
        for module, name, definition in annotated(entry):
            found.setdefault((module, name), PublicName(name, module, definition, False, module))
    return sorted(found.values(), key=lambda e: (e.package, e.name.casefold(), e.name))


def annotated(entry: PublicName) -> Iterator[tuple[str, str, Definition]]:
    """What of ours the arguments and results of a function or a class name, with its module."""
    node = entry.definition
    parts: list[ast.expr | None] = []
    results: list[ast.expr | None] = []
    if isinstance(node, ast.FunctionDef):
        parts = _annotations(node)
    elif isinstance(node, ast.ClassDef):
        parts = [each.annotation for each in node.body if isinstance(each, ast.AnnAssign)]
        for each in node.body:
            if isinstance(each, ast.FunctionDef) and each.name == "__init__":
                parts += _annotations(each)
            elif isinstance(each, ast.FunctionDef) and not each.name.startswith("_"):
                results += _annotations(each)
    for part in parts + results:
        for name in ast.walk(part) if part is not None else ():
            if not isinstance(name, ast.Name):
                continue
            module, found = resolve(entry.module, name.id)
            alias = isinstance(found, ast.Assign) and "TypeVar" not in ast.unparse(found.value)
            if found is None or module == ARRAYS:
                continue
            if isinstance(found, ast.ClassDef) or (alias and part in parts):
                yield module, name.id, found


def _annotations(node: ast.FunctionDef) -> list[ast.expr | None]:
    given = node.args
    every = (*given.posonlyargs, *given.args, *given.kwonlyargs)
    return [node.returns, *(argument.annotation for argument in every)]


def resolve(module: str, name: str) -> tuple[str, Definition | None]:
    """The module that defines a name, and its definition; None where it is none of ours."""
    for node in ast.walk(tree(module)):
        if not isinstance(node, ast.ImportFrom) or not _ours(node.module or ""):
            continue
        source = str(node.module)
        for alias in node.names:
            if (alias.asname or alias.name) == name:
                whole = f"{source}.{alias.name}"
                found = (source, None) if source == module else resolve(source, alias.name)
                return (whole, None) if found[1] is None and path_of(whole) else found
    last: Definition | None = None
    for node in tree(module).body:
        if name in _defined(node) and isinstance(node, Definition):
            last = node  # the last of several: the others are overloads
    return module, last


@cache
def tree(module: str) -> ast.Module:
    """The parsed source of a module."""
    path = path_of(module)
    assert path is not None, module
    return ast.parse(path.read_text(encoding="utf-8"))


def path_of(module: str) -> Path | None:
    """The file of a module of ours, or None where there is none."""
    folder = PACKAGE.joinpath(*module.split(".")[1:])
    for path in (folder / "__init__.py", folder.with_suffix(".py")):
        if path.is_file() and _ours(module):
            return path
    return None


def listed(module: str) -> list[str]:
    """The `__all__` of a module; empty where it has none."""
    for node in tree(module).body:
        if isinstance(node, ast.Assign) and "__all__" in _defined(node):
            names: list[str] = ast.literal_eval(node.value)
            return names
    return []


def _exported() -> Iterator[tuple[str, str]]:
    """Every package with each name that it exports; the front door first, then all errors."""
    packages = sorted(
        ".".join((FRONT_DOOR, *path.parent.relative_to(PACKAGE).parts))
        for path in PACKAGE.rglob("__init__.py")
    )
    for package in packages:
        for name in listed(package):
            yield package, name
    for node in tree("workbench.errors").body:
        if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
            yield "workbench.errors", node.name


def _ours(module: str) -> bool:
    return module.split(".")[0] == FRONT_DOOR


def _defined(node: ast.stmt) -> set[str]:
    if isinstance(node, ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
        return {node.name}
    targets = (
        node.targets
        if isinstance(node, ast.Assign)
        else [node.target]
        if isinstance(node, ast.AnnAssign)
        else []
    )
    return {each.id for each in targets if isinstance(each, ast.Name)}


def _comment(module: str, node: ast.stmt) -> str:
    """The comment above a statement, or at the end of its first line."""
    path = path_of(module)
    assert path is not None
    lines = path.read_text(encoding="utf-8").splitlines()
    above = []
    for line in reversed(lines[: node.lineno - 1]):
        if not line.startswith("#"):
            break
        above.append(line.lstrip("# "))
    text = " ".join(reversed(above)) or lines[node.lineno - 1].partition("  # ")[2]
    return f"{text[:1].upper()}{text[1:]}{'' if text.endswith('.') or not text else '.'}"


def of_function(node: ast.FunctionDef | ast.AsyncFunctionDef, name: str, method: bool) -> str:
    """`name(arguments) -> result`; a method is shown without `self`."""
    arguments = _arguments(node.args)
    if method and arguments and not _decorated(node, "staticmethod"):
        arguments = arguments[1:]
    result = "" if node.returns is None else f" -> {ast.unparse(node.returns)}"
    return laid_out(name, arguments, result)


def of_class(node: ast.ClassDef) -> str:
    """How an instance is made; empty for what users do not make, such as enumerations."""
    bases = {ast.unparse(base).split("[")[0] for base in node.bases}
    if bases & {"Enum", "StrEnum", "IntEnum", "Protocol"}:
        return ""
    for each in node.body:
        if isinstance(each, ast.FunctionDef) and each.name == "__init__":
            return laid_out(node.name, _arguments(each.args)[1:], "")
    if "NamedTuple" in bases or any("dataclass" in ast.unparse(d) for d in node.decorator_list):
        return laid_out(node.name, [_field(each) for each in fields(node)], "")
    return ""


def fields(node: ast.ClassDef) -> list[ast.AnnAssign]:
    """The fields of a dataclass that its maker takes, or the members that a protocol names."""
    return [
        each
        for each in node.body
        if isinstance(each, ast.AnnAssign)
        and isinstance(each.target, ast.Name)
        and not each.target.id.startswith("_")
        and "ClassVar" not in ast.unparse(each.annotation)
        and not (each.value is not None and "init=False" in ast.unparse(each.value))
    ]


def laid_out(name: str, arguments: list[str], result: str) -> str:
    """On one line, or with a line for every argument."""
    short = f"{name}({', '.join(arguments)}){result}"
    if len(short) <= WIDEST:
        return short
    return f"{name}(\n" + "".join(f"    {each},\n" for each in arguments) + f"){result}"


def is_property(node: ast.FunctionDef | ast.AsyncFunctionDef) -> bool:
    """Whether it is read without being called."""
    return _decorated(node, "property")


def _decorated(node: ast.FunctionDef | ast.AsyncFunctionDef, name: str) -> bool:
    return any(ast.unparse(each).endswith(name) for each in node.decorator_list)


def _field(node: ast.AnnAssign) -> str:
    text = f"{ast.unparse(node.target)}: {ast.unparse(node.annotation)}"
    value = node.value
    if isinstance(value, ast.Call) and ast.unparse(value.func).endswith("field"):
        given = {word.arg: word.value for word in value.keywords}
        if "default_factory" in given:
            return f"{text} = ..."
        value = given.get("default")
    return text + _default(value)


def _default(value: ast.expr | None) -> str:
    if value is None:
        return ""
    text = ast.unparse(value)
    return f" = {text if len(text) <= LONGEST else '...'}"


def _arguments(given: ast.arguments) -> list[str]:
    """Each with its annotation and default, and the marks / and * between them."""
    placed = [*given.posonlyargs, *given.args]
    missing = repeat(None, len(placed) - len(given.defaults))
    found = [_argument(a, d) for a, d in zip(placed, chain(missing, given.defaults), strict=True)]
    if given.posonlyargs:
        found.insert(len(given.posonlyargs), "/")
    if given.vararg:
        found.append("*" + _argument(given.vararg, None))
    elif given.kwonlyargs:
        found.append("*")
    found += [_argument(a, d) for a, d in zip(given.kwonlyargs, given.kw_defaults, strict=True)]
    return [*found, *(["**" + _argument(given.kwarg, None)] if given.kwarg else [])]


def _argument(given: ast.arg, default: ast.expr | None) -> str:
    annotation = "" if given.annotation is None else f": {ast.unparse(given.annotation)}"
    return given.arg + annotation + _default(default)


class Reference:
    """The public names, their pages, and the examples that show them."""

    def __init__(self, examples: list[ExampleRun]) -> None:
        self.entries = inventory()
        self.packages: dict[str, list[PublicName]] = defaultdict(list)
        for entry in self.entries:
            self.packages[entry.package].append(entry)
        self.examples = {name: example for example in examples for name in example.names}
        self.pages: dict[PublicName, str] = {}
        taken: set[str] = set()
        for entry in self.entries:
            page = f"{entry.package}/{entry.name}"
            while page.casefold() in taken or page.endswith("/index"):
                page += "_"  # `Start` and `start` are one file on some machines
            taken.add(page.casefold())
            self.pages[entry] = page

    def write(self, folder: Path) -> None:
        """Write all pages into a folder of their own."""
        folder.mkdir(parents=True)
        packages = list(self.packages)
        (folder / "index.md").write_text(self._index(packages), encoding="utf-8")
        for package in packages:
            (folder / package).mkdir()
            (folder / package / "index.md").write_text(self._package(package), encoding="utf-8")
        for entry, page in self.pages.items():
            (folder / f"{page}.md").write_text(self._page(entry), encoding="utf-8")

    def link(self, entry: PublicName) -> Link:
        """The links of an entry's page: names of its own package come first, then public ones."""

        def to(name: str) -> str | None:
            head, _, member = name.removeprefix("workbench.").removeprefix("wb.").partition(".")
            if name in _members(entry):
                return f"#{name}"
            found = [one for one in self.entries if one.name == head]
            if head.islower() and not member:  # a word of the language, or an argument, more often
                near = [one for one in found if one.public or one.package == entry.package]
                found = [] if head in _argument_names(entry) else near
            found.sort(key=lambda one: (one.package != entry.package, not one.public))
            if not found:
                return None
            other = found[0]
            if member in _members(other):
                return f"../{self.pages[other]}.html#{member}"
            return None if other is entry or member else f"../{self.pages[other]}.html"

        return to

    def _index(self, packages: list[str]) -> str:
        public = [entry for entry in self.entries if entry.public]
        table = "".join(
            f'<tr><td><a href="{self.pages[entry]}.html"><code>{entry.name}</code></a></td>'
            f"<td>{inline(entry.summary, _nowhere)}</td></tr>"
            for entry in sorted(public, key=lambda one: one.name.casefold())
        )
        floors = "".join(
            f'<tr><td><a href="{package}/index.html">{package}</a></td>'
            f"<td>{inline(_about(package), _nowhere)}</td>"
            f"<td>{len(self.packages[package])}</td></tr>"
            for package in packages
        )
        return (
            f"# Reference\n\n{INTRODUCTION}\n\n"
            + raw(f'<table class="names">{table}</table>')
            + "\n\n"
            + raw(
                '<h2>Packages</h2><table class="names">'
                "<tr><th>package</th><th></th><th>names</th></tr>"
                f"{floors}</table>"
            )
            + "\n\n```{toctree}\n:hidden:\n\n"
            + "\n".join(f"{package}/index" for package in packages)
            + "\n```\n"
        )

    def _package(self, package: str) -> str:
        captions = {e.name: e for e in self.packages[package] if e.name.startswith(CAPTION)}
        drawn = {e.name.replace(PLOT, CAPTION, 1) for e in self.packages[package]} & captions.keys()
        rows = ""
        for entry in self.packages[package]:
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
        names = "\n".join(Path(self.pages[entry]).name for entry in self.packages[package])
        table = f'<p>{inline(_about(package), _nowhere)}</p><table class="names">{rows}</table>'
        return f"# {package}\n\n{raw(table)}\n\n```{{toctree}}\n:hidden:\n\n{names}\n```\n"

    def _page(self, entry: PublicName) -> str:
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

    def _contents(self, entry: PublicName, link: Link) -> str:
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


def _members(entry: PublicName) -> set[str]:
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


def _argument_names(entry: PublicName) -> set[str]:
    node = entry.definition
    if isinstance(node, ast.ClassDef):
        made = [each for each in node.body if isinstance(each, ast.FunctionDef)]
        inside = {arg.arg for each in made for arg in ast.walk(each) if isinstance(arg, ast.arg)}
        return inside | {ast.unparse(each.target) for each in fields(node)}
    return {arg.arg for arg in ast.walk(node) if isinstance(arg, ast.arg)} if node else set()


def _is_enumeration(node: ast.ClassDef) -> bool:
    return any("Enum" in ast.unparse(base) for base in node.bases)


def _about(package: str) -> str:
    return summary(ast.get_docstring(tree(f"workbench.{package}")) or "")


def _nowhere(name: str) -> str | None:
    return None
