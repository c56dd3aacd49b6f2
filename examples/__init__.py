"""Examples: each one idea, importable, its result a name at module level."""
