"""A body from meshes in motion: bones, weights, joints and a tree that nobody gave.

A tree takes away what bones by themselves are free to do: the translations follow from the joints
and the rotations. What is left are the unknowns of training without blend shapes, one subject
being in all meshes, and the blocks of training find them (`Refinement`): Gauss-Newton steps in all
names, and in turn with them the weights of each vertex, exactly, which lets a weight leave zero.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import inf
from typing import Any

import numpy as np
from scipy.sparse import csr_array

from workbench.arrays import Array, Index
from workbench.bodies import SkinnedBody
from workbench.bodies.forward.posing import local_rotations
from workbench.errors import BadArgument
from workbench.geometry.rigid import procrustes
from workbench.geometry.rotation import matrix_from_vector, vector_from_matrix
from workbench.motions import Motion
from workbench.threads import limited_threads
from workbench.training.blocks import BLOCKS, BlockInput, BlockOptions
from workbench.training.estimate import Estimate, Sigmas, SkinningPass
from workbench.training.objective import Objective
from workbench.training.poses import PoseFit, poses_of_segments
from workbench.training.registrations import InMemory
from workbench.training.rigging.bones import (
    RigidBones,
    bones_of_weights,
    fit_bone_weights,
    fit_bones,
    rigid_motions,
)
from workbench.training.rigging.decomposition import (
    MOST_BONES,
    alternated,
    bones_needed,
    decompose,
    least_rms,
    merged_where_alike,
    noise_of,
    one_more,
)
from workbench.training.rigging.joints import (
    JointCandidate,
    JointTree,
    candidate,
    joint_tree,
    notes_of,
)
from workbench.training.rigging.steps import RigProgress, RigSteps, silent
from workbench.training.shares import fit_joint_regressor
from workbench.training.subsampling import subsample

TOLERANCE = 1e-4  # m, rms: errors of a decomposition that are no reason for one bone more
ABOVE_NOISE = 1.05  # factor on the rms of noise: what bones leave of it is never quite all
COARSE_VERTICES = 600  # vertices that bones, joints and poses are found from
MOST_SEARCHED = 60  # meshes, spread evenly, that bones are looked for in
TREE_ROUNDS = 4  # how often a tree is looked for again with better bones
ROUNDS, LAST_ROUNDS = 4, 30  # of the refinement, before the tree is certain and after
LEAST_GAIN = 0.05  # of the rms: a bone that lowers it by a smaller share is not kept
REGRESSOR_ERROR = 1e-9  # m: a joint regressor that is farther off is not used
SINGLE_ROUNDING = 2.0**-24  # of the largest coordinate: what single precision leaves of meshes
FIT_STEPS, FIT_SIGMA = 40, 1e-3  # of the fits of poses to further meshes; the sigma is in m
SIGMA = 1e-3  # m, of E_D, the only term: its size changes no minimum
DATA_ALONE = Sigmas(SIGMA, inf, inf, inf, inf, inf, inf)
ROUNDING_RMS = 1e-11  # m, rms per coordinate: what rounding leaves of meshes a few metres across
OPTIONS = BlockOptions(together_tolerance=1e-2, together_steps=4, products=200, enough=ROUNDING_RMS)
LAST_OPTIONS = replace(OPTIONS, together_tolerance=1e-4, products=2000)
LITTLE_GAIN = 0.02  # of the rms: a round that lowers it by a smaller share is the last


@dataclass(frozen=True, eq=False)
class Rigged:
    """A body that was found in T meshes in motion, and its motion.

    Attributes:
        body: its joints are called root, bone_1, bone_2 and so on; it has no blend shapes.
        poses: (T, K, 3) in radians.
        trans: (T, 3) in metres.
        rms: the root mean square distance of the body's vertices from the meshes, in metres.
        joints: of each joint but the root, how well its two bones determine it; `bones` are the
            numbers of the joint's parent and of the joint.
        notes: sentences on what the meshes leave open.
    """

    body: SkinnedBody
    poses: Array
    trans: Array
    rms: float
    joints: tuple[JointCandidate, ...]
    notes: tuple[str, ...]

    def motion(self, fps: float) -> Motion:
        """The motion of the meshes at a rate of `fps` frames a second."""
        return Motion(self.poses, self.trans, fps, self.body.joint_names)


@dataclass(frozen=True, eq=False)
class Refinement:
    """Meshes in motion, of which an estimate is refined.

    Attributes:
        meshes: (T, N, 3) in metres.
        faces: (F, 3) the triangles.
    """

    meshes: Array
    faces: Index

    def objective(self, estimate: Estimate) -> Objective:
        """E_D of these meshes, all of one subject, and no other term."""
        (N, K), T = estimate.weights.shape, len(self.meshes)
        registrations = InMemory(self.meshes, np.zeros(T, dtype=np.int64))
        return Objective(registrations, csr_array((K, N)), estimate.weights, None, DATA_ALONE)

    def rms(self, estimate: Estimate) -> float:
        """The root mean square distance of a vertex, in metres."""
        return float(np.sqrt(3)) * self.objective(estimate).rms(estimate)

    def refined(
        self,
        start: Estimate,
        block: str,
        rounds: int,
        steps: RigSteps,
        options: BlockOptions = OPTIONS,
    ) -> Estimate:
        """Rounds of a block, `skeleton` or `skinning`, and of the weights; none raises the cost."""

        def in_rounds(estimate: Estimate) -> Estimate:
            objective = self.objective(estimate)
            context, before = BlockInput(objective, self.faces, options), objective.rms(estimate)
            for number in range(rounds):
                for name in (block, "weights"):
                    estimate, _ = BLOCKS[name](context, estimate)
                steps.report(block, number + 1, rounds)
                rms = objective.rms(estimate)
                if rms < ROUNDING_RMS or rms > (1 - LITTLE_GAIN) * before:
                    break
                before = rms
            return estimate

        return steps(start, in_rounds)


def rig(
    meshes: Array,
    faces: Index,
    *,
    rest: Array | None = None,
    bones: int | None = None,
    tolerance: float | None = None,
    report: RigProgress = silent,
    steps: RigSteps | None = None,
    card: Mapping[str, Any] | None = None,
) -> Rigged:
    """Find a skeleton, its tree and skinning weights in meshes (T, N, 3) m of one topology.

    The meshes are decomposed into rigid bones with smooth weights (Le and Deng 2012, see `bones`),
    pairs of bones are joined where a point stays together in both (`joints`), and joints, poses
    and weights are refined together as in training without blend shapes (`Refinement`).

    `rest` (N, 3) m is the mesh in the pose in which the body is drawn, the first mesh if it is not
    given. If the body does not explain the meshes to within rounding with this very mesh, its
    vertices are refined too. `bones` is how many there are to be; without it, there are as many as
    lower the error to `tolerance` (m, rms), or as lower it notably. The tolerance is what noise
    leaves, which the singular values of the meshes tell (`noise_of`), and 0.1 mm at least. `report`
    is called with what is going on, and how much of how much of it is done. `steps` keep what was
    found on the way, in memory or in a file, so that a rig that was interrupted continues with
    them: it is the same rig.

    Raises BadFile for steps of another rig, and BadArgument for arrays that do not fit together or
    are too few, and for a motion that needs more than 64 bones.
    """
    first = meshes[0] if rest is None and len(meshes) else rest
    shape = _checked_rest(meshes, first, bones, tolerance)
    steps = RigSteps() if steps is None else steps
    steps.begin(report, (bones, tolerance), meshes, shape, faces)
    with limited_threads():
        turns, unmoved = _without_travel(shape, meshes)
        few = subsample(shape, np.asarray(faces), COARSE_VERTICES)
        vertices = few.vertices
        noise = noise_of(unmoved[:, vertices])
        noise_unknown = noise is None and tolerance is None and bones is None
        if tolerance is None:
            tolerance = max(TOLERANCE, ABOVE_NOISE * np.sqrt(3) * (noise or 0))
        coarse = Refinement(unmoved[:, vertices], few.faces)
        estimate, merged = _skeleton(coarse, shape[vertices], bones, tolerance, steps)
        free = bool((estimate.templates[0] != shape[vertices]).any())
        block = "skinning" if free else "skeleton"
        estimate = coarse.refined(estimate, block, LAST_ROUNDS, steps, LAST_OPTIONS)
        full = Refinement(unmoved, np.asarray(faces))
        if len(vertices) < len(shape):
            estimate = _on_every_vertex(estimate, unmoved, shape, vertices)
            estimate = full.refined(estimate, block, ROUNDS, steps)
        rounding = SINGLE_ROUNDING * np.abs(meshes).max()
        if not free and full.rms(estimate) > rounding:
            estimate = full.refined(estimate, "skinning", LAST_ROUNDS, steps)
        estimate = turned(put_back(estimate, shape), turns)
        full = replace(full, meshes=meshes)
        return _rigged(full, estimate, merged, noise_unknown, steps, dict(card or {}))


def pose_rms(body: SkinnedBody, meshes: Array) -> float:
    """The root mean square distance of further meshes (M, N, 3) m from the body posed onto them."""
    fit = PoseFit(body, body.n_vertices, FIT_SIGMA, FIT_STEPS)
    trusted = np.ones(body.n_vertices)
    starts = [
        poses_of_segments(body.template, body.weights, body.parents, V, trusted) for V in meshes
    ]
    with limited_threads():
        return fit.fits(np.stack(starts), meshes).rms(meshes)


def _without_travel(rest: Array, meshes: Array) -> tuple[Array, Array]:
    """Meshes that are turned and shifted back onto the one at rest, by the turns (T, 3, 3).

    Where a person walks to, and which way they turn as a whole, says nothing about the bones, and
    large coordinates only round away digits.
    """
    turns, moves = rigid_motions(rest, meshes.swapaxes(0, 1), np.ones(len(rest)))
    return turns, (meshes - moves[:, None]) @ turns


def _skeleton(
    refinement: Refinement, rest: Array, count: int | None, tolerance: float, steps: RigSteps
) -> tuple[Estimate, int]:
    """An estimate with enough bones on the right tree, and how many of them were merged.

    One bone more is tried only if the tree with a free template does not explain the meshes either.
    It is added to the bones that were there before the tree was found. Bones are looked for in some
    of the meshes, and the others follow.
    """
    meshes = refinement.meshes
    frames = np.unique(np.linspace(0, len(meshes) - 1, MOST_SEARCHED).round().astype(int))
    searched = meshes[frames] if len(frames) < len(meshes) else meshes
    target = bones_needed(meshes, tolerance) if count is None else count
    bones = decompose(rest, searched, target, steps)
    best: tuple[Estimate, int] | None = None
    lowest = inf
    while True:
        different = merged_where_alike(bones, rest, tolerance)
        merged = bones.count - different.count
        if len(frames) < len(meshes):
            different = bones_of_weights(different.weights, rest, meshes)
        settled, tree = _settled(refinement, rest, different, steps)
        estimate = refinement.refined(on_tree(settled, tree, rest), "skeleton", ROUNDS, steps)
        rms = refinement.rms(estimate)
        if rms > tolerance:
            freed = refinement.refined(estimate, "skinning", ROUNDS, steps)
            freed_rms = refinement.rms(freed)
            if freed_rms < rms:
                estimate, rms = freed, freed_rms
        if best is not None and rms > (1 - LEAST_GAIN) * lowest:
            return best
        enough = count is not None or bones.count >= MOST_BONES
        if enough or rms <= tolerance or steps.unfinished:
            return estimate, merged
        best, lowest = (estimate, merged), rms
        bones = one_more(merged_where_alike(bones, rest, tolerance), rest, searched, steps)


def _settled(
    refinement: Refinement, rest: Array, bones: RigidBones, steps: RigSteps
) -> tuple[RigidBones, JointTree]:
    """Refine bones on their tree, free them, and find the tree again, until it stays the same."""
    tree = joint_tree(bones, rest)
    for _ in range(TREE_ROUNDS):
        estimate = refinement.refined(on_tree(bones, tree, rest), "skeleton", ROUNDS, steps)
        freed = alternated(off_tree(estimate, refinement.meshes), rest, refinement.meshes)
        again = joint_tree(freed, rest)
        place = np.argsort(tree.order)
        same = {frozenset(int(place[k]) for k in edge) for edge in tree.edges} == again.edges
        if same and freed.rms(rest, refinement.meshes) > bones.rms(rest, refinement.meshes):
            return bones, tree  # the joints cost more than the refinement gained
        bones, tree = freed, again
        if same:
            break
    return bones, tree


def _on_every_vertex(estimate: Estimate, meshes: Array, rest: Array, vertices: Index) -> Estimate:
    """The estimate of some vertices, with a template and weights for all of `rest` (N, 3) m."""
    bones = off_tree(estimate, meshes[:, vertices], rounds=0)
    nearest = np.linalg.norm(rest[:, None] - rest[vertices], axis=2).argmin(axis=1)
    bones = replace(bones, weights=estimate.weights[nearest])
    weights = fit_bone_weights(bones, rest, meshes).weights
    none = np.zeros((len(rest), 3, 0))
    return replace(estimate, templates=rest[None], posedirs=none, weights=weights)


def _rigged(
    refinement: Refinement,
    estimate: Estimate,
    merged: int,
    noise_unknown: bool,
    steps: RigSteps,
    card: dict[str, Any],
) -> Rigged:
    meshes, template = refinement.meshes, estimate.templates[0]
    N, K = estimate.weights.shape
    root_weights = estimate.weights[:, 0] / estimate.weights[:, 0].sum()
    root_row = csr_array(np.concatenate([root_weights[None], np.zeros((K - 1, N))]))
    joints = estimate.joints.copy()
    joints[0, 0] = root_weights @ template  # to turn about another point is to stand elsewhere
    regressor = fit_joint_regressor(estimate.templates, joints, root_row)
    names = ("root", *(f"bone_{k}" for k in range(1, K)))
    rms = refinement.rms(estimate)
    freed = off_tree(estimate, meshes)
    candidates = tuple(
        candidate(freed, template, parent, k)
        for k, parent in enumerate(estimate.parents[1:], start=1)
    )
    notes = notes_of(candidates, names, merged, rms, least_rms(meshes, K))
    if noise_unknown and rms > TOLERANCE:
        notes += (
            "how much noise the meshes have cannot be told from so few of them, so bones were "
            f"looked for until {1e3 * TOLERANCE:g} mm would be left; a tolerance or more meshes "
            "may give fewer bones",
        )
    if steps.unfinished:
        notes += ("the search was interrupted: this is what was found until then, not refined",)
    body = SkinnedBody(
        template=template,
        shapedirs=np.zeros((N, 3, 0)),
        posedirs=np.zeros((N, 3, 9 * (K - 1))),
        J_regressor=regressor.matrix,
        weights=estimate.weights,
        parents=estimate.parents,
        faces=refinement.faces,
        joint_names=names,
        name="rigged",
        rest_joints=joints[0] if regressor.rms.max() > REGRESSOR_ERROR else None,
        card={"rigged_from": {"meshes": len(meshes), "rms_mm": 1e3 * rms}, "left_open": notes}
        | card,
    )
    posed = np.stack([body.vertices(pose) for pose in estimate.poses])
    trans = (meshes - posed).mean(axis=1)
    return Rigged(body, estimate.poses, trans, rms, candidates, notes)


def _checked_rest(
    meshes: Array, rest: Array | None, bones: int | None, tolerance: float | None
) -> Array:
    """The mesh at rest. Raises BadArgument."""
    if meshes.ndim != 3 or meshes.shape[2] != 3 or len(meshes) < 2 or meshes.shape[1] < 4:
        raise BadArgument(
            "meshes in motion are an array (T, N, 3) of two frames and four vertices or more, "
            f"not of shape {meshes.shape}"
        )
    if rest is None or rest.shape != meshes.shape[1:]:
        raise BadArgument(
            f"the mesh at rest has shape {None if rest is None else rest.shape}, but the meshes "
            f"have {meshes.shape[1:]}; give one of the same topology"
        )
    for name, array in (("meshes", meshes), ("rest", rest)):
        if not np.isfinite(array).all():
            raise BadArgument(f"{name} hold numbers that are not finite; leave such meshes out")
    if bones is not None and not 1 <= bones <= meshes.shape[1] // 4:
        raise BadArgument(
            f"there can be 1 to {meshes.shape[1] // 4} bones in {meshes.shape[1]} vertices, four "
            f"vertices for each, not {bones}"
        )
    if tolerance is not None and not tolerance > 0:
        raise BadArgument(f"the tolerance is a length in m above 0, not {tolerance!r}")
    return np.asarray(rest, dtype=float)


def on_tree(bones: RigidBones, tree: JointTree, rest: Array) -> Estimate:
    """The estimate that bones are on a tree, in the tree's order, without blend shapes.

    No motion shows where the root's joint is, as turning about another point is a translation
    more: it is put into the middle of the surface that the root carries.
    """
    order = list(tree.order)
    weights = bones.weights[:, order]
    root = weights[:, 0] @ rest / weights[:, 0].sum()
    joints = np.stack([root, *(joint.place for joint in tree.joints)])
    world = bones.rotations[:, order]
    poses = vector_from_matrix(np.stack([local_rotations(R, tree.parents) for R in world]))
    none = np.zeros((len(rest), 3, 0))
    return Estimate(rest[None], joints[None], none, weights, poses, tree.parents)


def off_tree(estimate: Estimate, meshes: Array, rounds: int = 3) -> RigidBones:
    """The bones of an estimate, each fitted to the meshes (T, N, 3) m without regard to joints."""
    T = len(meshes)
    passed = SkinningPass.of(estimate, slice(0, T), np.zeros(T, dtype=np.int64))
    trans = (meshes - passed.points).mean(axis=1)
    origins = passed.by_joint()[:, 0] - np.einsum(
        "tkab,b->tka", passed.posing.world, estimate.templates[0, 0]
    )
    bones = RigidBones(passed.posing.world, origins + trans[:, None], estimate.weights)
    return fit_bones(bones, estimate.templates[0], meshes, rounds)


def put_back(estimate: Estimate, rest: Array) -> Estimate:
    """The same motion, with the template turned and shifted onto the mesh at rest (N, 3) m.

    A turn Q of everything at rest is undone by the poses: Q R_k Q' for every joint, and R_0 Q' for
    the root. A shift is undone by the translations.
    """
    move = procrustes(estimate.templates[0], rest)
    local = matrix_from_vector(estimate.poses)
    local[:, 1:] = move.R @ local[:, 1:] @ move.R.T
    local[:, 0] = local[:, 0] @ move.R.T
    return replace(
        estimate,
        templates=move(estimate.templates),
        joints=move(estimate.joints),
        poses=vector_from_matrix(local),
    )


def turned(estimate: Estimate, turns: Array) -> Estimate:
    """The same motion, turned as a whole by turns (T, 3, 3)."""
    root = vector_from_matrix(turns @ matrix_from_vector(estimate.poses[:, 0]))
    poses = np.concatenate([root[:, None], estimate.poses[:, 1:]], axis=1)
    return replace(estimate, poses=poses)
