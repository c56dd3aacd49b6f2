"""Bones on a tree, and everything about them refined at once.

A tree takes away what bones by themselves are free to do: the translations follow from the joints
and the rotations. What is left are the unknowns of training without blend shapes, one subject
being in all meshes, and the blocks of training find them: steps of Gauss and Newton in all names,
and in turn with them the weights of each vertex, exactly, which lets a weight leave zero.
"""

from dataclasses import dataclass, replace
from math import inf

import numpy as np
from scipy.sparse import csr_array

from workbench.arrays import Array, Index
from workbench.bodies.forward.posing import local_rotations
from workbench.geometry.rigid import procrustes
from workbench.geometry.rotation import matrix_from_vector, vector_from_matrix
from workbench.training.blocks import BLOCKS, BlockInput, BlockOptions
from workbench.training.estimate import Estimate, Sigmas
from workbench.training.objective import Objective
from workbench.training.registrations import InMemory
from workbench.training.rigging.bones import Bones, fit_bones
from workbench.training.rigging.decomposition import Report
from workbench.training.rigging.joints import JointTree
from workbench.training.skinning_pass import SkinningPass

SIGMA = 1e-3  # m, of E_D, the only term: its size changes no minimum
DATA = Sigmas(SIGMA, inf, inf, inf, inf, inf, inf)
EXACT = 1e-11  # m, rms per coordinate: what rounding leaves of meshes a few metres across
STEPS = BlockOptions(together_tolerance=1e-2, together_steps=4, products=200, enough=EXACT)
LAST = replace(STEPS, together_tolerance=1e-4, products=2000)
EMPTY = 1e-8  # a bone whose weights are all below it moves no vertex
LITTLE = 0.02  # of the rms: a round that lowers it by a smaller share is the last


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
        return Objective(registrations, csr_array((K, N)), estimate.weights, None, DATA)

    def rms(self, estimate: Estimate) -> float:
        """The root mean square distance of a vertex, in metres."""
        return float(np.sqrt(3)) * self.objective(estimate).rms(estimate)

    def refined(
        self,
        estimate: Estimate,
        block: str,
        rounds: int,
        report: Report,
        options: BlockOptions = STEPS,
    ) -> Estimate:
        """Rounds of a block, `skeleton` or `skinning`, and of the weights; none raises the cost."""
        objective = self.objective(estimate)
        before = objective.rms(estimate)
        for number in range(rounds):
            for name in (block, "weights"):
                given = BlockInput(objective, self.faces, options)
                estimate = BLOCKS[name](given, estimate).estimate
            report(block, number + 1, rounds)
            rms = objective.rms(estimate)
            if rms < EXACT or rms > (1 - LITTLE) * before:
                break
            before = rms
        return estimate


def on_tree(bones: Bones, tree: JointTree, rest: Array) -> Estimate:
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


def off_tree(estimate: Estimate, meshes: Array, rounds: int = 3) -> Bones:
    """The bones of an estimate, each fitted to the meshes (T, N, 3) m without regard to joints."""
    T = len(meshes)
    passed = SkinningPass.of(estimate, slice(0, T), np.zeros(T, dtype=np.int64))
    trans = (meshes - passed.points).mean(axis=1)
    origins = passed.by_each()[:, 0] - np.einsum(
        "tkab,b->tka", passed.posing.world, estimate.templates[0, 0]
    )
    bones = Bones(passed.posing.world, origins + trans[:, None], estimate.weights)
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


def without_empty(estimate: Estimate) -> Estimate:
    """The same motion without bones that move no vertex and carry no other bone."""
    weights, parents = estimate.weights, estimate.parents
    carrying = {*parents}
    empty = [k for k in range(len(parents)) if k not in carrying and weights[:, k].max() < EMPTY]
    if not empty:
        return estimate
    kept = [k for k in range(len(parents)) if k not in empty]
    left = weights[:, kept]
    fewer = replace(
        estimate,
        joints=estimate.joints[:, kept],
        weights=left / left.sum(axis=1, keepdims=True),
        poses=estimate.poses[:, kept],
        parents=tuple(kept.index(parents[k]) if k else -1 for k in kept),
    )
    return without_empty(fewer)  # what carried only those may carry nothing now
