"""Solvers on problems of each kind, and on cases with known answers."""

from benchmarks.solvers.comparing import PARTS, measured, tables

__all__ = ["PARTS", "measured", "tables"]
