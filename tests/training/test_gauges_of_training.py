"""What registrations alone cannot tell of a body, by name, and what fixes it."""

from functools import cache

import numpy as np
import pytest
from scipy.sparse import csc_array, csr_array

from workbench import Diagnosis, Values, diagnose
from workbench.diagnostics.parts import Parts
from workbench.diagnostics.tied_elimination import TiedElimination
from workbench.problem import Linearization
from workbench.synthetic.made_up import draw_registrations, jointed_tube, random_smpl
from workbench.training.estimate import Estimate, Sigmas
from workbench.training.first_guess import Start
from workbench.training.objective import Objective
from workbench.training.symbolic_form import TERMS, SymbolicTraining

SUBJECTS, POSES = 4, 6


@cache
def limb() -> tuple[SymbolicTraining, Values]:
    """60 vertices on a root and one joint, in exact registrations of four subjects."""
    tube = jointed_tube(15, 4)
    half = np.where(tube.template[:, 0] > 0, 1, 0)
    start = Start(tube.template, tube.faces, (-1, 0), ("root", "tip"), half)
    body = random_smpl(start, 2, seed=3)
    data, truth = draw_registrations(body, SUBJECTS, POSES, seed=4)
    people = body.vertices(betas=truth.betas)
    joints = np.stack([body.J_regressor @ person for person in people])
    estimate = Estimate(people, joints, body.posedirs, body.weights, truth.poses, body.parents)
    weights = start.weights()
    middle = csr_array(np.full((2, body.n_vertices), 1 / body.n_vertices))  # E_J reads all vertices
    objective = Objective(data, middle, weights, None, Sigmas(), start.template)
    symbolic = SymbolicTraining.of(body, objective)
    return symbolic, symbolic.values(estimate)


@cache
def diagnosed(*terms: str) -> Diagnosis:
    symbolic, values = limb()
    found = diagnose(symbolic.problem(terms), values)
    assert isinstance(found, Diagnosis)
    return found


def test_every_gauge_of_the_data_alone_has_its_name() -> None:
    d = diagnosed("E_D")
    assert d.shape == (4320, 2700)
    names = [direction.name for direction in d.null_directions]
    expected = [
        f"a shift of subject {s}/template and subject {s}/joints, undone by "
        f"scan {POSES * s}/trans, scan {POSES * s + 1}/trans and 4 others, along {axis}"
        for s in range(SUBJECTS)
        for axis in "xyz"
    ]
    expected += [
        f"subject {s}/joints[root] along {axis}, undone by scan {POSES * s}/trans, "
        f"scan {POSES * s + 1}/trans and 4 others"
        for s in range(SUBJECTS)
        for axis in "xyz"
    ]
    expected += [
        f"a turn of everything at rest about {axis}, undone by the rotation of every root"
        for axis in "xyz"
    ]
    expected += [
        f"posedirs that push the whole surface along the joint's axis by {how}, undone by every "
        "translation"
        for how in ("sin", *(f"(1 - cos) times the axis's {axis}" for axis in "xyz"))
    ]
    assert sorted(names) == sorted(expected)
    assert d.rank == 2700 - len(expected)
    largest = float(d.here.column_norms.max())
    assert max(direction.change for direction in d.null_directions) < 1e-12 * largest


@pytest.mark.parametrize(
    ("terms", "left"),
    [
        (("E_D", "E_P"), 12 + 12),  # shifts and roots: a turn would change the blend shapes
        (("E_D", "E_T"), 12 + 4),  # roots and axes: templates may neither move nor turn
        (TERMS, 0),
    ],
    ids=lambda given: " ".join(given) if isinstance(given, tuple) else str(given),
)
def test_what_the_other_terms_fix(terms: tuple[str, ...], left: int) -> None:
    d = diagnosed(*terms)
    assert len(d.null_directions) == d.shape[1] - d.rank == left
    assert all(direction.kind in ("shift", "gauge") for direction in d.null_directions)


def test_without_its_gauges_the_rank_is_full() -> None:
    """A place of each subject and the root joints are held; E_P fixes turns and axes."""
    symbolic, values = limb()
    problem = symbolic.problem(["E_D", "E_P"])
    free = [name for name in problem.free.names if not name.endswith("/joints")]
    free += [f"subject {s}/joints[1]" for s in range(SUBJECTS)]
    held = {f"scan {POSES * s}/trans" for s in range(SUBJECTS)}
    found = diagnose(problem.freeing(*(name for name in free if name not in held)), values)
    assert isinstance(found, Diagnosis)
    assert found.rank == found.shape[1] == 2700 - 24


@pytest.mark.thorough
def test_elimination_finds_the_null_space_of_singular_values() -> None:
    d = diagnosed("E_D")
    constrained = d.point.constrained
    assert constrained.eliminated is not None
    spectrum = constrained.stacked.spectrum
    assert spectrum.rank == constrained.rank
    null = spectrum.Vt[spectrum.rank :].T
    overlap = np.linalg.svd(null.T @ constrained.null, compute_uv=False)
    np.testing.assert_allclose(overlap, 1, atol=1e-6)  # those from J'J have half of the digits


def test_the_rows_that_keep_joints_in_the_middle_of_vertices_are_added_afterwards() -> None:
    """E_J ties all vertices of a subject together, and the parts are found all the same."""
    d = diagnosed(*TERMS)
    constrained = d.point.constrained
    assert isinstance(constrained.eliminated, TiedElimination)
    assert constrained.parts is not None
    assert constrained.parts.ties.shape[0] == 2 * 3 * SUBJECTS
    s = constrained.reduced.spectrum.s
    assert d.condition == pytest.approx(s[0] / s[-1], rel=1e-4)
    sigma = constrained.eliminated.deviations(constrained.parts.lengths)
    J = constrained.stacked.dense
    np.testing.assert_allclose(sigma**2, np.diag(np.linalg.inv(J.T @ J)), rtol=1e-4)


def test_the_report_of_a_training_needs_no_singular_values(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """One over all of its singular values would be more work than everything else together."""

    def refused(_: Linearization) -> None:
        raise AssertionError("an array of 2,700 x 2,700 was computed")

    for name in ("spectrum", "singular_values", "unit_triangle", "R"):
        monkeypatch.setattr(Linearization, name, property(refused))
    symbolic, values = limb()
    problem = symbolic.problem(["E_D", "E_P"])
    found = diagnose(problem, values, priors=[r.name for r in problem.residuals if "E_P" in r.name])
    assert isinstance(found, Diagnosis)
    text = found.report()
    assert "numerical rank 2676 of 2700" in text
    assert found.identifiability.data_share is None
    assert 0 < found.identifiability.effective < 2676
    s, vectors = found.by_elimination.weakest(3) if found.by_elimination else (0, 0)
    np.testing.assert_allclose(np.linalg.norm(found.point.measured.here.along(vectors), axis=0), s)


def test_the_weakest_directions_of_the_data_alone_are_those_of_an_svd() -> None:
    """By QR and SVD of the whole Jacobian in yardsticks; from J'J they would be rounding errors."""
    d = diagnosed("E_D")
    found = d.by_elimination
    assert found is not None
    J, forbidden = d.point.measured.here.dense, found.forbidden
    allowed = J - (J @ forbidden.T) @ forbidden  # without what the sums of weights forbid
    s = np.linalg.svd(np.linalg.qr(allowed, mode="r"), compute_uv=False)[::-1]
    seen = s[len(forbidden) + found.nullity :]
    np.testing.assert_allclose(found.weakest(3)[0], seen[:3], rtol=1e-6)
    assert 1 < seen[0] < 2
    counts = [int(np.sum(seen < limit)) for limit in (2, 10, 30)]
    assert [found.count_below(limit) for limit in (2, 10, 30)] == counts
    assert 0 < counts[0] < counts[1] < counts[2]


@pytest.mark.parametrize(
    "J",
    [
        np.zeros((3, 0)),
        np.zeros((0, 3)),
        np.eye(4),  # each unknown by itself: nothing is shared
        np.random.default_rng(0).normal(size=(40, 30)),  # nothing falls apart
    ],
    ids=["no unknowns", "no rows", "diagonal", "full"],
)
def test_a_jacobian_without_parts_has_none(J: np.ndarray) -> None:
    assert Parts.of(Linearization(np.zeros(len(J)), csc_array(J))) is None
    assert Parts.of(Linearization(np.zeros(len(J)), J)) is None
