"""Reading a pickle as data: a stack machine that imports nothing and calls nothing.

Python's own unpickler runs whatever code a file asks for. This one reads the same instructions
and only writes down what they ask for: a name becomes a `PickledName`, a call a `PickledCall`.
Names that a body model has no use for are refused where they stand. What the other calls mean are
NumPy's and SciPy's arrays, and three of chumpy's values. One may be part of many others, and of
one of them many times: what it means is therefore found once, and every array is paid for from the
`Allowance` of its file before it is made.

The number of instructions bounds the work, because none of them copies, compares, hashes or writes
out what others have built; keys, names and whole numbers are short.
"""

import codecs
import io
import pickletools
import re
import warnings
from collections.abc import Callable, Iterable, Iterator, Set
from dataclasses import dataclass, field
from math import prod
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csc_array, csr_array

from workbench.arrays import Index
from workbench.errors import BadFile, UnsafePickle, cut, shown
from workbench.reading.arrays import check_letters


@dataclass(frozen=True)
class PickledName:
    """Something in a module, as the file names it; it was not looked up."""

    module: str
    name: str

    def __str__(self) -> str:
        return f"{self.module}.{self.name}"


LONGEST_NAME = 200  # characters of a name; those that are known have less than 50
NUMPY = ("numpy.core", "numpy._core")  # before NumPy 2, and since
SPARSE = frozenset(
    (f"scipy.sparse{module}", f"{kind}_{what}")
    for kind in ("csc", "csr", "coo")
    for module in ("", f".{kind}", f"._{kind}")
    for what in ("matrix", "array")
)
KNOWN_NAMES = SPARSE | {
    *((f"{numpy}.multiarray", name) for numpy in NUMPY for name in ("_reconstruct", "scalar")),
    *((f"{numpy}.numeric", "_frombuffer") for numpy in NUMPY),
    *(("numpy", name) for name in ("ndarray", "dtype")),
    ("_codecs", "encode"),
    *((m, n) for m in ("builtins", "__builtin__") for n in ("set", "object", "bytearray", "bytes")),
    *((module, "_reconstructor") for module in ("copyreg", "copy_reg")),
}
DICTIONARIES = {("collections", "OrderedDict"), ("collections", "defaultdict")}
JOBLIB = ("joblib.numpy_pickle", "NumpyArrayWrapper")  # an array whose bytes follow in the stream
OBJECTS = ("O", "O8")  # the type of arrays of Python objects
STORAGES = {  # what PyTorch keeps the numbers of tensors in
    **{"FloatStorage": "f4", "DoubleStorage": "f8", "HalfStorage": "f2", "BoolStorage": "?"},
    **{"LongStorage": "i8", "IntStorage": "i4", "ShortStorage": "i2", "ByteStorage": "u1"},
}
STORAGE = PickledName("torch", "a storage")  # of a tensor, which the file names by a number
MOTION_NAMES = DICTIONARIES | {  # that recordings of motions hold beside arrays
    *((m, name) for m in ("builtins", "__builtin__") for name in ("dict", "list", "int", "float")),
    *(("torch", name) for name in STORAGES),
    *(JOBLIB, ("torch._utils", "_rebuild_tensor_v2"), ("torch.storage", "_load_from_bytes")),
}
MOST_BYTES = 2 * 2**30  # of one file, unpacked; licensed models reach a quarter of a GB
Contents = dict[str, Any]  # by key: arrays, csr_arrays, plain values, and what stayed unread
COMPRESSED: dict[str, Callable[..., Any]] = {"csc": csc_array, "csr": csr_array}


@dataclass(frozen=True)
class Unread:
    """An entry of a file that was not read.

    Attributes:
        reason: the end of the sentence "shapedirs is ...".
    """

    reason: str


@dataclass(eq=False, repr=False, slots=True)
class PickledCall:
    """A call that the file asks for, and the state it would give the outcome; nothing ran.

    It has no text of its own: what it holds may hold the same thing twice on every level.
    """

    name: PickledName
    arguments: tuple[Any, ...]
    state: Any = None


def permitted(module: str, name: str, more: Set[tuple[str, str]] = frozenset()) -> PickledName:
    """The name, if it is among `more` or a body model has a use for it. Raises UnsafePickle."""
    if len(module) + len(name) > LONGEST_NAME:
        raise UnsafePickle(
            f"it asks for a name of {len(module) + len(name):,} characters, which is no part of a "
            "body model; it was not run"
        )
    words = (*module.split("."), name)
    chumpy = words[0] == "chumpy" and all(w.isidentifier() and w[0] != "_" for w in words)
    if not chumpy and (module, name) not in KNOWN_NAMES and (module, name) not in more:
        raise UnsafePickle(
            f"it asks for {cut(f'{module}.{name}', 100)}, which is no part of a body model; it was "
            "not run. Only numpy arrays, scipy.sparse matrices and chumpy values are read"
        )
    return PickledName(module, name)


def called(name: Any, arguments: Any) -> PickledCall:
    """The record of a call. Raises UnsafePickle unless a permitted name is called."""
    if not isinstance(name, PickledName):
        raise UnsafePickle(f"it calls a {type(name).__name__}, which is no name; it was not run")
    if not isinstance(arguments, tuple):
        raise ValueError(f"{name} is called with a {type(arguments).__name__}")
    if name.name == "_reconstructor":  # Python 2: a class, its base, and the base's value
        return called(arguments[0], ())
    return PickledCall(name, arguments)


OPCODES = {opcode.code.encode("latin1"): opcode for opcode in pickletools.opcodes}
MARK = object()  # where a run of items begins on the stack
MOST_INSTRUCTIONS = 500_000  # of one file; a body has a few thousand, and lists of numbers many
MOST_BITS = 64  # of a whole number: hashing or writing out a long one takes its length each time
DAMAGE = (ValueError, TypeError, IndexError, KeyError, OverflowError, AttributeError, MemoryError)


def read_pickle(path: Path) -> Any:
    """What the pickle at `path` says: plain values, lists, dicts, `PickledName` and `PickledCall`.

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
            return interpret(path.read_bytes())
    except UnsafePickle as error:
        raise UnsafePickle(f"{path}: {error}") from None
    except DAMAGE as error:
        raise BadFile(
            f"{path} is cut off, damaged or no pickle ({cut(error)}); fetch or export it again"
        ) from error


def interpret(
    pickled: bytes | io.BytesIO,
    more: Set[tuple[str, str]] = frozenset(),
    most: int = MOST_INSTRUCTIONS,
) -> Any:
    """What the instructions leave on the stack. Raises one of DAMAGE, or UnsafePickle.

    `more` are names that may be used beside those of bodies; with any, dictionaries of the standard
    library, joblib's arrays and PyTorch's storages are read. A stream is left after its STOP.
    """
    # a length that the file lies about reads no further than its end
    stream = pickled if isinstance(pickled, io.BytesIO) else io.BytesIO(pickled)
    machine = _Machine(stream, more)
    for count, (opcode, argument) in enumerate(_instructions(stream)):
        if count >= most:
            raise ValueError(
                f"it has more than {most:,} instructions, and a body's file has a few thousand"
            )
        if opcode in LITERALS:
            if type(argument) is int and argument.bit_length() > MOST_BITS:
                raise ValueError(f"a whole number of {argument.bit_length():,} bits")
            machine.stack.append(argument)
        elif opcode in EFFECTS:
            EFFECTS[opcode](machine, argument)
        elif opcode == "BINPERSID" and more:
            machine.stack.append(PickledCall(STORAGE, machine.pop()))
        elif opcode not in ("PROTO", "FRAME", "STOP"):
            raise UnsafePickle(f"it uses {opcode}, which a file of arrays has no use for")
    return machine.pop()


def _instructions(stream: io.BytesIO) -> Iterator[tuple[str, Any]]:
    """The instructions of a pickle, each with its decoded argument, up to the final STOP."""
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

    def __init__(self, stream: io.BytesIO, more: Set[tuple[str, str]]) -> None:
        self.stream, self.more = stream, more
        self.stack: list[Any] = []
        self.memo: dict[int, Any] = {}

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
        self.stack.append({})
        self.set_items(items)

    def name(self, module: Any, name: Any) -> None:
        if not (isinstance(module, str) and isinstance(name, str)):
            raise ValueError("a name that is no text")
        self.stack.append(permitted(module, name, self.more))

    def call(self, name: Any, arguments: Any) -> None:
        call = called(name, arguments)
        if (call.name.module, call.name.name) in DICTIONARIES:
            pairs = arguments[0] if arguments and isinstance(arguments[0], list) else []
            self.make_dict([part for pair in pairs for part in pair[:2]])
        else:
            self.stack.append(call)

    def instance(self, module: str, name: str) -> None:
        self.call(permitted(module, name, self.more), tuple(self.since_mark()))

    def build(self) -> None:
        state = self.pop()
        if not isinstance(self.top(), PickledCall):
            what = type(self.top()).__name__
            raise UnsafePickle(f"it changes the inside of a {what}; nothing was run")
        self.top().state = state
        if (self.top().name.module, self.top().name.name) == JOBLIB:
            self.follow(state)

    def follow(self, state: dict[str, Any]) -> None:
        """Take the bytes of an array of joblib's from the stream, or the pickle of its objects."""
        if state["dtype"].arguments[0] in OBJECTS:
            state["content"] = interpret(self.stream, self.more - {JOBLIB})
            return
        kind, sizes = _dtype(state["dtype"]), sizes_in(state["shape"], "shape")
        if min(sizes, default=0) < 0:
            raise ValueError("its shape is no tuple of sizes")
        if state.get("numpy_array_alignment_bytes") is not None:
            self.stream.read(self.stream.read(1)[0])
        state["content"] = self.stream.read(prod(sizes) * kind.itemsize)

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
    "NONE": lambda m, a: m.stack.append(None),
    "NEWTRUE": lambda m, a: m.stack.append(True),
    "NEWFALSE": lambda m, a: m.stack.append(False),
    **dict.fromkeys(("EMPTY_LIST", "EMPTY_SET"), lambda m, a: m.stack.append([])),
    "EMPTY_DICT": lambda m, a: m.stack.append({}),
    "EMPTY_TUPLE": lambda m, a: m.stack.append(()),
    "TUPLE1": lambda m, a: m.stack.append(m.pops(1)),
    "TUPLE2": lambda m, a: m.stack.append(m.pops(2)),
    "TUPLE3": lambda m, a: m.stack.append(m.pops(3)),
    "TUPLE": lambda m, a: m.stack.append(tuple(m.since_mark())),
    **dict.fromkeys(("LIST", "FROZENSET"), lambda m, a: m.stack.append(m.since_mark())),
    "DICT": lambda m, a: m.make_dict(m.since_mark()),
    "APPEND": lambda m, a: m.append([m.pop()]),
    **dict.fromkeys(("APPENDS", "ADDITEMS"), lambda m, a: m.append(m.since_mark())),
    "SETITEM": lambda m, a: m.set_items([*m.pops(2)]),
    "SETITEMS": lambda m, a: m.set_items(m.since_mark()),
    "MARK": lambda m, a: m.stack.append(MARK),
    "POP": lambda m, a: m.stack.pop(),
    "POP_MARK": lambda m, a: m.since_mark().clear(),
    "DUP": lambda m, a: m.stack.append(m.top()),
    **dict.fromkeys(("PUT", "BINPUT", "LONG_BINPUT"), lambda m, a: m.remember(a)),
    "MEMOIZE": lambda m, a: m.remember(len(m.memo)),
    **dict.fromkeys(("GET", "BINGET", "LONG_BINGET"), lambda m, a: m.stack.append(m.memo[a])),
    "GLOBAL": lambda m, a: m.name(*a.split(" ", 1)),
    "STACK_GLOBAL": lambda m, a: m.name(*m.pops(2)),
    **dict.fromkeys(("REDUCE", "NEWOBJ"), lambda m, a: m.call(*m.pops(2))),
    "NEWOBJ_EX": lambda m, a: m.call(*m.pops(3)[:2]),
    "INST": lambda m, a: m.instance(*a.split(" ", 1)),
    "OBJ": lambda m, a: m.call((items := m.since_mark())[0], tuple(items[1:])),
    "BUILD": lambda m, a: m.build(),
}


MOST_ROWS = 10**7  # of a sparse matrix, whose shape takes no bytes in the file
MOST_NESTED = 16  # chumpy values inside chumpy values; files have two
PLAIN_TYPE = re.compile(r"[biuf]\d{1,2}|[SU]\d{1,4}")  # types of numbers and of short texts
NUMERIC = "biuf"  # kinds of what chumpy and scipy compute with
MOST_RECORDS = 2000  # arrays, matrices and chumpy's values that are looked into; files have sixty
MOST_ENTRIES = 10_000  # of the dictionary that the file is; files have thirty
SPARE_BYTES = 2**26  # that the arrays of any file may take, however small it is
# Further bytes for each byte of the file. A number of one byte becomes a float64 of eight, so that
# arrays which share no bytes are never refused.
PER_BYTE = 8
DOUBLE_BYTES = 8  # bytes of a float64, which all numbers of a body become


class Allowance:
    """What may still be spent on a file of `size` bytes. Raises BadFile when it is spent."""

    def __init__(self, size: int, records: int = MOST_RECORDS) -> None:
        self.size, self.records, self.most = size, records, records
        self.bytes = SPARE_BYTES + PER_BYTE * size

    def pay_record(self) -> None:
        """For looking into one record."""
        self.records -= 1
        if self.records < 0:
            raise BadFile(
                f"it is made of more than {self.most:,} arrays and chumpy values, and a body of "
                "a few dozen; export it again with nothing but the arrays of the body"
            )

    def pay(self, sizes: Iterable[int], itemsize: int = DOUBLE_BYTES) -> None:
        """For an array of these sizes; a size of 0 counts as 1, for nothing else bounds the rest.

        Numbers count as float64, texts as what they take.
        """
        self.bytes -= prod(max(n, 1) for n in sizes) * max(itemsize, DOUBLE_BYTES)
        if self.bytes < 0:
            raise BadFile(
                f"its arrays would take more than {PER_BYTE} times its own {self.size:,} bytes and "
                f"{SPARE_BYTES // 2**20} MB, because they name the same bytes again and again or "
                "are much larger than what they hold; export it again with arrays of their own"
            )


def read_pickled_arrays(path: Path) -> Contents:
    """The entries of a pickled dictionary: arrays, csr_arrays, plain values, and the `Unread`.

    Raises BadFile (UnsafePickle) if it is no such file, or asks for more memory or work than a
    body of its size has a use for.
    """
    content = read_pickle(path)
    if not isinstance(content, dict):
        raise BadFile(f"{path} holds no dictionary of arrays, but a {_kind(content)}")
    if len(content) > MOST_ENTRIES:
        raise BadFile(f"{path} holds {len(content):,} entries; a body has a few dozen")
    reading = Records(Allowance(path.stat().st_size))
    return {key: _read(path, reading, value) for key, value in content.items()}


@dataclass
class Records:
    """One file: what may still be spent on it, and what its records were found to mean.

    Attributes:
        allowance: what may still be spent.
        meanings: what records were found to mean, by the identity of each.
    """

    allowance: Allowance
    meanings: dict[int, Any] = field(default_factory=dict)

    def meaning(self, value: Any, depth: int = 0) -> Any:
        """The array that a record stands for; other values as they are.

        Raises ValueError and its kin for a record that stands for no array, BadFile for one that
        takes more than the allowance.
        """
        if not isinstance(value, PickledCall):
            return value
        # the file's content holds the value, so that no other gets its id
        if id(value) not in self.meanings:
            self.allowance.pay_record()
            self.meanings[id(value)] = _meaning(self, value, depth)
        return self.meanings[id(value)]

    def numbers(self, value: Any, depth: int) -> NDArray[Any]:
        """An array of numbers that another value is made of; lists could be endless."""
        array = self.meaning(value, depth)
        if not isinstance(array, np.ndarray):
            raise ValueError(f"it is made of a {_kind(array)}, not of an array")
        if array.dtype.kind not in NUMERIC:
            raise ValueError(f"it is made of {array.dtype}, not of numbers")
        return array


def _read(path: Path, reading: Records, value: Any) -> Any:
    try:
        if isinstance(value, str):
            reading.allowance.pay((len(value),))
            value.encode()  # raises UnicodeEncodeError for half a pair of surrogates
        elif isinstance(value, bytes | bytearray):
            reading.allowance.pay((len(value),), 1)
        return reading.meaning(value)
    except BadFile as error:
        raise type(error)(f"{path}: {error}") from None
    except DAMAGE as error:
        return Unread(f"a {_kind(value)} that cannot be read ({cut(error)})")


def _meaning(reading: Records, call: PickledCall, depth: int) -> Any:
    if depth > MOST_NESTED:
        raise ValueError(f"it is nested more than {MOST_NESTED} deep")
    name = call.name.module, call.name.name
    if call.name.module.split(".")[0] == "chumpy":
        if call.name.name not in CHUMPY:
            raise ValueError("chumpy would have to compute it; store its value instead")
        return CHUMPY[call.name.name](reading, _state(call), depth + 1)
    if name in SPARSE:
        return _sparse(reading, call.name.name[:3], _state(call), depth + 1)
    if name not in MEANINGS:
        raise ValueError("it stands for no array")
    return MEANINGS[name](reading, call)


def _kind(value: Any) -> str:
    return str(value.name) if isinstance(value, PickledCall) else type(value).__name__


def _state(call: PickledCall) -> dict[str, Any]:
    """The attributes that an object was pickled with; of several, the first are its own."""
    state = call.state[0] if isinstance(call.state, tuple) else call.state
    if not isinstance(state, dict):
        raise ValueError("its attributes are missing")
    return state


def _array(reading: Records, call: PickledCall) -> NDArray[Any]:
    """An ndarray from its type, shape and bytes; the file's shape allocates nothing."""
    if call.arguments[:1] != (PickledName("numpy", "ndarray"),):
        first = call.arguments[:1]
        named = bool(first) and isinstance(first[0], PickledName)
        raise UnsafePickle(
            f"it makes an array of a kind that is not read: {first[0] if named else shown(first)}"
        )
    if not (isinstance(call.state, tuple) and 4 <= len(call.state) <= 5):
        raise ValueError("its type, shape and bytes are missing")
    shape, dtype, fortran, content = call.state[-4:]
    return _shaped(reading, content, dtype, shape, "F" if fortran else "C")


def _from_buffer(reading: Records, call: PickledCall) -> NDArray[Any]:
    content, dtype, shape, order = call.arguments
    return _shaped(reading, content, dtype, shape, order)


def _scalar(reading: Records, call: PickledCall) -> Any:
    dtype, content = call.arguments
    return _shaped(reading, content, dtype, (), "C")[()]


def _wrapped(reading: Records, call: PickledCall) -> NDArray[Any]:
    """An array as joblib writes it, whose bytes `_Machine.follow` kept."""
    state = call.state
    return _shaped(reading, state["content"], state["dtype"], state["shape"], state.get("order"))


def _shaped(reading: Records, content: Any, dtype: Any, shape: Any, order: Any) -> NDArray[Any]:
    numpy_type, raw = _dtype(dtype), _raw_bytes(content)
    sizes = sizes_in(shape, "shape")
    if min(sizes, default=0) < 0:
        raise ValueError("its shape is no tuple of sizes")
    if prod(sizes) * numpy_type.itemsize != len(raw):
        raise ValueError(
            f"{shown(sizes)} numbers of {numpy_type.itemsize} bytes, but {len(raw):,} bytes"
        )
    reading.allowance.pay(sizes, numpy_type.itemsize)
    flat = np.frombuffer(raw.encode("latin1") if isinstance(raw, str) else bytes(raw), numpy_type)
    if numpy_type.kind == "U":
        try:
            check_letters(flat)
        except BadFile as error:  # a text that Python cannot show: this entry is left out
            raise ValueError(str(error)) from error
    return flat.reshape(sizes, order="F" if order == "F" else "C")


def _dtype(call: Any) -> np.dtype[Any]:
    if not (isinstance(call, PickledCall) and call.name == PickledName("numpy", "dtype")):
        raise ValueError("its type is no numpy.dtype")
    code = call.arguments[0]
    if not (isinstance(code, str) and PLAIN_TYPE.fullmatch(code)):
        raise ValueError(f"an array of type {shown(code)}, not of numbers")
    order = call.state[1] if call.state else "="
    if order not in ("<", ">", "=", "|"):
        raise ValueError(f"byte order {shown(order)}")
    return np.dtype(code if order == "|" else order + code)


def _raw_bytes(content: Any) -> bytes | bytearray | str:
    """The bytes of an array, or a text with one byte per character, as Python 2 wrote them."""
    if isinstance(content, PickledCall) and content.name.name == "bytes" and not content.arguments:
        return b""  # of an array without numbers
    if isinstance(content, PickledCall) and content.name.name in ("encode", "bytearray"):
        if content.arguments[1:] not in ((), ("latin1",), ("latin-1",)):
            raise ValueError("its bytes are encoded in another way than latin-1")
        content = content.arguments[0]
    if not isinstance(content, (bytes, bytearray, str)):
        raise ValueError("an array of Python objects, not of numbers")
    return content


def _sparse(reading: Records, kind: str, state: dict[str, Any], depth: int) -> csr_array:
    """A csc, csr or coo matrix."""
    row, column = state.get("row"), state.get("col")
    if "coords" in state:  # what SciPy since 1.13 has for row and col
        row, column = state["coords"]
    places = {"row": row, "col": column} if kind == "coo" else state
    names = ("row", "col") if kind == "coo" else ("indices", "indptr")
    data, *indices = (
        reading.numbers(part, depth) for part in (state["data"], *(places[n] for n in names))
    )
    rows, columns = sizes_in(state["_shape"], "shape", most=2)
    if not 0 <= rows <= MOST_ROWS or not 0 <= columns <= MOST_ROWS:
        raise ValueError(f"a matrix of {rows:,} x {columns:,}")
    reading.allowance.pay((rows + columns + 2 * data.size,))
    if kind == "coo":
        return from_places(data, indices[0], indices[1], (rows, columns))
    return from_pointers(kind, data, indices[0], indices[1], (rows, columns))


def _select(reading: Records, state: dict[str, Any], depth: int) -> NDArray[Any]:
    """chumpy's Select: some entries of `a`, counted row by row, in a shape of their own."""
    source = reading.numbers(state["a"], depth)
    indices = reading.numbers(state["idxs"], depth)
    shape = reading.meaning(state.get("preferred_shape"), depth)
    reading.allowance.pay((indices.size + source.size,))
    chosen: NDArray[Any] = source.ravel()[indices]
    if shape is None:
        return chosen
    sizes = sizes_in(shape, "shape")
    reading.allowance.pay(sizes)  # of an empty array, they could be any
    return chosen.reshape(sizes)


def _transpose(reading: Records, state: dict[str, Any], depth: int) -> NDArray[Any]:
    axes = reading.meaning(state.get("axes"), depth)
    return np.transpose(
        reading.numbers(state["a"], depth), None if axes is None else sizes_in(axes, "axes")
    )


CHUMPY: dict[str, Callable[[Records, dict[str, Any], int], Any]] = {
    "Ch": lambda reading, state, depth: reading.meaning(state["x"], depth),
    "Select": _select,
    "transpose": _transpose,
}
MEANINGS: dict[tuple[str, str], Callable[[Records, PickledCall], Any]] = {
    **{(f"{numpy}.multiarray", "_reconstruct"): _array for numpy in NUMPY},
    **{(f"{numpy}.multiarray", "scalar"): _scalar for numpy in NUMPY},
    **{(f"{numpy}.numeric", "_frombuffer"): _from_buffer for numpy in NUMPY},
    JOBLIB: _wrapped,
}


def sizes_in(value: Any, what: str, most: int = 32) -> tuple[int, ...]:
    """A shape, or an order of axes: a few whole numbers of 32 bits. Raises ValueError."""
    if isinstance(value, np.ndarray) and value.size <= most:
        value = value.tolist()
    if not (isinstance(value, (tuple, list)) and len(value) <= most):
        raise ValueError(f"its {what} is no tuple of sizes")
    if not all(type(n) is int and -1 <= n < 2**31 for n in value):
        raise ValueError(f"its {what} is no tuple of sizes from 0 to {2**31 - 1:,}")
    return tuple(value)


def from_pointers(
    kind: str,
    data: NDArray[Any],
    indices: NDArray[Any],
    indptr: NDArray[Any],
    shape: tuple[int, int],
) -> csr_array:
    """A matrix stored by columns ("csc") or rows ("csr"). Raises ValueError for bad parts.

    scipy checks some of this, but only where the matrix has entries, and reads beyond the end of
    `indices` if the pointers of one that has none point somewhere in between.
    """
    lines, width = shape if kind == "csr" else shape[::-1]
    numbers, places, pointers = _native(data), _wholes(indices), _wholes(indptr)
    if pointers.shape != (lines + 1,) or numbers.shape != places.shape or places.ndim != 1:
        raise ValueError(
            f"its parts of {data.shape}, {indices.shape} and {indptr.shape} do not fit {shape}"
        )
    if pointers[0] != 0 or pointers[-1] > len(places) or (np.diff(pointers) < 0).any():
        raise ValueError("its pointers do not rise from 0 to the number of its entries")
    _check_places(places, width)
    return csr_array(COMPRESSED[kind]((numbers, places, pointers), shape=shape))


def from_places(
    data: NDArray[Any], row: NDArray[Any], column: NDArray[Any], shape: tuple[int, int]
) -> csr_array:
    """A matrix stored as entries with their rows and columns. Raises ValueError for bad parts."""
    numbers, rows, columns = _native(data), _wholes(row), _wholes(column)
    if not numbers.shape == rows.shape == columns.shape or numbers.ndim != 1:
        raise ValueError(f"its parts of {data.shape}, {row.shape} and {column.shape} do not fit")
    _check_places(rows, shape[0])
    _check_places(columns, shape[1])
    return csr_array(coo_array((numbers, (rows, columns)), shape=shape))


def _check_places(places: Index, end: int) -> None:
    if len(places) and not 0 <= places.min() <= places.max() < end:
        raise ValueError(
            f"its indices go from {places.min()} to {places.max()}, not 0 to {end - 1}"
        )


def _wholes(array: NDArray[Any]) -> Index:
    if array.dtype.kind not in "iu":
        raise ValueError("its indices are no whole numbers")
    return array.astype(np.int64)


def _native(array: NDArray[Any]) -> NDArray[Any]:
    """The array in the order of bytes of this machine."""
    return array.astype(array.dtype.newbyteorder("="), copy=False)
