"""Packs: exercises whose numbers differ from student to student, and how answers are marked.

A lecture may have a file `variants.py` beside its other four. What it imports from here is short.

When a pack is made, the solution of each `Variant` answers for each student's numbers, and the
answers are kept in the key as plain data, with which marking compares. A student's file runs in a
process that gets arguments alone (`workbench.course.process`).
"""

from workbench.course.checks import mistake
from workbench.course.packs.variants import rounded, variant

__all__ = ["mistake", "rounded", "variant"]
