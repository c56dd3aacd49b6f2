"""Packs: exercises whose numbers differ from student to student, and how answers are marked.

A lecture may have a file `variants.py` beside its other four. What it imports from here is short.

When a pack is made, the solution of each `Variant` answers for each student's numbers, and the
answers are kept in the key as plain data, with which marking compares. A file that is handed in
runs in a process that Python's audit events keep from the network, from other programs and from
files that are not its own (`confinement`). They do not see code in C; so keys are in memory while
an answer runs, and are written back if they changed (`keeping`).
"""

from workbench.course.packs.variants import rounded, slip, variant

__all__ = ["rounded", "slip", "variant"]
