"""Files to begin with: a problem, a residual, a solver, an experiment or a lecture that runs.

A template is a file that works as it stands, under the name `NAME`; `write_scaffold` copies it
under a name of the user's own.
"""

from workbench.scaffolds.scaffold import SCAFFOLDS, Scaffold, write_scaffold

__all__ = ["SCAFFOLDS", "Scaffold", "write_scaffold"]
