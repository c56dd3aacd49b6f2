"""Known answers of the gym: where they are kept, and how those without a formula are found.

`python -m benchmarks.gym.search` writes `data/answers.json` again. Where a problem has no answer in
a formula, SciPy's trf searches from where the data were made or, for published problems, from the
start and points around it, and Newton's method in 40 digits refines the lowest end.
"""

import json
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from workbench.arrays import Array
from workbench.fitting.setup import KnownAnswer

FILE = Path(__file__).parent / "data" / "answers.json"


@cache
def stored() -> dict[str, Any]:
    """The contents of the file: by problem its `cost` and the free numbers `x`."""
    found: dict[str, Any] = json.loads(FILE.read_text()) if FILE.exists() else {}
    return found


def known(name: str, source: str) -> KnownAnswer | None:
    """The stored answer of a problem; None while there is none.

    Only the cost is known in the sense of `KnownAnswer`: the same minimum may have several points.
    """
    answer = stored().get(name)
    return None if answer is None else KnownAnswer(source, answer["cost"])


def point(name: str) -> Array:
    """(n,) the free numbers of the stored answer, in the order of the layout."""
    return np.array(stored()[name]["x"], dtype=float)
