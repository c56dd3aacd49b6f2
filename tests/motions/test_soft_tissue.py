"""Soft tissue on a motion: nothing where nothing is asked, bounded, in symbols, in files."""

from dataclasses import replace
from pathlib import Path

import casadi as cs
import numpy as np
import pytest
from typer.testing import CliRunner

import workbench as wb
from tests.motions.test_expressions import played_by_hand
from workbench.bodies.spaces import body_mass_index
from workbench.cli.app import app
from workbench.errors import BadArgument, BadFile
from workbench.geometry.meshes import write_mesh
from workbench.motions import Motion, SoftTissue, load_tissue, save_tissue, write_glb
from workbench.motions.soft_tissue import (
    GRAVITY,
    MovingFrames,
    betas_with_tissue,
    companion,
    displaced_by,
    tissue_inputs,
    with_dmpls,
    with_tissue,
)
from workbench.synthetic.made_up import made_up_motion

BODY = wb.load_body("default")
SMALL = wb.load_body("small")
TISSUE = load_tissue()
MOTION = made_up_motion(BODY, 1.0)
HEAVY = np.array([0.0, 0.0, 2.0])


def test_tissue_is_linear_in_exaggeration() -> None:
    here = replace(MOTION[:8], betas=HEAVY)
    bare = here.vertices(BODY)
    assert np.array_equal(TISSUE.vertices(BODY, here, exaggeration=0.0), bare)
    assert np.array_equal(TISSUE.surface(BODY, here, np.zeros((8, TISSUE.n_coefficients))), bare)
    once, three = (TISSUE.vertices(BODY, here, many) - bare for many in (1.0, 3.0))
    np.testing.assert_allclose(three, 3 * once, atol=1e-12)
    assert 0.001 < np.linalg.norm(once, axis=-1).max() < 0.1


def test_tissue_is_stable_and_bounded() -> None:
    """Ten seconds of jumps, three times as far: never beyond what bounded inputs can do."""
    assert TISSUE.spectral_radius < 1
    rng = np.random.default_rng(0)
    pose = rng.standard_normal((600, 24, 3))
    wild = Motion(pose, rng.standard_normal((600, 3)), 60.0, BODY.joint_names)
    phi = TISSUE.coefficients(BODY, wild)
    x = tissue_inputs(MovingFrames.of(BODY, wild), TISSUE.part, TISSUE.n_betas)
    C, H = TISSUE.n_coefficients, companion(TISSUE.first, TISSUE.second)
    most, power = np.zeros(C), np.eye(2 * C)
    for _ in range(600):
        most += np.abs(power[:C, :C] @ TISSUE.response) @ np.abs(x).max(axis=0)
        power = H @ power
    assert (np.abs(phi) <= most).all()
    farthest = 3 * np.linalg.norm(TISSUE.displacements(BODY, phi), axis=-1).max()
    assert farthest < 0.5, "a person is no longer one"
    forces = x[:, 6 * 24 + 6 : -1 - TISSUE.n_betas]
    assert 0.5 < np.abs(forces).max() < 1


def test_tissue_of_heavier_people_moves_more() -> None:
    light, heavy = sorted((-HEAVY, HEAVY), key=lambda betas: body_mass_index(BODY, betas))
    assert TISSUE.gain(BODY) == 1
    assert TISSUE.gain(BODY, heavy) > 1 > TISSUE.gain(BODY, light)


def test_forces_on_points_match_mechanics() -> None:
    """Nothing at rest; in free fall it is pulled upwards as strongly as gravity pulls it down."""
    times = np.arange(30) / 60
    pose = np.zeros((30, SMALL.n_joints, 3))
    falling = Motion(pose, 0.5 * times[:, None] ** 2 * GRAVITY, 60.0, SMALL.joint_names)
    joints = np.array([0, 4])
    points = SMALL.joints()[joints] + 0.1
    standing = replace(falling, trans=np.zeros((30, 3)))
    np.testing.assert_allclose(MovingFrames.of(SMALL, standing).forces(points, joints), 0)
    felt = MovingFrames.of(SMALL, falling).forces(points, joints)
    np.testing.assert_allclose(felt, np.broadcast_to(-GRAVITY, felt.shape), atol=1e-9)
    # a root that turns about y at 2 rad/s: what is 10 cm away is pulled outwards by w^2 r
    pose[:, 0, 1] = 2 * times
    spinning = MovingFrames.of(SMALL, replace(standing, pose=pose))
    away = SMALL.joints()[:1] + [0.1, 0.0, 0.0]
    np.testing.assert_allclose(spinning.forces(away, joints[:1])[15, 0], [0.4, 0, 0], atol=1e-3)
    np.testing.assert_allclose(spinning.angular_velocities[:, 0], [[0, 2, 0]] * 30, atol=1e-9)


def tissue_of_small(power: float) -> SoftTissue:
    """Two dynamic blend shapes of `small`, and no model of their coefficients."""
    N, X = SMALL.n_vertices, 6 * SMALL.n_joints + 6 + 1
    D = 0.01 * np.random.default_rng(0).standard_normal((N, 3, 2))
    none, response = np.zeros((2, 2)), np.zeros((2, X))
    names = SMALL.joint_names
    return SoftTissue(D, none, none, response, np.full(N, -1), 60.0, names, power=power)


PHI, PERSON = np.array([1.5, -0.7]), np.array([0.5, -1.0, 2.0])


def test_fit_finds_coefficients_of_tissue_with_the_shape_that_decides_their_gain() -> None:
    tissue, truth = tissue_of_small(1.5), {"pose": MOTION.pose[7], "trans": MOTION.trans[7]}
    truth |= {"tissue": PHI, "betas": np.pad(PERSON, (0, SMALL.n_betas - 3))}
    here = replace(MOTION[6:9], betas=truth["betas"])
    seen = tissue.surface(SMALL, here, np.tile(PHI, (3, 1)))[1]
    pose, betas, trans = (block.symbol for block in SMALL.blocks())
    block = wb.Block("tissue", (2,))
    own = cs.vertcat(betas, tissue.gain_of(SMALL, betas) * block.symbol)
    points = with_tissue(SMALL, tissue).points(pose, own, trans)
    whole = wb.residuals.vertices(points, seen, sigma=0.002)
    problem = wb.Problem([whole], ("pose", "betas", "trans", "tissue"), blocks=[block])
    solution = wb.solve(problem, SMALL.start() | {"tissue": np.zeros(2)})
    for name, value in truth.items():
        np.testing.assert_allclose(solution.values[name], value, atol=1e-8, err_msg=name)
    assert wb.diagnose(problem, solution.values).rank == problem.free.size


def test_tissue_survives_its_file(tmp_path: Path) -> None:
    save_tissue(tmp_path / "mine.npz", TISSUE)
    again = load_tissue(tmp_path / "mine.npz")
    for name in ("directions", "first", "second", "response", "part"):
        assert np.array_equal(getattr(again, name), getattr(TISSUE, name)), name
    assert (again.fps, again.joint_names, again.card) == (60.0, BODY.joint_names, TISSUE.card)
    assert "simulated" in str(TISSUE.card["tissue"])
    with pytest.raises(BadFile, match="no soft tissue is called 'mine'"):
        load_tissue("mine")
    (tmp_path / "other.npz").write_bytes(b"no archive")
    with pytest.raises(BadFile, match="is no soft tissue"):
        load_tissue(tmp_path / "other.npz")


def test_bad_tissue_is_refused() -> None:
    with pytest.raises(BadArgument, match=r"'default'.*1229 vertices.*not that of body 'small'"):
        TISSUE.vertices(SMALL, MOTION)
    with pytest.raises(BadArgument, match=r"tissue.prepared\(motion\) splines it"):
        TISSUE.vertices(BODY, MOTION.resampled(30.0))
    assert TISSUE.prepared(MOTION.resampled(30.0)).fps == 60.0
    assert TISSUE.prepared(MOTION) is MOTION
    with pytest.raises(BadArgument, match=f"has {TISSUE.n_coefficients} coefficients a frame"):
        TISSUE.displacements(BODY, np.zeros(3))
    with pytest.raises(BadArgument, match=r"spectral radius of 1.* would not die away"):
        replace(TISSUE, first=2 * np.eye(len(TISSUE.first)), second=-np.eye(len(TISSUE.first)))
    with pytest.raises(BadArgument, match="response of soft tissue are"):
        replace(TISSUE, response=TISSUE.response[:, 1:])
    scape = wb.load_body("small-scape")
    with pytest.raises(BadArgument, match="soft tissue is made of a SkinnedBody"):
        TISSUE.vertices(scape, MOTION)  # type: ignore[arg-type]


SHORT = made_up_motion(BODY, seconds=0.1, seed=1)


def test_body_with_tissue_is_the_model_of_tissue(tmp_path: Path) -> None:
    assert isinstance(BODY, wb.SkinnedBody)
    body, betas = with_tissue(BODY, TISSUE), betas_with_tissue(BODY, TISSUE, SHORT, 2.0)
    expected = TISSUE.vertices(BODY, SHORT, 2.0)
    assert np.abs(expected - SHORT.vertices(BODY)).max() > 1e-3
    by = displaced_by(TISSUE, betas)
    rest = body.vertices(None, betas) - BODY.vertices(None, betas[:, : BODY.n_betas])
    np.testing.assert_allclose(by, rest, atol=1e-12)
    at = SHORT.pose, betas, SHORT.trans
    np.testing.assert_allclose(body.vertices(*at), expected, atol=1e-9)
    np.testing.assert_allclose(body.joints(*at), SHORT.joints(BODY), atol=1e-9)
    write_glb(tmp_path / "a.glb", SHORT, body, betas=betas)
    assert np.abs(played_by_hand(tmp_path / "a.glb", SHORT.pose) - expected).max() < 1e-5


def test_command_fits_tissue_to_a_mesh(tmp_path: Path) -> None:
    """With its soft tissue free a body reaches a displaced surface, and its shape is the person's.

    What is written draws the displaced surface.
    """
    phi = TISSUE.coefficients(BODY, TISSUE.prepared(MOTION))
    t = int(np.linalg.norm(phi, axis=1).argmax())
    betas = np.append(np.zeros(BODY.n_betas), phi[t])
    surface = with_tissue(BODY, TISSUE).vertices(MOTION.pose[0], betas)
    write_mesh(tmp_path / "soft.ply", surface, BODY.faces)
    off = {}
    for name, options in {"without": [], "with": ["--tissue"]}.items():
        out = ["--out", str(tmp_path / name)]
        said = CliRunner().invoke(app, ["fit", str(tmp_path / "soft.ply"), *options, *out])
        assert said.exit_code == 0, said.output
        assert "improbable" not in said.output
        with np.load(tmp_path / name / "soft" / "values.npz") as found:
            off[name] = np.linalg.norm(found["surface"] - surface, axis=1).mean()
            shape = np.sqrt(np.mean(found["betas"][: BODY.n_betas] ** 2))
    assert off["with"] < off["without"] / 2
    assert shape < 0.3


def test_dmpls_move_the_surface_and_its_joints(tmp_path: Path) -> None:
    """T = template + B_S(betas) + sum_c phi_c D_c, from which the joints follow, frame by frame."""
    rng = np.random.default_rng(0)
    directions = rng.normal(0, 0.01, (SMALL.n_vertices, 3, 12))
    np.savez(tmp_path / "model.npz", eigvec=directions)
    body, phi = with_dmpls(SMALL, tmp_path / "model.npz"), rng.normal(0, 1, (3, 8))
    wb.save_motion(tmp_path / "a.npz", replace(MOTION[:3], betas=rng.normal(0, 1, 2), dmpls=phi))
    moving = wb.read_motion(tmp_path / "a.npz")
    here = moving.named(SMALL)
    for t, surface in enumerate(moving.vertices(body)):
        thick = replace(SMALL, template=SMALL.template + directions[:, :, :8] @ phi[t])
        alone = thick.vertices(here.pose[t], here.betas, here.trans[t])
        np.testing.assert_allclose(surface, alone, atol=1e-12)
    pose, betas, trans = (block.symbol for block in SMALL.blocks())
    dmpls = wb.Block("dmpls", (8,))
    points = body.points(pose, cs.vertcat(betas, dmpls.symbol), trans)
    last = wb.residuals.vertices(points, moving.vertices(body)[2], sigma=0.002)
    problem = wb.Problem([last], ("dmpls",), blocks=[dmpls])
    known = {"pose": here.pose[2], "betas": np.pad(here.betas, (0, 8)), "trans": here.trans[2]}
    solution = wb.solve(problem, known | {"dmpls": np.zeros(8)})
    np.testing.assert_allclose(solution.values["dmpls"], phi[2], atol=1e-9)
    other = replace(SMALL, template=SMALL.template, name="again")
    np.testing.assert_array_equal(moving.vertices(other), here.vertices(SMALL))
    with pytest.raises(BadFile, match="vertices, and the body has"):
        with_dmpls(BODY, tmp_path / "model.npz")
