"""Stacks of meshes in one .npy, and facts in JSON beside the arrays."""

import json
import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from builder.bodies import already_made
from builder.sets import SetRecipe
from tests.hardening.archives import npy
from workbench.cli.train import _origin
from workbench.comparison.store import Folder
from workbench.errors import BadFile
from workbench.reading.facts import json_in
from workbench.reports.folder import SUMMARY, replacing_folder
from workbench.solvers import Solution
from workbench.synthetic.ground_truth import CARD
from workbench.synthetic.made_up import jointed_tube
from workbench.training.folder import FolderRegistrations, Row

START = jointed_tube(7, 5)
N = len(START.template)
STACK = np.stack([START.template] * 3).astype(np.float32)


def header(descr: str, shape: str, numbers: bytes = b"") -> bytes:
    text = f"{{'descr': {descr}, 'fortran_order': False, 'shape': {shape}}}\n".encode()
    return b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text + numbers


STACKS: dict[str, tuple[bytes, str]] = {
    "empty": (b"", "EOF"),
    "text": (b"no array", "magic string"),
    "a pickle": (b"\x80\x04K\x01.", "EOF"),
    "an archive": (b"PK\x03\x04" + bytes(60), "magic string"),
    "cut off": (npy(STACK)[:-4], "shorter"),
    "too long": (npy(STACK) + b"1", "longer"),
    "an unknown version": (npy(STACK).replace(b"Y\x01\x00", b"Y\x07\x00"), "version (7, 0)"),
    "a header that never ends": (header("'<f4", "(3,"), ""),
    "a header that is none": (header("'''", "(3"), ""),
    "a milliard meshes": (header("'<f4'", f"(1000000000, {N}, 3)"), "shorter"),
    "more than can be counted": (header("'<f4'", f"({2**62}, {N}, 3)"), "shorter"),
    "fewer than none": (header("'<f4'", f"(-1, {N}, 3)"), "cannot have"),
    "arrays in an array": (header("('<f4', (3,))", f"(1, {N})"), "cannot have"),
    "objects": (npy(np.array([{}, None], dtype=object)), "Python objects"),
    "bytes of no type": (header("'<U0'", "(1000000000000,)"), "shorter"),
    "complex": (npy(STACK.astype(complex)), "complex128"),
    "text in place of numbers": (npy(np.full(STACK.shape, "1")), "not float32"),
    "whole numbers": (npy(STACK.astype(int)), "int64, not float32"),
    "half precision": (npy(STACK.astype(np.float16)), "float16, not float32"),
    "truth values": (npy(STACK > 0), "bool, not float32"),
    "columns": (npy(np.zeros(3, [("x", "f4")])), "not float32"),
    "no axes": (npy(np.float32(1)), "name one of its rows"),
    "one axis": (npy(STACK.ravel()), "name one of its rows"),
    "four axes": (npy(STACK[None]), "name one of its rows"),
    "no meshes": (npy(STACK[:0]), "name one of its rows"),
    "other vertices": (npy(STACK[:, 1:]), f"the topology has ({N}, 3)"),
    "two coordinates": (npy(STACK[..., :2]), f"the topology has ({N}, 3)"),
    "NaN": (npy(np.full_like(STACK, np.nan)), "repair it"),
}


def one(path: Path, row: str = "#1") -> np.ndarray:
    found = FolderRegistrations(path.parent, (Row(path.name + row, "a"),), N, START.faces)
    return found.read(slice(0, 1)).vertices[0]


def test_a_stack_is_read_in_any_order_of_its_axes(tmp_path: Path) -> None:
    for array in (STACK, np.asfortranarray(STACK), STACK.astype(">f8")):
        np.save(tmp_path / "many.npy", array)
        np.testing.assert_array_equal(one(tmp_path / "many.npy"), STACK[1])
    np.save(tmp_path / "many.npy", STACK[0])
    np.testing.assert_array_equal(one(tmp_path / "many.npy", ""), STACK[0])


@pytest.mark.parametrize("name", STACKS)
def test_a_stack_that_is_none_is_refused(name: str, tmp_path: Path) -> None:
    content, says = STACKS[name]
    (tmp_path / "many.npy").write_bytes(content)
    with pytest.raises(BadFile) as caught:
        one(tmp_path / "many.npy")
    assert "many.npy" in str(caught.value)
    assert says in str(caught.value)


def test_a_stack_larger_than_memory_costs_only_what_is_read(tmp_path: Path) -> None:
    """A terabyte of nothing: what a file system keeps of it is its header."""
    start = header("'<f4'", f"({2**40 // (12 * N)}, {N}, 3)")
    with (tmp_path / "many.npy").open("wb") as file:
        file.write(start)
        try:
            file.truncate(len(start) + 2**40 // (12 * N) * 12 * N)
        except OSError:
            pytest.skip("this file system has no file as large")
    assert not one(tmp_path / "many.npy").any()


JSON: dict[str, bytes] = {
    "empty": b"",
    "text": b"made by hand",
    "cut off": b'{"made_by": "work',
    "no UTF-8": b'{"kind": "\xff\xfe"}',
    "brackets that do not close": b"[" * 100_000,
    "names in names": b'{"a":' * 50_000 + b"1" + b"}" * 50_000,
    "a number of five thousand digits": b"9" * 5000,
    "a null byte": b"{}\0",
}
OTHER_JSON: dict[str, bytes] = {
    "a list": b"[]",
    "nothing": b"null",
    "a number": b"5",
    "another's": b'{"made_by": "me", "kind": "else"}',
    "no names": b'{"kind": ["comparison"]}',
}
EACH_JSON = pytest.mark.parametrize("name", JSON)


@EACH_JSON
def test_what_is_no_json_is_said(name: str, tmp_path: Path) -> None:
    (tmp_path / "facts.json").write_bytes(JSON[name])
    with pytest.raises(BadFile, match=r"facts\.json cannot be read as JSON"):
        json_in(tmp_path / "facts.json")


@pytest.mark.parametrize("name", [*JSON, *OTHER_JSON])
def test_a_folder_with_another_mark_is_no_comparison(name: str, tmp_path: Path) -> None:
    (tmp_path / "comparison.json").write_bytes((JSON | OTHER_JSON)[name])
    with pytest.raises(BadFile, match="holds no comparison"):
        Folder(tmp_path)


@pytest.mark.parametrize("name", [*JSON, *OTHER_JSON])
def test_a_folder_with_another_summary_is_not_overwritten(name: str, tmp_path: Path) -> None:
    folder = tmp_path / "report"
    folder.mkdir()
    (folder / SUMMARY).write_bytes((JSON | OTHER_JSON)[name])
    with pytest.raises(BadFile, match="is not overwritten"), replacing_folder(folder):
        pass
    assert (folder / SUMMARY).read_bytes() == (JSON | OTHER_JSON)[name]


@pytest.mark.parametrize("files", [5, None, "index.html", [5, None, []], {"a": 1}])
def test_a_summary_whose_files_are_none_takes_nothing_away(files: object, tmp_path: Path) -> None:
    folder = tmp_path / "report"
    folder.mkdir()
    (folder / SUMMARY).write_text(json.dumps({"made_by": "workbench", "files": files}))
    (folder / "mine.txt").write_text("kept")
    with replacing_folder(folder) as fresh:
        (fresh / SUMMARY).write_text("{}")
    assert (folder / "mine.txt").read_text() == "kept"


@EACH_JSON
def test_a_card_of_registrations_that_is_none_is_said(name: str, tmp_path: Path) -> None:
    (tmp_path / CARD).write_bytes(JSON[name])
    with pytest.raises(BadFile, match=rf"{CARD} cannot be read as JSON.*remove it or correct it"):
        _origin(tmp_path)


@EACH_JSON
def test_sets_of_another_recipe_are_not_overwritten(name: str, tmp_path: Path) -> None:
    for folder in ("train", "held_out"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / CARD).write_bytes(JSON[name])
    with pytest.raises(BadFile, match="were made otherwise"):
        already_made(tmp_path, SetRecipe(), None)


PIPES: dict[str, Callable[[Path], object]] = {
    "archive": Solution.load,
    "stack": lambda path: one(path, "#0"),
}


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="there are no pipes here")
@pytest.mark.parametrize("name", PIPES)
def test_a_pipe_is_not_waited_for(name: str, tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.npy")
    with pytest.raises(BadFile, match="a pipe"):
        PIPES[name](tmp_path / "pipe.npy")
