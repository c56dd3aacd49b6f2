"""Numbers of a benchmark on their way to a file."""

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
