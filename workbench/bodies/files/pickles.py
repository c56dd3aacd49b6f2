"""Reading a pickle as data: a stack machine that imports nothing and calls nothing.

Python's own unpickler runs whatever code a file asks for. This one reads the same instructions
and only writes down what they ask for: a name becomes a `Name`, a call becomes a `Made`, and
`workbench.bodies.files.pickled_arrays` decides what a few of them mean. Names that a body model has
no use for are refused where they stand.

The work is bounded by the number of instructions, which are counted, because none of them copies,
compares, hashes or writes out what others have built. What is hashed, the keys of dictionaries and
the names of modules, is short, and so are whole numbers.
"""

import codecs
import io
import pickletools
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from workbench.bodies.files.entries import MOST_BYTES
from workbench.bodies.files.pickle_records import LONGEST_NAME, Made, called, permitted
from workbench.errors import BadFile, UnsafePickle, cut

OPCODES = {opcode.code.encode("latin1"): opcode for opcode in pickletools.opcodes}
MARK = object()  # where a run of items begins on the stack
MOST_INSTRUCTIONS = 500_000  # of one file; a body has a few thousand, and lists of numbers many
MOST_BITS = 64  # of a whole number: hashing or writing out a long one takes its length each time
DAMAGE = (ValueError, TypeError, IndexError, KeyError, OverflowError, AttributeError, MemoryError)


def read_pickle(path: Path) -> Any:
    """What the pickle at `path` says: plain values, lists, dicts, `Name` and `Made`.

    Python 2's strings come as latin-1 text, sets as lists. Raises UnsafePickle for any name
    but those that hold arrays, and BadFile if the file is cut off, damaged, over 2 GB or has more
    than half a million instructions.
    """
    size = path.stat().st_size
    if size > MOST_BYTES:
        raise BadFile(f"{path} has {size / 2**30:.1f} GB; pickles over 2 GB are not read")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)  # escapes in damaged texts
            return run(path.read_bytes())
    except UnsafePickle as error:
        raise UnsafePickle(f"{path}: {error}") from None
    except DAMAGE as error:
        raise BadFile(
            f"{path} is cut off, damaged or no pickle ({cut(error)}); fetch or export it again"
        ) from error


def run(pickled: bytes) -> Any:
    """What the instructions leave on the stack. Raises one of DAMAGE, or UnsafePickle."""
    machine = _Machine()
    for count, (opcode, argument) in enumerate(_instructions(pickled)):
        if count >= MOST_INSTRUCTIONS:
            raise ValueError(
                f"it has more than {MOST_INSTRUCTIONS:,} instructions, and a body's file has a few "
                "thousand"
            )
        if opcode in LITERALS:
            if type(argument) is int and argument.bit_length() > MOST_BITS:
                raise ValueError(f"a whole number of {argument.bit_length():,} bits")
            machine.push(argument)
        elif opcode in EFFECTS:
            EFFECTS[opcode](machine, argument)
        elif opcode not in ("PROTO", "FRAME", "STOP"):
            raise UnsafePickle(f"it uses {opcode}, which a file of arrays has no use for")
    return machine.pop()


def _instructions(pickled: bytes) -> Iterator[tuple[str, Any]]:
    """The instructions of a pickle, each with its decoded argument, up to the final STOP."""
    stream = io.BytesIO(pickled)  # a length that the file lies about reads no further than its end
    while True:
        code = stream.read(1)
        if code not in OPCODES:
            raise ValueError(f"unknown instruction {code!r}" if code else "its end is missing")
        opcode = OPCODES[code]
        if opcode.name == "STRING":  # Python 2 wrote bytes as text with escapes
            line: Any = pickletools.read_stringnl(stream, decode=False)
            yield opcode.name, codecs.escape_decode(line)[0].decode("latin1")
        else:
            yield opcode.name, None if opcode.arg is None else opcode.arg.reader(stream)
        if opcode.name == "STOP":
            return


class _Machine:
    """The stack and the memo of a pickle that is being read."""

    def __init__(self) -> None:
        self.stack: list[Any] = []
        self.memo: dict[int, Any] = {}

    def push(self, value: Any) -> None:
        self.stack.append(value)

    def top(self) -> Any:
        if self.stack[-1] is MARK:
            raise ValueError("a mark stands where a value should")
        return self.stack[-1]

    def pop(self) -> Any:
        self.top()
        return self.stack.pop()

    def pops(self, count: int) -> tuple[Any, ...]:
        return tuple([self.pop() for _ in range(count)][::-1])

    def since_mark(self) -> list[Any]:
        items: list[Any] = []
        while self.stack[-1] is not MARK:
            items.append(self.stack.pop())
        self.stack.pop()
        return items[::-1]

    def drop(self) -> None:
        self.stack.pop()

    def append(self, items: list[Any]) -> None:
        if type(self.top()) is not list:
            raise ValueError(f"items for a {type(self.top()).__name__}")
        self.top().extend(items)

    def set_items(self, items: list[Any]) -> None:
        if type(self.top()) is not dict:
            raise ValueError(f"entries for a {type(self.top()).__name__}")
        self.top().update(
            (_key(key), value)
            for key, value in zip(items[::2], items[1::2], strict=True)
            if isinstance(key, (str, bytes, int))  # others belong to chumpy's caches
        )

    def make_dict(self, items: list[Any]) -> None:
        self.push({})
        self.set_items(items)

    def name(self, module: Any, name: Any) -> None:
        if not (isinstance(module, str) and isinstance(name, str)):
            raise ValueError("a name that is no text")
        self.push(permitted(module, name))

    def call(self, name: Any, arguments: Any) -> None:
        self.push(called(name, arguments))

    def build(self) -> None:
        state = self.pop()
        if not isinstance(self.top(), Made):
            what = type(self.top()).__name__
            raise UnsafePickle(f"it changes the inside of a {what}; nothing was run")
        self.top().state = state

    def remember(self, index: int) -> None:
        self.memo[index] = self.top()


def _key(key: str | bytes | int) -> str:
    """The name of an entry as text, whose random hash keeps files from making names collide."""
    if isinstance(key, int):
        return str(key)
    if len(key) > LONGEST_NAME:
        raise ValueError(f"the name of an entry has {len(key):,} characters")
    text = key.decode("latin1") if isinstance(key, bytes) else key
    if text.isascii():
        return text
    text.encode()  # raises UnicodeEncodeError for half a pair of surrogates, which nothing prints
    return text


LITERALS = {
    *("INT", "BININT", "BININT1", "BININT2", "LONG", "LONG1", "LONG4", "FLOAT", "BINFLOAT"),
    *("STRING", "BINSTRING", "SHORT_BINSTRING"),
    *("UNICODE", "BINUNICODE", "SHORT_BINUNICODE", "BINUNICODE8"),
    *("BINBYTES", "SHORT_BINBYTES", "BINBYTES8", "BYTEARRAY8"),
}
# What each instruction does to the machine m with its argument a; `pickletools` describes them.
EFFECTS: dict[str, Callable[[_Machine, Any], None]] = {
    "NONE": lambda m, a: m.push(None),
    "NEWTRUE": lambda m, a: m.push(True),
    "NEWFALSE": lambda m, a: m.push(False),
    "EMPTY_LIST": lambda m, a: m.push([]),
    "EMPTY_SET": lambda m, a: m.push([]),
    "EMPTY_DICT": lambda m, a: m.push({}),
    "EMPTY_TUPLE": lambda m, a: m.push(()),
    "TUPLE1": lambda m, a: m.push(m.pops(1)),
    "TUPLE2": lambda m, a: m.push(m.pops(2)),
    "TUPLE3": lambda m, a: m.push(m.pops(3)),
    "TUPLE": lambda m, a: m.push(tuple(m.since_mark())),
    "LIST": lambda m, a: m.push(m.since_mark()),
    "FROZENSET": lambda m, a: m.push(m.since_mark()),
    "DICT": lambda m, a: m.make_dict(m.since_mark()),
    "APPEND": lambda m, a: m.append([m.pop()]),
    "APPENDS": lambda m, a: m.append(m.since_mark()),
    "ADDITEMS": lambda m, a: m.append(m.since_mark()),
    "SETITEM": lambda m, a: m.set_items([*m.pops(2)]),
    "SETITEMS": lambda m, a: m.set_items(m.since_mark()),
    "MARK": lambda m, a: m.push(MARK),
    "POP": lambda m, a: m.drop(),
    "POP_MARK": lambda m, a: m.since_mark().clear(),
    "DUP": lambda m, a: m.push(m.top()),
    "PUT": lambda m, a: m.remember(a),
    "BINPUT": lambda m, a: m.remember(a),
    "LONG_BINPUT": lambda m, a: m.remember(a),
    "MEMOIZE": lambda m, a: m.remember(len(m.memo)),
    "GET": lambda m, a: m.push(m.memo[a]),
    "BINGET": lambda m, a: m.push(m.memo[a]),
    "LONG_BINGET": lambda m, a: m.push(m.memo[a]),
    "GLOBAL": lambda m, a: m.name(*a.split(" ", 1)),
    "STACK_GLOBAL": lambda m, a: m.name(*m.pops(2)),
    "REDUCE": lambda m, a: m.call(*m.pops(2)),
    "NEWOBJ": lambda m, a: m.call(*m.pops(2)),
    "NEWOBJ_EX": lambda m, a: m.call(*m.pops(3)[:2]),
    "INST": lambda m, a: m.call(permitted(*a.split(" ", 1)), tuple(m.since_mark())),
    "OBJ": lambda m, a: m.call((items := m.since_mark())[0], tuple(items[1:])),
    "BUILD": lambda m, a: m.build(),
}
