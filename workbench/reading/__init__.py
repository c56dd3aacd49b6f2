"""Reading files that may be damaged: archives of arrays, what they must hold, facts in JSON."""
