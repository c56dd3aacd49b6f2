"""Capsules that stand for a body."""

import pickle
from dataclasses import replace
from pathlib import Path

import casadi as cs
import numpy as np
import pytest

from tests.differences import assert_jacobian
from tests.tiers import few
from workbench import Problem, load_body
from workbench.bodies import SkinnedBody, fit_capsules
from workbench.bodies.capsule_fitting import part_of, parts_of_capsules
from workbench.bodies.capsules import (
    KEYS,
    capsule_ends,
    capsule_gaps,
    capsule_points,
    capsules_of,
    closest_places,
    segment_distances,
)
from workbench.bodies.files.saving import save_body
from workbench.errors import BadBody
from workbench.geometry.mirror import REFLECTION, opposite
from workbench.residuals import landmarks

LARGEST_RMS = {"small": 6.7e-3, "default": 7.4e-3, "default-male": 7.8e-3, "default-female": 7.3e-3}


def capsule_distances(points: np.ndarray, ends: np.ndarray, radii: np.ndarray) -> np.ndarray:
    """How far points (N, 3) m are from each of C capsules, (C, N) m; negative inside."""
    a, u = ends[:, :1], ends[:, 1:] - ends[:, :1]  # (C, 1, 3)
    length = np.maximum((u * u).sum(axis=-1), 1e-18)
    along = np.clip(((points - a) * u).sum(axis=-1) / length, 0, 1)
    return np.linalg.norm(points - a - along[..., None] * u, axis=-1) - radii[:, None]


def errors(body: SkinnedBody, people: np.ndarray) -> np.ndarray:
    """The distances (m) of every vertex of people (M, B) from the surface of its capsule."""
    capsules, parts = capsules_of(body), parts_of_capsules(body)
    found = []
    for betas in people:
        rest = body.template + body.shapedirs @ betas
        away = capsule_distances(rest, capsules.ends_of(betas), capsules.radii_of(betas))
        found += [row[parts[name]] for name, row in zip(capsules.names, away, strict=True)]
    return np.concatenate(found)


@pytest.mark.parametrize("name", few(LARGEST_RMS, 1))
def test_capsules_fit_people_who_were_not_fitted(name: str) -> None:
    body = load_body(name)
    assert isinstance(body, SkinnedBody)
    people = np.random.default_rng(7).standard_normal((30, body.n_betas))
    rms = np.sqrt((errors(body, people) ** 2).mean())
    assert rms < LARGEST_RMS[name]
    without_shape = replace(
        capsules_of(body),
        end_slopes=0 * capsules_of(body).end_slopes,
        radius_slopes=0 * capsules_of(body).radius_slopes,
    )
    stiff = replace(body, capsules=without_shape)
    assert np.sqrt((errors(stiff, people) ** 2).mean()) > 1.5 * rms


@pytest.mark.parametrize("name", few(["default", "small", "full-female"], 1))
def test_both_sides_are_mirror_images(name: str) -> None:
    capsules = load_body(name).capsules
    at = [capsules.names.index(opposite(one)) for one in capsules.names]
    betas = np.random.default_rng(1).standard_normal(10)
    ends, radii = capsules.ends_of(betas), capsules.radii_of(betas)
    assert np.allclose(radii[at], radii, atol=1e-12)
    reflected = ends[at] * REFLECTION
    # the two ends of a capsule across the midline change places
    same = np.isclose(reflected, ends, atol=1e-12).all(axis=(1, 2))
    turned = np.isclose(reflected[:, ::-1], ends, atol=1e-12).all(axis=(1, 2))
    assert (same | turned).all()
    names = [frozenset(capsules.names[k] for k in pair) for pair in capsules.pairs]
    assert {frozenset(map(opposite, pair)) for pair in names} == set(names)


def test_pairs_are_apart_at_rest_and_no_neighbours() -> None:
    body = load_body("default")
    assert capsule_gaps(body).min() > -0.03
    names = set(body.capsules.pair_names)
    parts = [{part_of(one) for one in name.split(" and ")} for name in names]
    assert {"left_thigh", "right_thigh"} in parts
    assert {"left_thigh", "left_shin"} not in parts
    assert {"chest", "neck"} not in parts
    # the far half of an upper arm may touch the ribs, which the near half always overlaps
    assert "ribs and left_upper_arm_far" in names
    assert "ribs and left_upper_arm_near" not in names


def test_ends_move_rigidly_with_their_joint() -> None:
    body, rng = load_body("small"), np.random.default_rng(2)
    pose, betas, trans = (0.4 * rng.standard_normal(s) for s in ((24, 3), 10, 3))
    posed, rest = capsule_ends(body, pose, betas, trans), body.capsules.ends_of(betas)
    assert np.allclose(
        np.linalg.norm(posed[:, 1] - posed[:, 0], axis=1),
        np.linalg.norm(rest[:, 1] - rest[:, 0], axis=1),
    )
    assert np.allclose(capsule_ends(body, None, betas, trans), rest + trans)


def test_graph_numbers_and_derivatives_agree() -> None:
    body, rng = load_body("small"), np.random.default_rng(3)
    pose, betas, trans = body.blocks()
    ends = capsule_points(body, pose.symbol, betas.symbol, trans.symbol)
    values = {
        "pose": 0.4 * rng.standard_normal((24, 3)),
        "betas": rng.standard_normal(10),
        "trans": rng.standard_normal(3),
    }
    f = cs.Function("f", [b.symbol for b in body.blocks()], [ends.graph()])
    symbolic = np.asarray(f(values["pose"].T, values["betas"], values["trans"])).T
    found = capsule_ends(body, **values).reshape(-1, 3)
    assert np.allclose(symbolic, found, atol=1e-13)
    residual = landmarks(ends, np.zeros((ends.count, 3)), sigma=1.0)
    assert residual.label(0) == "landmarks(pose, betas, trans)[left_pelvis, start, x]"
    problem = Problem([residual], free=("pose", "betas", "trans"))
    x, fixed = problem.free.pack(values), problem.fixed.pack(values)
    assert_jacobian(problem, x, fixed, 1e-8)
    radii = cs.Function("r", [betas.symbol], [body.capsules.radii_in(betas.symbol)])
    expected = body.capsules.radii_of(values["betas"])
    assert np.allclose(np.asarray(radii(values["betas"])).ravel(), expected, atol=1e-15)


def test_gaps_of_a_batch_are_those_of_each() -> None:
    body, rng = load_body("small"), np.random.default_rng(4)
    poses, betas = 0.5 * rng.standard_normal((5, 24, 3)), rng.standard_normal((5, 10))
    each = [capsule_gaps(body, p, b) for p, b in zip(poses, betas, strict=True)]
    assert np.allclose(capsule_gaps(body, poses, betas), each)
    assert np.allclose(capsule_gaps(body, poses), [capsule_gaps(body, p) for p in poses])


@pytest.mark.parametrize("suffix", few([".npz", ".pkl"], 1))
def test_files_keep_capsules(tmp_path: Path, suffix: str) -> None:
    body = load_body("small")
    save_body(body, tmp_path / f"body{suffix}")
    again = load_body(tmp_path / f"body{suffix}")
    for key in KEYS:
        assert np.array_equal(getattr(again.capsules, key), getattr(body.capsules, key))
    assert not again.extras
    copied = pickle.loads(pickle.dumps(body))
    assert np.array_equal(copied.capsules.ends, body.capsules.ends)


def test_capsules_that_do_not_fit_are_refused(tmp_path: Path) -> None:
    body = load_body("small")
    capsules, symbols = body.capsules, [block.symbol for block in body.blocks()]
    slopes = capsules.end_slopes[..., :3], capsules.radius_slopes[:, :3]
    other = replace(capsules, end_slopes=slopes[0], radius_slopes=slopes[1])
    stranger = replace(body, joint_names=tuple(f"bone{k}" for k in range(24)))
    save_body(replace(body, capsules=None), tmp_path / "body.npz")
    bare = load_body(tmp_path / "body.npz")
    assert bare.capsules is None
    for ask, says in (
        (lambda: replace(capsules, radii=np.ones(3)), "radii has shape"),
        (lambda: replace(capsules, radii=np.nan * capsules.radii), "not finite"),
        (lambda: replace(capsules, pairs=np.array([[0, 31]])), "capsules 0 to 30"),
        (lambda: replace(body, capsules=other), "are of 3 betas"),
        (lambda: replace(body, capsules=3), "must be Capsules"),
        (lambda: capsule_points(body.freed("template"), *symbols), "free arrays"),
        (lambda: fit_capsules(stranger), "none of the joints of SMPL"),
        (lambda: capsule_points(bare, *symbols), "no capsules.*fit_capsules"),
        (lambda: capsule_ends(bare), "no capsules.*fit_capsules"),
        (lambda: capsule_gaps(bare), "no capsules.*fit_capsules"),
    ):
        with pytest.raises(BadBody, match=says):
            ask()


def test_segment_distances_are_those_of_brute_force() -> None:
    rng = np.random.default_rng(5)
    a, b, c, d = rng.standard_normal((4, 1000, 3))
    b[:30], d[30:60] = a[:30], c[30:60]  # points
    d[60:90] = c[60:90] + (b - a)[60:90] * rng.uniform(-2, 2, (30, 1))  # parallel
    c[90:110] = a[90:110] + 0.3 * (b - a)[90:110]
    d[90:110] = c[90:110] + 2 * (b - a)[90:110]  # on one line, overlapping
    starts, ends = np.stack([a, c], axis=1), np.stack([b, d], axis=1)
    found = segment_distances(starts, ends, np.array([[0, 1]]))[:, 0]
    s = np.linspace(0, 1, 101)
    for i in range(1000):
        p = a[i] + s[:, None] * (b - a)[i]
        q = c[i] + s[:, None] * (d - c)[i]
        brute = np.linalg.norm(p[:, None] - q, axis=2).min()
        step = (np.linalg.norm(b[i] - a[i]) + np.linalg.norm(d[i] - c[i])) / 200
        assert brute - step - 1e-12 <= found[i] <= brute + 1e-12
    one, other = closest_places(starts, ends, np.array([[0, 1]]))[:, 0].transpose(1, 0, 2)
    assert np.allclose(np.linalg.norm(other - one, axis=1), found, atol=1e-15)
    to_one = capsule_distances(one[:1], np.stack([a, b], axis=1)[:1], np.zeros(1))
    assert to_one == pytest.approx(0, abs=1e-12)  # the place is on its segment
