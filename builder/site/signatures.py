"""Signatures as the source has them: short types, one argument a line where they are many."""

import ast
from itertools import chain, repeat

WIDEST = 76  # characters of a signature on one line
LONGEST = 60  # characters of a default that is shown


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
