"""Whether compiled surfaces say what NumPy says, about a few random vertices."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from workbench.arrays import Array
from workbench.bodies.forward.exact_storage import Storage, Stored
from workbench.bodies.forward.joint import joint_functions
from workbench.bodies.forward.motion import Motion, Slopes
from workbench.bodies.forward.numeric import ChunkedArithmetic, chunks_of
from workbench.bodies.forward.packed_vertices import PackedVertices, Packing

TRIED = 11  # vertices: all lanes full at least once, and some that are left over
TRIED_SHARE = 0.1  # of its joints that carry and bend each of them
STEP = 1e-3  # of the numbers that are tried

Surfaces = Callable[..., Any]


class _Arrays(NamedTuple):
    template: Array
    shapedirs: Array
    posedirs: Array
    weights: Array


def agrees_with_numpy(
    compiled: Callable[[PackedVertices], Surfaces],
    lanes: int,
    parents: tuple[int, ...],
    B: int,
    packing: Packing,
) -> bool:
    """Whether compiled surfaces of bodies with B betas on this tree are right.

    The numbers of the joints are random; only the features and their slopes are those of rotations.
    """
    rng, K = np.random.default_rng(0), len(parents)
    arrays = _random_arrays(rng, K, B, packing)
    features, d_features = _of_rotations(rng.standard_normal((K, 3)))
    axes = rng.standard_normal((K, 3, 1, 3))
    motion = Motion(
        G=rng.standard_normal((K, 3, 4)),
        features=features,
        joints=rng.standard_normal((K, 3)),
    )
    slopes = Slopes(
        turns=np.cross(np.eye(3), axes).reshape(K, 9, 3),  # antisymmetric, as of rotations
        d_features=d_features,
        d_shift=rng.standard_normal((3 * B, K)),
    )
    betas, scale = rng.standard_normal(B), rng.standard_normal(3 * TRIED)
    packed = PackedVertices.of(arrays, parents, slice(None), lanes, packing)
    in_numpy = ChunkedArithmetic(chunks_of(arrays, slice(None)), parents)
    surfaces = compiled(packed)
    right = _answers(lambda: in_numpy.evaluate(motion, betas), slopes, scale)
    compiled_too = _answers(lambda: surfaces(motion, betas), slopes, scale)
    return all(
        np.allclose(got, expected, rtol=0, atol=1e-12 * (1 + np.abs(expected).max(initial=0)))
        for got, expected in zip(compiled_too, right, strict=True)
    )


def packing_tried(kind: Stored) -> Packing:
    """The packing of the numbers that are tried."""
    storage = Storage(kind, STEP if kind is Stored.STEPS else 1.0)
    return Packing(storage, storage)


def _random_arrays(rng: np.random.Generator, K: int, B: int, packing: Packing) -> _Arrays:
    bends = rng.random((TRIED, 1, K - 1, 1)) < TRIED_SHARE
    carries = rng.random((TRIED, K)) < TRIED_SHARE
    by_joint = rng.standard_normal((TRIED, 3, K - 1, 9)) * bends
    return _Arrays(
        rng.standard_normal((TRIED, 3)),
        _as_stored(rng.standard_normal((TRIED, 3, B)), packing.shape),
        _as_stored(by_joint.reshape(TRIED, 3, 9 * (K - 1)), packing.bend),
        rng.standard_normal((TRIED, K)) * carries,
    )


def _as_stored(array: Array, storage: Storage) -> Array:
    """The numbers that are left of an array when it is stored."""
    return storage.stored(array) * np.float64(storage.step)


def _of_rotations(pose: Array) -> tuple[Array, Array]:
    """The features of a pose (K, 3), and their slopes (K - 1, 3, 9)."""
    of_joint = joint_functions()["local_slopes"]
    turns = np.array([of_joint(own).full().reshape(4, 9) for own in pose])
    return (turns[1:, 0] - np.eye(3).ravel()).ravel(), turns[1:, 1:]


def _answers(surface: Callable[[], Any], slopes: Slopes, scale: Array) -> list[Array]:
    """The points with their derivative and alone, the derivative and the gradients."""
    K, B = len(slopes.turns), len(slopes.d_shift) // 3
    sizes = {"pose": 3 * K, "betas": B, "trans": 3}
    into = {name: np.zeros((size, len(scale))) for name, size in sizes.items()}
    here = surface()
    here.write_jacobian(slopes, into, scale)
    gradients = here.vjp(scale.reshape(-1, 3))
    return [here.points, surface().points, *into.values(), *gradients]
