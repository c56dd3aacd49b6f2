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
from workbench.bodies.triangles import TriangleBody, blend_scape, scape
from workbench.cli.app import app
from workbench.errors import BadArgument
from workbench.geometry.triangles import gradients
from workbench.reports.triangles import count, lecture_table, triangles_text, write_triangles
from workbench.training.embedded.fine_weights import teacher_of
from workbench.training.triangles import study as module
from workbench.training.triangles.comparison import Explained
from workbench.training.triangles.learning import PosedMeshes
from workbench.training.triangles.measures import Cost, Held, betas_at_rest, cost, crease, n_seams
from workbench.training.triangles.models import learn_smpl
from workbench.training.triangles.people import DRAWN, People, Plan, Registrations, register
from workbench.training.triangles.study import HARD, SHOWN, Study, hard_poses, study

SMALL = wb.load_body("small")
PLAN = Plan(people=24, subjects=3, poses=6, trial=5, strangers=6, test=12, betas=10)
SAID: list[str] = []


@cache
def given() -> Registrations:
    people = People(many_people(0), many_people(1)[:6], SMALL, teacher_of(SMALL).weights)
    return register(PLAN, people, None)


@cache
def found() -> Study:
    def quick(mesh: str, models: object) -> list[Cost]:
        return [Cost(m, name, 369, 734, 1.0, 2.0, 0.5) for m in (mesh, "full") for name in SHOWN]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "costs", quick)
        return study(PLAN, given(), SAID.append)


def test_strangers_and_their_poses_are_not_those_learned_from() -> None:
    all_poses = np.concatenate([given().posed.poses, given().trial.poses, given().test.poses])
    assert len(np.unique(all_poses, axis=0)) == 18 + 5 + 12
    assert set(given().posed.person) == {0, 1, 2}
    assert given().said == DRAWN
    again = register(PLAN, given().people, None)
    np.testing.assert_array_equal(again.test.vertices, given().test.vertices)


def test_what_is_learned_of_pose_helps_on_what_it_was_learned_from() -> None:
    by_name = {one.model: one for one in found().outcomes}
    assert list(by_name) == [
        "linear blend skinning", "SMPL", "SCAPE, Q = I", "SCAPE", "BlendSCAPE, Q = I", "BlendSCAPE",
    ]  # fmt: skip
    for better, worse in (
        ("SMPL", "linear blend skinning"), ("SCAPE", "SCAPE, Q = I"),
        ("BlendSCAPE", "BlendSCAPE, Q = I"),
    ):  # fmt: skip
        assert by_name[better].learned < 0.7 * by_name[worse].learned
        assert by_name[better].rest == pytest.approx(by_name[worse].rest)
    for one in found().outcomes:
        assert one.mean <= one.rms <= one.largest
    assert by_name["SMPL"].gap < 1e-10
    assert by_name["SCAPE"].gap > 0.1
    assert by_name["BlendSCAPE, Q = I"].crease < by_name["SCAPE, Q = I"].crease
    assert any("BlendSCAPE" in line for line in SAID)


def test_smpl_is_learned_back_from_what_it_generated() -> None:
    rng = np.random.default_rng(0)
    betas = rng.normal(size=(14, 10))
    betas -= betas.mean(axis=0)
    people = SMALL.vertices(betas=betas)
    poses = np.concatenate([np.zeros((300, 1, 3)), rng.normal(scale=0.3, size=(300, 23, 3))], 1)
    person = rng.integers(14, size=300)
    posed = PosedMeshes(SMALL.vertices(poses, betas[person]), poses, person)
    learned = learn_smpl(SMALL, people, posed, posed, 10)
    before = replace(learned, posedirs=0 * learned.posedirs)
    off = [Held.of(body, people, posed).rms for body in (learned, before)]
    assert off[0] < 0.2 * off[1]
    np.testing.assert_allclose(learned.template, SMALL.template, atol=1e-12)


@pytest.mark.parametrize(
    "body", [SMALL, scape(SMALL), blend_scape(SMALL)], ids=lambda body: body.name
)
def test_betas_are_those_of_the_people(body: wb.SkinnedBody | TriangleBody) -> None:
    betas = np.random.default_rng(1).normal(size=(4, 10))
    people = body.vertices(betas=betas) + [1.0, 2.0, 3.0]
    np.testing.assert_allclose(betas_at_rest(body, people), betas, atol=1e-9)


def test_a_body_is_no_distance_from_itself() -> None:
    body = scape(SMALL)
    betas = np.random.default_rng(2).normal(size=(2, 10))
    poses = np.random.default_rng(3).normal(scale=0.3, size=(3, 24, 3))
    person = np.array([0, 1, 0])
    posed = PosedMeshes(body.vertices(poses, betas[person], [0, 0, 9.0]), poses, person)
    assert Held.of(body, body.vertices(betas=betas), posed).largest < 1e-8


def test_creases_are_jumps_between_parts_and_only_there() -> None:
    body, part = SMALL, scape(SMALL).weights.toarray().argmax(axis=1)
    turned = body.template @ np.array([[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]])
    assert crease(body.template, body.faces, part, turned[None]) < 1e-12
    bent = body.vertices(np.random.default_rng(4).normal(scale=0.3, size=(2, 24, 3)))
    X = gradients(body.template, bent, body.faces)
    sides: dict[frozenset[int], list[int]] = {}
    for f, corners in enumerate(body.faces.tolist()):
        for a, b in ((0, 1), (1, 2), (2, 0)):
            sides.setdefault(frozenset((corners[a], corners[b])), []).append(f)
    seams = [(f, g) for f, g in sides.values() if part[f] != part[g]]
    jumps = [np.sum((X[i, f] - X[i, g]) ** 2) for i in range(2) for f, g in seams]
    np.testing.assert_allclose(crease(body.template, body.faces, part, bent) ** 2, np.mean(jumps))
    assert n_seams(body.faces, part) == len(seams)


def test_hard_poses_turn_most_and_differ() -> None:
    rng = np.random.default_rng(5)
    poses = rng.normal(size=(20, 24, 3)) * np.linspace(0.1, 1, 20)[:, None, None]
    poses[18] = poses[19] + 1e-3  # nearly the same
    chosen = hard_poses(poses)
    assert len(chosen) == HARD
    assert not {18, 19} <= set(chosen)
    assert min(chosen) > 10


def test_a_cost_is_measured() -> None:
    skinned, triangles = (cost("small", "a", body, 1) for body in (SMALL, scape(SMALL)))
    assert skinned.density < 0.6 < 0.95 < triangles.density
    for one in (skinned, triangles):
        assert one.n_faces == 734
        assert one.vertices_ms > 0
        assert one.jacobian_ms > 0


def test_directions_are_counted() -> None:
    share = np.array([0.0, 0.5, 0.9, 0.97])
    explained = Explained(share, share)
    assert [count(explained, level) for level in (0.5, 0.9, 0.91, 0.99)] == [
        "1", "2", "3", "more than 3",
    ]  # fmt: skip
    assert explained.count_for(0.99) is None


def test_the_page_says_what_was_measured(tmp_path: Path) -> None:
    page = write_triangles(found(), tmp_path / "triangles").read_text()
    assert "Eckart and Young" in page
    assert page.count("data:image") == 6
    assert "SMPL adds what shape and pose do to each vertex" in page
    table = lecture_table(found())
    assert all(len(row) == 4 for row in table.rows)
    for name in SHOWN:
        assert f"{found().outcome(name).rms:.2f}" in triangles_text(found())
    assert (found().shapes.leads > -1e-12).all()
    assert not re.search(r"\bnan\b|None", page)
    assert (tmp_path / "triangles" / "smpl.glb").read_bytes()[:4] == b"glTF"
    assert (tmp_path / "triangles" / "summary.json").stat().st_size > 1000
    assert np.isfinite([found().true_crease, *found().shapes.gradients]).all()


@pytest.mark.parametrize(
    ("wrong", "text"),
    [
        ({"body": "tiny"}, "no body 'tiny'; there are default, small, full"),
        ({"people": 5}, "5 people tell up to 4 shape directions apart, not 10"),
        ({"subjects": 300}, "300 subjects are not among 200 people"),
        ({"test": 4}, "5 tests"),
    ],
)
def test_plans_that_cannot_be_are_refused(wrong: dict[str, int], text: str) -> None:
    with pytest.raises(BadArgument, match=text):
        Plan(**wrong)  # type: ignore[arg-type]


def test_the_command_refuses_before_it_works(tmp_path: Path) -> None:
    where = ["--out", str(tmp_path), "--people", "5"]
    result = CliRunner().invoke(app, ["triangles", "nowhere.whl", *where])
    assert isinstance(result.exception, BadArgument)
    result = CliRunner().invoke(app, ["triangles", "nowhere.whl", "--out", str(tmp_path)])
    assert "nowhere.whl" in str(result.exception)
