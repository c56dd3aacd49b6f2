"""SMPL beside SCAPE on the same made-up people: learning, measuring, and the page."""

import re
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import workbench as wb
from tests.training.test_triangles import many_people
from workbench.bodies.triangles import TriangleBody, blend_scape
from workbench.cli.app import app
from workbench.errors import BadArgument, BadFile
from workbench.geometry.rigid import procrustes
from workbench.studies.triangles import study as module
from workbench.studies.triangles.measures import (
    HeldOutFits,
    Timing,
)
from workbench.studies.triangles.models import TrainingOptions, near
from workbench.studies.triangles.page import lecture_table, triangles_text, write_triangles
from workbench.studies.triangles.people import (
    DRAWN,
    People,
    TriangleData,
    TrianglePlan,
    read_people,
    register,
)
from workbench.studies.triangles.study import (
    DIFFICULT,
    SHOWN,
    TriangleStudy,
    compare_models,
    difficult_poses,
)
from workbench.synthetic.teacher import teacher_of
from workbench.training.blocks import Plan as TrainingPlan
from workbench.training.evaluation import AT_REST
from workbench.training.triangles.alternation import TriangleOptions
from workbench.training.triangles.learning import Lsqr
from workbench.writing import write_arrays

pytestmark = pytest.mark.thorough

SMALL = wb.load_body("small")
PLAN = TrianglePlan(people=14, subjects=3, poses=5, held_out=5, test=5, betas=10)
OPTIONS = TrainingOptions(
    lambda sigmas: TrainingPlan(near(sigmas).stages[:2], 2),
    (0.01, 0.1),
    TriangleOptions(1, (1e-1, 1e-2), Lsqr(1e-2), Lsqr(1e-2)),
)
LINES: list[str] = []


@cache
def data() -> TriangleData:
    people = People(many_people(0)[:14], many_people(1)[:5], SMALL, teacher_of(SMALL).weights)
    return register(PLAN, people, None)


@cache
def study() -> TriangleStudy:
    def quick(mesh: str, models: object) -> list[Timing]:
        return [Timing(m, name, 369, 734, 1.0, 2.0, 0.5) for m in (mesh, "full") for name in SHOWN]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "timings", quick)
        return compare_models(PLAN, data(), LINES.append, OPTIONS)


def test_registrations_are_reproducible_anywhere() -> None:
    people, posed, standing = data().people, data().posed, data().standing
    assert posed.subject.tolist() == [i % 3 for i in range(15)]
    assert standing.subject.tolist() == list(range(14))
    assert standing.vertices.mean(axis=1).std(axis=0).min() > 0.2
    # nobody faces where he did, and nobody stands quite as he was drawn
    for V, rest in zip(standing.vertices, people.training, strict=True):
        T = procrustes(rest, V, np.ones(len(V)))
        off = np.linalg.norm(rest @ T.R.T + T.t - V, axis=1)
        assert 1e-3 < off.max() < 0.3
    assert data().test_poses == DRAWN
    again = register(PLAN, people, None)
    np.testing.assert_array_equal(again.test.vertices, data().test.vertices)
    np.testing.assert_array_equal(again.posed.vertices, posed.vertices)


def test_people_are_read_from_sets(tmp_path: Path) -> None:
    write_arrays(tmp_path / AT_REST, {"train": many_people(0)[:14], "held_out": many_people(1)[:4]})
    with pytest.raises(BadArgument, match="holds 4 people of the set 'held_out', not 5"):
        read_people(PLAN, tmp_path, SMALL)
    people = read_people(replace(PLAN, held_out=4), tmp_path, SMALL)
    np.testing.assert_array_equal(people.training, data().people.training)
    with pytest.raises(BadFile, match="people"):
        read_people(PLAN, tmp_path / "nowhere", SMALL)


def test_regularization_is_chosen_by_error() -> None:
    assert list(study().choices) == list(SHOWN)
    for choice in study().choices.values():
        assert choice.errors[choice.tried.index(choice.chosen)] == min(choice.errors)
        assert len(set(choice.errors)) == len(choice.tried)
        assert max(choice.errors) < 60  # mm: nothing went astray


@pytest.mark.parametrize("body", [SMALL, blend_scape(SMALL)], ids=lambda body: body.name)
def test_bodies_fit_meshes_of_their_own(body: wb.SkinnedBody | TriangleBody) -> None:
    rng = np.random.default_rng(2)
    betas, poses = rng.normal(size=(2, 10)), rng.normal(scale=0.3, size=(2, 24, 3))
    fits = HeldOutFits.of(body, SMALL, body.vertices(poses, betas, rng.normal(size=(2, 3))))
    assert 1e3 * fits.errors.largest < 0.5  # mm; the prior on betas shows
    np.testing.assert_allclose(fits.fits.betas, betas, atol=0.05)
    rms = np.sqrt(np.mean(fits.errors.distances[1] ** 2))
    assert fits.only([1]).errors.rms == pytest.approx(rms)


def test_difficult_poses_turn_most_and_differ() -> None:
    rng = np.random.default_rng(5)
    poses = rng.normal(size=(20, 24, 3)) * np.linspace(0.1, 1, 20)[:, None, None]
    poses[18] = poses[19] + 1e-3  # nearly the same
    chosen = difficult_poses(poses)
    assert len(chosen) == DIFFICULT
    assert not {18, 19} <= set(chosen)
    assert min(chosen) > 10


def test_page_tells_what_was_measured(tmp_path: Path) -> None:
    page = write_triangles(study(), tmp_path / "triangles").read_text()
    assert "Eckart and Young" in page
    assert page.count("data:image") == 6
    assert "sigma of P, m" in page
    assert "SMPL adds what shape and pose do to each vertex" in page
    table = lecture_table(study())
    assert all(len(row) == 4 for row in table.rows)
    for name in SHOWN:
        assert f"{study().result(name).rms:.2f}" in triangles_text(study())
    assert (study().shapes.leads > -1e-12).all()
    assert not re.search(r"\bnan\b|None", page)
    assert (tmp_path / "triangles" / "smpl.glb").read_bytes()[:4] == b"glTF"
    assert (tmp_path / "triangles" / "summary.json").stat().st_size > 1000
    assert np.isfinite([study().true_seam_jump, *study().shapes.gradients]).all()


WRONG: list[tuple[dict[str, int], str]] = [
    ({"body": "tiny"}, "no body 'tiny'; there are default, small, full"),
    ({"people": 5}, "from 5 people at most 4 shape directions can be learned, not 10"),
    ({"subjects": 300}, "300 subjects cannot be taken from 200 people"),
    ({"subjects": 1}, "2 subjects"),
    ({"test": 4}, "5 test meshes"),
]


def test_command_refuses_before_working(tmp_path: Path) -> None:
    where = ["--out", str(tmp_path), "--people", "5"]
    result = CliRunner().invoke(app, ["triangles", "nowhere.whl", *where])
    assert isinstance(result.exception, BadArgument)
    result = CliRunner().invoke(app, ["triangles", "nowhere.whl", "--out", str(tmp_path)])
    assert "nowhere.whl" in str(result.exception)
