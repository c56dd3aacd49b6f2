"""Studies: questions that take minutes to answer, with fixed seeds; `README.md` has the answers."""
