"""Compiled arithmetic: the numbers of NumPy and of the whole graph, or NumPy and a reason why."""

import logging
import shutil
import subprocess
import sys
import tracemalloc
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import workbench as wb
from tests.bodies_made_up import SMPL_PARENTS, random_body
from workbench import compiling
from workbench.bodies import SkinnedBody
from workbench.bodies.forward import arithmetic, numeric, packed_vertices, surface
from workbench.bodies.forward import kernels as compiled_kernels
from workbench.bodies.forward.arithmetic import arithmetic_of
from workbench.bodies.forward.exact_storage import Stored
from workbench.bodies.forward.joint_kernels import CompiledJoints, joint_kernels
from workbench.bodies.forward.kernel_trial import packing_tried
from workbench.bodies.forward.kernels import NAME, CompiledArithmetic, kernels
from workbench.bodies.forward.motion import Kinematics
from workbench.bodies.forward.numeric import ChunkedArithmetic, chunks_of
from workbench.bodies.forward.packed_vertices import PackedVertices, Packing
from workbench.bodies.forward.skeleton import Skeleton
from workbench.bodies.forward.vertex import motion_column, slopes_column

COMPILER = next((c for c in ("gcc", "clang", "cc") if shutil.which(c)), None)
NEEDS_COMPILER = pytest.mark.skipif(COMPILER is None, reason="no C compiler on the PATH")
KINDS = {"smpl": (24, 10), "one joint": (1, 0), "no betas": (5, 0), "small": (4, 2)}


@pytest.fixture(scope="module")
def cache(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A cache for the tests that may share what they compile."""
    return tmp_path_factory.mktemp("cache")


@pytest.fixture(autouse=True)
def afresh(monkeypatch: pytest.MonkeyPatch, cache: Path) -> Iterator[None]:
    """As in a new process, with everything worth compiling."""
    monkeypatch.setenv("WORKBENCH_CACHE", str(cache))
    monkeypatch.delenv("WORKBENCH_COMPILE", raising=False)
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setattr(arithmetic, "WORTH_COMPILING", 1)
    kernels.cache_clear()
    joint_kernels.cache_clear()
    yield
    kernels.cache_clear()
    joint_kernels.cache_clear()


def body_of(kind: str, N: int, nonzeros: int | None = None) -> SkinnedBody:
    K, B = KINDS[kind]
    parents = SMPL_PARENTS if K == 24 else None
    body = random_body(N, n_vertices=N, n_joints=K, n_betas=B, parents=parents)
    if nonzeros:
        rng = np.random.default_rng(0)
        body = replace(body, weights=rng.dirichlet(np.ones(K), size=N))  # all joints, everywhere
    return body


def pose_at(where: str, K: int) -> np.ndarray:
    axes = np.random.default_rng(5).standard_normal((K, 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    sizes = {"zero": 0.0, "near zero": 1e-7, "pi": np.pi, "anywhere": 0.7}
    sizes |= {"a full turn": 2 * np.pi * (1 + 1e-9)}
    return sizes[where] * axes


def graph_of(body: SkinnedBody, pose: np.ndarray, betas: np.ndarray) -> list[np.ndarray]:
    """Points (N, 3), and the Jacobian by pose and by betas, from the whole graph."""
    import casadi as cs

    symbols = [block.symbol for block in body.blocks()]
    whole = cs.vec(body.points(*symbols).source.expression)
    J = cs.Function("J", symbols, [whole, *(cs.jacobian(whole, s) for s in symbols)])
    points, *by = (np.asarray(a) for a in J(pose.T, betas, np.zeros(3)))
    return [points.reshape(-1, 3), *by]


def assert_right(
    body: SkinnedBody, where: str = "anywhere", kind: type = CompiledArithmetic
) -> None:
    K, B, N = body.n_joints, body.n_betas, body.n_vertices
    rng = np.random.default_rng(6)
    pose, betas = pose_at(where, K), rng.standard_normal(B)
    motion, slopes = body.kinematics.motion(pose, betas), body.kinematics.slopes(pose, betas)
    made = arithmetic_of(body, surface.ALL)
    assert isinstance(made, kind)
    points, *by = graph_of(body, pose, betas)
    here, asked_last = made.evaluate(motion, betas), made.evaluate(motion, betas)
    np.testing.assert_allclose(here.points, points, rtol=0, atol=1e-12)
    scale = rng.standard_normal(3 * N)
    into = {n: np.full((b.shape[1], 3 * N), np.nan) for n, b in zip(NAMES, by, strict=True)}
    here.tangent(slopes, into, scale)
    again = {name: np.full_like(array, np.nan) for name, array in into.items()}
    asked_last.tangent(slopes, again, scale)  # which meets the points on its way
    np.testing.assert_allclose(asked_last.points, points, rtol=0, atol=1e-12)
    for name, expected in zip(NAMES, by, strict=True):
        largest = np.abs(expected).max(initial=0.0)
        wanted = (expected * scale[:, None]).T
        for got in (into[name], again[name]):
            np.testing.assert_allclose(got, wanted, rtol=1e-11, atol=1e-11 * largest)
    pull = rng.standard_normal((N, 3))
    in_numpy = ChunkedArithmetic(chunks_of(body, slice(None)), body.parents).evaluate(motion, betas)
    for got, expected in zip(here.adjoint(pull), in_numpy.adjoint(pull), strict=True):
        np.testing.assert_allclose(got, expected, atol=1e-12 * np.abs(expected).max(initial=1.0))


NAMES = ("pose", "betas", "trans")


@NEEDS_COMPILER
@pytest.mark.parametrize("where", ["zero", "near zero", "pi", "anywhere"])
@pytest.mark.parametrize("kind", KINDS)
def test_the_numbers_of_the_whole_graph(kind: str, where: str) -> None:
    assert_right(body_of(kind, 43), where)


@NEEDS_COMPILER
@pytest.mark.parametrize("N", [1, 7, 8, 9, 16, 1030])
def test_any_number_of_vertices(N: int) -> None:
    assert_right(body_of("small", N))


@NEEDS_COMPILER
@pytest.mark.parametrize("kind", [Stored.STEPS, Stored.SINGLE])
def test_directions_that_are_stored_small_are_the_same_numbers(
    kind: Stored, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The results are those of plain double precision, to 1e-13 of the size of the body."""
    body, step = body_of("smpl", 61), 1e-5
    small = {
        name: (
            np.rint(array / step) * step
            if kind is Stored.STEPS
            else array.astype(np.float32).astype(np.float64)
        )
        for name, array in (("shapedirs", body.shapedirs), ("posedirs", body.posedirs))
    }
    body = replace(body, **small)
    monkeypatch.setattr(packed_vertices, "WORTH_NARROWING", 0)
    narrow = arithmetic_of(body, surface.ALL)
    assert_right(body)
    monkeypatch.setattr(packed_vertices, "WORTH_NARROWING", np.inf)
    plain = arithmetic_of(replace(body), surface.ALL)
    assert isinstance(narrow, CompiledArithmetic)
    assert isinstance(plain, CompiledArithmetic)
    assert narrow.packed.bends.dtype == kind.dtype
    assert plain.packed.bends.dtype == np.float64
    motion = body.kinematics.motion(pose_at("anywhere", 24), np.ones(10))
    found = [one.evaluate(motion, np.ones(10)).points for one in (narrow, plain)]
    np.testing.assert_allclose(*found, rtol=0, atol=1e-13 * np.ptp(found[1]))


def in_whole_steps(body: SkinnedBody, step: float = 1e-5) -> SkinnedBody:
    shapedirs, posedirs = (
        np.rint(array / step) * step for array in (body.shapedirs, body.posedirs)
    )
    return replace(body, shapedirs=shapedirs, posedirs=posedirs)


@NEEDS_COMPILER
@pytest.mark.parametrize("where", ["zero", "near zero", "pi", "a full turn", "anywhere"])
def test_halves_of_pose_directions_give_the_same_numbers(where: str) -> None:
    """Also in double precision, and where the ratio of two derivatives is large."""
    body = in_whole_steps(body_of("small", 13))
    made = arithmetic_of(body, surface.ALL)
    assert isinstance(made, CompiledArithmetic)
    assert made.packed.by_halves
    assert_right(body, where)


@NEEDS_COMPILER
@pytest.mark.parametrize(
    ("stored", "by_halves"),
    [(Stored.STEPS, True), (Stored.DOUBLE, True), (Stored.SINGLE, False), (Stored.DOUBLE, False)],
)
def test_points_have_the_same_bits_alone_and_with_their_derivative(
    stored: Stored, by_halves: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    body = in_whole_steps(body_of("small", 61))
    packing = packing_tried(stored, by_halves)
    monkeypatch.setattr(Packing, "of", lambda arrays: packing)
    made, betas = arithmetic_of(body, surface.ALL), np.ones(2)
    for where in ("zero", "near zero", "pi", "a full turn", "anywhere"):
        motion, slopes = body.kinematics.motion_and_slopes(pose_at(where, 4), betas)
        trans = np.array([0.3, -1.0, 7.0])
        alone, both = (made.evaluate_translated(motion, betas, trans) for _ in range(2))
        both.tangent(slopes, {"pose": np.zeros((12, 3 * 61))}, None)
        assert "points" in vars(both)
        np.testing.assert_array_equal(alone.points, both.points)


@NEEDS_COMPILER
def test_a_residual_has_the_same_bits_alone_and_with_its_jacobian() -> None:
    body = in_whole_steps(body_of("smpl", 61))
    points = body.points(*[block.symbol for block in body.blocks()])
    observed = wb.Block("observed", (61, 3), "m")
    terms = [wb.residuals.vertices(points, observed.symbol, sigma=0.01)]
    problem = wb.Problem(terms, ("pose", "betas", "trans"))
    x, fixed = problem.split(body.start() | {"observed": np.zeros((61, 3))})
    for seed in range(4):
        here = x + np.random.default_rng(seed).normal(0, 0.3, x.shape)
        alone = problem.residual(here, fixed).copy()
        for other in (1, 2, 3):  # so that nothing is kept of the first answer
            problem.residual(here + other, fixed)
        np.testing.assert_array_equal(problem.linearize_at(here, fixed).residual, alone)


@NEEDS_COMPILER
def test_a_translation_of_another_size_is_refused() -> None:
    body = body_of("small", 9)
    motion = body.kinematics.motion(pose_at("anywhere", 4), np.ones(2))
    made = arithmetic_of(body, surface.ALL)
    for trans in (np.zeros(1), np.zeros(2), np.zeros((2, 3))):
        with pytest.raises(ValueError, match="trans has"):
            made.evaluate_translated(motion, np.ones(2), trans)


@NEEDS_COMPILER
def test_pose_directions_are_stored_by_halves_only_where_these_hold_them() -> None:
    body = in_whole_steps(body_of("small", 13))
    assert Packing.of(body).by_halves
    single = body.posedirs.astype(np.float32).astype(np.float64)
    assert not Packing.of(replace(body, posedirs=single)).by_halves
    bound = in_whole_steps(random_body(13, n_vertices=13, n_joints=4, n_betas=2, bound=True))
    assert not Packing.of(bound).by_halves
    assert_right(bound)


@NEEDS_COMPILER
def test_every_joint_may_move_a_vertex() -> None:
    assert_right(body_of("smpl", 21, nonzeros=24))


@NEEDS_COMPILER
@pytest.mark.parametrize("threads", ["2", "3", "40"])
def test_threads_share_the_vertices_and_change_no_bit(
    threads: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(compiled_kernels, "WORTH_SHARING", 0)
    body = body_of("smpl", 61)  # no whole number of groups
    pose, betas = pose_at("anywhere", 24), np.linspace(-1, 1, 10)
    motion, slopes = body.kinematics.motion(pose, betas), body.kinematics.slopes(pose, betas)
    found = []
    for count in ("1", threads):
        monkeypatch.setenv("WORKBENCH_THREADS", count)
        made = arithmetic_of(body, surface.ALL)
        assert isinstance(made, CompiledArithmetic)
        here = made.evaluate(motion, betas)
        into = {n: np.full((r, 3 * 61), np.nan) for n, r in zip(NAMES, (72, 10, 3), strict=True)}
        here.tangent(slopes, into, np.linspace(1, 2, 3 * 61))
        found.append(np.concatenate([*into.values(), here.points.reshape(1, -1)]))
    assert np.isfinite(found[1]).all()
    np.testing.assert_array_equal(*found)


@NEEDS_COMPILER
def test_some_vertices_in_any_order() -> None:
    body, some = body_of("small", 40), [31, 2, 2, 17]
    motion = body.kinematics.motion(pose_at("anywhere", 4), np.ones(2))
    every, few = (
        arithmetic_of(body, v).evaluate(motion, np.ones(2)).points for v in (surface.ALL, some)
    )
    assert isinstance(arithmetic_of(body, some), CompiledArithmetic)
    np.testing.assert_array_equal(few, every[some])


@NEEDS_COMPILER
@pytest.mark.parametrize("layout", ["columns", "rows of a larger one", "float32", "every other"])
def test_into_memory_of_any_layout(layout: str) -> None:
    body, betas, pose = body_of("small", 13), np.ones(2), pose_at("anywhere", 4)
    motion, slopes = body.kinematics.motion(pose, betas), body.kinematics.slopes(pose, betas)
    made = arithmetic_of(body, surface.ALL).evaluate(motion, betas)
    plain = {"pose": np.zeros((12, 39)), "trans": np.zeros((3, 39))}
    made.tangent(slopes, plain, None)
    room = {
        "columns": np.full((39, 12), 7.0).T,
        "rows of a larger one": np.full((20, 50), 7.0)[3:15, 5:44],
        "float32": np.full((12, 39), 7.0, dtype=np.float32),
        "every other": np.full((12, 78), 7.0)[:, ::2],
    }[layout]
    made.tangent(slopes, {"pose": room}, np.broadcast_to(2.0, 39))
    tolerance = 1e-6 if room.dtype == np.float32 else 0
    np.testing.assert_allclose(room, 2 * plain["pose"], rtol=tolerance)
    if layout == "rows of a larger one":
        whole = room.base
        assert whole is not None
        outside = np.ones(whole.shape, dtype=bool)
        outside[3:15, 5:44] = False
        assert (whole[outside] == 7).all()


@NEEDS_COMPILER
def test_what_is_cleared_is_what_is_written_to(monkeypatch: pytest.MonkeyPatch) -> None:
    """Room for an array that the library cannot write to lives until it has been copied."""
    given = {}
    whole = CompiledArithmetic.run

    def run(self: CompiledArithmetic, name: str, *arrays: np.ndarray | None) -> None:
        given[name] = arrays
        whole(self, name, *arrays)

    monkeypatch.setattr(CompiledArithmetic, "run", run)
    body, betas, pose = body_of("small", 13), np.ones(2), pose_at("anywhere", 4)
    motion, slopes = body.kinematics.motion(pose, betas), body.kinematics.slopes(pose, betas)
    made = arithmetic_of(body, surface.ALL).evaluate(motion, betas)
    made.tangent(slopes, {"pose": np.full((39, 12), 7.0).T}, None)
    (cleared,) = given["clear"]
    assert any(cleared is array for array in given["tangent"])


@NEEDS_COMPILER
def test_poses_of_any_type_are_read_as_numbers() -> None:
    body = body_of("smpl", 9)
    pose, betas = np.ones((24, 3)), np.ones(10)
    expected = body.kinematics.motion(pose, betas)
    for kind in (np.float32, np.int64):
        found = body.kinematics.motion(pose.astype(kind), betas.astype(kind))
        np.testing.assert_array_equal(found.G, expected.G)
    with pytest.raises(ValueError, match="3 numbers"):
        body.kinematics.motion(np.ones(3), betas)


@NEEDS_COMPILER
def test_the_motion_that_comes_with_its_slopes_is_the_same_to_the_bit() -> None:
    body, betas, pose = body_of("smpl", 9), np.ones(10), pose_at("anywhere", 24)
    apart = body.kinematics.motion(pose, betas), body.kinematics.slopes(pose, betas)
    together = body.kinematics.motion_and_slopes(pose, betas)
    for one, other in zip(apart, together, strict=True):
        assert one.column is not None
        np.testing.assert_array_equal(one.column, other.column)
    posed = body.kinematics.evaluate(pose, betas)
    np.testing.assert_array_equal(posed.slopes.column, apart[1].column)
    assert "motion" in vars(posed)
    np.testing.assert_array_equal(posed.motion.column, apart[0].column)
    posed = body.kinematics.evaluate(pose + 1, betas)
    assert posed.slopes is posed.slopes
    moved = posed.motion
    assert posed.motion is moved


@NEEDS_COMPILER
def test_the_motions_of_many_poses_are_those_of_each_to_the_bit() -> None:
    kinematics, rng = body_of("smpl", 9).kinematics, np.random.default_rng(3)
    poses, betas = rng.standard_normal((3, 24, 3)), rng.standard_normal((3, 10))
    motions, slopes = kinematics.motions(poses, betas), kinematics.slopes_batch(poses, betas)
    for i in range(3):
        motion, sloped = kinematics.motion_and_slopes(poses[i], betas[i])
        for many, one in ((motions[i], motion), (slopes[i], sloped)):
            for part, expected in zip(vars(many).values(), vars(one).values(), strict=True):
                np.testing.assert_array_equal(part, expected)
    with pytest.raises(ValueError, match="3 poses have 216 numbers and betas 20"):
        kinematics.motions(poses, betas[:2])


@pytest.mark.parametrize("layout", ["whole", "read-only", "in pieces", "empty", "part"])
def test_addresses_are_those_of_numpy(layout: str) -> None:
    whole = np.arange(24.0).reshape(4, 6)
    array = {
        "whole": whole,
        "read-only": np.frombuffer(whole.tobytes()),
        "in pieces": whole[:, ::2],
        "empty": whole[:0],
        "part": whole[2:],
    }[layout]
    assert compiling.address(array) == array.ctypes.data


# The ways to NumPy, each with its reason.


def assert_falls_back(caplog: pytest.LogCaptureFixture, reason: str) -> None:
    with caplog.at_level(logging.INFO, logger="workbench"):
        assert_right(body_of("small", 9), kind=ChunkedArithmetic)
    said = [r.getMessage() for r in caplog.records if "computed by NumPy" in r.getMessage()]
    assert len(said) == 1
    assert reason in said[0]
    assert reason in kernels(body_of("small", 9).parents, 2)[1]


def compiler_that(tmp_path: Path, says: str) -> str:
    script = tmp_path / "mycc"
    script.write_text(f"#!/bin/sh\n{says}\n")
    script.chmod(0o755)
    return str(script)


def test_switched_off(monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture) -> None:
    monkeypatch.setenv("WORKBENCH_COMPILE", "0")
    assert_falls_back(caplog, "switched off by WORKBENCH_COMPILE=0")


def test_no_compiler(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture, tmp_path: Path
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    assert_falls_back(caplog, "no C compiler on the PATH")


def test_a_compiler_that_fails(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture, tmp_path: Path
) -> None:
    monkeypatch.setenv("CC", compiler_that(tmp_path, "echo no licence >&2; exit 1"))
    assert_falls_back(caplog, "fails with exit code 1: no licence")


def test_a_compiler_that_fails_on_the_source(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture, tmp_path: Path
) -> None:
    script = compiler_that(tmp_path, 'case "$*" in *-dM*) echo "#define X";; *) exit 3;; esac')
    monkeypatch.setenv("CC", script)
    assert_falls_back(caplog, "fails with exit code 3: it says nothing")


def test_a_compiler_that_makes_no_library(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture, tmp_path: Path
) -> None:
    says = 'case "$*" in *-dM*) ;; *) echo rubbish > vertex-kernels.so;; esac'
    monkeypatch.setenv("CC", compiler_that(tmp_path, says))
    monkeypatch.setenv("WORKBENCH_CACHE", str(tmp_path / "cache"))
    assert_falls_back(caplog, "does not load")
    assert not list((tmp_path / "cache").glob("vertex-kernels-*.so"))


@NEEDS_COMPILER
@pytest.mark.parametrize("kind", ["one joint", "small"])
@pytest.mark.parametrize("bound", [False, True])
def test_kinematics_are_those_of_casadi(kind: str, bound: bool) -> None:
    K, B = KINDS[kind]
    body = random_body(1, n_vertices=5, n_joints=K, n_betas=B, bound=bound)
    of = Skeleton.of(body), body.bind_pose, body.parents
    compiled, usual = CompiledJoints.of(*of), Kinematics(*of)
    assert compiled is not None
    betas = np.random.default_rng(0).standard_normal(B)
    for size in (0.0, 1e-9, 0.4, 3.0, 40.0):
        pose = size * np.random.default_rng(1).standard_normal((K, 3))
        motion, slopes = compiled.motion(pose, betas), compiled.slopes(pose, betas)
        expected, sloping = usual.motion(pose, betas), usual.slopes(pose, betas)
        for part in ("G", "features", "joints"):
            np.testing.assert_allclose(getattr(motion, part), getattr(expected, part), atol=1e-13)
        for part in ("turns", "d_features", "d_shift", "halves"):
            np.testing.assert_allclose(getattr(slopes, part), getattr(sloping, part), atol=1e-13)
        np.testing.assert_allclose(motion_column(motion), motion_column(expected), atol=1e-13)
        np.testing.assert_allclose(slopes_column(slopes), slopes_column(sloping), atol=1e-13)


@NEEDS_COMPILER
def test_kinematics_with_wrong_numbers_are_not_used(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    spoil = "sed -i.bak 's/= -axis.2./= axis[2]/' joint-kernels.c"
    says = f'case "$*" in *-dM*) ;; *) {spoil};; esac; exec {COMPILER} "$@"'
    monkeypatch.setenv("CC", compiler_that(tmp_path, says))
    monkeypatch.setenv("WORKBENCH_CACHE", str(tmp_path / "cache"))
    assert joint_kernels((-1, 0), 1) is None
    assert not list((tmp_path / "cache").glob("*.so"))


@NEEDS_COMPILER
@pytest.mark.parametrize(
    ("right", "wrong"),
    [
        ("whole.i. .= factor", "whole[i] += factor"),
        ("translated.trans,", "translated(NULL,"),
        ("translated.into->place,", "translated(NULL,"),
    ],
)
def test_a_library_with_wrong_numbers_is_not_kept(
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
    tmp_path: Path,
    right: str,
    wrong: str,
) -> None:
    spoil = f"sed -i.bak 's/{right}/{wrong}/' vertex-kernels.c"
    says = f'case "$*" in *-dM*) ;; *) {spoil};; esac; exec {COMPILER} "$@"'
    monkeypatch.setenv("CC", compiler_that(tmp_path, says))
    monkeypatch.setenv("WORKBENCH_CACHE", str(tmp_path / "cache"))
    assert_falls_back(caplog, "numbers are wrong")
    assert not list((tmp_path / "cache").glob("vertex-kernels-*.so"))


@NEEDS_COMPILER
@pytest.mark.parametrize("damage", ["truncated", "another's", "empty"])
def test_a_damaged_library_is_made_anew(
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
    tmp_path: Path,
    damage: str,
) -> None:
    monkeypatch.setenv("WORKBENCH_CACHE", str(tmp_path))
    assert_right(body_of("small", 9))
    (kept,) = tmp_path.glob(f"{NAME}-*.so")
    whole = kept.read_bytes()
    kept.unlink()  # a loaded library must not change under the process
    kept.write_bytes(
        {"truncated": whole[: len(whole) // 2], "another's": b"MZ" * 999}.get(damage, b"")
    )
    kernels.cache_clear()
    joint_kernels.cache_clear()
    with caplog.at_level(logging.WARNING, logger="workbench"):
        assert_right(body_of("small", 9))
    assert "it is damaged" in caplog.text
    assert [path.read_bytes() for path in tmp_path.glob(f"{NAME}-*.so")] == [whole]


@NEEDS_COMPILER
def test_a_cache_that_cannot_be_written(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture, tmp_path: Path
) -> None:
    (tmp_path / "file").write_text("not a folder")
    monkeypatch.setenv("WORKBENCH_CACHE", str(tmp_path / "file" / "cache"))
    with caplog.at_level(logging.WARNING, logger="workbench"):
        assert_right(body_of("small", 9))
    assert "compiled for this process only" in caplog.text


@NEEDS_COMPILER
def test_a_compiler_of_several_words(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CC", f"env {COMPILER}")
    assert_right(body_of("small", 9))


@NEEDS_COMPILER
def test_compiled_once_and_said(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture, tmp_path: Path
) -> None:
    monkeypatch.setenv("WORKBENCH_CACHE", str(tmp_path))
    with caplog.at_level(logging.INFO, logger="workbench"):
        for N in (9, 20, 33):
            body = random_body(N, n_vertices=N, parents=(-1, 0, 1), n_joints=3, n_betas=2)
            assert_right(body)
            kernels.cache_clear()
            joint_kernels.cache_clear()
    for name in ("vertex-kernels", "joint-kernels"):
        assert caplog.text.count(f"compiling the {name}") == 1
    assert len(list(tmp_path.iterdir())) == 2


def test_little_is_not_worth_compiling(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(arithmetic, "WORTH_COMPILING", 10)
    monkeypatch.setattr(compiling, "find_compiler", lambda: pytest.fail("compiled"))
    assert isinstance(arithmetic_of(body_of("small", 9), surface.ALL), ChunkedArithmetic)


@NEEDS_COMPILER
def test_a_part_is_compiled_where_the_whole_is_worth_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(arithmetic, "WORTH_COMPILING", 20)
    monkeypatch.setattr(arithmetic, "PART", 5)
    body = random_body(0, n_vertices=20, parents=(-1, 0, 1), n_joints=3, n_betas=2)
    found = [arithmetic_of(body, list(range(n))) for n in (5, 4)]
    assert [type(one) for one in found] == [CompiledArithmetic, ChunkedArithmetic]


@NEEDS_COMPILER
def test_two_processes_at_once(tmp_path: Path) -> None:
    code = (
        "from workbench.bodies.forward.kernels import kernels\n"
        "library, why = kernels((-1, 0, 0, 1), 3)\n"
        "assert library is not None, why"
    )
    environment = {
        "WORKBENCH_CACHE": str(tmp_path),
        "PATH": str(Path(shutil.which(COMPILER)).parent),
    }
    runs = [
        subprocess.Popen([sys.executable, "-c", code], env=environment, stderr=subprocess.PIPE)
        for _ in range(2)
    ]
    for run in runs:
        _, error = run.communicate(timeout=120)
        assert run.returncode == 0, error
    left = [path.name for path in tmp_path.iterdir()]
    assert len(left) in (1, 2)
    assert all(name.startswith(NAME) for name in left)


@NEEDS_COMPILER
def test_joints_that_leave_vertices_alone_are_left_out() -> None:
    """One joint carries every vertex, two carry some of them, and five bend them."""
    body = body_of("smpl", 61)
    posedirs = body.posedirs.reshape(61, 3, 23, 9).copy()
    posedirs[:, :, 5:] = 0
    posedirs[16:48, :, 3] = 0
    weights = np.zeros((61, 24))
    weights[:, 0] = 0.5
    weights[:20, 7] = weights[20:, 23] = 0.5
    body = replace(body, posedirs=posedirs.reshape(61, 3, 207), weights=weights)
    assert_right(body)
    packed = PackedVertices.of(body, body.parents, slice(None), 4)
    assert packed.bends.shape[:2] == (16 * 5 - 8, 27)
    carriers, benders = packed.joints[:3].tolist(), packed.joints[3:9].tolist()
    assert carriers == [2, 0, 7]
    assert benders == [5, 1, 2, 3, 4, 5]
    still = {k: [(a, n) for j, a, n in packed.still.tolist() if j == k] for k in range(24)}
    assert still[0] == []
    assert still[4] == [(20, 28)]  # bent before and after, and joint 7 hangs from it up to 20
    assert still[22] == [(0, 61)]  # neither it nor what hangs from it carries or bends
    assert still[23] == [(0, 20)]


@pytest.mark.parametrize("lanes", [4, 8])
def test_packing_needs_little_memory_beside_the_result(lanes: int) -> None:
    """Pose directions are nine tenths of a body: not even half of them are held a second time."""
    body = body_of("smpl", 12_288)
    tracemalloc.start()
    try:
        packed = PackedVertices.of(body, body.parents, slice(None), lanes)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    kept = packed.vertices.nbytes + packed.size
    assert packed.bends.nbytes > 0.85 * kept
    assert peak < 1.4 * kept


def test_numpy_leaves_out_the_features_that_bend_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("WORKBENCH_COMPILE", "0")
    kernels.cache_clear()
    joint_kernels.cache_clear()
    monkeypatch.setattr(numeric, "CHUNK", 40)
    body = body_of("smpl", 70)
    posedirs = body.posedirs.reshape(70, 3, 23, 9).copy()
    posedirs[40:, :, [0, 3, *range(5, 23)]] = 0
    body = replace(body, posedirs=posedirs.reshape(70, 3, 207))
    first, second = chunks_of(body, slice(None))
    assert len(first.used) == 207
    assert second.benders.tolist() == [1, 2, 4]
    assert second.posedirs.shape == (27, 3 * 30)
    assert_right(body, kind=ChunkedArithmetic)
