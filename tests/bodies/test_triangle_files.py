"""Files of triangle bodies: what is saved comes back bit for bit, and damage gets its sentence."""

import copy
import pickle
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import workbench as wb
from tests.bodies.test_triangle_bodies import BODIES, some_arguments
from tests.bodies_made_up import tube_body
from workbench.bodies.catalogue import load_skinned
from workbench.bodies.triangles import TriangleBody, blend_scape
from workbench.errors import BadBody, BadFile
from workbench.experiments.body_problems import body_outliers
from workbench.experiments.model_fits import body_points
from workbench.reports import card_text, write_card

EXTRAS = {"joint_limits": np.arange(6.0).reshape(3, 2), "gender": np.array("neutral")}
CARD = {"source": "made up", "numbers": [1, 0.1, None], "nested": {"é": "ü"}}
ARRAYS = ("template", "faces", "shapedirs", "posedirs", "near")


def whole(body: TriangleBody) -> TriangleBody:
    """The body with everything that its file can hold."""
    return replace(body, name="somebody", card=CARD, extras=EXTRAS)


def assert_same(one: TriangleBody, other: TriangleBody) -> None:
    assert type(one) is type(other) is TriangleBody
    for name in ARRAYS:
        a, b = getattr(one, name), getattr(other, name)
        assert a.dtype == b.dtype
        np.testing.assert_array_equal(a, b, err_msg=name)
    pairs = [(one.weights, other.weights), (one.J_regressor, other.J_regressor)]
    assert one.landmarks.keys() == other.landmarks.keys()
    for name, marks in one.landmarks.items():
        assert marks.names == other.landmarks[name].names
        pairs.append((marks.regressor, other.landmarks[name].regressor))
    for a, b in pairs:
        assert a.shape == b.shape
        for part in ("data", "indices", "indptr"):
            np.testing.assert_array_equal(getattr(a, part), getattr(b, part))
    assert (one.parents, one.joint_names, one.name) == (
        other.parents,
        other.joint_names,
        other.name,
    )
    assert dict(one.card) == dict(other.card)
    assert one.extras.keys() == other.extras.keys()
    for key, value in one.extras.items():
        np.testing.assert_array_equal(value, other.extras[key])


@pytest.mark.parametrize("body", BODIES.values(), ids=list(BODIES))
def test_what_is_saved_comes_back(body: TriangleBody, tmp_path: Path) -> None:
    given = whole(body)
    wb.save_body(given, tmp_path / "body.npz")
    found = wb.load_body(tmp_path / "body.npz")
    assert isinstance(found, TriangleBody)
    assert_same(given, found)
    arguments = some_arguments(body)
    np.testing.assert_array_equal(found.vertices(*arguments), given.vertices(*arguments))
    wb.save_body(found, tmp_path / "again.npz")
    assert_same(given, wb.load_body(tmp_path / "again.npz"))


@pytest.mark.parametrize(
    "copied", [copy.copy, copy.deepcopy, lambda b: pickle.loads(pickle.dumps(b))]
)
def test_copies_keep_card_and_extras(copied: Callable[[Any], Any]) -> None:
    given = whole(BODIES["tube, SCAPE"])
    assert_same(copied(given), given)


def test_a_file_says_which_kind_it_holds(tmp_path: Path) -> None:
    skinned = tube_body()
    wb.save_body(skinned, tmp_path / "skinned.npz")
    wb.save_body(blend_scape(skinned), tmp_path / "triangles.npz")
    assert isinstance(wb.load_body(tmp_path / "skinned.npz"), wb.SkinnedBody)
    assert isinstance(load_skinned(tmp_path / "skinned.npz"), wb.SkinnedBody)
    for name, style in (("skinned", "lbs"), ("triangles", "triangles")):
        with np.load(tmp_path / f"{name}.npz") as archive:
            assert archive["bs_style"].item() == style
    said = r"a SkinnedBody is needed here, but body .* is a TriangleBody; the skinned bodies are"
    with pytest.raises(BadBody, match=said):
        load_skinned(tmp_path / "triangles.npz")
    with pytest.raises(BadBody, match=said):
        body_points(body=str(tmp_path / "triangles.npz"))
    assert body_outliers(str(tmp_path / "triangles.npz")).body is not None


def test_a_triangle_body_is_no_pickle_for_smplx(tmp_path: Path) -> None:
    with pytest.raises(BadFile, match=r"is a TriangleBody, which the package smplx does not know"):
        wb.save_body(BODIES["tube, SCAPE"], tmp_path / "body.pkl")
    assert not list(tmp_path.iterdir())


def without(*keys: str) -> Callable[[dict[str, Any]], dict[str, Any]]:
    return lambda arrays: {k: v for k, v in arrays.items() if k not in keys}


def put(**changed: Any) -> Callable[[dict[str, Any]], dict[str, Any]]:
    return lambda arrays: arrays | {k.replace("__", "/"): v for k, v in changed.items()}


@pytest.mark.parametrize(
    ("damage", "error", "text"),
    [
        (without("near"), BadFile, "has no near; it has .*The file of a triangle body has"),
        (without("card", "f"), BadFile, "has no f, card; it has"),
        (without("weights/indptr"), BadFile, "has no weights/indptr"),
        (put(bs_style=np.array("chain")), BadFile, "bs_style 'chain'; there is lbs, .*triangles"),
        (put(near=np.zeros((40, 3), int)), BadFile, r"posedirs has shape .*\(40, 3, 3, 9\)"),
        (put(near=np.zeros((40, 2), int)), BadBody, r"face 0 is near the joints \[0, 0\]"),
        (put(near=np.full((40, 2), 0.5)), BadFile, "near must hold whole numbers"),
        (put(near=np.array(2)), BadFile, r"near has shape \(\), but must be \(40, J\)"),
        (put(f=np.zeros((40, 4), int)), BadFile, r"f has shape \(40, 4\), but must be \(F, 3\)"),
        (put(f=np.full((40, 3), 99)), BadBody, r"face 0 is \[99, 99, 99\], but there are 22"),
        (put(shapedirs=np.zeros((40, 9, 2))), BadFile, r"must be \(40, 3, 3, B\)"),
        (put(shapedirs=np.full((40, 3, 3, 2), np.inf)), BadBody, "shapedirs.* is not finite"),
        (put(v_template=np.array("tall")), BadFile, "v_template holds .*must hold numbers"),
        (put(v_template=1e200 * np.eye(22, 3)), BadBody, "has no area"),
        (put(v_template=np.full((22, 3), -1e300) * np.arange(22)[:, None]), BadBody, "no area"),
        (put(weights__indices=np.full(40, 99)), BadFile, "weights is no sparse matrix"),
        (put(weights__data=np.full(40, 2.0)), BadBody, "weights of face 0 sum to 2"),
        (put(weights__shape=np.array([2**40, 3])), BadFile, "weights is no sparse matrix"),
        (put(J_regressor__shape=np.array([3, 2**40])), BadBody, "J_regressor has shape"),
        (put(kintree_table=np.array([[9, 2, 1], [0, 1, 2]])), BadBody, "joint 1 has parent 2"),
        (put(joint_names=np.array(["a", "b"])), BadBody, "2 names for 3 joints"),
        (put(card=np.array("{")), BadFile, "its card is no JSON"),
        (put(card=np.array("[1]")), BadFile, "its card is a list, not an object"),
    ],
)
def test_damaged_files_get_a_sentence(
    damage: Any, error: type[Exception], text: str, tmp_path: Path
) -> None:
    wb.save_body(BODIES["tube, SCAPE"], tmp_path / "body.npz")
    with np.load(tmp_path / "body.npz") as archive:
        arrays = dict(archive)
    np.savez(tmp_path / "body.npz", **damage(arrays))
    with pytest.raises(error, match=text):
        wb.load_body(tmp_path / "body.npz")


def test_what_cannot_be_kept_is_named_in_the_card(tmp_path: Path) -> None:
    wb.save_body(whole(BODIES["tube, SCAPE"]), tmp_path / "body.npz")
    with np.load(tmp_path / "body.npz") as archive:
        arrays = dict(archive)
    np.savez(tmp_path / "body.npz", **arrays, thing=np.array([{}], dtype=object))
    found = wb.load_body(tmp_path / "body.npz")
    (said,) = found.card["left_out"]
    assert said.startswith("thing, which is an array of Python objects")
    assert found.extras.keys() == EXTRAS.keys()


@pytest.mark.parametrize("key", ["near", "weights/data", "bs_style", "landmarks/x/names"])
def test_extras_cannot_take_the_place_of_its_own_arrays(key: str) -> None:
    with pytest.raises(BadBody, match=f"extras must not be called .*: {key}"):
        replace(BODIES["tube, SCAPE"], extras={key: np.zeros(3)})


def test_a_triangle_body_has_a_card(tmp_path: Path) -> None:
    body = whole(BODIES["small, SCAPE"])
    text = card_text(body)
    for said in (
        "TriangleBody, each triangle with one part, then stitched",
        "734",
        "faces moved",
        "carried along",
        "joint_limits (3 × 2), gender",
        "made up",
        "at most 1 per face",
    ):
        assert said in text
    assert "each triangle with several parts" in card_text(BODIES["small, BlendSCAPE"])
    # each face moves with one joint, so the table's column adds up to them
    rows = [line.split() for line in text.splitlines() if line.strip()[:1].isdigit()]
    assert sum(int(row[-2]) for row in rows) == body.n_faces
    page = write_card(body, tmp_path / "card").read_text()
    assert "each triangle with one part" in page


def test_a_triangle_body_carries_where_its_numbers_come_from(tmp_path: Path) -> None:
    skinned = wb.load_body("small")
    wb.save_body(blend_scape(skinned), tmp_path / "body.npz")
    card = wb.load_body(tmp_path / "body.npz").card
    assert card["made_of"].startswith("body 'small'")
    assert {key: card[key] for key in skinned.card} == dict(skinned.card)
