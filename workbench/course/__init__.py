"""What lectures are made of, what grades their exercises, and their site and slides.

A lecture is a folder of four files in `lectures/`, with a line in `lectures/outline.py`. Its prose
takes its numbers from the run of its code (`cells`). `process` runs a student's file in a process
that can be killed, and `grading` compares its answers with the solution's. The likeliest mistake is
found by calling the known wrong answers with the same arguments.
"""

from typing import TYPE_CHECKING, Any

from workbench.course.checks import Missed, check, equal, holds, mistake
from workbench.errors import Unsolved

if TYPE_CHECKING:
    from workbench.course.showing import Picture, source

__all__ = ["Missed", "Picture", "Unsolved", "check", "equal", "holds", "mistake", "source"]


def __getattr__(name: str) -> Any:
    """`Picture` and `source`, imported on first use: files of answers need no figures."""
    if name not in ("Picture", "source"):
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from workbench.course import showing

    return getattr(showing, name)
