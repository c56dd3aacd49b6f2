"""Packs: exercises whose numbers differ from student to student, and how answers are marked.

A lecture may have a file `variants.py` beside its other four. What it imports from here is short.
"""

from workbench.course.packs.variants import rounded, slip, variant

__all__ = ["rounded", "slip", "variant"]
