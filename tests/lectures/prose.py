"""What a lecture's prose says of its run, and where the two disagree.

Each lecture has a table `SAYS` in `tests/lectures/claims/`: a phrase, as it stands in the prose,
and a function of the run. The function answers one value for every number in the phrase, in order,
and a truth value for what the phrase says in words. `GIVEN` names the phrases whose numbers come
from elsewhere, and `GENERAL` those that compare things other than results. Prose is what stands in
Markdown cells and in the captions of figures.
"""

import gc
import io
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import redirect_stdout
from dataclasses import dataclass, replace
from functools import lru_cache
from importlib import import_module
from typing import Any

import numpy as np

from tests.lectures.comparisons import comparisons
from tests.lectures.numerals import Numeral, numerals, printed_numbers, right
from workbench.course.cells import carried_out
from workbench.course.outline import Lecture, lecture
from workbench.course.showing import Picture


@dataclass(frozen=True)
class Run:
    """A lecture that was run: its prose, what it printed, showed and computed."""

    prose: str  # with single spaces, captions at the end
    printed: str
    names: Mapping[str, Any]  # what its variables held at the end
    shown: tuple[Any, ...]  # what its cells ended with
    seconds: float  # of one core

    def __getitem__(self, name: str) -> Any:
        return self.names[name]

    def lines(self, *words: str) -> list[list[int | float]]:
        """The numbers in each of the printed lines that hold all of these words."""
        found = [line for line in self.printed.splitlines() if all(word in line for word in words)]
        assert found, f"no printed line holds {words}"
        return [printed_numbers(line) for line in found]

    def line(self, *words: str) -> list[int | float]:
        """The numbers in the one printed line that holds all of these words."""
        found = self.lines(*words)
        assert len(found) == 1, f"{len(found)} printed lines hold {words}"
        return found[0]


@dataclass(frozen=True)
class Claims:
    """What a prose says of the run, and the phrases that do not speak of it.

    Attributes:
        says: phrases, each with a function of the run that answers what the phrase says.
        given: phrases whose numbers come from elsewhere.
        general: phrases that compare things, but not results of the run: mathematics, definitions.
    """

    says: Mapping[str, Callable[[Run], Any]]
    given: tuple[str, ...] = ()
    general: tuple[str, ...] = ()

    def instead(self, phrase: str, other: str) -> "Claims":
        """The same with one phrase in another's place."""
        said = {other if key == phrase else key: value for key, value in self.says.items()}
        return replace(self, says=said)


@lru_cache(maxsize=1)  # a run may hold 200 MB, and tests of one lecture follow each other
def run_of(number: int) -> Run:
    """A lecture, run once for all its tests."""
    run_of.cache_clear()  # the lecture before is freed before this one grows
    gc.collect()
    names: dict[str, Any] = {}
    texts, captions, shown = [], [], []
    began = time.process_time()
    with redirect_stdout(io.StringIO()) as printed:
        for cell, value in carried_out(lecture(number).folder / "lecture.py", names=names):
            if cell.prose:
                texts.append(cell.text)
            elif value is not None:
                shown.append(value)
            if isinstance(value, Picture):
                captions.append(value.caption)
    prose = " ".join("\n".join(texts + captions).split())
    return Run(prose, printed.getvalue(), names, tuple(shown), time.process_time() - began)


def claims_of(one: Lecture) -> Claims:
    """The table of a lecture."""
    module = import_module(f"tests.lectures.claims.{one.folder_name}")
    return Claims(module.SAYS, module.GIVEN, getattr(module, "GENERAL", ()))


def disagreements(run: Run, claims: Claims) -> list[str]:
    """A sentence for every phrase that is not in the prose, or that the run does not bear out."""
    return [told for phrase, of in claims.says.items() if (told := _disagreement(run, phrase, of))]


def loose_numbers(run: Run, claims: Claims) -> list[str]:
    """The numbers of the prose, with the words around, that no phrase of the table holds."""
    spans = [(one.begin, one.end) for one in numerals(run.prose)]
    return _outside(run.prose, spans, (*claims.says, *claims.given))


def loose_comparisons(run: Run, claims: Claims) -> list[str]:
    """The comparisons of the prose, with the words around, that no phrase of the table holds."""
    phrases = (*claims.says, *claims.given, *claims.general)
    return _outside(run.prose, comparisons(run.prose), phrases)


def _outside(prose: str, spans: Iterable[tuple[int, int]], phrases: Iterable[str]) -> list[str]:
    held = [span for phrase in phrases for span in places(prose, phrase)]
    return [
        prose[max(0, a - 40) : b + 40]
        for a, b in spans
        if not any(begin <= a and b <= end for begin, end in held)
    ]


def absent(run: Run, phrases: Iterable[str]) -> list[str]:
    """The phrases that do not stand in the prose."""
    return [phrase for phrase in phrases if phrase not in run.prose]


def places(prose: str, phrase: str) -> Iterator[tuple[int, int]]:
    """Where it stands."""
    begin = prose.find(phrase)
    while begin >= 0:
        yield begin, begin + len(phrase)
        begin = prose.find(phrase, begin + 1)


def quoted(prose: str, phrase: str) -> list[Numeral]:
    """The numbers in a phrase, where it first stands in the prose."""
    begin, end = next(places(prose, phrase))
    return [one for one in numerals(prose) if begin <= one.begin and one.end <= end]


def _disagreement(run: Run, phrase: str, of: Callable[[Run], Any]) -> str:
    if phrase not in run.prose:
        return f"the prose does not say {phrase!r}"
    answer = of(run)
    values = answer if isinstance(answer, tuple) else (answer,)
    truths = [value for value in values if isinstance(value, bool | np.bool_)]
    amounts = [value for value in values if not isinstance(value, bool | np.bool_)]
    found = quoted(run.prose, phrase)
    if len(found) != len(amounts):
        return f"{phrase!r} quotes {[one.text for one in found]}, its function answers {amounts}"
    if not all(truths):
        return f"{phrase!r} is not so in the run"
    wrong = [(a.text, b) for a, b in zip(found, amounts, strict=True) if not right(a, b)]
    return f"{phrase!r} quotes {wrong[0][0]}, the run has {wrong[0][1]}" if wrong else ""
