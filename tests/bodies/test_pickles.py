"""Pickles: what a body's holds is read, what an attacker's asks for never happens."""

import os
import pickle
import struct
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from scipy.sparse import coo_matrix, csc_array, csc_matrix, csr_matrix

from tests.bodies.random_bodies import Entries, entries, equal_to
from tests.tiers import few
from workbench.bodies.catalogue import load_body
from workbench.bodies.files.pickles import (
    EFFECTS,
    KNOWN_NAMES,
    LITERALS,
    OPCODES,
    PickledCall,
    Unread,
    interpret,
    read_pickled_arrays,
)
from workbench.errors import BadFile, UnsafePickle

# A stand-in for the package chumpy, there while a file is written and gone when it is read.


class Ch:
    def __init__(self, **terms: Any) -> None:
        self.__dict__.update(terms)


class Select(Ch):
    pass


class transpose(Ch):  # noqa: N801
    pass


class add(Ch):  # noqa: N801
    pass


PLACES = (
    (Ch, "chumpy.ch"),
    (Select, "chumpy.reordering"),
    (transpose, "chumpy.reordering"),
    (add, "chumpy.ch_ops"),
)


@pytest.fixture
def chumpy(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setitem(sys.modules, "chumpy", ModuleType("chumpy"))
    for kind, place in PLACES:
        module = sys.modules.get(place, ModuleType(place))
        setattr(module, kind.__name__, kind)
        monkeypatch.setitem(sys.modules, place, module)
        monkeypatch.setattr(kind, "__module__", place)
    yield
    monkeypatch.undo()


def dumped(raw: Entries, path: Path, protocol: int = 2) -> Path:
    """A pickle of the entries, with chumpy already forgotten when this returns."""
    path.write_bytes(pickle.dumps(raw, protocol=protocol))
    for name in [name for name in sys.modules if name.split(".")[0] == "chumpy"]:
        del sys.modules[name]
    return path


def python_2_pickle(raw: dict[str, np.ndarray]) -> bytes:
    """A dictionary of float64 and int64 arrays, opcode by opcode as Python 2 wrote it."""
    out = [b"\x80\x02}("]
    for key, array in raw.items():
        code = array.dtype.str[1:].encode()
        content = array.tobytes()
        out += [
            b"U" + bytes([len(key)]) + key.encode(),
            b"cnumpy.core.multiarray\n_reconstruct\n(cnumpy\nndarray\nK\x00\x85U\x01btR(K\x01(",
            b"".join(b"J" + struct.pack("<i", n) for n in array.shape),
            b"tcnumpy\ndtype\n(U" + bytes([len(code)]) + code + b"K\x00K\x01tR(K\x03U\x01<NNNJ",
            b"\xff\xff\xff\xffJ\xff\xff\xff\xffK\x00tb\x89T" + struct.pack("<i", len(content)),
            content + b"tb",
        ]
    return b"".join([*out, b"u."])


# What is read.


KINDS = (np.asarray, csc_matrix, csr_matrix, coo_matrix, csc_array)
CASES = [
    *(pytest.param(protocol, csc_matrix) for protocol in range(pickle.HIGHEST_PROTOCOL + 1)),
    *(pytest.param(2, kind) for kind in KINDS),
]


@pytest.mark.parametrize(("protocol", "kind"), few(CASES, 3))
def test_every_protocol_and_sparse_kind_is_read(tmp_path: Path, protocol: int, kind: Any) -> None:
    raw = entries()
    raw["posedirs"] = np.asfortranarray(raw["posedirs"])  # stored column by column
    held = raw | {"J_regressor": kind(raw["J_regressor"]), "gender": "female", "n": np.float64(3)}
    path = dumped(held, tmp_path / "model.pkl", protocol)
    equal_to(raw, path)
    assert load_body(path).card["gender"] == "female"
    assert read_pickled_arrays(path)["n"] == 3


def test_pickles_of_python_2_are_read(tmp_path: Path) -> None:
    raw = entries()
    (tmp_path / "old.pkl").write_bytes(python_2_pickle(raw))
    theirs = pickle.loads(python_2_pickle(raw), encoding="latin1")  # the test's own file is one
    np.testing.assert_array_equal(theirs["weights"], raw["weights"])
    equal_to(raw, tmp_path / "old.pkl")


@pytest.mark.usefixtures("chumpy")
@pytest.mark.parametrize("protocol", few([2, 0, 1, 4], 1))
def test_values_of_chumpy_are_read_without_it(tmp_path: Path, protocol: int) -> None:
    raw = entries(N=20, B=4)
    wide = np.random.default_rng(5).normal(size=(20, 3, 9))
    idxs = np.arange(wide.size).reshape(wide.shape)[:, :, :4].ravel()
    held = raw | {
        "v_template": Ch(x=raw["v_template"], _dirty_vars={"x"}, dterms=["x"], cache={(1, 2): 3}),
        "weights": transpose(a=Ch(x=raw["weights"].T.copy()), axes=None),
        "posedirs": transpose(a=raw["posedirs"].transpose(2, 0, 1).copy(), axes=(1, 2, 0)),
        "shapedirs": Select(a=Ch(x=wide), idxs=idxs, preferred_shape=(20, 3, 4)),
        "J_regressor": csc_matrix(raw["J_regressor"]),
        "J": transpose(a=add(a=1, b=2)),
        "v_shaped": add(a=Ch(x=raw["v_template"]), b=1),
    }
    path = dumped(held, tmp_path / "model.pkl", protocol)
    assert "chumpy" not in sys.modules
    equal_to(raw | {"shapedirs": wide[:, :, :4]}, path)
    assert isinstance(read_pickled_arrays(path)["v_shaped"], Unread)
    assert "chumpy" not in sys.modules


@pytest.mark.usefixtures("chumpy")
def test_values_that_cannot_be_evaluated_are_refused(tmp_path: Path) -> None:
    for value, says in (
        (add(a=1, b=2), "chumpy would have to compute it"),
        (Ch(), "cannot be read"),
        (Select(a=np.zeros(3), idxs=np.array([7])), "out of bounds"),
        (np.array([None, 1]), "not of numbers"),
        ([1, 2], "must be an array"),
    ):
        path = tmp_path / "model.pkl"
        path.write_bytes(pickle.dumps(entries() | {"weights": value}, protocol=2))
        with pytest.raises(BadFile, match=f"weights.*{says}"):
            load_body(path)


def test_every_opcode_is_read_or_refused() -> None:
    refused = {"EXT1", "EXT2", "EXT4", "PERSID", "BINPERSID", "NEXT_BUFFER", "READONLY_BUFFER"}
    assert LITERALS | EFFECTS.keys() | {"PROTO", "FRAME", "STOP"} == (
        {opcode.name for opcode in OPCODES.values()} - refused
    )


# What is refused. Each attack tries to make the file `marker`.


class Calls:
    """Pickles as a call."""

    def __init__(self, function: Any, argument: str) -> None:
        self.call = function, (argument,)

    def __reduce__(self) -> Any:
        return self.call


def text(value: str) -> bytes:
    return b"\x8c" + bytes([len(value)]) + value.encode()


def stack_global(module: str, name: str) -> bytes:
    return b"\x80\x04" + text(module) + text(name) + b"\x93"


def command(marker: Path) -> bytes:
    return b"X" + struct.pack("<i", len(f"touch {marker}")) + f"touch {marker}".encode()


def attacks(marker: Path) -> dict[str, tuple[bytes, str]]:
    """PickledName -> (the file, what the refusal names)."""
    touch = command(marker)
    run_it = touch + b"\x85R."
    again = b"ccopy_reg\n_reconstructor\n"
    return {
        "os.system": (b"\x80\x02cposix\nsystem\n" + run_it, "posix.system"),
        "protocol 0": (b"cposix\nsystem\n(S'touch " + str(marker).encode() + b"'\ntR.", "posix.sy"),
        "STACK_GLOBAL": (stack_global("os", "system") + run_it, "os.system"),
        "dotted name": (stack_global("numpy", "os.system") + run_it, "numpy.os.system"),
        "dotted, chumpy": (stack_global("chumpy.ch", "os.system") + run_it, "chumpy.ch.os.system"),
        "chumpy's builtins": (b"\x80\x02cchumpy\n__builtins__\n" + run_it, "chumpy.__builtins__"),
        "private chumpy": (stack_global("chumpy._x", "y") + run_it, "chumpy._x.y"),
        "like chumpy": (b"\x80\x02cchumpyx\nsystem\n" + run_it, "chumpyx.system"),
        "eval": (b"\x80\x02cbuiltins\neval\n" + run_it, "builtins.eval"),
        "getattr": (b"\x80\x02c__builtin__\ngetattr\n" + run_it, "__builtin__.getattr"),
        "old sparse loader": (stack_global("scipy.sparse", "load_npz") + run_it, "load_npz"),
        "numpy.load": (stack_global("numpy", "load") + run_it, "numpy.load"),
        "numpy f2py": (stack_global("numpy.testing._private.utils", "runstring") + run_it, "runst"),
        "copyreg": (stack_global("copyreg", "add_extension") + run_it, "copyreg.add_extension"),
        "codecs": (stack_global("_codecs", "lookup") + run_it, "_codecs.lookup"),
        "INST": (b"(" + touch + b"iposix\nsystem\n.", "posix.system"),
        "OBJ": (b"(cposix\nsystem\n" + touch + b"o.", "posix.system"),
        "NEWOBJ": (b"\x80\x02csubprocess\nPopen\n" + touch + b"\x85\x81.", "subprocess.Popen"),
        "NEWOBJ_EX": (stack_global("subprocess", "Popen") + touch + b"\x85}\x92.", "subprocess."),
        "reconstructor": (again + b"(csubprocess\nPopen\nc__builtin__\nobject\nNtR.", "Popen"),
        "unnamed class": (again + b"(S'posix'\nc__builtin__\nobject\nNtR.", "calls a str"),
        "call of a call": (b"\x80\x02cbuiltins\nobject\n)R" + run_it, "calls a PickledCall"),
        "call of a text": (b"\x80\x02X\x02\x00\x00\x00os" + run_it, "calls a str"),
        "BUILD on a name": (
            b"\x80\x02cnumpy\nndarray\n}X\x01\x00\x00\x00aK\x01sb.",
            "of a PickledName",
        ),
        "BUILD on a dict": (b"\x80\x02}}b.", "inside of a dict"),
        "EXT1": (b"\x80\x02\x82\x01.", "EXT1"),
        "EXT4": (b"\x80\x02\x84\x01\x00\x00\x00.", "EXT4"),
        "persistent id": (b"Pposix.system\n.", "PERSID"),
        "binary persistent id": (b"\x80\x02K\x01Q.", "BINPERSID"),
        "out-of-band buffer": (b"\x80\x05\x97.", "NEXT_BUFFER"),
    }


@pytest.mark.parametrize("name", attacks(Path("marker")))
def test_attack_is_refused_by_name_and_nothing_runs(tmp_path: Path, name: str) -> None:
    pickled, named = attacks(tmp_path / "marker")[name]
    path = tmp_path / "model.pkl"
    for content in (pickled, b"(" + pickled if pickled[:1] in b"cP" else pickled):
        path.write_bytes(content)
        if content[:1] not in b"\x80(}]c":
            continue
        with pytest.raises(UnsafePickle, match=named.replace(".", r"\.")) as refusal:
            load_body(path)
        assert str(path) in str(refusal.value)
    assert not (tmp_path / "marker").exists()


def test_attack_would_work_in_python(tmp_path: Path) -> None:
    pickle.loads(attacks(tmp_path / "marker")["os.system"][0])
    assert (tmp_path / "marker").exists()


@pytest.mark.parametrize("protocol", few([2, 0, 5], 1))
def test_attack_inside_a_good_file_is_refused(tmp_path: Path, protocol: int) -> None:
    marker = tmp_path / "marker"
    trap = Calls(os.system, f"touch {marker}")
    for held in (
        {"weights": trap},
        {"notes": [{"deep": (1, trap)}]},
        {"objects": np.array([trap, None], dtype=object)},
    ):
        path = dumped(entries() | held, tmp_path / "model.pkl", protocol)
        with pytest.raises(UnsafePickle, match=r"posix\.system|nt\.system"):
            load_body(path)
    assert not marker.exists()


@pytest.mark.usefixtures("chumpy")
def test_state_cannot_change_what_a_record_does(tmp_path: Path) -> None:
    marker = tmp_path / "marker"
    value = np.arange(72.0).reshape(24, 3)
    wild = Ch(
        x=value,
        __class__="os",
        __setstate__="os",
        name="Select",
        arguments=(),
        state=None,
        __reduce__="posix.system",
        __dict__={"x": 1},
    )
    path = dumped({"a": wild}, tmp_path / "model.pkl")
    np.testing.assert_array_equal(read_pickled_arrays(path)["a"], value)
    assert not marker.exists()


def test_array_of_another_class_is_refused(tmp_path: Path) -> None:
    good = python_2_pickle({"a": np.zeros(3)})
    for subtype in (b"cnumpy\ndtype\n", b"cchumpy.ch\nCh\n", b"cbuiltins\nobject\n"):
        (tmp_path / "model.pkl").write_bytes(good.replace(b"cnumpy\nndarray\n", subtype))
        with pytest.raises(UnsafePickle, match="an array of a kind that is not read"):
            load_body(tmp_path / "model.pkl")


def test_known_names_make_records_alone() -> None:
    for module, name in KNOWN_NAMES:
        if name != "_reconstructor":
            made = interpret(b"c" + module.encode() + b"\n" + name.encode() + b"\n(S'x'\ntR.")
            assert isinstance(made, PickledCall)


def test_claimed_shape_allocates_nothing(tmp_path: Path) -> None:
    good = python_2_pickle({"weights": np.zeros((3, 5))})
    shape = b"J" + struct.pack("<i", 3) + b"J" + struct.pack("<i", 5)
    assert shape in good
    huge = b"J" + struct.pack("<i", 2**31 - 1) + shape[5:]
    for wrong in (huge, b"K\x02K\x05", b"J\xff\xff\xff\xffK\x05"):
        (tmp_path / "model.pkl").write_bytes(good.replace(shape, wrong))
        weights = read_pickled_arrays(tmp_path / "model.pkl")["weights"]
        assert isinstance(weights, Unread)
        assert "bytes" in weights.reason or "no tuple of sizes" in weights.reason


def test_indices_of_a_sparse_matrix_are_checked(tmp_path: Path) -> None:
    matrix = csc_matrix(entries()["J_regressor"])
    far, pointer, real, huge = (matrix.copy() for _ in range(4))
    beyond = csc_matrix(matrix.shape)  # without entries, so that SciPy asks for less
    far.indices[0] = 10**6
    pointer.indptr[3] = 10**6
    beyond.indptr[3] = 5
    real.indices = real.indices.astype(float)
    huge._shape = (10**10, 10**10)
    for wrong in (far, pointer, beyond, real, huge):
        path = dumped(entries() | {"J_regressor": wrong}, tmp_path / "model.pkl")
        with pytest.raises(BadFile, match=r"J_regressor is a scipy.*that cannot be read"):
            load_body(path)
