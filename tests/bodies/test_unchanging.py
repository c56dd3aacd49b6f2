"""A body never changes, so what it computed with stays true; and it travels whole."""

import copy
import gc
import pickle
import weakref
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.sparse import coo_array, csr_array

import workbench as wb
from tests.bodies_made_up import random_body
from workbench.bodies.readonly import locked, readonly
from workbench.errors import BadBody

ARRAYS = (
    "template",
    "shapedirs",
    "posedirs",
    "weights",
    "faces",
    "mirror",
    "bound_in",
    "rest_joints",
)
PARTS = ("data", "indices", "indptr")


def whole_body(N: int = 12) -> wb.SkinnedBody:
    """A body that has everything a body can have."""
    face = wb.Landmarks(("nose", "eye"), csr_array(np.eye(2, N)))
    body = random_body(2, n_vertices=N, bound=True)
    return replace(
        body,
        mirror=np.arange(N),
        landmarks={"face": face},
        card={"licence": "CC0"},
        rest_joints=body.joints() + 0.01,
    )


def all_arrays(body: wb.SkinnedBody) -> dict[str, np.ndarray]:
    found = {name: getattr(body, name) for name in ARRAYS}
    for name, matrix in (("J", body.J_regressor), ("face", body.landmarks["face"].regressor)):
        found |= {f"{name}.{part}": getattr(matrix, part) for part in PARTS}
    return found


@pytest.mark.parametrize("name", list(all_arrays(whole_body())))
def test_no_array_of_a_body_can_be_written_to(name: str) -> None:
    array = all_arrays(whole_body())[name]
    with pytest.raises(ValueError, match="read-only"):
        array[...] = 0


@pytest.mark.filterwarnings("ignore:Changing the sparsity structure")
def test_a_matrix_takes_no_new_entries() -> None:
    body = whole_body()
    for matrix in (body.J_regressor, body.landmarks["face"].regressor):
        with pytest.raises(ValueError, match="read-only"):
            matrix[1, 0] = 1.0
    for mapping in (body.landmarks, body.free):
        with pytest.raises(TypeError, match="mappingproxy"):
            mapping["other"] = None  # type: ignore[index]


def test_what_a_body_was_made_of_stays_the_callers_own() -> None:
    made = whole_body()
    given: dict[str, Any] = {name: getattr(made, name).copy() for name in ARRAYS}
    regressor, sets = made.J_regressor.copy(), dict(made.landmarks)
    body = replace(made, **given, J_regressor=regressor, landmarks=sets)
    before = body.vertices()
    for array in (*given.values(), regressor.data):
        assert array.flags.writeable
        array[...] = 0
    sets.clear()
    np.testing.assert_array_equal(body.vertices(), before)
    np.testing.assert_array_equal(replace(body).vertices(), before)  # nothing cached
    assert body.landmark_names("face") == ("nose", "eye")


def test_a_read_only_view_of_what_can_be_written_is_copied() -> None:
    body = whole_body()
    base = body.template.copy()
    view = base[:]
    view.setflags(write=False)
    seen = replace(body, template=view)
    base[...] = 0
    np.testing.assert_array_equal(seen.template, body.template)


def test_arrays_that_nobody_can_write_to_are_shared() -> None:
    body = wb.load_body("small")
    other = replace(body, name="other")
    for name in ("template", "shapedirs", "posedirs", "weights", "faces"):
        assert getattr(other, name) is getattr(body, name)
    assert np.shares_memory(other.J_regressor.data, body.J_regressor.data)
    assert np.shares_memory(other.J_regressor.indices, body.J_regressor.indices)


def test_what_a_reader_gives_up_is_kept_as_it_is() -> None:
    """A view as well, as readers reshape: both it and what it looks at are locked."""
    base = np.zeros((4, 6))
    view = base.reshape(8, 3)
    assert readonly("points", locked(view)) is view
    assert not base.flags.writeable


@pytest.mark.parametrize("dtype", [np.float32, np.float64, np.int64])
@pytest.mark.parametrize("order", ["C", "F"])
def test_any_precision_and_order_becomes_float64_in_one_piece(dtype: type, order: str) -> None:
    given = np.asarray(np.arange(12).reshape(4, 3), dtype=dtype, order=order)  # type: ignore[call-overload]
    kept = readonly("points", given)
    assert (kept.dtype, kept.flags.c_contiguous, kept.flags.writeable) == (np.float64, True, False)
    assert kept.base is None  # of its own size, not a view of more
    np.testing.assert_array_equal(kept, given)


def test_lists_and_any_matrix_will_do() -> None:
    body = whole_body()
    given: dict[str, Any] = {n: getattr(body, n).tolist() for n in ARRAYS}
    given["parents"] = list(body.parents)
    dense = body.J_regressor.toarray()
    for regressor in (dense.tolist(), coo_array(dense), csr_array(dense.astype(np.float32))):
        same = replace(body, **given, J_regressor=regressor)
        np.testing.assert_allclose(same.vertices(), body.vertices(), atol=1e-7)
        assert isinstance(same.J_regressor, csr_array)
        assert isinstance(same.parents, tuple)


@pytest.mark.parametrize(
    ("wrong", "text"),
    [
        ({"template": [["a", "b", "c"]] * 12}, "template must be .* real numbers, not text"),
        ({"template": [[0, 0, 0], [1, 1]]}, "template must .*, not rows of different lengths"),
        ({"weights": None}, "weights must .*, not something of type NoneType"),
        ({"shapedirs": np.ones((12, 3, 1), complex)}, "shapedirs must .*, not complex numbers"),
        ({"J_regressor": np.ones(12)}, r"J_regressor must .* two axes, not one of shape \(12,\)"),
        ({"J_regressor": csr_array(1j * np.eye(5, 12))}, "J_regressor must .* of complex128"),
        ({"faces": np.ones((2, 3))}, "faces must be an array of whole numbers, not float64"),
        ({"mirror": np.arange(12.0)}, "mirror must be .* whole numbers, not float64"),
        ({"template": np.zeros((0, 3))}, "template has no vertices"),
        ({"parents": (), "joint_names": ()}, "joint 0 must be the root"),
    ],
    ids=lambda value: next(iter(value)) if isinstance(value, dict) else "",
)
def test_what_are_no_arrays_is_named(wrong: dict[str, Any], text: str) -> None:
    with pytest.raises(BadBody, match=f"body 'made-up': {text}"):
        replace(whole_body(), **wrong)


# Travelling.


def through_pickle(body: wb.SkinnedBody) -> wb.SkinnedBody:
    found = pickle.loads(pickle.dumps(body))
    assert isinstance(found, wb.SkinnedBody)
    return found


def used(body: wb.SkinnedBody) -> wb.SkinnedBody:
    """The body after everything that it keeps for later was made, compiled arithmetic included."""
    symbols = [block.symbol for block in body.blocks("scan/")]
    body.vertices()
    _ = body.numeric.skinned_rest
    observed = wb.Block("observed", (body.n_vertices, 3), "m").symbol
    term = wb.residuals.vertices(body.points(*symbols), observed, sigma=1.0)
    wb.Problem([term], "scan/pose").prepare()
    return body


@pytest.mark.parametrize("travel", [through_pickle, copy.deepcopy, copy.copy])
def test_a_used_body_arrives_whole(travel: Callable[[wb.SkinnedBody], wb.SkinnedBody]) -> None:
    body = used(whole_body(1100))  # from 1,000 vertices on the arithmetic may be compiled
    there = travel(body)
    for name, array in all_arrays(body).items():
        np.testing.assert_array_equal(all_arrays(there)[name], array)
        assert not all_arrays(there)[name].flags.writeable
    for name in ("parents", "joint_names", "name", "card", "skinning"):
        assert getattr(there, name) == getattr(body, name)
    rng = np.random.default_rng(0)
    arguments = (rng.normal(size=(3, 5, 3)), rng.normal(size=3), rng.normal(size=3))
    np.testing.assert_array_equal(there.vertices(*arguments), body.vertices(*arguments))
    np.testing.assert_array_equal(there.joints(*arguments), body.joints(*arguments))
    np.testing.assert_array_equal(there.landmark("face"), body.landmark("face"))
    assert there.blocks("scan/")[0].symbol is not body.blocks("scan/")[0].symbol


def test_a_copy_of_a_copy_is_as_good() -> None:
    body = used(whole_body())
    again = copy.deepcopy(through_pickle(body))
    np.testing.assert_array_equal(again.vertices(), body.vertices())


@pytest.mark.parametrize("travel", [through_pickle, copy.deepcopy])
def test_free_arrays_stay_free_and_get_symbols_of_their_own(
    travel: Callable[[wb.SkinnedBody], wb.SkinnedBody],
) -> None:
    body = used(whole_body().freed("template", prefix="new "))
    there = travel(body)
    block = there.free["template"]
    assert (block.name, block.shape, block.unit) == ("new template", (12, 3), "m")
    assert block.symbol is not body.free["template"].symbol
    points = there.points(*(b.symbol for b in there.blocks()))
    problem = wb.Problem(
        [wb.residuals.vertices(points, there.template + 1, sigma=1.0)], "new template"
    )
    np.testing.assert_allclose(problem.linearize(there.start()).residual, -1, atol=1e-14)


def test_a_body_that_computed_is_freed_with_its_last_name() -> None:
    """Large arrays must not wait for the garbage collector."""
    body = whole_body()
    body.vertices()
    body.joints()
    there = weakref.ref(body)
    gc.collect()
    gc.disable()
    try:
        del body
        assert there() is None
    finally:
        gc.enable()
