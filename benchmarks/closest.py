"""Closest places on the surface of a body: compiled, in NumPy, and by libigl's AABB tree."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from importlib.util import find_spec
from typing import Any

import numpy as np

import workbench as wb
from benchmarks.timing import side_by_side
from workbench.arrays import Array, Index
from workbench.geometry.surface_search import IN_NUMPY, SearchBackend
from workbench.geometry.surface_tree import SurfaceTree, compiled, quickest

BODY, COUNT = "full", 40_000
COMPILED, NUMPY, IGL = "workbench, compiled", "workbench", "libigl"
NOISE, CLUTTER, ROOM, OFF = 0.005, 0.2, 0.2, 0.15  # m, share, m around the body, m
DIFFERENT = 4  # sets of points of each kind
FEW = 3  # turns of NumPy
AGREE = 1e-12  # m: by how much distances may differ
KINDS = {"near": "near", "clutter": "20 % clutter", "off": "15 cm off"}
REFIT = "refit"


@dataclass(frozen=True, eq=False)
class Surface:
    """A mesh, (N, 3) m and (F, 3)."""

    vertices: Array
    faces: Index

    @staticmethod
    def of(name: str) -> "Surface":
        """An embedded body at rest."""
        body = wb.load_body(name)
        return Surface(np.ascontiguousarray(body.template), np.ascontiguousarray(body.faces))

    def points(self, kind: str, count: int, seed: int) -> Array:
        """Points (count, 3) m, in no order: near the surface, with clutter, or all of them off."""
        rng = np.random.default_rng(seed)
        corners = self.vertices[self.faces[rng.integers(len(self.faces), size=count)]]
        found = np.einsum("ik,ikj->ij", rng.dirichlet(np.ones(3), count), corners)
        found += NOISE * rng.standard_normal(found.shape)
        if kind == "clutter":
            low, high = self.vertices.min(axis=0) - ROOM, self.vertices.max(axis=0) + ROOM
            some = rng.random(count) < CLUTTER
            found[some] = rng.uniform(low, high, (int(some.sum()), 3))
        return np.asarray(found + [OFF if kind == "off" else 0, 0, 0])


def measure(
    rounds: int, peers: bool = True, body: str = BODY, count: int = COUNT
) -> dict[str, Any]:
    """By kind of points: seconds by candidate; and those of a refit. All agree on distances."""
    surface = Surface.of(body)
    candidates = _candidates(surface, peers)
    seconds: dict[str, Any] = {}
    for kind in KINDS:
        inputs = [surface.points(kind, count, seed) for seed in range(DIFFERENT)]
        answers = {name: run(inputs[0]) for name, run in candidates.items()}
        for found in answers.values():
            np.testing.assert_allclose(found, answers[NUMPY], rtol=0, atol=AGREE)
        slow = {NUMPY: candidates[NUMPY]}  # not among the others, whose turns would be far apart
        quick = {name: run for name, run in candidates.items() if name not in slow}
        times = side_by_side(quick, inputs, rounds) | side_by_side(slow, inputs, min(rounds, FEW))
        seconds[kind] = {name: times[name] for name in candidates}
    moved = [surface.vertices * (1 + 0.01 * k) for k in range(DIFFERENT)]
    refits = {name: tree.moved for name, tree in _trees(surface).items()}
    seconds[REFIT] = side_by_side(refits, moved, rounds)
    return {"body": body, "faces": len(surface.faces), "points": count, "seconds": seconds}


def _trees(surface: Surface) -> dict[str, SurfaceTree]:
    ways: dict[str, Callable[[], SearchBackend]] = {NUMPY: lambda: IN_NUMPY}
    if compiled():
        ways = {COMPILED: quickest, **ways}
    return {name: SurfaceTree(surface.vertices, surface.faces, way) for name, way in ways.items()}


def _candidates(surface: Surface, peers: bool) -> Mapping[str, Callable[[Array], Array]]:
    """What takes points (M, 3) m to distances (M,) m, never negative."""

    def by_tree(tree: SurfaceTree, points: Array) -> Array:
        return np.abs(tree.closest(points).distances)

    found = {name: partial(by_tree, tree) for name, tree in _trees(surface).items()}
    if not peers:
        return found
    if find_spec("igl") is None:
        print("skipped libigl: igl not installed")
        return found
    import igl

    tree = igl.AABB()
    tree.init(surface.vertices, surface.faces)

    def by_igl(points: Array) -> Array:
        squares, _, _ = tree.squared_distance(surface.vertices, surface.faces, points)
        return np.sqrt(squares)

    return {**found, IGL: by_igl}
