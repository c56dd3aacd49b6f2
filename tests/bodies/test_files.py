"""Bodies out of files and into them: every array of the family's layouts comes back or is named."""

import pickle
import zipfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import casadi as cs
import numpy as np
import pytest
from scipy.sparse import csc_matrix, issparse

from tests.bodies.model_files import MODELS, written
from tests.bodies.random_bodies import Entries, decorated, entries, equal_to, same
from tests.bodies_made_up import random_body
from tests.tiers import few
from workbench.bodies.catalogue import load_body, load_skinned
from workbench.bodies.files.layouts import body_from
from workbench.bodies.files.reading import read_npz
from workbench.bodies.files.saving import save_body
from workbench.errors import BadBody, BadFile, WorkbenchError

OBJECTS = {"joint2num", "part2num"}  # dictionaries, which are not read


def saved(path: Path, raw: Entries) -> Path:
    np.savez(path, **raw)
    return path


def dense(value: Any) -> Any:
    return value.toarray() if issparse(value) else np.asarray(value)


def test_unknown_name_lists_what_there_is() -> None:
    with pytest.raises(BadFile, match=r"'smal'.*no such file.*default, .*full, .*small"):
        load_body("smal")


def test_path_is_never_a_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(BadFile, match="no such file"):
        load_body(Path("small"))
    saved(tmp_path / "small.npz", entries(N=12))
    (tmp_path / "small.npz").rename(tmp_path / "small")
    assert load_body(Path("small")).n_vertices == 12
    assert load_body("small").n_vertices > 12


# Round trips.


@pytest.mark.parametrize("suffix", [".npz", ".pkl"])
def test_bodies_survive_their_files(tmp_path: Path, suffix: str) -> None:
    """Also under the other kind's suffix: a file is read for what it is."""
    other = {".npz": ".pkl", ".pkl": ".npz"}[suffix]
    whole = decorated(body_from(entries(K=3), "b", "b"))
    for body in (load_body("small"), random_body(n_betas=0), whole):
        save_body(body, tmp_path / f"body{suffix}")
        same(body, load_body(tmp_path / f"body{suffix}"))
        (tmp_path / f"body{suffix}").rename(tmp_path / f"renamed{other}")
        same(body, load_body(str(tmp_path / f"renamed{other}")))
    bound = replace(body, bound_in=np.random.default_rng(0).normal(size=(3, 3)))
    if suffix == ".npz":
        save_body(bound, tmp_path / "bound.npz")
        same(bound, load_body(tmp_path / "bound.npz"))
    else:
        with pytest.raises(BadFile, match=r"save it as \.npz"):
            save_body(bound, tmp_path / "bound.pkl")


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("suffix", few([".npz", ".pkl"], 1))
def test_every_key_of_a_model_survives(tmp_path: Path, model: str, suffix: str) -> None:
    make, given = MODELS[model]
    raw = make() | {"a key that nobody knows": np.arange(6, dtype=np.int16).reshape(2, 3)}
    body = load_skinned(written(raw, tmp_path / f"model{given}"))
    assert body.card["model"] == model
    left_out = {line.partition(",")[0] for line in body.card.get("left_out", ())}
    assert left_out == raw.keys() & OBJECTS
    path = tmp_path / f"again{suffix}"
    if (model, suffix) == ("STAR", ".pkl"):
        with pytest.raises(BadFile, match="star_features"):
            save_body(body, path)
        return
    save_body(body, path)
    same(body, load_skinned(path))
    found = read_npz(path) if suffix == ".npz" else pickle.loads(path.read_bytes())
    for key in raw.keys() - OBJECTS:
        np.testing.assert_array_equal(dense(found[key]), dense(raw[key]), err_msg=key)


# SMPL's layout in its variants.


VARIANTS: dict[str, Callable[[Entries], Entries]] = {
    "flat posedirs": lambda e: {"posedirs": e["posedirs"].reshape(3 * len(e["v_template"]), -1)},
    "smplx posedirs": lambda e: {"posedirs": e["posedirs"].reshape(120, -1).T},
    "flatter shapedirs": lambda e: {"shapedirs": e["shapedirs"].reshape(40, -1)},
    "fortran": lambda e: {"posedirs": np.asfortranarray(e["posedirs"])},
    "big-endian": lambda e: {"weights": e["weights"].astype(">f8")},
    "root 2^64 - 1": lambda e: {"kintree_table": with_root(e, -1).astype(np.uint64)},
    "float tree": lambda e: {"kintree_table": e["kintree_table"].astype(np.float32)},
    "more keys": lambda e: {"vert_sym_idxs": np.arange(40), "bs_style": np.array("lbs")},
}


def with_root(raw: Entries, parent: int) -> Any:
    table = raw["kintree_table"].astype(np.int64)
    table[0, 0] = parent
    return table


def test_variants_of_the_layout_are_read(tmp_path: Path) -> None:
    raw = entries()
    for change in VARIANTS.values():
        equal_to(raw, saved(tmp_path / "model.npz", raw | change(raw)))
    single = {k: v.astype(np.float32) if v.dtype == float else v for k, v in raw.items()}
    equal_to(single, saved(tmp_path / "model.npz", single))  # nothing is normalised


# What is no body.


ALL = dict.fromkeys(entries(N=2))  # None: what is not in the file
MANY = {"J_regressor": np.zeros((72, 121)), "posedirs": np.zeros((40, 3, 96))}
NO_BODIES: list[tuple[Entries, type[WorkbenchError], str]] = [
    ({"weights": None, "f": None}, BadFile, "has no weights, f"),
    ({"bs_style": np.array(b"dqbs")}, BadFile, "bs_style 'dqbs'"),
    ({"shapedirs": np.zeros((41, 3, 10))}, BadFile, "shapedirs has shape"),
    ({"v_template": np.zeros((0, 3))}, BadFile, "v_template has shape"),
    ({"v_template": np.full((40, 3), np.nan)}, BadBody, "not finite"),
    ({"v_template": np.full((40, 3), 1800.0)}, BadBody, "beyond 1,000 m"),  # in millimetres
    ({"f": np.full((2, 3), 0.5)}, BadFile, "f must hold whole numbers"),
    ({"kintree_table": [[-1, 0, 9, *[0] * 21], range(24)]}, BadBody, "joint 2 has parent 9"),
    ({"weights": np.array([{"a": 1}], dtype=object)}, BadFile, "Python objects"),
    ({"joint_names": np.arange(24)}, BadFile, "must be a list of names"),
    (MANY, BadBody, "has shape"),
    (ALL | {"poses": np.zeros((4, 156)), "trans": np.zeros((4, 3))}, BadFile, "like a motion"),
    (ALL | {"vertices": np.zeros((4, 3)), "faces": np.eye(3)}, BadFile, "like a plain mesh"),
]


def test_arrays_that_are_no_body_are_refused(tmp_path: Path) -> None:
    for change, error, says in NO_BODIES:
        raw = {k: value for k, value in (entries() | change).items() if value is not None}
        with pytest.raises(error, match=says):
            load_body(saved(tmp_path / "model.npz", raw))


def test_other_kinds_of_files_are_recognised(tmp_path: Path) -> None:
    np.save(tmp_path / "one.npy", np.zeros(3))
    with zipfile.ZipFile(tmp_path / "archive.zip", "w") as archive:
        archive.writestr("readme.txt", "hello")
    for content, says in (
        (b"", "is empty"),
        (b"\x00\x01\x02", "is neither an .npz nor a .pkl file"),
        (b"<!DOCTYPE html><html>", "a web page"),
        (b"version https://git-lfs.github.com/spec/v1", "git lfs pull"),
        (b"glTF\x02\x00\x00\x00", "read_mesh"),
        (b"\x1f\x8b\x08", "gzip"),
        (b"PK\x03\x04 and then nothing", "cut off or damaged"),
        ((tmp_path / "one.npy").read_bytes(), "a single array"),
        ((tmp_path / "archive.zip").read_bytes(), "zip archive without arrays"),
    ):
        (tmp_path / "model.npz").write_bytes(content)
        with pytest.raises(BadFile, match=says):
            load_body(tmp_path / "model.npz")
    with pytest.raises(BadFile, match="is a folder"):
        load_body(tmp_path)


def test_objects_of_an_npz_are_never_made(tmp_path: Path) -> None:
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


# What travels with a body.


def test_entries_left_out_are_named_with_the_reason(tmp_path: Path) -> None:
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


def test_extras_that_a_file_cannot_hold_are_refused() -> None:
    body = body_from(entries(), "b", "b")
    for key in ("weights", "card", "J_regressor/data", "landmarks/face/names"):
        with pytest.raises(BadBody, match=f"extras must not be called .*: {key}"):
            replace(body, extras={key: np.zeros(3)})
    with pytest.raises(BadBody, match=r"extras\['info'\] must be an array"):
        replace(body, extras={"info": np.array({})})


# Writing.


def test_failed_save_leaves_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
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


def test_bodies_and_places_that_hold_no_file_are_refused(tmp_path: Path) -> None:
    def rigid(points: cs.MX, motions: Any, weights: cs.MX) -> cs.MX:
        return points

    (tmp_path / "folder.npz").mkdir()
    body = body_from(entries(), "b", "b")
    for parts, name, says in (
        ({}, "no/body.npz", "choose an existing folder"),
        ({}, "body.json", r"\.npz or \.pkl"),
        ({}, "folder.npz", "cannot write"),
        ({"card": {"array": np.zeros(3)}}, "body.npz", "card .* must hold texts"),
        ({"name": "b" * 201}, "body.npz", "name of 201 characters"),
        ({"skinning": rigid}, "body.npz", "not skinned by linear_blend"),
    ):
        with pytest.raises(BadFile, match=says):
            save_body(replace(body, **parts), tmp_path / name)
    assert [p.name for p in tmp_path.iterdir()] == ["folder.npz"]


def test_saved_pickles_hold_numpy_arrays_only(tmp_path: Path) -> None:
    save_body(decorated(body_from(entries(), "b", "b")), tmp_path / "body.pkl")
    with (tmp_path / "body.pkl").open("rb") as file:
        content = pickle.load(file)
    assert all(
        type(value) is np.ndarray and not value.dtype.hasobject for value in content.values()
    )
