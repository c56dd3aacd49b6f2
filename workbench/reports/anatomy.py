"""What a body is made of, in names and numbers."""

import numpy as np

from workbench.arrays import Array
from workbench.bodies import SkinnedBody
from workbench.bodies.files.extras import shapes_in_words
from workbench.bodies.triangles import TriangleBody
from workbench.plots.body import side

LOWERED = 1.15  # rad that the arms hang down from a T-pose, so that shapes stand closer together
ENDS = 2.0  # standard deviations at which shapes are drawn
NOT_READ = "arrays of its file that nothing here computes with; save_body writes them back"
DRAWN = 5  # shape directions in the gallery


def facts(body: SkinnedBody | TriangleBody) -> dict[str, str]:
    """Sizes and kinds, by name."""
    sets = [f"{name} ({len(marks.names)})" for name, marks in body.landmarks.items()]
    tall = float(np.ptp(body.template[:, 1]))
    return {
        "type": _type(body),
        "vertices V": f"{body.n_vertices:,}",
        "faces": f"{len(body.faces):,}",
        "joints K": str(body.n_joints),
        "shape directions B": str(body.n_betas),
        **(_skin(body) if isinstance(body, SkinnedBody) else _deformations(body)),
        "J_regressor": f"{body.J_regressor.nnz:,} nonzeros",
        "height of the template": f"{tall:.3f} m",
        **(_mirrored(body) if isinstance(body, SkinnedBody) else {}),
        "landmarks": ", ".join(["joints", *sets]),
        **({"synthetic": str(body.card["synthetic"])} if "synthetic" in body.card else {}),
        **({"carried along": f"{shapes_in_words(body.extras)}: {NOT_READ}"} if body.extras else {}),
    }


def _type(body: SkinnedBody | TriangleBody) -> str:
    if isinstance(body, SkinnedBody):
        return f"SkinnedBody, {body.skinning.__name__.replace('_', ' ')} skinning"
    single = np.diff(body.weights.indptr).max() == 1
    each = "each triangle with one part" if single else "each triangle with several parts"
    return f"TriangleBody, {each}, then stitched"


def _skin(body: SkinnedBody) -> dict[str, str]:
    weights = np.count_nonzero(body.weights, axis=1)
    features, acting = body.posedirs.shape[2], int(np.count_nonzero(body.posedirs))
    return {
        "pose features P": f"{features} ({acting:,} nonzeros in posedirs)",
        "skinning weights": f"at most {weights.max()} per vertex, {weights.mean():.2f} on average",
    }


def _mirrored(body: SkinnedBody) -> dict[str, str]:
    found = "no" if body.mirror is None else "yes: a partner on the other side for every vertex"
    return {"mirror": found}


def _deformations(body: TriangleBody) -> dict[str, str]:
    weights, acting = np.diff(body.weights.indptr), int(np.count_nonzero(body.posedirs))
    return {
        "joints that bend a face": f"{body.near.shape[1]} ({acting:,} nonzeros in posedirs)",
        "parts' weights": f"at most {weights.max()} per face, {weights.mean():.2f} on average",
    }


def shapes(body: SkinnedBody | TriangleBody) -> dict[str, Array]:
    """The mean and the first shape directions at plus, then at minus two standard deviations.

    (N, 3) m each, the arms hanging where the body is a T-pose of SMPL's joint names.
    """
    pose = _arms_down(body)
    found: dict[str, Array] = {}
    for sign, word in ((1, "+2 sd"), (-1, "−2 sd")):
        mean = body.vertices(pose)
        found |= {"mean": mean} if sign > 0 else {"mean, side": side(mean)}
        for b in range(min(DRAWN, body.n_betas)):
            betas = np.zeros(body.n_betas)
            betas[b] = sign * ENDS
            found[f"betas[{b}] {word}"] = body.vertices(pose, betas)
    return found


def directions_drawn(body: SkinnedBody | TriangleBody) -> str:
    """Which shape directions `shapes` shows, as the subject of a sentence."""
    if body.n_betas <= DRAWN:
        return "Each shape direction"
    return f"Each of the first {DRAWN} of {body.n_betas} shape directions"


def _unbound(body: SkinnedBody | TriangleBody) -> bool:
    return isinstance(body, TriangleBody) or body.bound_in is None


def _arms_down(body: SkinnedBody | TriangleBody) -> Array:
    pose = body.bind_pose.copy()
    for name, turn in (("left_shoulder", -LOWERED), ("right_shoulder", LOWERED)):
        if name in body.joint_names and _unbound(body):
            pose[body.joint_names.index(name), 2] = turn
    return pose
