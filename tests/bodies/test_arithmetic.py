"""Arithmetic of surfaces and joints, in C and in NumPy: the numbers of the whole graph."""

import shutil
from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path

import casadi as cs
import numpy as np
import pytest

from tests.bodies_made_up import SMPL_PARENTS, random_body
from tests.tiers import few
from workbench.bodies import SkinnedBody
from workbench.bodies.forward import compiled, posed_points
from workbench.bodies.forward.compiled import (
    MESH,
    CompiledJoints,
    CompiledMesh,
    joint_library,
    mesh_library,
)
from workbench.bodies.forward.kinematics import Skeleton
from workbench.bodies.forward.mesh import NumpyMesh, chunks_of
from workbench.bodies.forward.motion import Kinematics

COMPILER = next((c for c in ("gcc", "clang", "cc") if shutil.which(c)), None)
NEEDS_COMPILER = pytest.mark.skipif(COMPILER is None, reason="no C compiler on the PATH")
WAYS = {"C": CompiledMesh, "NumPy": NumpyMesh}
EACH_WAY = pytest.mark.parametrize(
    "way", [pytest.param("C", marks=NEEDS_COMPILER), pytest.param("NumPy")]
)
KINDS = {"smpl": (24, 10, False), "one joint": (1, 0, False), "small": (4, 2, False)}
KINDS |= {"bound": (4, 2, True), "no betas": (5, 0, False)}
TREES = {24: SMPL_PARENTS, 5: (-1, 0, 1, 1, 0), 4: (-1, 0, 1, 0), 1: (-1,)}  # a library for each
ANGLES = {"zero": 0.0, "near zero": 1e-7, "pi": np.pi, "anywhere": 0.7}
ANGLES |= {"a full turn": 2 * np.pi * (1 + 1e-9)}
NAMES = ("pose", "betas", "trans")


@pytest.fixture(autouse=True)
def afresh(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """As in a new process, with everything worth compiling."""
    monkeypatch.delenv("WORKBENCH_COMPILE", raising=False)
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setattr(posed_points, "WORTH_COMPILING", 1)
    forget_libraries()
    yield
    forget_libraries()


def forget_libraries() -> None:
    mesh_library.cache_clear()
    joint_library.cache_clear()


def choose(way: str, monkeypatch: pytest.MonkeyPatch) -> None:
    if way == "NumPy":
        monkeypatch.setenv("WORKBENCH_COMPILE", "0")


@cache
def body_of(kind: str, N: int) -> SkinnedBody:
    K, B, bound = KINDS[kind]
    return random_body(N, n_vertices=N, n_joints=K, n_betas=B, parents=TREES[K], bound=bound)


def in_whole_steps(body: SkinnedBody, step: float = 1e-5) -> SkinnedBody:
    """As the embedded bodies are stored."""
    shapedirs, posedirs = (np.rint(a / step) * step for a in (body.shapedirs, body.posedirs))
    return replace(body, shapedirs=shapedirs, posedirs=posedirs)


def pose_at(where: str, K: int) -> np.ndarray:
    axes = np.random.default_rng(5).standard_normal((K, 3))
    return ANGLES[where] * axes / np.linalg.norm(axes, axis=1, keepdims=True)


@cache
def graph_of(body: SkinnedBody) -> cs.Function:
    """Points, and the Jacobian by pose, betas and trans, of the whole graph."""
    symbols = [block.symbol for block in body.blocks()]
    whole = cs.vec(body.points(*symbols).source.expression)
    return cs.Function("J", symbols, [whole, *(cs.jacobian(whole, s) for s in symbols)])


def assert_right(body: SkinnedBody, where: str = "anywhere", way: str = "C") -> None:
    """Points, derivatives by rows and gradients, whichever of them is asked for first."""
    K, B, N = body.n_joints, body.n_betas, body.n_vertices
    rng = np.random.default_rng(6)
    pose, betas = pose_at(where, K), rng.standard_normal(B)
    motion = body.kinematics.motion(pose, betas)
    made = replace(body).numeric.mesh()
    assert isinstance(made, WAYS[way])
    points, *by = (np.asarray(a) for a in graph_of(body)(pose.T, betas, np.zeros(3)))
    first, asked_last = made.at(motion, betas), made.at(motion, betas)
    np.testing.assert_allclose(first.points, points.reshape(-1, 3), rtol=0, atol=1e-12)
    scale = rng.standard_normal(3 * N)
    for here in (first, asked_last):
        into = {n: np.zeros((b.shape[1], 3 * N)) for n, b in zip(NAMES, by, strict=True)}
        here.write_jacobian(motion.derivatives, into, scale)
        for name, expected in zip(NAMES, by, strict=True):
            largest = np.abs(expected).max(initial=0.0)
            wanted = (expected * scale[:, None]).T
            np.testing.assert_allclose(into[name], wanted, rtol=1e-11, atol=1e-11 * largest)
    np.testing.assert_allclose(asked_last.points, points.reshape(-1, 3), rtol=0, atol=1e-12)
    cotangent = rng.standard_normal((N, 3))
    in_numpy = NumpyMesh(chunks_of(body, slice(None)), body.parents).at(motion, betas)
    for got, expected in zip(first.vjp(cotangent), in_numpy.vjp(cotangent), strict=True):
        np.testing.assert_allclose(got, expected, atol=1e-12 * np.abs(expected).max(initial=1.0))


# The numbers.


@EACH_WAY
@pytest.mark.parametrize("kind", few(KINDS, ["smpl", "one joint", "bound"]))
def test_arithmetic_is_that_of_the_graph(
    kind: str, way: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    choose(way, monkeypatch)
    for where in ("zero", "near zero", "pi", "anywhere"):
        assert_right(body_of(kind, 21), where, way)


@NEEDS_COMPILER
@pytest.mark.parametrize("N", few([1, 8, 9, 7, 16, 1030], 3))
def test_compiled_surfaces_have_any_number_of_vertices(N: int) -> None:
    assert_right(body_of("bound", N))


@NEEDS_COMPILER
@pytest.mark.parametrize("kind", ["steps", "single"])
def test_directions_stored_small_are_the_same_numbers(
    kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The results are those of plain double precision, to 1e-13 of the size of the body."""
    body = body_of("small", 13)
    if kind == "steps":
        body = in_whole_steps(body)
    else:
        S, P = (a.astype(np.float32).astype(float) for a in (body.shapedirs, body.posedirs))
        body = replace(body, shapedirs=S, posedirs=P)
    monkeypatch.setattr(compiled, "WORTH_NARROWING", 0)
    narrow = body.numeric.mesh()
    for where in ANGLES:
        assert_right(body, where)
    monkeypatch.setattr(compiled, "WORTH_NARROWING", np.inf)
    plain = replace(body).numeric.mesh()
    assert isinstance(narrow, CompiledMesh)
    assert isinstance(plain, CompiledMesh)
    stored = narrow.packed.posedirs.dtype, plain.packed.posedirs.dtype
    assert stored == (np.float32, np.float64)
    motion = body.kinematics.motion(pose_at("anywhere", 4), np.ones(2))
    found = [one.at(motion, np.ones(2)).points for one in (narrow, plain)]
    np.testing.assert_allclose(*found, rtol=0, atol=1e-13 * np.ptp(found[1]))


@EACH_WAY
def test_joints_that_leave_vertices_alone_change_no_number(
    way: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whether all joints move every vertex, or some neither carry nor bend any."""
    choose(way, monkeypatch)
    body = body_of("smpl", 21)
    everywhere = np.random.default_rng(0).dirichlet(np.ones(24), size=21)
    assert_right(replace(body, weights=everywhere), way=way)
    posedirs = body.posedirs.reshape(21, 3, 23, 9).copy()
    posedirs[:, :, 5:] = posedirs[8:16, :, 3] = 0
    weights = np.zeros((21, 24))
    weights[:, 0] = weights[:7, 7] = weights[7:, 23] = 0.5
    assert_right(replace(body, posedirs=posedirs.reshape(21, 3, 207), weights=weights), way=way)


@NEEDS_COMPILER
def test_derivatives_go_into_memory_of_any_layout() -> None:
    body, betas, pose = body_of("bound", 13), np.ones(2), pose_at("anywhere", 4)
    motion = body.kinematics.motion(pose, betas)
    made = body.numeric.mesh().at(motion, betas)
    plain = {"pose": np.zeros((12, 39)), "trans": np.zeros((3, 39))}
    made.write_jacobian(motion.derivatives, plain, None)
    whole = np.zeros((20, 50))
    rooms = {
        "columns": np.zeros((39, 12)).T,
        "rows of a larger one": whole[3:15, 5:44],
        "every other": np.zeros((12, 78))[:, ::2],
    }
    for layout, room in rooms.items():
        made.write_jacobian(motion.derivatives, {"pose": room}, np.broadcast_to(2.0, 39))
        np.testing.assert_allclose(room, 2 * plain["pose"], rtol=0, err_msg=layout)
    outside = np.ones(whole.shape, dtype=bool)
    outside[3:15, 5:44] = False
    assert not whole[outside].any()


# Kinematics.


@NEEDS_COMPILER
@pytest.mark.parametrize("kind", ["bound", "one joint"])
def test_compiled_kinematics_are_those_of_numpy(kind: str) -> None:
    body = body_of(kind, 5)
    of = Skeleton.of(body), body.bind_pose, body.parents
    in_c = CompiledJoints.of(*of)
    assert in_c is not None
    betas = np.random.default_rng(0).standard_normal(body.n_betas)
    for size in (0.0, 1e-9, 0.4, 3.0, 40.0):
        pose = size * np.random.default_rng(1).standard_normal((body.n_joints, 3))
        ours, usual = (Kinematics(*of, way).motion(pose, betas) for way in (in_c, None))
        for found, expected in ((ours, usual), (ours.derivatives, usual.derivatives)):
            np.testing.assert_allclose(found.numbers, expected.numbers, rtol=0, atol=1e-13)


# Compilers that fail, and libraries that are not trusted.


def compiler_that(tmp_path: Path, says: str) -> str:
    script = tmp_path / "mycc"
    script.write_text(f"#!/bin/sh\n{says}\n")
    script.chmod(0o755)
    return str(script)


def spoiling(tmp_path: Path, name: str, right: str, wrong: str) -> str:
    """A compiler of slightly other code."""
    spoil = f"sed -i.bak 's/{right}/{wrong}/' {name}.c"
    says = f'case "$*" in *-dM*) ;; *) {spoil};; esac; exec {COMPILER} "$@"'
    return compiler_that(tmp_path, says)


NO_LIBRARY = 'case "$*" in *-dM*) ;; *) echo rubbish > mesh.so;; esac'


@pytest.mark.parametrize(
    ("name", "value", "reason"),
    [
        ("WORKBENCH_COMPILE", "0", "switched off"),
        ("PATH", "", "no C compiler"),
        ("CC", "echo no licence >&2; exit 1", "exit code 1: no licence"),
        ("CC", NO_LIBRARY, "does not load"),
    ],
    ids=["switched off", "no compiler", "fails", "makes no library"],
)
def test_numpy_computes_where_nothing_can_be_compiled(
    name: str,
    value: str,
    reason: str,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
    tmp_path: Path,
) -> None:
    monkeypatch.setenv("WORKBENCH_CACHE", str(tmp_path / "cache"))
    monkeypatch.setenv(name, compiler_that(tmp_path, value) if name == "CC" else value)
    with caplog.at_level("INFO", logger="workbench"):
        assert_right(body_of("small", 9), way="NumPy")
    said = [r.getMessage() for r in caplog.records if "surfaces are computed" in r.getMessage()]
    assert len(said) == 1
    assert reason in said[0]
    assert not list(tmp_path.glob("cache/*.so"))


@NEEDS_COMPILER
def test_library_of_wrong_surfaces_is_not_kept(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    spoilt = spoiling(tmp_path, MESH, "whole.i. .= factor", "whole[i] += factor")
    monkeypatch.setenv("CC", spoilt)
    monkeypatch.setenv("WORKBENCH_CACHE", str(tmp_path / "cache"))
    loaded, why = mesh_library((-1, 0), 1)
    assert loaded is None
    assert "numbers are wrong" in why
    assert not list((tmp_path / "cache").glob("*.so"))


@NEEDS_COMPILER
def test_library_of_wrong_kinematics_is_not_kept(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    code = spoiling(tmp_path, "joints", "step.c. . from", "step[c] * 2 * from")
    monkeypatch.setenv("CC", code)
    monkeypatch.setenv("WORKBENCH_CACHE", str(tmp_path / "cache"))
    assert joint_library((-1, 0), 1) is None
    assert not list((tmp_path / "cache").glob("*.so"))
