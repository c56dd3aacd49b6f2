"""Scans registered together, with models of vertices and of triangles."""

from dataclasses import dataclass, replace
from functools import cache
from itertools import pairwise
from pathlib import Path

import casadi as cs
import numpy as np
import pytest

from workbench.arrays import Array, Index
from workbench.blocks import Block, Points
from workbench.bodies import SkinnedBody
from workbench.bodies.triangles import TriangleBody, blend_scape
from workbench.errors import BadArgument, BadFile
from workbench.fitting import Scan
from workbench.geometry.solids import area
from workbench.registration import ScanTerm
from workbench.registration.coregistration import (
    Coregistration,
    CoregistrationPlan,
    Fitted,
    ScansInMemory,
    State,
)
from workbench.registration.coregistration.coregistering import FILE, SIGMAS
from workbench.registration.coregistration.scan_block import (
    OnScan,
    ScanCoupling,
    jobs,
    on_scans,
    scan_evidence,
)
from workbench.registration.coregistration.triangle_steps import learned_bends
from workbench.registration.coregistration.triangles import (
    TriangleCoregistration,
    TrianglePlan,
    TriangleState,
)
from workbench.residuals import Residual, geman_mcclure, of_norms, offset
from workbench.synthetic.made_up import jointed_tube, random_smpl
from workbench.training.blocks import BLOCKS, BlockInput
from workbench.training.estimate import Estimate
from workbench.training.execution import Execution, Report
from workbench.training.registrations import InMemory

START = jointed_tube(7, 5)
PEOPLE, EACH = 2, 3
TERM = ScanTerm(sigma=0.002, outlier=0.01, within=0.1)
PLAN = CoregistrationPlan(rounds=2, term=TERM, sigmas=replace(SIGMAS, data=0.002))


@cache
def body() -> SkinnedBody:
    return random_smpl(START, 2, seed=3)


def sampled(vertices: Array, rng: np.random.Generator, n: int) -> Scan:
    """Points with normals and areas on one half of a surface."""
    corners = vertices[body().faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = np.linalg.norm(normals, axis=1) / 2
    on = rng.choice(len(areas), n, p=areas / areas.sum())
    on = on[normals[on] @ rng.standard_normal(3) > 0]
    points = np.einsum("mk,mki->mi", rng.dirichlet((1, 1, 1), len(on)), corners[on])
    each = np.full(len(on), areas.sum() / n)
    return Scan(points, normals[on] / (2 * areas[on, None]), weights=each)


@cache
def made() -> tuple[ScansInMemory, tuple[Fitted, ...], Array, Array]:
    """Scans of two people with shapes that betas do not reach, fits, true surfaces, templates."""
    rng = np.random.default_rng(8)
    model, subject = body(), np.repeat(np.arange(PEOPLE), EACH)
    own = [0.02 * np.sin(3 * model.template + p) for p in range(PEOPLE)]
    templates = model.template + np.stack(own)
    scans, fits, truth = [], [], []
    for s in subject:
        pose = 0.25 * rng.standard_normal((model.n_joints, 3))
        trans = 0.1 * rng.standard_normal(3)
        there = replace(model, template=templates[s]).vertices(pose, np.zeros(2), trans)
        scans.append(sampled(there, rng, 500))
        off = pose + 0.02 * rng.standard_normal(pose.shape)
        fits.append(Fitted(off, np.zeros(2), trans + 0.003 * rng.standard_normal(3)))
        truth.append(there)
    return ScansInMemory(tuple(scans), subject), tuple(fits), np.stack(truth), templates


@cache
def joint() -> Coregistration:
    return Coregistration(body(), made()[0], PLAN)


@cache
def state() -> State:
    return joint().run(made()[1])


def off(vertices: Array) -> float:
    return float(np.linalg.norm(vertices - made()[2], axis=2).mean())


@pytest.mark.thorough
def test_joint_cost_is_monotone_over_blocks() -> None:
    log = state().log
    assert [entry.block for entry in log] == ["registrations", "model"] * 2 + ["registrations"]
    costs = [sum(log[0].before.values()), *(sum(entry.after.values()) for entry in log)]
    assert all(b <= a * (1 + 1e-9) for a, b in pairwise(costs)), costs
    assert costs[-1] < 0.8 * costs[1], costs
    assert all(e.facts["share"] > 0 for e in log if e.block == "model")


@pytest.mark.thorough
def test_learned_model_improves_registrations() -> None:
    alone = Coregistration(body(), made()[0], replace(PLAN, blocks=())).run(made()[1])
    assert off(state().vertices) < 0.7 * off(alone.vertices)


@pytest.mark.thorough
def test_targets_bound_the_scan_cost() -> None:
    """The surrogate touches E_S at the registration, and lies above it elsewhere."""
    coupled = ScanCoupling(START.faces, area(START.template, START.faces), PLAN.sigmas.data, TERM)

    def each(solve: bool, estimate: Estimate, V: Array, trans: Array) -> list[OnScan]:
        todo = jobs(estimate, joint().scans.subject, V, trans)
        return [one for job in todo for one in on_scans(coupled, joint().scans, solve, job)]

    here = each(True, state().estimate, state().vertices, state().trans)
    V, poses, trans = (
        np.stack([getattr(o, n) for o in here]) for n in ("vertices", "pose", "trans")
    )
    moved = V + 1e-3 * np.random.default_rng(1).standard_normal(V.shape)
    there = each(False, replace(state().estimate, poses=poses), moved, trans)
    sigma = PLAN.sigmas.data
    for j, (one, other) in enumerate(zip(here, there, strict=True)):
        C = one.confidence
        e, Q = np.linalg.eigh(C)
        assert e.min() > -1e-12
        assert e.max() < 1
        L = np.einsum("nab,nb,ncb->nac", Q, e / (1 - e), Q) / sigma**2
        bound = [
            0.5 * np.einsum("na,nab,nb->", d, L, d)
            for d in (x - one.targets for x in (V[j], moved[j]))
        ]
        rise = other.scan_costs - one.scan_costs
        assert rise <= (bound[1] - bound[0]) * 1.1 + 0.02 * abs(rise), j


def test_kernels_of_norms_are_refused() -> None:
    V = made()[2][0]
    block = Block("vertices", V.shape, "m")
    three = replace(TERM, form=offset)
    scan = three.residual(block.symbol, body().faces, made()[0].read(0), 1.0)
    norms = replace(scan, kernel=of_norms(geman_mcclure))
    with pytest.raises(BadArgument, match="kernel of single numbers"):
        scan_evidence(norms, V, 0.002)


def test_targets_of_landmarks_are_their_places() -> None:
    """Three rows for a vertex and no kernel: the target is the landmark, whatever the vertices."""
    V = made()[2][0]
    block, there = Block("vertices", V.shape, "m"), V[4] + [0.01, -0.02, 0.03]
    place = Residual("mark", block.symbol[:, 4] - there, 0.004, "m", rows_per_point=3)
    targets, confidence = scan_evidence(place, V, 0.002)
    np.testing.assert_allclose(targets[4], there, atol=1e-12)
    np.testing.assert_allclose(confidence[4], np.eye(3) / 5, atol=1e-12)
    np.testing.assert_array_equal(np.delete(targets, 4, axis=0), np.delete(V, 4, axis=0))


@dataclass(frozen=True)
class Labelled(ScanTerm):
    """A scan that shows every vertex, by its number."""

    def residual(self, points: Points | cs.MX, faces: Index, scan: Scan, area: float) -> Residual:
        assert isinstance(points, cs.MX)
        off = cs.vec(points - scan.points.T)
        return Residual("labels", off, 1e-5, "m", rows_per_point=3)


@pytest.mark.thorough
def test_perfect_scans_match_training_on_meshes() -> None:
    scans, fits, truth, _ = made()
    tight = {"linear_tolerance": 1e-8, "together_tolerance": 1e-4, "together_stop": 1e-9}
    exact = replace(PLAN.options, together_steps=40, **tight)
    plan = replace(PLAN, term=Labelled(), options=exact)
    by = Coregistration(body(), ScansInMemory(tuple(map(Scan, truth)), scans.subject), plan)
    trained = by.first(fits).estimate
    context = BlockInput(by.objective(InMemory(truth, scans.subject)), body().faces, exact)
    for _ in range(plan.rounds):
        for name in plan.blocks:
            trained, _ = BLOCKS[name](context, trained)
    estimate = by.run(fits).estimate
    off = np.linalg.norm(estimate.templates - trained.templates, axis=2)
    moved = np.linalg.norm(trained.templates - by.first(fits).estimate.templates, axis=2)
    assert off.max() < 5e-5, "m"
    assert moved.max() > 5e-3, "m, or there was nothing to learn"


@pytest.mark.thorough
def test_stopped_run_continues_to_the_same_bits(tmp_path: Path) -> None:
    class After(Report):
        left = 0

        def block(self, progress: object) -> None:
            self.left -= 1
            if not self.left:
                raise InterruptedError

        def part(self, doing: str, done: int, of: int) -> None:
            pass

    report = After()
    for report.left in (1, 1, 2):
        with pytest.raises(InterruptedError):
            joint().run(made()[1], folder=tmp_path, execution=Execution(report=report))
    continued = joint().run(made()[1], folder=tmp_path)
    assert len(continued.log) == 5
    for name, array in state().arrays().items():
        np.testing.assert_array_equal(array, continued.arrays()[name], err_msg=name)


@pytest.mark.thorough
def test_other_settings_do_not_continue_a_run(tmp_path: Path) -> None:
    short = Coregistration(body(), made()[0], replace(PLAN, rounds=1))
    short.run(made()[1], folder=tmp_path)
    for other in (replace(PLAN, rounds=1, edges=0.02), PLAN):
        with pytest.raises(BadFile, match="other settings"):
            Coregistration(body(), made()[0], other).run(made()[1], folder=tmp_path)
    (tmp_path / FILE).write_bytes((tmp_path / FILE).read_bytes()[:-500])
    with pytest.raises(BadFile, match="checkpoint"):
        short.run(made()[1], folder=tmp_path)


def test_bad_subjects_are_refused() -> None:
    scans = made()[0].scans
    for subject, why in (([0] * 6, "two subjects"), ([0, 0, 0, 2, 2, 2], "without gaps")):
        with pytest.raises(BadArgument, match=why):
            Coregistration(body(), ScansInMemory(scans, np.array(subject)), PLAN)
    with pytest.raises(BadArgument, match="rounds of a coregistration"):
        CoregistrationPlan(rounds=0)


TRIANGLE_PLAN = TrianglePlan(rounds=2, coupling=0.005, term=TERM)


@cache
def start() -> TriangleBody:
    """BlendSCAPE on the test's body, with a Q for triangles before they are stitched."""
    skinned = body()
    poses = 0.25 * np.random.default_rng(4).standard_normal((12, skinned.n_joints, 3))
    poses[:, 0] = 0
    return learned_bends(blend_scape(skinned), poses, skinned.vertices(poses), 0.02)


def apart() -> Array:
    """Where the fitted body is on each scan."""
    _, fits, _, _ = made()
    return np.stack([body().vertices(f.pose, f.betas, f.trans) for f in fits])


@cache
def run(plan: TrianglePlan) -> TriangleState:
    scans, fits, _, _ = made()
    return TriangleCoregistration(start(), scans, plan).run(fits, apart())


@pytest.mark.thorough
def test_triangle_cost_is_monotone_over_blocks() -> None:
    log = run(TRIANGLE_PLAN).log
    assert [entry.block for entry in log] == ["persons", "bends", "registrations"] * 2
    for entry in log:
        assert sum(entry.after.values()) < sum(entry.before.values())
    for before, after in pairwise(log):
        assert sum(before.after.values()) == pytest.approx(sum(after.before.values()))


def test_bad_triangle_plans_are_refused() -> None:
    for change, told in [
        ({"rounds": 0}, "rounds of a coregistration .* not 0"),
        ({"bends": 0.0}, "bends of a coregistration .* not 0"),
        ({"blocks": ("templates",)}, "no block is called 'templates'; give persons and bends"),
    ]:
        with pytest.raises(BadArgument, match=told):
            replace(TRIANGLE_PLAN, **change)  # type: ignore[arg-type]
