"""What lectures are made of, what grades their exercises, and their site and slides.

A lecture is a folder of four files in `lectures/`.

Each has a line in `lectures/outline.py`. `grading` calls a student's function in a process that can
be killed and has neither checks nor solutions (`answer_process`): it gets arguments, returns plain
values, and all checks run outside of it, so that it cannot set its own grade. The likeliest mistake
is found by calling the known wrong answers with the same arguments. What prose says about a run is
listed phrase by phrase in `tests/lectures/claims/`, each with a function that checks it.
"""

from workbench.course.checks import Missed, check, equal, holds, mistake
from workbench.course.showing import Picture, source
from workbench.errors import Unsolved

__all__ = ["Missed", "Picture", "Unsolved", "check", "equal", "holds", "mistake", "source"]
