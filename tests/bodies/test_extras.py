"""What a body's file holds beside SMPL's arrays is kept, or named; nothing vanishes in silence."""

import copy
import pickle
import zipfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.sparse import csc_matrix

from tests.bodies.random_bodies import Entries, entries, same
from workbench.bodies.catalogue import load_body
from workbench.bodies.files.npz_files import read_npz
from workbench.bodies.files.saving import save_body
from workbench.bodies.files.smpl_layout import body_from
from workbench.errors import BadBody, BadFile
from workbench.reports import card_text
from workbench.reports.card import card_page

rng = np.random.default_rng(5)
HAND = {
    "hands_components": rng.normal(size=(45, 45)),
    "hands_mean": rng.normal(size=45),
    "hands_coeffs": rng.normal(size=(7, 45)),
}
BOTH_HANDS = {key + side: value for key, value in HAND.items() for side in "lr"}
FACE = {
    "lmk_faces_idx": rng.integers(80, size=51).astype(np.uint32),
    "lmk_bary_coords": rng.dirichlet(np.ones(3), size=51),
    "dynamic_lmk_faces_idx": rng.integers(80, size=(79, 17)),
    "dynamic_lmk_bary_coords": rng.dirichlet(np.ones(3), size=(79, 17)),
}
LAYOUTS: dict[str, tuple[Entries, Entries]] = {  # the arrays of SMPL, and what comes beside them
    "SMPL": (
        entries(),
        {
            "weights_prior": rng.random((40, 24)),
            "bs_type": np.array("lrotmin"),
            "gender": np.array("female"),
        },
    ),
    "MANO": (entries(K=16), HAND),
    "SMPL-H": (entries(K=52, B=16), BOTH_HANDS),
    "SMPL-X": (entries(K=55, B=20), BOTH_HANDS | FACE),
}


@pytest.mark.parametrize("written", [".npz", ".pkl"])
@pytest.mark.parametrize("given", [".npz", ".pkl"])
@pytest.mark.parametrize("layout", LAYOUTS)
def test_every_array_of_a_file_survives_loading_and_saving(
    tmp_path: Path, layout: str, given: str, written: str
) -> None:
    arrays, beside = LAYOUTS[layout]
    path = tmp_path / f"model{given}"
    if given == ".npz":
        np.savez(path, **arrays, **beside)
    else:
        path.write_bytes(pickle.dumps(arrays | beside, protocol=2))
    body = load_body(path)
    assert body.card["model"] == layout
    assert "left_out" not in body.card
    save_body(body, tmp_path / f"again{written}")
    again = load_body(tmp_path / f"again{written}")
    same(body, again)
    if written == ".npz":
        found: Any = read_npz(tmp_path / "again.npz")
    else:
        found = pickle.loads((tmp_path / "again.pkl").read_bytes())
    for key, value in beside.items():
        for there in (body.extras[key], again.extras[key], found[key]):
            np.testing.assert_array_equal(there, value, err_msg=key)
            assert there.dtype == value.dtype, key
    assert set(body.extras) == set(beside)


def test_a_mirror_that_is_none_is_saved_as_it_was(tmp_path: Path) -> None:
    wrong = np.roll(np.arange(40), 1)
    np.savez(tmp_path / "m.npz", **entries(), vert_sym_idxs=wrong)
    body = load_body(tmp_path / "m.npz")
    assert body.mirror is None
    save_body(body, tmp_path / "again.npz")
    np.testing.assert_array_equal(read_npz(tmp_path / "again.npz")["vert_sym_idxs"], wrong)
    assert "kept as they are" in str(body.card["provenance"])


def test_what_cannot_be_kept_is_named_with_the_reason(tmp_path: Path) -> None:
    """The kinds of entries of SMPL's own files: objects, dictionaries, and what was computed."""
    raw = entries() | {
        "pose_training_info": {"rms": 1.0},
        "nothing": None,
        "J": np.zeros((24, 3)),
        "J_regressor_prior": csc_matrix(np.eye(24, 40)),
        "bs_type": "lrotmin",
        "scale": 2.0,
        "complex": np.zeros(3, complex),
        "landmarks/face": np.zeros((3, 40)),
    }
    (tmp_path / "m.pkl").write_bytes(pickle.dumps(raw, protocol=2))
    body = load_body(tmp_path / "m.pkl")
    told = {line.partition(",")[0]: line for line in body.card["left_out"]}
    assert set(told) == {"pose_training_info", "nothing", "J", "complex", "landmarks/face"}
    assert "a dict" in told["pose_training_info"]
    assert "v_template and J_regressor" in told["J"]
    np.testing.assert_array_equal(body.extras["J_regressor_prior"], np.eye(24, 40))
    assert (body.extras["bs_type"].item(), body.extras["scale"].item()) == ("lrotmin", 2.0)
    save_body(body, tmp_path / "again.npz")
    assert load_body(tmp_path / "again.npz").card == body.card  # said once, and kept


def test_objects_of_an_npz_and_its_other_members_are_named(tmp_path: Path) -> None:
    part2num = np.array({"head": 1}, dtype=object)
    np.savez(tmp_path / "m.npz", **entries(K=55), part2num=part2num)
    with zipfile.ZipFile(tmp_path / "m.npz", "a") as archive:
        archive.writestr("LICENSE.txt", "to be read")
    body = load_body(tmp_path / "m.npz")
    told = {line.partition(",")[0]: line for line in body.card["left_out"]}
    assert set(told) == {"part2num", "LICENSE.txt"}
    assert "Python objects" in told["part2num"]
    assert "another kind than .npy" in told["LICENSE.txt"]


@pytest.mark.filterwarnings("ignore:Duplicate name")
def test_two_arrays_of_one_name_are_refused(tmp_path: Path) -> None:
    np.savez(tmp_path / "m.npz", **entries())
    with zipfile.ZipFile(tmp_path / "m.npz", "a") as archive:
        archive.writestr("weights.npy", b"another")
    with pytest.raises(BadFile, match=r"two arrays called weights\.npy"):
        load_body(tmp_path / "m.npz")


def test_the_card_lists_what_travels_and_what_does_not() -> None:
    body = body_from(LAYOUTS["MANO"][0] | HAND | {"why": None}, "hand", "hand.npz")
    for text in (card_text(body), card_page(body)):
        for word in (
            "hands_components (45 × 45)",
            "hands_mean (45)",
            "carried along",
            "why, which is empty",
        ):
            assert word in text
    plain = card_text(body_from(LAYOUTS["MANO"][0], "hand", "hand.npz"))
    assert "carried" not in plain
    assert "left" not in plain


def test_extras_are_the_bodys_own() -> None:
    given = {"hands_mean": np.zeros(45)}
    body = replace(body_from(entries(), "b", "b"), extras=given)
    given["hands_mean"][0] = 1
    assert body.extras["hands_mean"][0] == 0
    with pytest.raises(ValueError, match="read-only"):
        body.extras["hands_mean"][0] = 1
    for other in (copy.deepcopy(body), pickle.loads(pickle.dumps(body)), replace(body, name="x")):
        np.testing.assert_array_equal(other.extras["hands_mean"], np.zeros(45))


@pytest.mark.parametrize("key", ["weights", "card", "J_regressor/data", "landmarks/face/names"])
def test_extras_cannot_take_the_place_of_a_bodys_own_arrays(key: str) -> None:
    with pytest.raises(BadBody, match=f"extras must not be called .*: {key}"):
        replace(body_from(entries(), "b", "b"), extras={key: np.zeros(3)})


def test_extras_are_arrays_of_numbers_or_texts() -> None:
    with pytest.raises(BadBody, match=r"extras\['info'\] must be an array of numbers or texts"):
        replace(body_from(entries(), "b", "b"), extras={"info": np.array({})})
