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
from scipy.sparse import csr_array

import workbench as wb
from tests.bodies_made_up import random_body

ARRAYS = ("template", "shapedirs", "posedirs", "weights", "faces", "mirror")
ARRAYS += ("bound_in", "rest_joints")
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


@pytest.mark.filterwarnings("ignore:Changing the sparsity structure")
def test_nothing_of_a_body_can_be_written_to() -> None:
    body = whole_body()
    for array in all_arrays(body).values():
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 0
    for matrix in (body.J_regressor, body.landmarks["face"].regressor):
        with pytest.raises(ValueError, match="read-only"):
            matrix[1, 0] = 1.0
    for mapping in (body.landmarks, body.free):
        with pytest.raises(TypeError, match="mappingproxy"):
            mapping["other"] = None  # type: ignore[index]


def test_arrays_given_to_a_body_stay_the_callers() -> None:
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
    base = made.template.copy()
    view = base[:]
    view.setflags(write=False)  # of what can be written to
    seen = replace(made, template=view)
    base[...] = 0
    np.testing.assert_array_equal(seen.template, made.template)


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


def again(body: wb.SkinnedBody) -> wb.SkinnedBody:
    """A copy of a copy."""
    return copy.copy(copy.deepcopy(through_pickle(body)))


@pytest.mark.thorough
@pytest.mark.parametrize("travel", [through_pickle, copy.deepcopy, again])
def test_used_bodies_travel_whole(travel: Callable[[wb.SkinnedBody], wb.SkinnedBody]) -> None:
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


def test_used_bodies_are_freed_without_garbage_collection() -> None:
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
