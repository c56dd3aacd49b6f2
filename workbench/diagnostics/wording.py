"""What a diagnosis says in words: findings, and the functions that make text and data of it."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from workbench.diagnostics.remedies import Suggestion
from workbench.errors import WorkbenchError

D = TypeVar("D")


class Undiagnosed(WorkbenchError, AssertionError):
    """An assertion about a diagnosis that does not hold."""


@dataclass(frozen=True)
class Finding:
    """One sentence about a problem.

    Attributes:
        part: the section of the report that says more.
        text: the sentence.
        warning: whether it is a warning, or else a note.
    """

    part: str
    text: str
    warning: bool = True


@dataclass(frozen=True)
class Wording(Generic[D]):
    """The functions that put a diagnosis of type D into words.

    They read a diagnosis, so their modules stand above its own; it is given them when it is made.

    Attributes:
        findings: all findings, warnings first.
        summary: a few lines.
        report: everything in words, section by section.
        data: everything as plain data, for JSON.
        suggestions: what to do about it, each tried out.
    """

    findings: Callable[[D], tuple[Finding, ...]]
    summary: Callable[[D], str]
    report: Callable[[D], str]
    data: Callable[[D], dict[str, Any]]
    suggestions: Callable[[D], tuple[Suggestion, ...]] = lambda diagnosis: ()
