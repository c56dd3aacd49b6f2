"""Numbers of a benchmark, and what is written from them, on their way to a file."""

import json
import re
from pathlib import Path
from typing import Any


def keep(file: Path, data: Any, digits: int) -> None:
    """As JSON, to so many digits, with every list of numbers on a line of its own."""
    rounded = json.loads(
        json.dumps(data), parse_float=lambda said: float(f"{float(said):.{digits}g}")
    )
    text = json.dumps(rounded, indent=1)
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(re.sub(r"\[[^][{}]*\]", lambda match: " ".join(match[0].split()), text) + "\n")


def write_between(file: Path, begin: str, end: str, text: str) -> None:
    """Put lines between two marks in a file that has them."""
    before, _, rest = file.read_text(encoding="utf-8").partition(begin)
    after = rest.partition(end)[2]
    file.write_text(f"{before}{begin}\n{text}\n{end}{after}", encoding="utf-8")
