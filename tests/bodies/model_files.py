"""Synthetic files in the layouts of the family: keys, dtypes and kinds of entries as in real ones.

The numbers are random or those of the embedded bodies; only the number of vertices is smaller.
"""

import pickle
from pathlib import Path
from typing import Any

import numpy as np
from scipy.sparse import csc_matrix

from tests.bodies.random_bodies import Entries, entries
from workbench.bodies.catalogue import load_skinned
from workbench.bodies.files.joint_names import TREES
from workbench.bodies.files.reading import REQUIRED
from workbench.bodies.files.saving import arrays_of
from workbench.geometry.mirror import AXIAL

LANDMARKS, CONTOUR = 51, (79, 17)  # of SMPL-X: static ones, and one row of contour for each degree


def layout(model: str, N: int = 40, B: int = 10, seed: int = 0) -> Entries:
    """The arrays of SMPL that a file of this model has, on its own tree."""
    parents = TREES[model]
    raw = entries(N, len(parents), B, seed)
    raw["kintree_table"] = np.array([(2**32 - 1, *parents[1:]), range(len(parents))], np.uint32)
    return raw


def hand_space(seed: int, letter: str = "", rows: int = 45) -> Entries:
    """A hand's mean pose, its principal components, and the poses that they were found from."""
    rng = np.random.default_rng((seed, len(letter)))
    components = np.linalg.qr(rng.normal(size=(45, 45)))[0][:rows]
    return {
        f"hands_mean{letter}": rng.normal(size=45) * 0.3,
        f"hands_components{letter}": components,
        f"hands_coeffs{letter}": rng.normal(size=(20, rows)),
    }


def smpl(N: int = 40) -> Entries:
    """SMPL's pickle as it is after its own loader: a sparse regressor, texts, a person's state."""
    raw = layout("SMPL", N)
    return raw | {
        "J_regressor": csc_matrix(raw["J_regressor"]),
        "J_regressor_prior": csc_matrix(raw["J_regressor"]),
        "weights_prior": raw["weights"].copy(),
        "vert_sym_idxs": np.arange(N)[::-1].copy(),
        "bs_style": "lbs",
        "bs_type": "lrotmin",
    }


def mano(N: int = 40, model: str = "MANO") -> Entries:
    """MANO's pickle."""
    raw = layout(model, N)
    regressor = csc_matrix(raw["J_regressor"])
    return raw | hand_space(1) | {"J_regressor": regressor, "bs_style": "lbs", "bs_type": "lrotmin"}


def smplh(N: int = 40) -> Entries:
    """SMPL-H as merged for smplx: the body of 52 joints and the keys of both hands."""
    return layout("SMPL-H", N, 16) | hand_space(2, "l") | hand_space(3, "r")


def smplx(N: int = 40, B: int = 400, seed: int = 4) -> Entries:
    """SMPL-X's npz: 300 directions of shape and 100 of expression, landmarks, a texture map."""
    rng = np.random.default_rng(seed)
    raw = layout("SMPL-X", N, B)
    F = len(raw["f"])
    return (
        raw
        | hand_space(5, "l", 12)
        | hand_space(6, "r", 12)
        | {
            "lmk_faces_idx": rng.integers(F, size=LANDMARKS).astype(np.uint32),
            "lmk_bary_coords": rng.dirichlet(np.ones(3), size=LANDMARKS),
            "dynamic_lmk_faces_idx": rng.integers(F, size=CONTOUR).astype(np.int64),
            "dynamic_lmk_bary_coords": rng.dirichlet(np.ones(3), size=CONTOUR),
            "ft": rng.integers(N + 9, size=(F, 3)).astype(np.uint32),
            "vt": rng.random((N + 9, 2)),
            "joint2num": np.array({"Pelvis": 0}, dtype=object),
            "part2num": np.array({"Global": 0}, dtype=object),
        }
    )


def flame(N: int = 40) -> Entries:
    """FLAME's pickle: five joints, 300 directions of shape and 100 of expression, single floats."""
    raw = layout("FLAME", N, 400)
    regressor = csc_matrix(raw["J_regressor"])
    return raw | {"J_regressor": regressor, "bs_style": "lbs", "bs_type": "lrotmin"}


def star(N: int = 40, B: int = 300) -> Entries:
    """STAR's npz, whose posedirs have 93 columns."""
    rng = np.random.default_rng(7)
    raw = layout("SMPL", N, B)
    return raw | {"posedirs": rng.normal(size=(N, 3, 93)) * 0.01}


def foreign(name: str) -> Entries:
    """An embedded body in the seven arrays of SMPL's files alone, as from another program."""
    body = load_skinned(name)
    arrays = arrays_of(body)
    return {key: arrays[key].copy() for key in (*REQUIRED, *body.extras)}


def with_fingers(name: str = "default") -> Entries:
    """An embedded body of 24 joints in SMPL-H's layout, with the hands' joints and pose spaces.

    The joints are those of the embedded hand, moved to the wrists; the weights of a hand go to the
    nearest of its fingers' joints. It is made up, to be looked at, and moves like no hand.
    """
    body, hand = load_skinned(name), load_skinned("hand")
    own, K = foreign(name), 52
    parents = TREES["SMPL-H"]
    weights, regressor = np.zeros((body.n_vertices, K)), np.zeros((K, body.n_vertices))
    weights[:, :22], regressor[:22] = own["weights"][:, :22], own["J_regressor"][:22]
    space = {key: hand.extras[key] for key in ("hands_mean", "hands_components")}
    spaces: Entries = {}
    for joint, first, side, letter in ((22, 22, 1.0, "l"), (23, 37, -1.0, "r")):
        wrist = body.joints()[joint - 2]
        places = wrist + (hand.joints() - hand.joints()[0])[1:] * [-side, 1, 1]
        there = np.flatnonzero(own["weights"][:, joint] > 0)
        nearest = np.linalg.norm(body.template[there, None] - places, axis=2).argmin(axis=1)
        weights[there, first + nearest] = own["weights"][there, joint]
        means = np.column_stack([body.template[there], np.ones(len(there))])
        wanted = np.column_stack([places, np.ones(15)])
        regressor[first : first + 15, there] = np.linalg.lstsq(means.T, wanted.T, rcond=None)[0].T
        for key, rows in space.items():
            turned = rows.reshape(-1, 3) * (AXIAL if side > 0 else 1)
            spaces[key + letter] = turned.reshape(rows.shape)
    posedirs = np.zeros((body.n_vertices, 3, 9 * (K - 1)))
    posedirs[:, :, : 9 * 21] = own["posedirs"][:, :, : 9 * 21]
    table = np.array([(2**32 - 1, *parents[1:]), range(K)], np.uint32)
    changed = {"weights": weights, "J_regressor": regressor, "posedirs": posedirs}
    return own | changed | {"kintree_table": table} | spaces


MODELS: dict[str, Any] = {
    "SMPL": (smpl, ".pkl"),
    "MANO": (mano, ".pkl"),
    "SMPL-H": (smplh, ".pkl"),
    "SMPL-X": (smplx, ".npz"),
    "FLAME": (flame, ".pkl"),
    "STAR": (star, ".npz"),
}


def written(raw: Entries, path: Path) -> Path:
    """The file of these entries, of the kind that its suffix says."""
    if path.suffix == ".npz":
        np.savez(path, **raw)
    else:
        path.write_bytes(pickle.dumps(raw, protocol=2))
    return path
