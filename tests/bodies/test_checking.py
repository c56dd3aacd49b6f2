"""Each fault of a model file is found and said, and nothing is found in good ones."""

import re
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.bodies.model_files import foreign, mano, smplx, with_fingers, written
from tests.bodies.random_bodies import Entries
from tests.tiers import few
from workbench.bodies import FileCheck, check_body_file
from workbench.bodies.catalogue import BODIES, load_body
from workbench.bodies.checking.check_file import check_contents
from workbench.bodies.files.saving import arrays_of
from workbench.errors import BadFile

Change = Callable[[Entries], Entries]


@cache
def whole(base: str) -> Entries:
    """A file without faults, by the name that it has below."""
    if base == "SMPLH_NEUTRAL":
        return with_fingers()
    names = {"MANO_RIGHT": "hand", "MANO_LEFT": "hand-left", "SMPL_MALE": "small"}
    return foreign(names[base])


def checked(base: str, change: Change) -> FileCheck:
    raw = {key: value.copy() for key, value in whole(base).items()}
    raw |= change(raw)
    return check_contents({k: v for k, v in raw.items() if v is not None}, f"{base}.npz")


LOOKED_AT = [n for n in BODIES if n not in ("full-hands-female", "full-hands-male")]  # 2 s each


@pytest.mark.parametrize("name", few(LOOKED_AT, ("default", "hand", "small-scape")))
def test_shipped_bodies_have_no_findings(name: str) -> None:
    found = check_contents(dict(arrays_of(load_body(name))), name)
    assert found.findings == ()
    assert found.facts["loads"] == "yes"


@pytest.mark.parametrize("base", few(["SMPL_MALE", "MANO_LEFT", "MANO_RIGHT", "SMPLH_NEUTRAL"], 2))
def test_same_bodies_in_other_layouts_have_no_warnings(base: str) -> None:
    found = checked(base, lambda raw: {})
    assert found.warnings == ()
    assert found.facts["loads"] == "yes"


def at(key: str, place: Any, value: float) -> Change:
    """The array with one number, or some of them, replaced."""

    def change(raw: Entries) -> Entries:
        array = raw[key].astype(np.float64) if isinstance(value, float) else raw[key].copy()
        array[place] = value
        return {key: array}

    return change


def scaled(factor: float, *keys: str) -> Change:
    return lambda raw: {key: raw[key] * factor for key in keys}


def turned(*axes: int, signs: tuple[int, int, int]) -> Change:
    """The model in other axes: each of its coordinates is one of the old ones, with a sign."""

    def change(raw: Entries) -> Entries:
        template = raw["v_template"][:, list(axes)] * signs
        others = {
            key: raw[key][:, list(axes)] * np.array(signs)[:, None]
            for key in ("shapedirs", "posedirs")
        }
        handed = np.linalg.det(np.eye(3)[list(axes)] * np.array(signs)[:, None])
        return {"v_template": template} | others | ({"f": raw["f"][:, ::-1]} if handed < 0 else {})

    return change


def parent(k: int, value: int) -> Change:
    def change(raw: Entries) -> Entries:
        table = raw["kintree_table"].astype(np.int64)
        table[0, k] = value
        return {"kintree_table": table}

    return change


def put(**changes: Any) -> Change:
    return lambda raw: changes


def computed(key: str, function: Callable[[Any], Any]) -> Change:
    return lambda raw: {key: function(raw[key])}


BODY, RIGHT, LEFT, BOTH = "SMPL_MALE", "MANO_RIGHT", "MANO_LEFT", "SMPLH_NEUTRAL"
LENGTHS = ("v_template", "shapedirs", "posedirs")
NEGATIVE = np.eye(369, 24, 1) * 1.2 - np.eye(369, 24) * 1.2
UNMIRRORED = np.array([-1, 1, 1])[:, None]
# A name for each fault, the file, what is changed, the key that is blamed, and what is said.
FAULTS: dict[str, tuple[str, Change, str, str]] = {
    "weights sum to 0.98": (BODY, scaled(0.98, "weights"), "weights", "do not sum to 1"),
    "millimetres": (BODY, scaled(1000, *LENGTHS), "v_template", "in millimetres it would be"),
    "inches": (
        BODY,
        scaled(1 / 0.0254, *LENGTHS),
        "v_template",
        "in inches it would be 1.69 m, .* Multiply .* by 0.0254",
    ),
    "z up": (BODY, turned(0, 2, 1, signs=(1, -1, 1)), "v_template", "stands along z, but y"),
    "mirrored": (BODY, turned(0, 1, 2, signs=(-1, 1, 1)), "v_template", "are swapped"),
    "inside out": (BODY, computed("f", lambda f: f[:, ::-1]), "f", "look inwards"),
    "faces from 1": (BODY, computed("f", lambda f: f + 1), "f", "from 1 to 369.* Subtract 1"),
    "NaN": (BODY, at("posedirs", (3, 1, 7), np.nan), "posedirs", r"first at \[3, 1, 7\]"),
    "child before parent": (BODY, parent(4, 7), "kintree_table", "Joint 4 .* has parent 7, which"),
    "another tree": (BODY, parent(14, 12), "kintree_table", "tree is another one"),
    "another model's columns": (
        BOTH,
        put(posedirs=np.zeros((1229, 3, 207))),
        "posedirs",
        "52 joints have 459 .* as many as 24 joints",
    ),
    "no posedirs": (BODY, put(posedirs=None), "posedirs", "There is no posedirs"),
    "left hand with right shapes": (
        LEFT,
        computed("shapedirs", lambda dirs: dirs * UNMIRRORED),
        "shapedirs",
        "x of shapedirs was not mirrored",
    ),
    "weights of other joints": (
        BODY,
        computed("weights", lambda w: w[:, ::-1]),
        "weights",
        "no nearer to the vertices that they move",
    ),
    # The default run ends here.
    "negative weights": (
        BODY,
        computed("weights", lambda w: w + NEGATIVE),
        "weights",
        "below zero",
    ),
    "face out of range": (BODY, at("f", (7, 2), 5000), "f", r"face 7 is \[\d+, \d+, 5000\]"),
    "unknown parent": (BODY, parent(4, 99), "kintree_table", "parent 99, which is no joint"),
    "rows swapped": (
        BODY,
        computed("kintree_table", lambda t: t[::-1]),
        "kintree_table",
        "swapped",
    ),
    "shape in millimetres": (BODY, scaled(1000, "shapedirs"), "shapedirs", "another unit than"),
    "unmirrored mean": (
        BOTH,
        lambda raw: {"hands_meanl": raw["hands_meanr"]},
        "hands_meanl",
        "bends the fingers of the left hand backwards",
    ),
    "other skinning": (BODY, put(bs_style=np.array("dqbs")), "file", "refused by load_body"),
}
BESIDE = {"negative weights": {"J_regressor"}}  # faults from which others follow


@pytest.mark.parametrize("fault", few(FAULTS, 14))
def test_fault_is_found_and_nothing_else_blamed(fault: str) -> None:
    base, change, part, says = FAULTS[fault]
    found = checked(base, change)
    blamed = [finding.text for finding in found.warnings if finding.part == part]
    assert any(re.search(says, text) for text in blamed), "\n".join(found.lines())
    assert {f.part for f in found.warnings} - {part} <= BESIDE.get(fault, set()), found.lines()
    assert all(len(finding.text) < 600 for finding in found.findings)


def test_findings_name_no_sizes_that_are_unknown() -> None:
    check = checked("SMPL_MALE", lambda raw: {"v_template": None, "weights": raw["weights"][:, 1:]})
    (text,) = (finding.text for finding in check.findings if finding.part == "weights")
    assert "joints of kintree_table" in text
    assert "None" not in text


def test_odd_numbers_of_expressions_are_judged() -> None:
    for B, warned in ((400, False), (20, False), (300, True)):
        found = check_contents(smplx(B=B), "SMPLX_NEUTRAL.npz")
        assert any("all of them count as shape" in f.text for f in found.warnings) == warned


# Files.


def test_report_tells_facts_and_fate_of_every_key(tmp_path: Path) -> None:
    text = "For research alone. " * 3
    raw = mano() | {"LICENSE": text, "training_info": {"rms": 1}}
    found = check_body_file(written(raw, tmp_path / "MANO_RIGHT.pkl"))
    assert found.facts["model"] == "in the layout of MANO"
    assert found.facts["joints"].startswith("16: wrist, index1")
    assert found.facts["LICENSE"] == text
    assert found.facts["file"].startswith("pickle, of which no code was run")
    fates = {key: fate for key, _, fate in found.keys}
    assert fates["weights"] == "computed with"
    assert fates["hands_components"] == fates["bs_type"] == "kept, and saved again"
    assert fates["training_info"].startswith("left out")
    report = found.report()
    assert report.startswith(str(tmp_path / "MANO_RIGHT.pkl"))
    assert "(40, 3) float64" in report


def test_side_of_a_hand_is_told() -> None:
    for base, side in ((RIGHT, "right"), (LEFT, "left")):
        assert checked(base, lambda raw: {}).facts["side"].startswith(f"a {side} hand")
    without = checked(RIGHT, put(hands_mean=np.zeros(45)))
    assert without.facts["side"].startswith("unknown")


def test_files_without_a_body_are_refused(tmp_path: Path) -> None:
    motion = {"poses": np.zeros((4, 72)), "trans": np.zeros((4, 3))}
    mesh = {"v_template": np.zeros((4, 3)), "f": np.zeros((2, 3))}
    for raw, says in ((motion, "looks like a motion"), (mesh, "holds no body")):
        np.savez(tmp_path / "a.npz", **raw)
        with pytest.raises(BadFile, match=says):
            check_body_file(tmp_path / "a.npz")
