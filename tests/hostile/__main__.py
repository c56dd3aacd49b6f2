"""Attack every reader, and say in a table what was seen.

    python -m tests.hostile [--cases 1000] [--seed 7] [--keep] [FORMAT ...]

`--keep` puts one file of each kind that made a reader fail into tests/hostile/found/FORMAT/, where
a test reads it from then on.
"""

import argparse
import hashlib
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from tests.hostile.attack import Counts, attacked
from tests.hostile.formats import FORMATS
from tests.hostile.limits import Reader

FOUND = Path(__file__).parent / "found"


def main() -> None:
    """See above."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("formats", nargs="*", default=list(FORMATS), metavar="FORMAT")
    parser.add_argument("--cases", type=int, default=1000, help="for each format")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--keep", action="store_true", help="store what made a reader fail")
    parser.add_argument("--processes", type=int, default=2)
    chosen = parser.parse_args()

    def one(name: str) -> Counts:
        reader = Reader()
        try:
            with tempfile.TemporaryDirectory() as folder:
                return attacked(reader, name, Path(folder), chosen.seed, chosen.cases)
        finally:
            reader.close()

    print(f"{'format':20} {'tried':>6} {'read':>6} {'refused':>8} {'failed':>7}")
    with ThreadPoolExecutor(chosen.processes) as several:
        for name, counts in zip(chosen.formats, several.map(one, chosen.formats), strict=True):
            failed = len(counts.failures)
            print(f"{name:20} {counts.tried:6} {counts.read:6} {counts.refused:8} {failed:7}")
            for what, times in counts.reasons().most_common():
                print(f"    {times} x {what}", flush=True)
            if chosen.keep:
                keep(counts)


def keep(counts: Counts) -> None:
    """Store one case of each kind of failure."""
    for what in counts.reasons():
        failure = next(f for f in counts.failures if f.what.startswith(what[:100]))
        digest = hashlib.sha256(failure.content).hexdigest()[:12]
        place = FOUND / failure.format / digest / failure.file
        place.parent.mkdir(parents=True, exist_ok=True)
        place.write_bytes(failure.content)


if __name__ == "__main__":
    main()
