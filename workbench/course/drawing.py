"""The code that draws a figure, apart from the code that computes what it shows.

Whoever reads a lecture wants the second. So in notebooks and on the site the first is a cell of its
own that is folded, and that a click opens. Imports are folded too.
"""

import ast

DRAWS = "with house_style():"
FOLDED = {"tags": ["hide-input"], "jupyter": {"source_hidden": True}}  # MyST-NB; JupyterLab


def apart(code: str) -> tuple[str, str]:
    """The code of a cell up to where it begins to draw, and from there on; either may be empty.

    A lecture draws from the first statement `with house_style():` to the end of the cell.
    """
    lines = code.splitlines()
    for statement in ast.parse(code).body:
        if isinstance(statement, ast.With) and lines[statement.lineno - 1].startswith(DRAWS):
            first = statement.lineno - 1
            while first > 0 and lines[first - 1].startswith("#"):  # its comment goes with it
                first -= 1
            return "\n".join(lines[:first]).rstrip(), "\n".join(lines[first:])
    return code, ""


def only_imports(code: str) -> bool:
    """Whether a cell does nothing but import names."""
    return all(isinstance(one, ast.Import | ast.ImportFrom) for one in ast.parse(code).body)
