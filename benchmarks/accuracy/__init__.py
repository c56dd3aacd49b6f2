"""How accurate fits are, one module a subject."""

NAMES: tuple[str, ...] = ()
