"""Which solver for which problem: comparisons behind the advice of `workbench solvers --for`."""
