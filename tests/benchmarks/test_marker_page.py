"""The page on markers says what its stored results say."""

import json
from pathlib import Path

import numpy as np

from benchmarks.images.markers import RESULTS

PAGE = Path(RESULTS).parent.parent / "MARKERS.md"
COLUMNS = (
    ("shape_before", 1),
    ("offsets_before", 2),
    ("shape", 2),
    ("offsets", 2),
    ("choosing_seconds", 2),
    ("seconds", 2),
)


def test_the_page_holds_the_means_of_the_stored_results() -> None:
    text = PAGE.read_text()
    rows = json.loads(RESULTS.read_text())["rows"]
    assert list(rows) == ["random", "spread", "informative"]
    for name, several in rows.items():
        means = [f"{np.mean([r[key] for r in several]):.{digits}f}" for key, digits in COLUMNS]
        assert f"| {name} | {' | '.join(means)} |" in text
        assert len(several) == 8
