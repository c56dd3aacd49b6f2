"""Reading TOML files of unknown origin."""

import re
import tomllib
from pathlib import Path
from typing import Any

from workbench.errors import BadFile, cut
from workbench.reading.facts import bounded

MOST_BYTES = 2**20  # a hundred calibrated cameras take a twentieth of that
MOST_PARTS = 20  # of a dotted key: Python's parser looks at each part once for every part after it
DOTTED = re.compile(  # so many parts in one key, bare or quoted; numbers have one dot
    rf"""(?:(?<![\w-])[\w-]++|"[^"\n]*+"|'[^'\n]*+')"""
    rf"""(?:[ \t]*+\.[ \t]*+(?:[\w-]++|"[^"\n]*+"|'[^'\n]*+')){{{MOST_PARTS}}}"""
)


def toml_in(path: Path) -> dict[str, Any]:
    """The contents of a TOML file. Raises BadFile with a sentence that names the file."""
    try:
        text = bounded(path, MOST_BYTES).decode("utf-8-sig")  # editors on Windows begin with a mark
        if found := DOTTED.search(text):
            line = text.count("\n", 0, found.start()) + 1
            raise BadFile(f"a key in line {line} has more than {MOST_PARTS} parts")
        return tomllib.loads(text)
    except (OSError, ValueError, RecursionError, BadFile) as error:  # too deep, or no UTF-8
        raise BadFile(f"{path} cannot be read as TOML: {cut(error)}") from error
