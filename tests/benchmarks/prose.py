"""The prose of a benchmark's page, which remembers what tests found in it."""

import re
from collections.abc import Callable, Iterable
from pathlib import Path

from tests.lectures.numerals import numerals
from tests.lectures.prose import places

WRITTEN = re.compile(r"<!--(?P<a>.*?written by.*?)-->.*?(?=<!--).*?-->", re.DOTALL)
DATE = re.compile(r"\b\d{1,2} (?:October|November|December) 20\d\d\b")
ONCE = "stored nowhere"  # what a paragraph says whose numbers were measured once


class Prose(str):
    """The text of one section, or of a whole page, with single spaces.

    Tables and what a command wrote between two marks are left out. `phrase in prose` is True or
    False as it is for any string, and remembers phrases that were found.
    """

    found: set[str]
    paragraphs: list[str]

    def __new__(cls, page: Path, section: str | None = None) -> "Prose":
        """`section` is a heading of the first level."""
        text = page.read_text(encoding="utf-8")
        if section is not None:
            text = text.partition(f"# {section}\n")[2].partition("\n# ")[0]
            assert text, f"{page} has no section {section!r}"
        text = WRITTEN.sub("", text)
        lines = [line for line in text.splitlines() if not line.startswith(("|", "#"))]
        paragraphs = re.split(r"\n\s*\n|\n(?=- )", "\n".join(lines))
        each = [" ".join(paragraph.split()) for paragraph in paragraphs]
        prose = super().__new__(cls, " ".join(paragraph for paragraph in each if paragraph))
        prose.found, prose.paragraphs = set(), each
        return prose

    def __contains__(self, phrase: object) -> bool:
        there = isinstance(phrase, str) and str.__contains__(self, phrase)
        if there:
            self.found.add(str(phrase))
        return there


def unheld(
    prose: Prose,
    tests: Iterable[Callable[[], None]],
    given: Iterable[str] = (),
    once: Iterable[str] = (),
) -> list[str]:
    """What is wrong with the numbers of a prose: one that no test holds, with the words around it.

    `tests` are run, and hold what they look for in the prose. `given` are phrases with numbers of
    no run: what was wanted or set, and what a source says. `once` are phrases with numbers of a
    measurement that is stored nowhere, which the paragraph must say.
    """
    prose.found.clear()
    for test in tests:
        test()
    wrong = []
    for phrase in once:
        (paragraph,) = [one for one in prose.paragraphs if phrase in one] or [""]
        if ONCE not in paragraph:
            wrong.append(f"no paragraph says {phrase!r} and that it is {ONCE}")
    wrong += [f"the page does not say {one!r}" for one in given if not str(prose).count(one)]
    phrases = [*prose.found, *given, *once]
    held = [span for phrase in phrases for span in places(str(prose), phrase)]
    held += [match.span() for match in DATE.finditer(prose)]
    for one in numerals(str(prose)):
        if not any(begin <= one.begin and one.end <= end for begin, end in held):
            wrong.append(f"no test holds {str(prose)[max(0, one.begin - 60) : one.end + 40]!r}")
    return wrong
