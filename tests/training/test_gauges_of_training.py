"""What registrations alone cannot tell of a body, by name, and what fixes it."""

from functools import cache

import numpy as np
import pytest
from scipy.sparse import csr_array

from workbench import Diagnosis, Values, diagnose
from workbench.synthetic.made_up import draw_registrations, jointed_tube, random_smpl
from workbench.training.estimate import Estimate, Sigmas
from workbench.training.first_guess import Start
from workbench.training.objective import Objective
from workbench.training.symbolic_form import TERMS, SymbolicTraining

pytestmark = pytest.mark.thorough

SUBJECTS, POSES = 4, 6


@cache
def limb(
    subjects: int = SUBJECTS, poses: int = POSES, rings: int = 15
) -> tuple[SymbolicTraining, Values]:
    """Four vertices on each ring, on a root and one joint, in exact registrations of subjects."""
    tube = jointed_tube(rings, 4)
    half = np.where(tube.template[:, 0] > 0, 1, 0)
    start = Start(tube.template, tube.faces, (-1, 0), ("root", "tip"), half)
    body = random_smpl(start, 2, seed=3)
    data, truth = draw_registrations(body, subjects, poses, seed=4)
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


def test_gauges_of_the_data_alone_are_named() -> None:
    d = diagnosed("E_D")
    assert d.shape == (4320, 2700)
    names = [direction.name for direction in d.null_directions]
    expected = [
        f"a translation along {axis} of {what}, undone by scan {POSES * s}/trans to "
        f"scan {POSES * s + POSES - 1}/trans"
        for s in range(SUBJECTS)
        for what in (f"subject {s}/template and subject {s}/joints", f"subject {s}/joints[root]")
        for axis in "xyz"
    ]
    expected += [  # everything at rest, against every root
        f"a rotation about {axis} of subject 0/template, undone by posedirs, subject 0/joints, "
        "subject 1 to subject 3 and 1 more"
        for axis in "xyz"
    ]
    # and blend shapes push the whole surface along the joint's axis, which has no name of its own
    assert set(names) >= set(expected)
    assert d.rank == 2700 - len(expected) - 4 == 2700 - len(names)
    largest = float(d.here.column_norms.max())
    assert max(direction.change for direction in d.null_directions) < 1e-12 * largest


@pytest.mark.parametrize(
    ("terms", "left"),
    [
        (("E_D", "E_P"), 12 + 12),  # shifts and roots: a turn would change the blend shapes
        (TERMS, 0),
    ],
    ids=lambda given: " ".join(given) if isinstance(given, tuple) else str(given),
)
def test_priors_fix_gauges(terms: tuple[str, ...], left: int) -> None:
    d = diagnosed(*terms)
    assert len(d.null_directions) == d.shape[1] - d.rank == left
    assert all(direction.kind == "translation" for direction in d.null_directions)


def test_rank_is_full_without_gauges() -> None:
    """A place of each subject and the root joints are held; E_P fixes turns and axes."""
    symbolic, values = limb()
    problem = symbolic.problem(["E_D", "E_P"])
    free = [name for name in problem.free.names if not name.endswith("/joints")]
    free += [f"subject {s}/joints[1]" for s in range(SUBJECTS)]
    held = {f"scan {POSES * s}/trans" for s in range(SUBJECTS)}
    found = diagnose(problem.freeing(*(name for name in free if name not in held)), values)
    assert isinstance(found, Diagnosis)
    assert found.rank == found.shape[1] == 2700 - 24


def test_weakest_directions_are_those_of_an_svd() -> None:
    """By QR and SVD of the whole Jacobian in scales; from J'J they would be rounding errors."""
    d = diagnosed("E_D")
    found = d.sparse
    assert found is not None
    J, forbidden = d.measured.here.dense, found.forbidden
    allowed = J - (J @ forbidden.T) @ forbidden  # without what the sums of weights forbid
    s = np.linalg.svd(np.linalg.qr(allowed, mode="r"), compute_uv=False)[::-1]
    seen = s[len(forbidden) + found.nullity :]
    np.testing.assert_allclose(found.weakest(3)[0], seen[:3], rtol=1e-6)
    assert 1 < seen[0] < 2
    counts = [int(np.sum(seen < limit)) for limit in (2, 10, 30)]
    assert [found.count_below(limit) for limit in (2, 10, 30)] == counts
    assert 0 < counts[0] < counts[1] < counts[2]


def test_training_with_far_fewer_rows_than_unknowns_is_diagnosed() -> None:
    symbolic, values = limb(1, 3, 35)
    d = diagnose(symbolic.problem(["E_D"]), values)
    assert isinstance(d, Diagnosis)
    assert d.shape == (1260, 4513)
    S = np.vstack([d.here.dense, d.active.rows])
    s = np.linalg.svd(S / np.linalg.norm(S, axis=1)[:, None], compute_uv=False)
    assert d.rank == int(np.sum(s > 1e-12 * s[0])) == 1501
    assert len(d.null_directions) == d.shape[1] - d.rank
    # of the numbers of one coordinate of a vertex, in few scans
    assert np.median([np.count_nonzero(x.vector) for x in d.null_directions]) < 10
    largest = float(d.here.column_norms.max())
    assert max(direction.change for direction in d.null_directions) < 1e-11 * largest
