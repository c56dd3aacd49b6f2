"""A body with 52 joints that is made of one with 24: its hands get the fingers of `hand-left`.

It stands in for bodies such as SMPL-H. Its finger joints and skinning weights are those of the
embedded hands, placed at the wrists; nothing was trained for it.
"""

from dataclasses import replace

import numpy as np
from scipy.sparse import csr_array, vstack

import workbench as wb
from workbench.arrays import Array
from workbench.bodies.skinned import SkinnedBody
from workbench.geometry.closest_points import read_off

NEAR = 12  # vertices that a finger joint is a mean of


def with_fingers(body: SkinnedBody) -> SkinnedBody:
    """The body with 15 joints for the fingers of each hand instead of one: 52 for one of 24."""
    gone = [body.joint_names.index(f"{side}_hand") for side in ("left", "right")]
    kept = [k for k in range(body.n_joints) if k not in gone]
    names = [body.joint_names[k] for k in kept]
    parents = [-1 if k == 0 else kept.index(body.parents[k]) for k in kept]
    weights, regressor = body.weights[:, kept].copy(), body.J_regressor.tocsr()[kept]
    features = [np.arange(9 * (k - 1), 9 * k) for k in kept[1:]]
    posedirs = body.posedirs[:, :, np.concatenate(features)]
    for side, k in zip(("left", "right"), gone, strict=True):
        hand = wb.load_body("hand-left" if side == "left" else "hand")
        wrist = names.index(f"{side}_wrist")
        of_hand = body.weights[:, k] + weights[:, wrist]
        at_wrist = body.joints()[body.joint_names.index(f"{side}_wrist")]
        surface = hand.template - hand.joints()[0] + at_wrist
        shares = read_off(surface, hand.faces, body.template) @ hand.weights  # (N, 16)
        weights[:, wrist] = of_hand * shares[:, 0]
        weights = np.hstack([weights, of_hand[:, None] * shares[:, 1:]])
        parents += [wrist if p == 0 else len(names) + p - 1 for p in hand.parents[1:]]
        names += [f"{side}_{name}" for name in hand.joint_names[1:]]
        places = hand.joints()[1:] - hand.joints()[0] + at_wrist
        regressor = vstack([regressor, _means(body.template, places)])
        posedirs = np.concatenate([posedirs, np.zeros((*posedirs.shape[:2], 9 * 15))], axis=2)
    weights[weights < np.sort(weights, axis=1)[:, -4:-3]] = 0.0  # four joints a vertex
    return replace(
        body,
        weights=weights / weights.sum(axis=1, keepdims=True),
        J_regressor=csr_array(regressor),
        posedirs=posedirs,
        parents=tuple(parents),
        joint_names=tuple(names),
        landmarks={},
        capsules=None,
        name=f"{body.name} with fingers",
    )


def _means(vertices: Array, places: Array) -> csr_array:
    """Rows that sum to one and make each place (M, 3) of the vertices (N, 3) around it."""
    found = np.zeros((len(places), len(vertices)))
    for row, place in zip(found, places, strict=True):
        near = np.argsort(np.linalg.norm(vertices - place, axis=1))[:NEAR]
        A = np.vstack([vertices[near].T, np.ones(NEAR)])
        row[near] = np.linalg.lstsq(A, np.append(place, 1.0), rcond=None)[0]
    return csr_array(found)
