"""SMPL, SCAPE and BlendSCAPE learned from the same registrations."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from workbench.bodies import SkinnedBody
from workbench.bodies.triangles import TriangleBody, blend_scape, scape
from workbench.training.blocks import BLOCKS
from workbench.training.crew import ONE
from workbench.training.estimate import Estimate, Sigmas
from workbench.training.objective import Objective
from workbench.training.plan import QUICK, REACH, Plan, alternation
from workbench.training.pose_training import PoseModel, Progress, train_poses
from workbench.training.registrations import InMemory, kept_and_held_back
from workbench.training.training import train
from workbench.training.triangles.alternation import (
    QUICK as QUICK_BLOCKS,
)
from workbench.training.triangles.alternation import Effort, State, choose_ridge, train_triangles
from workbench.training.triangles.choice import Choice
from workbench.training.triangles.fitting import AnyBody
from workbench.training.triangles.people import Registrations

Array = NDArray[np.float64]
Report = Callable[[str], None]
SMPL, SCAPE, BLEND_SCAPE = "SMPL", "SCAPE", "BlendSCAPE"
LBS = "linear blend skinning"


def near(sigmas: Sigmas) -> Plan:
    """As `workbench train` has it: blend shapes follow the joints near a vertex."""
    return alternation(sigmas, reach=REACH)


@dataclass(frozen=True)
class Teaching:
    """How SMPL is trained, and how the triangle models are."""

    plan: Callable[[Sigmas], Plan] = near
    sigmas: tuple[float, ...] = (0.003, 0.006, 0.01, 0.02)  # m per unit of feature, E_P; tried
    triangles: Effort = QUICK_BLOCKS


WHOLE = Teaching()


@dataclass(frozen=True, eq=False)
class Learned:
    """Models by name, each also without what it learned of pose."""

    models: dict[str, AnyBody]
    left: dict[str, float]  # mm, rms of the meshes learned from, each subject's shape his own
    choices: dict[str, Choice]  # how strongly pose's part was held: E_P (m), E_Q (m^2)

    @property
    def smpl(self) -> SkinnedBody:
        """The one that is skinned."""
        found = self.models[SMPL]
        assert isinstance(found, SkinnedBody)
        return found

    @property
    def rigid(self) -> TriangleBody:
        """SCAPE before Q."""
        found = self.models[without_bends(SCAPE)]
        assert isinstance(found, TriangleBody)
        return found


def without_bends(name: str) -> str:
    """What a triangle model is called whose Q is the identity."""
    return f"{name}, Q = I"


def learn_models(
    given: Registrations, n_betas: int, report: Report, teaching: Teaching = WHOLE
) -> Learned:
    """SMPL by the training pipeline; the others from where it ended, by their own blocks.

    SCAPE and BlendSCAPE compare vertices, as SMPL does, not edges (see CentredVertices).
    """
    report("choosing how freely SMPL's blend shapes follow the pose")
    start = given.start
    choices = {SMPL: choose_sigma(given, teaching)}
    report("training SMPL")
    plan = teaching.plan(Sigmas(posedirs=choices[SMPL].chosen))
    trained = train(
        given.posed, start, multi_shape=given.standing, plan=plan, n_betas=n_betas,
        report=_Blocks(report),
    )  # fmt: skip
    smpl = trained.body
    left = {SMPL: _mm(trained.poses.objective, trained.poses.estimate)}
    models: dict[str, AnyBody] = {LBS: replace(smpl, posedirs=0 * smpl.posedirs), SMPL: smpl}
    for name, untrained in ((SCAPE, scape(smpl)), (BLEND_SCAPE, blend_scape(smpl))):
        report(f"choosing {name}'s ridge")
        begun = State.begin(untrained, trained)
        choices[name] = choose_ridge(begun, given.posed, teaching.triangles)
        report(f"training {name}")
        end = train_triangles(
            begun, given.standing, given.posed,
            n_betas=n_betas, ridge=choices[name].chosen, effort=teaching.triangles,
        )  # fmt: skip
        left[name] = 1e3 * end.fits(given.posed).rms(given.posed.vertices)
        models[without_bends(name)] = replace(end.body, posedirs=0 * end.body.posedirs)
        models[name] = end.body
    return Learned(models, left, choices)


def choose_sigma(given: Registrations, teaching: Teaching) -> Choice:
    """E_P's: the beginning of training, blend shapes from most subjects, judged on the others.

    Poses of those held back are sought anew with each; their rest shapes stay as found first.
    """
    posed, start = given.posed, given.start
    plan = teaching.plan(Sigmas())
    first = train_poses(posed, start, replace(plan, stages=plan.stages[:2]))
    kept, back = kept_and_held_back(posed.subject)
    left = []
    for sigma in teaching.sigmas:
        objective, estimate = _some(first, posed, kept, sigma)
        learned = BLOCKS["surfaces"](objective, estimate, start.faces, QUICK, ONE).estimate
        objective, estimate = _some(first, posed, back, sigma)
        bent = replace(estimate, posedirs=learned.posedirs)
        found = BLOCKS["poses"](objective, bent, start.faces, QUICK, ONE).estimate
        left.append(_mm(objective, found))
    return Choice(teaching.sigmas, tuple(left))


def _some(
    model: PoseModel, posed: InMemory, rows: NDArray[np.int64], sigma: float
) -> tuple[Objective, Estimate]:
    """Of some registrations alone, posedirs held at sigma."""
    who, subject = np.unique(posed.subject[rows], return_inverse=True)
    own, found = InMemory(posed.vertices[rows], subject), model.estimate
    estimate = replace(
        found, poses=found.poses[rows], templates=found.templates[who], joints=found.joints[who]
    )
    return replace(model.objective, registrations=own, sigmas=Sigmas(posedirs=sigma)), estimate


def _mm(objective: Objective, estimate: Estimate) -> float:
    """rms per vertex."""
    return 1e3 * float(np.sqrt(3)) * objective.rms(estimate)


@dataclass(frozen=True)
class _Blocks:
    """Says each block of the training in a line."""

    report: Report

    def block(self, progress: Progress) -> None:
        """One has ended."""
        self.report(f"  {progress.entry.block}, block {progress.number} of {progress.of}")

    def part(self, doing: str, done: int, of: int) -> None:
        """Nothing."""
