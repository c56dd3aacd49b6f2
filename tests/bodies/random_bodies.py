"""Bodies of random numbers in the layout of SMPL's files, for the tests of files."""

from collections.abc import Mapping
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.sparse import csr_array

from tests.bodies_made_up import SMPL_PARENTS
from workbench.arrays import Array
from workbench.bodies.body import Body, Landmarks
from workbench.bodies.catalogue import load_body
from workbench.bodies.skinned import SkinnedBody

Entries = dict[str, Any]


def entries(N: int = 40, K: int = 24, B: int = 10, seed: int = 0) -> Entries:
    """The seven arrays of an SMPL file, float64, the root's parent being 2^32 - 1."""
    rng = np.random.default_rng(seed)
    parents = SMPL_PARENTS if K == 24 else (-1, *(int(rng.integers(k)) for k in range(1, K)))
    return {
        "v_template": rng.normal(size=(N, 3)),
        "shapedirs": rng.normal(size=(N, 3, B)) * 0.02,
        "posedirs": rng.normal(size=(N, 3, 9 * (K - 1))) * 0.01,
        "J_regressor": _rows(rng, K, N),
        "weights": _rows(rng, N, K),
        "kintree_table": np.array([(2**32 - 1, *parents[1:]), range(K)], dtype=np.uint32),
        "f": rng.integers(N, size=(2 * N, 3)).astype(np.uint32),
    }


def _rows(rng: np.random.Generator, rows: int, columns: int) -> Array:
    """Sparse rows that sum to one."""
    found = rng.random((rows, columns)) * (rng.random((rows, columns)) < 4 / columns)
    found[np.arange(rows), rng.integers(columns, size=rows)] += 1
    return found / found.sum(axis=1, keepdims=True)


def decorated(body: SkinnedBody) -> SkinnedBody:
    """The body with everything that a file of ours can hold beside SMPL's arrays."""
    rng = np.random.default_rng(1)
    landmarks = {
        name: Landmarks(
            tuple(f"{name}_{i}" for i in range(M)), csr_array(_rows(rng, M, body.n_vertices))
        )
        for name, M in (("coco", 5), ("one", 1), ("a/b", 2), ("none", 0))
    }
    return replace(
        body,
        mirror=np.arange(body.n_vertices)[::-1].copy(),
        landmarks=landmarks,
        name="someone",
        card={"source": "made up", "numbers": [1, 0.1, None], "nested": {"é": "ü"}},
    )


def same(a: Body, b: Body) -> None:
    """Assert that two bodies of one kind hold the same, bit for bit."""
    assert type(a) is type(b)
    for field in fields(a):  # type: ignore[arg-type]
        if field.name not in ("landmarks", "capsules", "free"):
            _same(getattr(a, field.name), getattr(b, field.name), field.name)
    assert a.landmarks.keys() == b.landmarks.keys()
    for name, landmarks in a.landmarks.items():
        assert landmarks.names == b.landmarks[name].names
        _same(landmarks.regressor, b.landmarks[name].regressor, name)


def _same(one: Any, other: Any, name: str) -> None:
    assert type(one) is type(other), name
    if isinstance(one, csr_array):
        _same(one.toarray(), other.toarray(), name)
    elif isinstance(one, np.ndarray):
        assert one.dtype == other.dtype or one.dtype.kind == "U", name
        np.testing.assert_array_equal(one, other, err_msg=name)
    elif isinstance(one, Mapping):
        assert one.keys() == other.keys(), name
        for key in one:
            _same(one[key], other[key], f"{name}[{key}]")
    else:
        assert one == other, name


def equal_to(raw: Entries, path: Path) -> None:
    """Assert that the file of a body holds these entries."""
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
