"""Examples of the reference: each runs and prints, and its docstring names what it shows."""
