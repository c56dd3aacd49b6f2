"""What lectures are made of, and what grades their exercises.

A lecture is a folder of four files in `lectures/`.
"""

from workbench.course.checks import Missed, check, equal, holds, mistake
from workbench.course.picture import Picture, source
from workbench.errors import Unsolved

__all__ = ["Missed", "Picture", "Unsolved", "check", "equal", "holds", "mistake", "source"]
