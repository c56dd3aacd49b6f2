"""Training as a whole: it resumes, it refuses, what it returns is a body, and held-out people."""

import os
import signal
import subprocess
import sys
import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from workbench import SkinnedBody, load_body, save_body
from workbench.errors import BadArgument, BadFile, UnknownName
from workbench.synthetic.made_up import (
    CorruptedRegistrations,
    draw_registrations,
    jointed_tube,
    random_smpl,
)
from workbench.training import blocks
from workbench.training.blocks import (
    BlockInput,
    BlockOptions,
    Plan,
    Stage,
    alternation,
    without_blend_shapes,
)
from workbench.training.checkpoint import FILE
from workbench.training.estimate import Estimate, Sigmas
from workbench.training.evaluation import (
    evaluate_held_out,
    held_out_errors,
    shape_share,
    shapes_explained,
)
from workbench.training.execution import NotLowered, Progress, Report
from workbench.training.registrations import InMemory, RegistrationSubset
from workbench.training.shape_training import learn_shapes
from workbench.training.training import train

START = jointed_tube(7, 5)
BODY = random_smpl(START, 2, seed=3)
EXACT, TRUTH = draw_registrations(BODY, 3, 8, seed=4)
DATA = CorruptedRegistrations(EXACT, seed=5, noise=0.001, missing=0.1)
SHAPES, _ = draw_registrations(BODY, 12, 1, seed=6, turn=0.1)


def short_plan() -> Plan:
    plan = alternation(rounds=1)
    options = BlockOptions(linear_tolerance=1e-3, products=20, together_steps=2)
    return Plan(tuple(replace(stage, options=options) for stage in plan.stages))


@dataclass
class Told(Report):
    """Remembers what it is told."""

    blocks: list[Progress]
    parts: list[str]

    def block(self, progress: Progress) -> None:
        self.blocks.append(progress)

    def part(self, doing: str, done: int, of: int) -> None:
        assert 0 < done <= of
        self.parts.append(doing)


def test_trained_body_has_a_card_and_round_trips(tmp_path: Path) -> None:
    told = Told([], [])
    trained = train(DATA, START, multi_shape=SHAPES, plan=short_plan(), n_betas=2, report=told)
    body = trained.body
    assert isinstance(body, SkinnedBody)
    said = told.blocks
    assert {"first poses", "poses", "together", "shapes"} <= set(told.parts)
    assert [p.entry.block for p in said] == body.card["blocks"].split(", ")
    assert said[-1].number == said[-1].of == len(short_plan().steps)
    for entry in trained.poses.log:
        assert sum(entry.after.values()) <= sum(entry.before.values()) * (1 + 1e-9)
    assert body.card["worst_kkt"] < 1e-8
    assert body.card["weights_per_vertex"] <= 4
    assert body.card["explained_variance_cumulative"][-1] > 0.8
    np.testing.assert_allclose(body.J_regressor[[0]] @ body.template, 0, atol=1e-12)
    save_body(body, tmp_path / "body.npz")
    again = load_body(tmp_path / "body.npz")
    np.testing.assert_allclose(again.vertices(betas=[1, 0]), body.vertices(betas=[1, 0]))


def test_one_subject_gives_no_shape_directions() -> None:
    one, _ = draw_registrations(BODY, 1, 8, seed=4)
    person, plan = InMemory(one.vertices[:1], one.subject[:1]), without_blend_shapes(rounds=1)
    for multi_shape in (None, person):
        body = train(one, START, multi_shape=multi_shape, plan=plan).body
        assert body.n_betas == 0
        assert not body.posedirs.any()
        assert abs(body.J_regressor @ body.template)[0].max() < 1e-12  # about the root, as others
    assert shapes_explained(body, person)["people_in_one_pose"] == 1
    with pytest.raises(BadArgument, match="shape_rounds"):
        train(one, START, multi_shape=person, plan=plan, shape_rounds=0)


def test_confidence_may_depend_on_the_direction() -> None:
    """Matrices that are multiples of the identity are numbers."""
    C = np.random.default_rng(0).uniform(0.5, 1, (24, 35))
    plan = Plan((Stage(Sigmas(), ("rest", "poses", "weights")),))
    results = []
    for c in (C, C[..., None, None] * np.eye(3)):
        people = InMemory(SHAPES.vertices[:4], SHAPES.subject[:4], c[:4])
        shapes = learn_shapes(BODY, people, n_betas=1, mirror=None, rounds=1)
        one = InMemory(EXACT.vertices[:8], EXACT.subject[:8], c[:8])
        model = train(one, START, multi_shape=people, plan=plan, shape_rounds=1).poses
        results.append((shapes.space.template, model.estimate.templates, model.estimate.weights))
    for numbers, matrices in zip(*results, strict=True):
        np.testing.assert_allclose(matrices, numbers, atol=1e-9)


@pytest.mark.parametrize(
    ("subject", "vertices", "reason"),
    [
        ([0, 0, 2, 2], 35, r"numbered from 0 without gaps, got 0, 2; np\.unique"),
        ([0, 0, -1, -1], 35, "numbered from 0 without gaps, got -1, 0"),
        ([0, 0, 1, 1], 30, "registrations have 30 vertices, but the template has 35"),
    ],
)
def test_registrations_that_do_not_fit_are_refused(
    subject: list[int], vertices: int, reason: str
) -> None:
    some = InMemory(EXACT.vertices[:4, :vertices], np.array(subject))
    with pytest.raises(BadArgument, match=reason):
        train(some, START, plan=short_plan())
    with pytest.raises(BadArgument, match=reason):
        train(EXACT, START, multi_shape=some, plan=short_plan())


def test_plans_without_known_blocks_are_refused() -> None:
    with pytest.raises(BadArgument, match="at least one block"):
        Plan(())
    with pytest.raises(UnknownName, match=r"no block of training is called 'pose'; .*poses"):
        Stage(Sigmas(), ("rest", "pose"))


def test_raised_cost_stops_training(monkeypatch: pytest.MonkeyPatch) -> None:
    def worse(context: BlockInput, estimate: Estimate) -> tuple[Estimate, dict[str, float]]:
        return replace(estimate, templates=1.01 * estimate.templates), {}

    monkeypatch.setitem(blocks.BLOCKS, "weights", worse)
    with pytest.raises(NotLowered, match="'weights' raised the cost"):
        train(DATA, START, plan=short_plan())


@pytest.mark.thorough
def test_checkpoints_of_other_trainings_are_refused(tmp_path: Path) -> None:
    trained = train(DATA, START, plan=short_plan(), n_betas=2, folder=tmp_path)
    other = CorruptedRegistrations(EXACT, seed=6, noise=0.001)
    with pytest.raises(BadFile, match="other registrations"):
        train(other, START, plan=short_plan(), folder=tmp_path)
    with pytest.raises(BadFile, match="another plan"):
        train(DATA, START, plan=alternation(rounds=2), folder=tmp_path)
    with np.load(tmp_path / FILE) as archive:
        arrays = dict(archive)
    again = train(DATA, START, plan=short_plan(), n_betas=2, folder=tmp_path)
    assert again.poses.log == trained.poses.log
    arrays["facts"] = np.array(str(arrays["facts"]).replace('"2:', '"'))  # as the version before
    np.savez(tmp_path / FILE, **arrays)
    with pytest.raises(BadFile, match=r"another version .*remove it to start anew"):
        train(DATA, START, plan=short_plan(), folder=tmp_path)
    (tmp_path / FILE).write_bytes(b"PK nothing")
    with pytest.raises(BadFile, match="is no checkpoint"):
        train(DATA, START, plan=short_plan(), folder=tmp_path)


RUN = """
import sys
from pathlib import Path
from tests.training.test_training import DATA, START, short_plan
from workbench.training.shape_training import learn_shapes
from workbench.training.training import train
from workbench.bodies.files.saving import save_body
class Say:
    def block(self, p):
        print(p.number, p.entry.block, flush=True)
    def part(self, doing, done, of):
        pass
body = train(DATA, START, plan=short_plan(), n_betas=2, folder=Path(sys.argv[1]), report=Say()).body
save_body(body, Path(sys.argv[1]) / "body.npz")
"""


def started(folder: Path) -> "subprocess.Popen[str]":
    folder.mkdir(exist_ok=True)
    return subprocess.Popen(
        [sys.executable, "-c", RUN, str(folder)],
        stdout=subprocess.PIPE,
        text=True,
        cwd=Path(__file__).parents[2],
        env=os.environ | {"OMP_NUM_THREADS": "1"},
    )


@pytest.mark.thorough
def test_killed_training_ends_with_the_same_body(tmp_path: Path) -> None:
    whole = started(tmp_path / "whole")
    lines = whole.communicate(timeout=120)[0].splitlines()
    assert len(lines) == len(short_plan().steps)
    for pause in (0.03,):  # s after a block is told: it is killed while the next one is at work
        run = started(tmp_path / "killed")
        assert run.stdout is not None
        assert run.stdout.readline()
        time.sleep(pause)
        run.send_signal(signal.SIGKILL)
        run.communicate(timeout=60)
        assert run.returncode == -signal.SIGKILL
    run = started(tmp_path / "killed")
    left = run.communicate(timeout=120)[0].splitlines()
    assert run.returncode == 0
    assert len(left) <= len(lines) - 1  # what was told is not done again
    bodies = [load_body(tmp_path / name / "body.npz") for name in ("whole", "killed")]
    for name in ("template", "shapedirs", "posedirs", "weights"):
        np.testing.assert_array_equal(getattr(bodies[0], name), getattr(bodies[1], name))
    np.testing.assert_array_equal(bodies[0].J_regressor.toarray(), bodies[1].J_regressor.toarray())


EVEN = replace(random_smpl(START, 2, seed=3), mirror=START.mirror().vertices)  # type: ignore[union-attr]


def made(seed: int, subjects: int = 3, poses: int = 30) -> RegistrationSubset:
    data, _ = draw_registrations(EVEN, subjects, poses, seed, turn=1.0)
    return RegistrationSubset(data, np.arange(subjects * poses))


def test_every_second_registration_is_held_out() -> None:
    data = made(5, subjects=2, poses=4)
    told = evaluate_held_out(replace(EVEN, mirror=None), data)
    assert told.distances.shape == (4, 35)
    assert told.distances.mean() < 0.02


def test_person_with_one_registration_is_refused() -> None:
    data = made(5, subjects=3, poses=2)
    with pytest.raises(BadArgument, match=r"there is only one of subject 1$"):
        evaluate_held_out(EVEN, RegistrationSubset(data, np.array([0, 1, 2, 4, 5])))


@pytest.mark.thorough
def test_body_explains_those_it_made() -> None:
    data = made(5, subjects=2, poses=8)
    uneven = replace(EVEN, mirror=None)
    told = evaluate_held_out(uneven, data)
    assert told.distances.shape == (8, 35)
    wrong = evaluate_held_out(replace(uneven, posedirs=0 * EVEN.posedirs), data).distances.mean()
    assert told.distances.mean() < 0.4 * wrong
    assert told.shape_explained > 0.7
    errors = held_out_errors(uneven, data)
    assert errors["mean_mm"] == pytest.approx(1e3 * told.distances.mean(), abs=1e-4)
    assert errors["mean_without_posedirs_mm"] == pytest.approx(1e3 * wrong, abs=1e-4)
    assert errors["people_in_poses"] == 2


def test_shape_share_of_what_is_known() -> None:
    inside = EVEN.vertices(betas=np.array([[1.0, 2.0], [0.5, -1.0]]))
    assert shape_share(EVEN, inside) == pytest.approx(1)
    assert shape_share(EVEN, inside + [1.0, 2.0, 3.0]) == pytest.approx(1)
    away = np.random.default_rng(0).standard_normal((40, 35, 3))
    assert shape_share(EVEN, EVEN.template + away) == pytest.approx(2 / 102, rel=0.5)
    assert shape_share(EVEN, EVEN.template[None]) == 1  # there is nothing to explain
