"""Docstrings as HTML: prose, lists, formulas and fields, whatever characters are in them."""

import re
from collections.abc import Callable
from html import escape
from inspect import cleandoc

Link = Callable[[str], str | None]  # a name, maybe dotted, to the address of its description

FIELDS = re.compile(r"(Attributes|Args|Arguments|Parameters|Members|Returns|Raises):\s*$")
FIELD = re.compile(r"(\*{0,2}[\w.`, /]+?)\s*(?:\([^)]*\))?:\s+(.*)", re.S)
BULLET = re.compile(r"(?:[-*•]|\d+[.)])\s+")
CODE = re.compile(r"(?<!`)(`{1,2})(?!`)(.+?)(?<!`)\1(?!`)", re.S)
CLASS = re.compile(r"\b(?:wb\.)?[A-Z]+[a-z]\w*\b")  # names of classes are links also without code


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
