"""Bodies out of files and into them."""

import json
import pickle
import zipfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, get_args

import casadi as cs
import numpy as np
import pytest
from scipy.sparse import coo_matrix, csc_matrix, csr_matrix

from tests.bodies.random_bodies import Entries, decorated, entries, same
from workbench.bodies.catalogue import Embedded, load_body
from workbench.bodies.files.npz_files import read_npz
from workbench.bodies.files.saving import save_body
from workbench.bodies.files.smpl_layout import body_from
from workbench.bodies.files.smplx_vertices import extras, vertex_ids
from workbench.errors import BadBody, BadFile
from workbench.writing import replacing


def saved(path: Path, raw: Entries) -> Path:
    np.savez(path, **raw)
    return path


def equal_to(raw: Entries, path: Path) -> None:
    body = load_body(path)
    for name, key in (
        ("template", "v_template"),
        ("shapedirs", "shapedirs"),
        ("posedirs", "posedirs"),
        ("weights", "weights"),
    ):
        np.testing.assert_array_equal(getattr(body, name), raw[key])
        assert getattr(body, name).dtype == np.float64
    np.testing.assert_array_equal(body.J_regressor.toarray(), raw["J_regressor"])
    np.testing.assert_array_equal(body.faces, raw["f"])
    assert body.parents == (-1, *raw["kintree_table"][0, 1:].tolist())


# What comes with the workbench.


@pytest.mark.parametrize("name", get_args(Embedded))
def test_the_embedded_bodies_load_and_stand(name: str) -> None:
    body = load_body(name)
    assert body.name == name
    assert (body.n_joints, body.n_betas) == (24, 10)
    assert "licence" in body.card
    assert body.joint_names[body.joint_names.index("left_knee")] == "left_knee"
    left, head = (body.joints()[body.joint_names.index(n)] for n in ("left_knee", "head"))
    assert left[0] > 0  # the left is on +x
    assert head[1] > left[1]  # and y is up


def test_a_wrong_name_says_what_there_is() -> None:
    with pytest.raises(BadFile, match=r"'smal'.*no such file.*default, .*full, .*small"):
        load_body("smal")


def test_a_path_is_never_a_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(BadFile, match="no such file"):
        load_body(Path("small"))
    saved(tmp_path / "small.npz", entries(N=12))
    (tmp_path / "small.npz").rename(tmp_path / "small")
    assert load_body(Path("small")).n_vertices == 12
    assert load_body("small").n_vertices > 12


# Round trips.


@pytest.mark.parametrize("suffix", [".npz", ".pkl"])
@pytest.mark.parametrize(
    "make",
    [
        lambda: load_body("small"),
        lambda: body_from(entries(), "b", "b"),
        lambda: decorated(body_from(entries(K=3), "b", "b")),
    ],
)
def test_a_body_survives_its_file(tmp_path: Path, suffix: str, make: Callable[[], Any]) -> None:
    body = make()
    save_body(body, tmp_path / f"body{suffix}")
    same(body, load_body(tmp_path / f"body{suffix}"))


def test_a_bind_pose_survives(tmp_path: Path) -> None:
    body = body_from(entries(K=3), "b", "b")
    bound = replace(body, bound_in=np.random.default_rng(0).normal(size=(3, 3)))
    save_body(bound, tmp_path / "bound.npz")
    same(bound, load_body(tmp_path / "bound.npz"))
    with pytest.raises(BadFile, match=r"save it as \.npz"):
        save_body(bound, tmp_path / "bound.pkl")
    assert not (tmp_path / "bound.pkl").exists()


def test_the_file_is_read_for_what_it_is_not_for_its_name(tmp_path: Path) -> None:
    body = body_from(entries(), "b", "b")
    save_body(body, tmp_path / "a.npz")
    save_body(body, tmp_path / "b.pkl")
    (tmp_path / "a.npz").rename(tmp_path / "model.pkl")
    (tmp_path / "b.pkl").rename(tmp_path / "model.npz")
    same(body, load_body(tmp_path / "model.pkl"))
    same(body, load_body(str(tmp_path / "model.npz")))


# SMPL's layout in its variants.


@pytest.mark.parametrize(
    ("K", "B", "last", "model"),
    [
        (24, 10, "right_hand", "SMPL"),
        (24, 300, "right_hand", "SMPL"),
        (52, 16, "right_thumb3", "SMPL-H"),
        (16, 10, "thumb3", "MANO"),
        (55, 20, "right_thumb3", "SMPL-X"),
        (5, 3, "joint_4", "SMPL-like"),
        (1, 2, "joint_0", "SMPL-like"),
    ],
)
def test_any_size(tmp_path: Path, K: int, B: int, last: str, model: str) -> None:
    raw = entries(N=30, K=K, B=B)
    path = saved(tmp_path / "m_FEMALE.npz", raw)
    equal_to(raw, path)
    body = load_body(path)
    assert (body.joint_names[-1], len(set(body.joint_names))) == (last, K)
    assert (body.card["model"], body.card["gender"]) == (model, "female")
    assert ("expression" in str(body.card)) == (K == 55)


VARIANTS: dict[str, Callable[[Entries], Entries]] = {
    "flat posedirs": lambda e: {"posedirs": e["posedirs"].reshape(3 * len(e["v_template"]), -1)},
    "smplx posedirs": lambda e: {"posedirs": e["posedirs"].reshape(120, -1).T},
    "flat shapedirs": lambda e: {"shapedirs": e["shapedirs"].reshape(120, -1)},
    "flatter shapedirs": lambda e: {"shapedirs": e["shapedirs"].reshape(40, -1)},
    "fortran": lambda e: {"posedirs": np.asfortranarray(e["posedirs"])},
    "big-endian": lambda e: {"weights": e["weights"].astype(">f8")},
    "root -1": lambda e: {"kintree_table": _root(e, -1).astype(np.int64)},
    "root 0": lambda e: {"kintree_table": _root(e, 0).astype(np.int32)},
    "root 2^64 - 1": lambda e: {"kintree_table": _root(e, 2**64 - 1)},
    "float tree": lambda e: {"kintree_table": e["kintree_table"].astype(np.float32)},
    "float faces": lambda e: {"f": e["f"].astype(np.float64)},
    "more keys": lambda e: {
        "vert_sym_idxs": np.arange(40),
        "bs_style": np.array("lbs"),
        "part2num": np.array({"head": 1}, dtype=object),
    },
}


def _root(raw: Entries, parent: int) -> Any:
    table = raw["kintree_table"].astype(object)
    table[0, 0] = parent
    return table if parent < 2**63 and parent < 0 else table.astype(np.uint64)


@pytest.mark.parametrize("variant", VARIANTS)
def test_variants_of_the_layout(tmp_path: Path, variant: str) -> None:
    raw = entries()
    changed = {
        key: value.astype(np.int64) if key == "kintree_table" and value.dtype == object else value
        for key, value in VARIANTS[variant](raw).items()
    }
    equal_to(raw, saved(tmp_path / "model.npz", raw | changed))


def test_single_precision_is_kept_as_it_is(tmp_path: Path) -> None:
    raw = {k: v.astype(np.float32) if v.dtype == float else v for k, v in entries(N=900).items()}
    equal_to(raw, saved(tmp_path / "model.npz", raw))  # nothing is normalised


@pytest.mark.parametrize("kind", [csc_matrix, csr_matrix, coo_matrix])
def test_a_sparse_regressor_in_its_parts(tmp_path: Path, kind: Any) -> None:
    raw = entries()
    matrix = csr_matrix(kind(raw["J_regressor"]))
    parts = {f"J_regressor/{part}": getattr(matrix, part) for part in ("data", "indices", "indptr")}
    del (rest := dict(raw))["J_regressor"]
    whole = rest | parts | {"J_regressor/shape": np.array(matrix.shape)}
    equal_to(raw, saved(tmp_path / "model.npz", whole))
    wild = whole | {"J_regressor/indices": matrix.indices + 1000}
    with pytest.raises(BadFile, match="no sparse matrix"):
        load_body(saved(tmp_path / "model.npz", wild))
    del wild["J_regressor/indptr"]
    with pytest.raises(BadFile, match="has no J_regressor/indptr"):
        load_body(saved(tmp_path / "model.npz", wild))


def test_a_mirror_that_is_none_is_left_out(tmp_path: Path) -> None:
    for wrong in (np.roll(np.arange(40), 1), np.arange(39), np.arange(40) + 5):
        body = load_body(saved(tmp_path / "m.npz", entries() | {"vert_sym_idxs": wrong}))
        assert body.mirror is None
        assert "vert_sym_idxs" in str(body.card)
    mirror = np.arange(40)[::-1]
    body = load_body(saved(tmp_path / "m.npz", entries() | {"vert_sym_idxs": mirror}))
    np.testing.assert_array_equal(body.mirror, mirror)


# What is no body.


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"weights": None, "f": None}, "has no weights, f; it has J_regressor, kintree_table, po"),
        ({"bs_style": np.array("dqbs")}, "bs_style 'dqbs'"),
        ({"bs_style": np.array(b"dqbs")}, "bs_style 'dqbs'"),
        ({"shapedirs": np.zeros((41, 3, 10))}, r"shapedirs has shape \(41, 3, 10\)"),
        ({"v_template": np.zeros((40, 2))}, r"v_template has shape \(40, 2\)"),
        ({"v_template": np.zeros((0, 3))}, r"v_template has shape \(0, 3\)"),
        ({"v_template": np.array(["a"])}, "v_template holds <U1"),
        ({"f": np.full((2, 3), 0.5)}, "f must hold whole numbers"),
        ({"kintree_table": np.full((2, 24), np.inf)}, "kintree_table must hold whole numbers"),
        ({"kintree_table": np.arange(24)}, r"kintree_table is \(24,\), but must be \(2, K\)"),
        ({"kintree_table": np.zeros((2, 24))}, "row 1 of kintree_table"),
        ({"J_regressor": np.zeros(3)}, r"J_regressor has shape \(3,\)"),
        ({"weights": np.array([{"a": 1}], dtype=object)}, "Python objects, which are not read"),
        ({"card": np.array("{")}, "card is no JSON"),
        ({"joint_names": np.arange(24)}, "joint_names must be a list of names"),
    ],
)
def test_what_is_wrong_is_said(tmp_path: Path, change: Entries, says: str) -> None:
    raw = {key: value for key, value in (entries() | change).items() if value is not None}
    with pytest.raises(BadFile, match=says):
        load_body(saved(tmp_path / "model.npz", raw))


def test_arrays_that_do_not_fit_are_a_bad_body(tmp_path: Path) -> None:
    raw = entries()
    tree = raw["kintree_table"].copy()
    tree[0, 3] = 9
    with pytest.raises(BadBody, match="joint 3 has parent 9"):
        load_body(saved(tmp_path / "model.npz", raw | {"kintree_table": tree}))
    with pytest.raises(BadBody, match="not finite"):
        load_body(saved(tmp_path / "m.npz", raw | {"v_template": np.full((40, 3), np.nan)}))


@pytest.mark.parametrize(
    ("raw", "says"),
    [
        ({"poses": np.zeros((4, 156)), "trans": np.zeros((4, 3))}, "a motion"),
        ({"vertices": np.zeros((4, 3)), "faces": np.zeros((2, 3))}, "a plain mesh"),
        ({"eigvec": np.zeros((4, 3, 8))}, "soft-tissue"),
    ],
)
def test_what_a_file_may_be_instead(tmp_path: Path, raw: Entries, says: str) -> None:
    with pytest.raises(BadFile, match=f"It looks like .*{says}"):
        load_body(saved(tmp_path / "file.npz", raw))


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (b"", "is empty"),
        (b"\x00\x01\x02", "is neither an .npz nor a .pkl file"),
        (b"<!DOCTYPE html><html>", "a web page"),
        (b"\n<html>", "a web page"),
        (b"version https://git-lfs.github.com/spec/v1", "git lfs pull"),
        (b"glTF\x02\x00\x00\x00", "read_mesh"),
        (b"\x1f\x8b\x08", "gzip"),
        (b"PK\x03\x04 and then nothing", "cut off or damaged"),
    ],
)
def test_other_files_are_recognised(tmp_path: Path, content: bytes, says: str) -> None:
    (tmp_path / "model.npz").write_bytes(content)
    with pytest.raises(BadFile, match=says):
        load_body(tmp_path / "model.npz")


def test_folders_single_arrays_and_archives(tmp_path: Path) -> None:
    with pytest.raises(BadFile, match="is a folder"):
        load_body(tmp_path)
    np.save(tmp_path / "one.npy", np.zeros(3))
    with pytest.raises(BadFile, match="a single array"):
        load_body(tmp_path / "one.npy")
    with zipfile.ZipFile(tmp_path / "archive.zip", "w") as archive:
        archive.writestr("readme.txt", "hello")
    with pytest.raises(BadFile, match="zip archive without arrays"):
        load_body(tmp_path / "archive.zip")


def test_a_file_cut_off_anywhere_is_refused(tmp_path: Path) -> None:
    for suffix in (".npz", ".pkl"):
        save_body(body_from(entries(N=6, K=2), "b", "b"), tmp_path / f"whole{suffix}")
        whole = (tmp_path / f"whole{suffix}").read_bytes()
        for end in range(0, len(whole) - 1, 37):
            (tmp_path / "cut").write_bytes(whole[:end])
            with pytest.raises(BadFile):
                load_body(tmp_path / "cut")


def test_a_damaged_npz_is_refused(tmp_path: Path) -> None:
    save_body(body_from(entries(N=6, K=2), "b", "b"), tmp_path / "whole.npz")
    whole = bytearray((tmp_path / "whole.npz").read_bytes())
    whole[200] ^= 0xFF
    (tmp_path / "broken.npz").write_bytes(whole)
    with pytest.raises(BadFile):
        load_body(tmp_path / "broken.npz")


def npy(shape: str) -> bytes:
    header = f"{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}}}".ljust(117) + "\n"
    return b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header.encode()


def test_a_header_that_claims_too_much_allocates_nothing(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "bomb.npz", "w") as archive:
        archive.writestr("v_template.npy", npy("(123456789012, 3)"))
    with pytest.raises(BadFile, match=r"claims .* numbers, but is shorter"):
        load_body(tmp_path / "bomb.npz")


def test_an_npz_that_unpacks_to_too_much_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    np.savez_compressed(tmp_path / "bomb.npz", zeros=np.zeros(10**6))
    monkeypatch.setattr("workbench.reading.archive.MOST_BYTES", 10**6)
    with pytest.raises(BadFile, match="unpacks to"):
        load_body(tmp_path / "bomb.npz")


def test_no_object_of_an_npz_is_ever_made(tmp_path: Path) -> None:
    marker = tmp_path / "ran"

    class Trap:
        def __reduce__(self) -> Any:
            return Path.touch, (marker,)

    trap = np.empty(1, dtype=object)
    trap[0] = Trap()
    path = saved(tmp_path / "trap.npz", entries() | {"weights": trap, "other": trap})
    with pytest.raises(BadFile, match=r"allow_pickle=True and save\s+this entry again"):
        load_body(path)
    read_npz(path)
    assert not marker.exists()
    np.load(path, allow_pickle=True)["other"]
    assert marker.exists()  # the trap is a trap


# Writing.


def test_a_failure_leaves_what_was_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    body = body_from(entries(), "b", "b")
    for suffix, writer in ((".npz", "numpy.lib.format.write_array"), (".pkl", "pickle.dump")):
        (tmp_path / f"body{suffix}").write_text("before")

        def fail(*_: Any, **__: Any) -> None:
            raise OSError(28, "No space left on device")

        monkeypatch.setattr(writer, fail)
        with pytest.raises(BadFile, match="No space left"):
            save_body(body, tmp_path / f"body{suffix}")
        assert (tmp_path / f"body{suffix}").read_text() == "before"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["body.npz", "body.pkl"]


def test_places_that_cannot_be_written(tmp_path: Path) -> None:
    body = body_from(entries(), "b", "b")
    with pytest.raises(BadFile, match="choose an existing folder"):
        save_body(body, tmp_path / "no" / "body.npz")
    with pytest.raises(BadFile, match=r"\.npz or \.pkl"):
        save_body(body, tmp_path / "body.json")
    (tmp_path / "folder.npz").mkdir()
    with pytest.raises(BadFile, match="cannot write"):
        save_body(body, tmp_path / "folder.npz")
    assert [p.name for p in tmp_path.iterdir()] == ["folder.npz"]


def test_an_interrupted_write_leaves_nothing(tmp_path: Path) -> None:
    def interrupted() -> None:
        with replacing(tmp_path / "file.txt") as temporary:
            temporary.write_text("half")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert not list(tmp_path.iterdir())


def test_what_a_file_cannot_hold_is_refused(tmp_path: Path) -> None:
    body = body_from(entries(), "b", "b")
    with pytest.raises(BadFile, match=r"card .* must hold texts"):
        save_body(replace(body, card={"array": np.zeros(3)}), tmp_path / "body.npz")

    def rigid(points: cs.MX, motions: Any, weights: cs.MX) -> cs.MX:
        return points

    with pytest.raises(BadFile, match="not skinned by linear_blend"):
        save_body(replace(body, skinning=rigid), tmp_path / "body.npz")
    assert not list(tmp_path.iterdir())


def test_our_pickles_hold_numpy_arrays_only(tmp_path: Path) -> None:
    save_body(decorated(body_from(entries(), "b", "b")), tmp_path / "body.pkl")
    with (tmp_path / "body.pkl").open("rb") as file:
        content = pickle.load(file)
    assert all(
        type(value) is np.ndarray and not value.dtype.hasobject for value in content.values()
    )


def test_the_vertices_that_smplx_appends(tmp_path: Path) -> None:
    body = load_body("default")
    save_body(body, tmp_path / "SMPL_NEUTRAL.pkl")
    ids = json.loads((tmp_path / "SMPL_NEUTRAL_vertex_ids.json").read_text())
    assert ids == vertex_ids(body)
    assert len(ids) == len(extras()) == 21
    at = {name: body.template[i] for name, i in ids.items()}
    landmarks = dict(zip(body.landmark_names("coco"), body.landmark("coco"), strict=True))
    assert np.linalg.norm(at["nose"] - landmarks["nose"]) < 0.02
    assert np.linalg.norm(at["RHeel"] - landmarks["right_heel"]) < 0.03
    for left, right in (("lear", "rear"), ("LBigToe", "RBigToe"), ("lthumb", "rthumb")):
        np.testing.assert_allclose(at[left] * (-1, 1, 1), at[right], atol=0.005)
    bare = vertex_ids(replace(body, landmarks={}))  # guesses from the shape alone
    for name, i in bare.items():
        assert np.linalg.norm(body.template[i] - at[name]) < 0.08, name
    assert max(vertex_ids(body_from(entries(), "b", "b")).values()) < 40
