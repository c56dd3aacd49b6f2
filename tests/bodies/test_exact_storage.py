"""Directions stored in the smallest type that holds them exactly: the same numbers to the bit."""

import numpy as np
import pytest

from tests.bodies_made_up import random_body
from workbench import load_body
from workbench.bodies.forward.exact_storage import MOST, Storage, Stored, storages, whole_step

STEPS = [2e-5, 5e-6, 1e-3, 0.1, 1 / 3, 2.0**-20, np.pi * 1e-7]


def whole(rng: np.random.Generator, step: float, most: int = MOST) -> np.ndarray:
    return rng.integers(-most, most + 1, (40, 3, 7)) * step


@pytest.mark.parametrize("step", STEPS)
@pytest.mark.parametrize("most", [1, 3, 100, MOST])
def test_whole_steps_are_found_and_come_back_to_the_bit(step: float, most: int) -> None:
    array = whole(np.random.default_rng(1), step, most)
    found = whole_step(array)
    ratio = step / found if found else np.nan
    assert abs(ratio - round(ratio)) < 1e-9  # the step, or a whole part of it
    (storage,) = storages(array)
    assert storage.kind is Stored.STEPS
    stored = storage.stored(array)
    assert stored.dtype == np.float32
    np.testing.assert_array_equal(stored * np.float64(storage.step), array)


def test_what_steps_do_not_hold_is_single_or_double() -> None:
    rng = np.random.default_rng(2)
    real = rng.standard_normal((30, 3, 5))
    single = real.astype(np.float32).astype(np.float64)
    steps = whole(rng, 1e-5)
    too_many = np.append(steps, (MOST + 1) * 1e-5 * np.array([1, -1]))
    off = steps.copy()
    off.ravel()[17] = np.nextafter(off.ravel()[17], np.inf)
    kinds = [storages(a)[0].kind for a in (real, single, too_many, off)]
    assert kinds == [Stored.DOUBLE, Stored.SINGLE, Stored.DOUBLE, Stored.DOUBLE]
    np.testing.assert_array_equal(Storage(Stored.SINGLE).stored(single), single)


@pytest.mark.parametrize("spoilt", [np.nan, np.inf, 1e39, 5e-324])
def test_numbers_that_only_double_precision_has(spoilt: float) -> None:
    array = whole(np.random.default_rng(3), 1e-5)
    array[0, 0, 0] = spoilt
    assert storages(array)[0].kind is Stored.DOUBLE


def test_nothing_fits_into_anything() -> None:
    steps, nothing = whole(np.random.default_rng(4), 1e-5), np.zeros((4, 3, 0))
    for empty in (nothing, np.zeros((4, 3, 9))):
        assert {s.kind for s in storages(steps, empty)} == {Stored.STEPS}


def test_several_arrays_share_a_type() -> None:
    rng = np.random.default_rng(5)
    one, other = storages(whole(rng, 1e-5), whole(rng, 3e-6))
    assert one.kind is other.kind is Stored.STEPS
    assert one.step != other.step
    mixed = storages(whole(rng, 1e-5), rng.standard_normal(9))
    assert mixed == (Storage(Stored.DOUBLE),) * 2


def test_the_embedded_bodies_are_steps_and_random_ones_are_not() -> None:
    body = load_body("small")
    shape, bend = storages(body.shapedirs, body.posedirs)
    assert shape.kind is bend.kind is Stored.STEPS
    assert bend.step == 2e-5
    made_up = random_body(1, n_vertices=20)
    assert storages(made_up.shapedirs, made_up.posedirs)[0].kind is Stored.DOUBLE
