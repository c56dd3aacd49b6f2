"""Answers that are alike: for a remark to the lecturer, who has to judge what it means.

Two right answers to a short exercise are often the same by chance.
"""

import ast
import builtins
from collections.abc import Iterable
from dataclasses import dataclass
from difflib import SequenceMatcher

SHORT = 120  # words of a function below which likeness may be chance: four or five lines
SHORTEST_NEAR = 60  # words below which near likeness says nothing
NEAR = 0.9  # the share of words in the same order, from which on two functions are nearly the same
LEAST = 12  # words below which nothing is compared at all


@dataclass(frozen=True)
class Shape:
    """A function without its names, text and layout.

    Attributes:
        words: the kinds of its parts, names by the order of their appearance, and numbers.
        text: the code as it was written, without docstring and comments.
    """

    words: tuple[str, ...]
    text: str


def shapes(source: str) -> dict[str, Shape]:
    """The shape of each function of a file, with what it calls there; none if it is no code."""
    functions = {
        node.name: node
        for node in _parsed(source).body
        if isinstance(node, ast.FunctionDef) and node.body
    }
    return {name: _shape(name, functions) for name in functions}


def _parsed(source: str) -> ast.Module:
    """The code of a file; empty if it is none."""
    try:
        return ast.parse(source)
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        return ast.Module([], [])


def attempted(source: str, exercises: Iterable[str]) -> bool:
    """Whether a file holds more than these functions as they were handed out."""
    tree = _parsed(source)
    for node in tree.body:
        if isinstance(node, ast.FunctionDef) and node.name in exercises:
            rest = _without_docstring(node).body
            if len(rest) != 1 or "raise Unsolved(" not in ast.unparse(rest[0]):
                return True
    return not any(isinstance(n, ast.FunctionDef) and n.name in exercises for n in tree.body)


def compared(a: Shape, b: Shape) -> str:
    """How far two answers are the same: `the same word for word`; nothing if they are not.

    Of short answers it says that this may be chance.
    """
    if min(len(a.words), len(b.words)) < LEAST:
        return ""
    shorter = min(len(a.words), len(b.words))
    short = shorter < SHORT
    chance = ", but short, so that this may be chance" if short else ""
    if a.text == b.text:
        return f"the same word for word{chance}"
    if a.words == b.words:
        return f"the same but for names{chance}"
    if shorter < SHORTEST_NEAR:
        return ""
    match = SequenceMatcher(None, a.words, b.words, autojunk=False)
    if match.real_quick_ratio() < NEAR or match.quick_ratio() < NEAR or match.ratio() < NEAR:
        return ""
    return f"nearly the same{chance}"


def constants(source: str) -> set[float]:
    """The numbers with three or more digits that stand in a file."""
    found = {
        float(node.value)
        for node in ast.walk(_parsed(source))
        if isinstance(node, ast.Constant)
        and isinstance(node.value, int | float)
        and abs(node.value) < 1e300
    }
    return {number for number in found if distinctive(number)}


def words_of(source: str) -> set[str]:
    """All names that a file uses, imports or has as text, without comments."""
    found: set[str] = set()
    for node in ast.walk(_parsed(source)):
        match node:
            case ast.Name(id=name) | ast.Attribute(attr=name) | ast.Constant(value=str(name)):
                found.add(name)
            case ast.alias(name=name):
                found |= set(name.split("."))
            case ast.ImportFrom(module=str(name)):
                found |= set(name.split("."))
    return found


def distinctive(number: float) -> bool:
    """Whether a number has so many digits that two people hardly choose it independently."""
    return len(f"{abs(number):.12g}".replace(".", "").strip("0")) >= 3


def _shape(name: str, functions: dict[str, ast.FunctionDef]) -> Shape:
    words: list[str] = []
    names: dict[str, str] = {}
    texts: list[str] = []
    waiting, done = [name], set()
    while waiting:
        one = waiting.pop(0)
        if one in done:
            continue
        done.add(one)
        node = _without_docstring(functions[one])
        texts.append(ast.unparse(node))
        for part in node.body:
            _walk(part, words, names)
        called = [n.id for n in ast.walk(node) if isinstance(n, ast.Name) and n.id in functions]
        waiting += sorted(set(called) - done, key=called.index)
    return Shape(tuple(words), "\n".join(texts))


def _without_docstring(node: ast.FunctionDef) -> ast.Module:
    said = isinstance(node.body[0], ast.Expr) and isinstance(node.body[0].value, ast.Constant)
    return ast.Module(node.body[1:] if said else node.body, [])


def _walk(node: ast.AST, words: list[str], names: dict[str, str]) -> None:
    words.append(type(node).__name__)
    if isinstance(node, ast.Name):
        known = hasattr(builtins, node.id) or node.id in ("np", "numpy", "scipy", "cs", "wb")
        words.append(node.id if known else names.setdefault(node.id, f"name {len(names)}"))
    elif isinstance(node, ast.Attribute):
        words.append(node.attr)
    elif isinstance(node, ast.Constant):
        words.append(repr(node.value)[:40])
    for child in ast.iter_child_nodes(node):
        if not isinstance(child, ast.expr_context):
            _walk(child, words, names)
