"""Files of a format that are changed one after the other, and what their reader makes of them."""

from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from tests.hostile.formats import FORMATS, whole
from tests.hostile.limits import FAILED, READ, Answer, Reader
from tests.hostile.mutations import mutated


@dataclass(frozen=True)
class Failure:
    """A case that did not end as it must."""

    format: str
    seed: int
    number: int
    file: str
    what: str
    content: bytes

    def __str__(self) -> str:
        return f"{self.format}, seed {self.seed}, case {self.number}, {self.file}: {self.what}"


@dataclass
class Counts:
    """What came of the cases of one format."""

    read: int = 0
    refused: int = 0
    failures: list[Failure] = field(default_factory=list)

    @property
    def tried(self) -> int:
        """All of them."""
        return self.read + self.refused + len(self.failures)

    def reasons(self) -> Counter[str]:
        """Failures by their kind."""
        return Counter(failure.what.split("\n")[0][:160] for failure in self.failures)


def ask(
    reader: Reader, name: str, folder: Path, file: str | None = None, content: bytes = b""
) -> Answer:
    """What becomes of a format's valid files in a folder if one of them has another content."""
    for other, kept in whole(name).items():
        path = folder / other
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content if other == file else kept)
    return reader.ask(name, folder, megabytes=FORMATS[name].megabytes)


def drawn(name: str, seed: int, number: int) -> tuple[str, bytes]:
    """Which file of a format is changed in one case, and its content."""
    rng = np.random.default_rng((seed, number))
    file = sorted(whole(name))[rng.integers(len(whole(name)))]
    with np.errstate(all="ignore"):
        return file, mutated(file, whole(name)[file], rng)


def attacked(reader: Reader, name: str, folder: Path, seed: int, cases: int) -> Counts:
    """So many cases of one format; `folder` is for the files."""
    counts = Counts()
    for number in range(cases):
        file, content = drawn(name, seed, number)
        answer = ask(reader, name, folder, file, content)
        if answer.outcome == FAILED:
            counts.failures.append(Failure(name, seed, number, file, answer.what, content))
        elif answer.outcome == READ:
            counts.read += 1
        else:
            counts.refused += 1
    return counts
