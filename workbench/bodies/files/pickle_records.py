"""What a pickle asks for, as records; nothing of it is carried out."""

from dataclasses import dataclass
from typing import Any

from workbench.errors import UnsafePickle, cut

LONGEST_NAME = 200  # characters of a name; those that are known have less than 50
NUMPY = ("numpy.core", "numpy._core")  # before NumPy 2, and since
SPARSE = frozenset(
    (f"scipy.sparse{module}", f"{kind}_{what}")
    for kind in ("csc", "csr", "coo")
    for module in ("", f".{kind}", f"._{kind}")
    for what in ("matrix", "array")
)
KNOWN = SPARSE | {
    *((f"{numpy}.multiarray", name) for numpy in NUMPY for name in ("_reconstruct", "scalar")),
    *((f"{numpy}.numeric", "_frombuffer") for numpy in NUMPY),
    *(("numpy", name) for name in ("ndarray", "dtype")),
    ("_codecs", "encode"),
    *((m, name) for m in ("builtins", "__builtin__") for name in ("set", "object", "bytearray")),
    *((module, "_reconstructor") for module in ("copyreg", "copy_reg")),
}


@dataclass(frozen=True)
class Name:
    """Something in a module, as the file names it; it was not looked up."""

    module: str
    name: str

    def __str__(self) -> str:
        return f"{self.module}.{self.name}"


@dataclass(eq=False, repr=False, slots=True)
class Made:
    """A call that the file asks for, and the state it would give the outcome; nothing ran.

    It is compared by identity and has no text of its own: what it holds may hold the same thing
    twice on every level, and a text of that would never end.
    """

    name: Name
    arguments: tuple[Any, ...]
    state: Any = None


def permitted(module: str, name: str) -> Name:
    """The name, if a body model has a use for it. Raises UnsafePickle."""
    if len(module) + len(name) > LONGEST_NAME:
        raise UnsafePickle(
            f"it asks for a name of {len(module) + len(name):,} characters, which is no part of a "
            "body model; it was not run"
        )
    words = (*module.split("."), name)
    chumpy = words[0] == "chumpy" and all(w.isidentifier() and w[0] != "_" for w in words)
    if not chumpy and (module, name) not in KNOWN:
        raise UnsafePickle(
            f"it asks for {cut(f'{module}.{name}', 100)}, which is no part of a body model; it was "
            "not run. Only numpy arrays, scipy.sparse matrices and chumpy values are read"
        )
    return Name(module, name)


def called(name: Any, arguments: Any) -> Made:
    """The record of a call. Raises UnsafePickle unless a permitted name is called."""
    if not isinstance(name, Name):
        raise UnsafePickle(f"it calls a {type(name).__name__}, which is no name; it was not run")
    if not isinstance(arguments, tuple):
        raise ValueError(f"{name} is called with a {type(arguments).__name__}")
    if name.name == "_reconstructor":  # Python 2: a class, its base, and the base's value
        return called(arguments[0], ())
    return Made(name, arguments)
