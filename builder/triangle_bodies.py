"""Learning the pose-dependent deformations of the embedded SCAPE and BlendSCAPE bodies.

Run as `python -m builder.triangle_bodies --out workbench/data/bodies`. Each body learns from posed
surfaces of the skinned body on its mesh, so that the bodies explain the same people by different
equations. Nothing is needed but what is in the checkout.
"""

import argparse
import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from builder.stored import in_steps, write_arrays
from builder.triangle_learning import Lsqr, learn_pose_deformations
from workbench.arrays import Array
from workbench.bodies.catalogue import SYNTHETIC, UNTRAINED, load_skinned
from workbench.bodies.skinned import SkinnedBody
from workbench.bodies.triangles import TriangleBody
from workbench.priors.poses import draw_poses, shipped_gaussian
from workbench.training.triangles import PosedMeshes

LEARNED_FROM, VALIDATED_ON, TESTED_ON = 600, 100, 100  # people, each in one pose
RIDGES = (1e-1, 1e-2, 1e-3, 1e-4)  # m^2, from which that of Q is chosen on the validation set
ALLOWED = 1.1  # times the least error: smaller ridges gain little, and stitching undoes much of it
TURNED = 0.3  # rad per axis, by which every other person's joints are turned further
SEED = 7


@dataclass(frozen=True, eq=False)
class PosedPeople:
    """People of a skinned body, each in a pose of its own, as in the training of that body.

    Attributes:
        poses: (M, K, 3) rad.
        betas: (M, B).
        surfaces: (M, N, 3) m.
    """

    poses: Array
    betas: Array
    surfaces: Array

    @staticmethod
    def drawn(body: SkinnedBody, count: int, rng: np.random.Generator) -> "PosedPeople":
        """Poses of the shipped Gaussian, every other one turned further, and shapes of 1 sd."""
        poses = draw_poses(shipped_gaussian(), count, rng)
        poses[::2, 1:] += TURNED * rng.standard_normal(poses[::2, 1:].shape)
        betas = rng.standard_normal((count, body.n_betas))
        return PosedPeople(poses, betas, body.vertices(poses, betas))

    def rms(self, body: TriangleBody) -> float:
        """The rms distance in mm of a body's vertices from these, after centring, each alike."""
        found = body.vertices(self.poses, self.betas)
        off = _centred(found) - _centred(self.surfaces)
        return float(1e3 * np.sqrt((off**2).sum(axis=2).mean()))


def build(name: str) -> tuple[TriangleBody, dict[str, Any]]:
    """One body of `UNTRAINED` with posedirs, and its card."""
    mesh, model = UNTRAINED[name]
    skinned, rng = load_skinned(mesh), np.random.default_rng(SEED)
    training, validation, test = (
        PosedPeople.drawn(skinned, count, rng) for count in (LEARNED_FROM, VALIDATED_ON, TESTED_ON)
    )
    untrained = model(skinned)
    meshes = PosedMeshes(training.surfaces, training.poses, np.arange(LEARNED_FROM))
    errors, found = [], []
    for ridge in RIDGES:
        learned = learn_pose_deformations(
            untrained, meshes, training.betas, ridge=ridge, by=Lsqr(3e-3)
        )
        found.append(learned)
        errors.append(validation.rms(learned))
    best = int(np.argmax(np.array(errors) <= ALLOWED * min(errors)))  # the largest ridge of these
    card = {
        "synthetic": SYNTHETIC,
        "name": name,
        "made_of": f"body {mesh!r}: its mesh, tree, shape space and joint regressor, written as "
        "deformations of triangles; its card is under `skinned_body`",
        "learned": f"posedirs (Q), from surfaces of body {mesh!r} in known poses; no scan was seen",
        "builder": {
            "command": "python -m builder.triangle_bodies --out workbench/data/bodies",
            "people": LEARNED_FROM,
            "turned_rad": TURNED,
            "seed": SEED,
            "ridges_m2": list(RIDGES),
            "validation_rms_mm": [round(error, 2) for error in errors],
            "ridge_m2": RIDGES[best],
        },
        "held_out": {
            "people": TESTED_ON,
            "rms_mm": round(test.rms(found[best]), 2),
            "rms_without_posedirs_mm": round(test.rms(untrained), 2),
        },
        "licence": dict(skinned.card)["licence"],
    }
    return replace(found[best], name=name), card


def write(body: TriangleBody, card: dict[str, Any], path: Path) -> None:
    """Write the posedirs of a body in small whole numbers, and its card."""
    step = float(np.abs(body.posedirs).max()) / np.iinfo(np.int16).max
    arrays = {
        "near": body.near.astype(np.uint8),
        "posedirs": in_steps(body.posedirs, step),
        "posedirs_step": np.array(step),
        "card": np.array(json.dumps(card)),
    }
    write_arrays(path, arrays)


def main() -> None:
    """Learn all of them and write them."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    arguments = parser.parse_args()
    for name in UNTRAINED:
        body, card = build(name)
        write(body, card, arguments.out / f"{name}.npz")
        print(f"{name}: {card['held_out']}")


def _centred(surfaces: Array) -> Array:
    return np.asarray(surfaces - surfaces.mean(axis=1, keepdims=True))


if __name__ == "__main__":
    main()
