"""Each fault of a model file is found and said, and nothing is found in good ones."""

import itertools
import re
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.sparse import csr_array

from tests.bodies.model_files import foreign, mano, smplx, with_fingers, written
from tests.bodies.random_bodies import Entries
from workbench.bodies import FileCheck, check_body_file, mirrored, pose_space
from workbench.bodies.catalogue import BODIES, load_body, load_skinned
from workbench.bodies.checking.check_file import check_contents
from workbench.bodies.checking.model_arrays import model_arrays
from workbench.bodies.checking.trees import EXCHANGED, FAR, joints_away
from workbench.bodies.files.saving import arrays_of, save_body
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


@pytest.mark.parametrize("name", BODIES)
def test_nothing_is_wrong_with_the_embedded_bodies(name: str) -> None:
    found = check_contents(dict(arrays_of(load_body(name))), name)
    assert found.findings == ()
    assert found.facts["loads"] == "yes"


@pytest.mark.parametrize("base", ["SMPL_MALE", "MANO_RIGHT", "MANO_LEFT", "SMPLH_NEUTRAL"])
def test_nothing_is_wrong_with_the_same_in_other_layouts(base: str) -> None:
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


def joints_in_order(order: list[int]) -> Change:
    """The same body with its joints in another order; the tree says so."""

    def change(raw: Entries) -> Entries:
        parents = raw["kintree_table"][0].astype(np.int64)
        parents[0] = -1
        places = {old: new for new, old in enumerate(order)}
        table = np.array([[places.get(int(parents[old]), -1) for old in order], range(len(order))])
        groups = raw["posedirs"].reshape(len(raw["v_template"]), 3, -1, 9)
        later = [old - 1 for old in order if old]
        return {
            "kintree_table": table,
            "weights": raw["weights"][:, order],
            "J_regressor": raw["J_regressor"][order],
            "posedirs": groups[:, :, later].reshape(len(groups), 3, -1),
        }

    return change


def parent(k: int, value: int) -> Change:
    def change(raw: Entries) -> Entries:
        table = raw["kintree_table"].astype(np.int64)
        table[0, k] = value
        return {"kintree_table": table}

    return change


def joint_pulled(k: int, metres: float) -> Change:
    """A joint outside of its skin, along x, by a row of the regressor that still sums to 1."""

    def change(raw: Entries) -> Entries:
        x = raw["v_template"][:, 0]
        row = np.zeros(len(x))
        row[[x.argmax(), x.argmin()]] = 1, -1
        regressor = raw["J_regressor"].copy()
        regressor[k] -= row * metres / np.ptp(x)
        return {"J_regressor": regressor}

    return change


def more_betas(count: int) -> Change:
    def change(raw: Entries) -> Entries:
        N, _, B = raw["shapedirs"].shape
        return {"shapedirs": np.dstack([raw["shapedirs"], np.zeros((N, 3, count - B))])}

    return change


def drawn_in_its_mean_pose(raw: Entries) -> Entries:
    hand = load_skinned("hand")
    return {"v_template": hand.vertices(pose_space(hand).poses(hand, np.zeros(45)))}


def coefficients_with_the_mean(raw: Entries) -> Entries:
    rows, mean = raw["hands_components"], raw["hands_mean"]
    around = np.random.default_rng(0).normal(size=(50, 45))
    around -= around.mean(axis=0)
    return {"hands_coeffs": around * 0.3 + mean @ np.linalg.pinv(rows)}


def on_faces(**changes: Any) -> Change:
    def change(raw: Entries) -> Entries:
        F = len(raw["f"])
        good = {
            "lmk_faces_idx": np.arange(51) % F,
            "lmk_bary_coords": np.full((51, 3), 1 / 3),
            "ft": raw["f"],
            "vt": np.zeros((len(raw["v_template"]), 2)),
        }
        return good | changes

    return change


BODY, RIGHT, LEFT, BOTH = "SMPL_MALE", "MANO_RIGHT", "MANO_LEFT", "SMPLH_NEUTRAL"
COLLARS = [*range(13), 14, 13, *range(15, 24)]
SWAPPED = [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 18, 19, 16, 17, 20, 21, 22, 23]
# A name for each fault, the file, what is changed, the key that is blamed, and what is said.
FAULTS: dict[str, tuple[str, Change, str, str]] = {
    "weights sum to 0.98": (
        BODY,
        scaled(0.98, "weights"),
        "weights",
        r"369 of 369 vertices do not sum to 1; those of vertex \d+ sum to 0\.98.* Divide each row",
    ),
    "a negative weight": (
        BODY,
        lambda raw: {
            "weights": raw["weights"] + np.eye(369, 24) * [-1.2] + np.eye(369, 24, 1) * 1.2
        },
        "weights",
        "have weights below zero.* Set them to zero",
    ),
    "a regressor of 0.9": (
        BODY,
        lambda raw: {
            "J_regressor": raw["J_regressor"] * np.where(np.arange(24) == 4, 0.9, 1)[:, None]
        },
        "J_regressor",
        r"1 of 24 joints .* that of joint 4 \(left_knee\) sums to 0\.9",
    ),
    "NaN in posedirs": (
        BODY,
        at("posedirs", (3, 1, 7), np.nan),
        "posedirs",
        r"1 entry that is not finite, the first at \[3, 1, 7\].* Export",
    ),
    "infinity in a sparse regressor": (
        BODY,
        lambda raw: {"J_regressor": csr_array(np.where(raw["J_regressor"], np.inf, 0))},
        "J_regressor",
        "not finite",
    ),
    "NaN in what is only kept": (RIGHT, at("hands_mean", 4, np.nan), "hands_mean", "not finite"),
    "a face out of range": (
        BODY,
        at("f", (7, 2), 5000),
        "f",
        r"1 of \d+ faces name vertices that do not exist: face 7 is \[\d+, \d+, 5000\]",
    ),
    "faces from 1": (BODY, lambda raw: {"f": raw["f"] + 1}, "f", "from 1 to 369.* Subtract 1"),
    "a child before its parent": (
        BODY,
        joints_in_order([0, 2, 1, 3, 7, 5, 6, 4, *range(8, 24)]),
        "kintree_table",
        r"Joint 4 .* has parent 7, which does not come before it\. Sort the joints",
    ),
    "a circle": (BODY, parent(4, 7), "kintree_table", "Some joints are their own ancestors"),
    "a parent that is none": (BODY, parent(4, 99), "kintree_table", "parent 99, which is no joint"),
    "a second root": (BODY, parent(5, -1), "kintree_table", "joint 0 alone has no parent"),
    "a root that is none": (BODY, parent(0, 3), "kintree_table", "Joint 0 has parent 3"),
    "rows swapped": (
        BODY,
        lambda raw: {"kintree_table": raw["kintree_table"][::-1]},
        "kintree_table",
        r"rows of kintree_table are swapped.* kintree_table\[::-1\]",
    ),
    "numbers in disorder": (
        BODY,
        lambda raw: {"kintree_table": raw["kintree_table"] * [[1], [2]]},
        "kintree_table",
        r"must number the joints 0, 1, 2, \.\.\., but begins \[0, 2, 4, 6, 8\]",
    ),
    "another tree of 24": (
        BODY,
        parent(16, 12),
        "kintree_table",
        r"parent of joint 16 \(left_shoulder\) is joint 12 \(neck\), and in SMPL it is joint 13",
    ),
    "joints in the order of another model": (
        BODY,
        joints_in_order(COLLARS),
        "kintree_table",
        "24 joints as in SMPL, but the tree is another one",
    ),
    "a regressor in another order": (
        BODY,
        lambda raw: {"J_regressor": raw["J_regressor"][SWAPPED]},
        "J_regressor",
        r"Joint 16 \(left_shoulder\) and joint 18 \(left_elbow\) would be closer .* changed places",
    ),
    "a mesh in another order": (
        BODY,
        lambda raw: {"J_regressor": np.roll(raw["J_regressor"], 40, axis=1)},
        "J_regressor",
        "take all from one file",
    ),
    "a joint far out": (
        BODY,
        joint_pulled(23, 0.4),
        "J_regressor",
        r"Of 24 joints, 1 joint is far from the skin .* joint 23 \(right_hand\) is",
    ),
    "millimetres": (
        BODY,
        scaled(1000, "v_template", "shapedirs", "posedirs"),
        "v_template",
        r"in millimetres it would be 1\.69 m\. Multiply .* by 0\.001",
    ),
    "a hand in centimetres": (
        RIGHT,
        scaled(100, "v_template", "shapedirs", "posedirs"),
        "v_template",
        r"too large for MANO; in centimetres it would be 0\.22 m",
    ),
    "a size in no unit": (BODY, scaled(1e6, "v_template"), "v_template", "Find out its unit"),
    "shape in millimetres alone": (
        BODY,
        scaled(1000, "shapedirs"),
        "shapedirs",
        "would tear it apart.* another unit than v_template",
    ),
    "poses in millimetres alone": (BODY, scaled(1000, "posedirs"), "posedirs", "another unit"),
    "z up": (
        BODY,
        turned(0, 2, 1, signs=(1, -1, 1)),
        "v_template",
        r"stands along z, but y points up.* turned by \(-1\.5708, 0, 0\) rad",
    ),
    "facing -z": (
        BODY,
        turned(0, 1, 2, signs=(-1, 1, -1)),
        "v_template",
        r"left side of the model is along -x.* turned by \(0, -?3\.1416, 0\) rad",
    ),
    "mirrored": (
        BODY,
        turned(0, 1, 2, signs=(-1, 1, 1)),
        "v_template",
        "Left and right are swapped",
    ),
    "inside out": (BODY, lambda raw: {"f": raw["f"][:, ::-1]}, "f", r"look inwards.* f\[:, ::-1\]"),
    "10 of 300 betas do something": (
        BODY,
        more_betas(300),
        "shapedirs",
        r"Only the first 10 of 300 .* keep shapedirs\[:, :, :10\]",
    ),
    "10 of 300 betas are there": (
        BODY,
        lambda raw: {"num_betas": np.array(300)},
        "num_betas",
        "says 300 in num_betas, but shapedirs has 10 directions: it was cut to 10 of 300",
    ),
    "columns of another model": (
        BOTH,
        lambda raw: {"posedirs": np.zeros((1229, 3, 207))},
        "posedirs",
        r"207 columns, but 52 joints have 459 .* as many as 24 joints have",
    ),
    "quaternions of every joint": (
        BODY,
        lambda raw: {"posedirs": np.zeros((369, 3, 96))},
        "posedirs",
        "root included, as in SUPR",
    ),
    "weights of another mesh": (
        BODY,
        lambda raw: {"weights": raw["weights"][:300]},
        "weights",
        r"shape \(300, 24\), but must be \(369, 24\) for the 369 vertices",
    ),
    "no posedirs": (
        BODY,
        lambda raw: {"posedirs": None},
        "posedirs",
        "There is no posedirs .what poses do",
    ),
    "texts for numbers": (
        BODY,
        lambda raw: {"weights": np.array(["a", "b"])},
        "weights",
        "must hold numbers",
    ),
    "a left hand with right shapes": (
        LEFT,
        lambda raw: {"shapedirs": raw["shapedirs"] * np.array([-1, 1, 1])[:, None]},
        "shapedirs",
        r"x of shapedirs was not mirrored .* shapedirs\[:, 0, :\] \*= -1",
    ),
    "a right hand in the left hand's file": (
        LEFT,
        lambda raw: whole(RIGHT),
        "hands_mean",
        "says left, but this is a right hand",
    ),
    "an unmirrored mean of the left hand": (
        BOTH,
        lambda raw: {"hands_meanl": raw["hands_meanr"]},
        "hands_meanl",
        r"hands_meanl bends the fingers of the left hand backwards.* by \(1, -1, -1\)",
    ),
    "the same mean for both hands": (
        BOTH,
        lambda raw: {"hands_meanl": raw["hands_meanr"]},
        "hands_meanl",
        "is the same as hands_meanr",
    ),
    "a mean added twice on the left": (
        BOTH,
        scaled(2, "hands_meanl"),
        "hands_meanl",
        "twice the mean of the other hand.* Halve it",
    ),
    "a mean added twice on the right": (
        BOTH,
        scaled(2, "hands_meanr"),
        "hands_meanr",
        "twice the mean of the other hand.* Halve it",
    ),
    "the mean in the template too": (
        RIGHT,
        drawn_in_its_mean_pose,
        "v_template",
        r"bent by \d+ degrees .* would be added twice",
    ),
    "the mean in the coefficients too": (
        RIGHT,
        coefficients_with_the_mean,
        "hands_coeffs",
        "the mean is added twice. Subtract",
    ),
    "components as columns": (
        RIGHT,
        lambda raw: {"hands_components": raw["hands_components"][:12].T},
        "hands_components",
        "components are rows.* Transpose it",
    ),
    "a mean of ten joints": (
        RIGHT,
        lambda raw: {"hands_mean": np.zeros(30)},
        "hands_mean",
        "has 30 numbers, but the 15 joints of a hand have 45",
    ),
    "landmarks of another mesh": (
        BODY,
        on_faces(lmk_faces_idx=np.full(51, 90000)),
        "lmk_faces_idx",
        "names face 90000",
    ),
    "landmarks off the surface": (
        BODY,
        on_faces(lmk_bary_coords=np.full((51, 3), 0.5)),
        "lmk_bary_coords",
        "51 of 51 landmarks .* do not sum to 1",
    ),
    "fewer landmarks": (
        BODY,
        on_faces(lmk_bary_coords=np.full((50, 3), 1 / 3)),
        "lmk_bary_coords",
        r"has shape \(50, 3\)",
    ),
    "texture from 1": (
        BODY,
        lambda raw: on_faces(ft=raw["f"] + 1)(raw),
        "ft",
        "subtract 1 if ft counts from 1",
    ),
    "another style of skinning": (
        BODY,
        lambda raw: {"bs_style": np.array("dqbs")},
        "file",
        "refused by load_body: .*skinned by bs_style 'dqbs'",
    ),
}


BESIDE = {  # faults from which others follow
    "a negative weight": {"J_regressor"},
    "a mesh in another order": {"v_template"},
}


@pytest.mark.parametrize("fault", FAULTS)
def test_each_fault_is_found_and_said_and_nothing_else_is_blamed(fault: str) -> None:
    base, change, part, says = FAULTS[fault]
    found = checked(base, change)
    blamed = [finding.text for finding in found.warnings if finding.part == part]
    assert any(re.search(says, text) for text in blamed), "\n".join(found.lines())
    assert {f.part for f in found.warnings} - {part} <= BESIDE.get(fault, set()), found.lines()
    for text in (finding.text for finding in found.findings):
        assert text.endswith(".")
        assert len(text) < 600


def test_notes_do_not_count_as_warnings() -> None:
    for base, change, part, says in (
        (BODY, lambda raw: {"vert_sym_idxs": np.arange(369) + 1}, "vert_sym_idxs", "no mirror"),
        (BODY, at("f", (0, 1), 0), "f", "corner twice"),
        (BODY, lambda raw: {}, "shapedirs", "SMPL was released with up to 300"),
        (BODY, on_faces(ft=np.zeros((5, 3), int)), "ft", "5 rows, one for each face"),
        (
            RIGHT,
            lambda raw: {"info": np.array({}, dtype=object)},
            "info",
            "left out, because it is",
        ),
    ):
        raw = whole(base)
        if part == "f":
            change = at("f", (0, slice(None)), int(raw["f"][0, 0]))
        found = checked(base, change)
        assert found.warnings == ()
        assert any(n.part == part and says in n.text for n in found.findings), found.lines()


@pytest.mark.parametrize(
    ("B", "warned", "says"),
    [
        (400, False, ""),
        (20, False, "10 directions of shape and 10 of expression, of 300 and 100"),
        (10, True, "smplx takes directions 10 to 19 for expressions"),
        (300, True, "Here all of them count as shape"),
    ],
)
def test_the_numbers_of_shape_and_expression(B: int, warned: bool, says: str) -> None:
    found = check_contents(smplx(B=B), "SMPLX_NEUTRAL.npz")
    about = [finding for finding in found.findings if finding.part == "shapedirs"]
    assert [finding.warning for finding in about] == ([warned] if says else [])
    assert says in "".join(finding.text for finding in about)


def test_joints_are_where_their_skin_begins() -> None:
    """The bounds leave room to what the embedded bodies have, and few exchanges go unseen."""
    for name, least in (("default", 0.95), ("hand", 0.95)):
        away = joints_away(model_arrays(dict(arrays_of(load_body(name))), name))
        assert away is not None
        assert 0.01 < np.nanmax(np.diag(away)) < FAR / 2
        K, seen = len(away), []
        for i, j in itertools.combinations(range(K), 2):
            order = np.arange(K)
            order[[i, j]] = j, i
            own = np.diag(away[order])
            gains = own[:, None] + own - away[order] - away[order].T
            seen.append(bool(np.nanmax(gains) > EXCHANGED or np.nanmax(own) > FAR))
        assert np.mean(seen) > least
        own = np.diag(away)
        assert np.nanmax(own[:, None] + own - away - away.T - np.eye(K)) < 0


# Files.


def test_a_card_of_a_file(tmp_path: Path) -> None:
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
    assert "a dict" in next(f.text for f in found.findings if f.part == "training_info")
    report = found.report()
    assert report.startswith(str(tmp_path / "MANO_RIGHT.pkl"))
    assert "(40, 3) float64" in report
    assert "warning: v_template: The model is " in report


def test_the_sides_of_hands_are_told() -> None:
    for base, side in ((RIGHT, "right"), (LEFT, "left")):
        assert checked(base, lambda raw: {}).facts["side"].startswith(f"a {side} hand")
    without = checked(RIGHT, lambda raw: {"hands_mean": np.zeros(45)})
    assert without.facts["side"].startswith("unknown")


def test_two_hands_are_compared(tmp_path: Path) -> None:
    right = load_skinned("hand")
    left = mirrored(right, "left")
    save_body(right, tmp_path / "right.npz")
    save_body(left, tmp_path / "left.npz")
    assert check_body_file(tmp_path / "left.npz", tmp_path / "right.npz").findings == ()
    raw = foreign("hand-left")
    for key, says in (
        ("v_template", r"v_template[..., 0] *= -1"),
        ("shapedirs", r"shapedirs[:, 0, :] *= -1"),
        ("posedirs", "workbench.bodies.mirrored"),
        ("hands_mean", "rotation vectors by (1, -1, -1)"),
        ("hands_components", "rotation vectors by (1, -1, -1)"),
    ):
        wrong = raw | {key: foreign("hand")[key]}
        path = written(wrong, tmp_path / "hand.npz")
        found = check_body_file(path, tmp_path / "right.npz")
        texts = [f.text for f in found.warnings if "the other hand's" in f.text]
        assert len(texts) == 1, found.lines()
        assert texts[0].startswith(key)
        assert says in texts[0]
    noisy = raw | {"v_template": raw["v_template"] + 0.001 * np.sin(np.arange(778))[:, None]}
    found = check_body_file(written(noisy, tmp_path / "hand.npz"), tmp_path / "right.npz")
    assert found.warnings == ()
    assert "learned apart may differ" in found.findings[0].text
    written(foreign("small"), tmp_path / "body.npz")
    found = check_body_file(tmp_path / "left.npz", tmp_path / "body.npz")
    assert "only hands of one mesh can be compared" in found.warnings[0].text


@pytest.mark.parametrize(
    ("raw", "says"),
    [
        ({"poses": np.zeros((4, 72)), "trans": np.zeros((4, 3))}, "looks like a motion"),
        ({"v_template": np.zeros((4, 3)), "f": np.zeros((2, 3))}, "holds no body: it has f, v_tem"),
    ],
)
def test_what_holds_no_body_cannot_be_checked(tmp_path: Path, raw: Entries, says: str) -> None:
    np.savez(tmp_path / "a.npz", **raw)
    with pytest.raises(BadFile, match=says):
        check_body_file(tmp_path / "a.npz")
