"""Writing a body for the workbench, and for the packages of the field."""

import json
import pickle
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from workbench.bodies.body import why_not_skinned
from workbench.bodies.files.joint_names import family
from workbench.bodies.files.layouts import STYLE
from workbench.bodies.files.reading import LONGEST_NAME, SPARSE_PARTS
from workbench.bodies.forward.skinning import linear_blend
from workbench.bodies.forward.surface import rotation_elements, star_features
from workbench.bodies.hands import FINGERS
from workbench.bodies.skinned import SkinnedBody
from workbench.bodies.triangles import TriangleBody
from workbench.errors import BadFile
from workbench.writing import replacing, write_arrays

HANDS_OF = {16: ("",), 52: ("l", "r")}  # what the keys of hands end in, by the number of joints
WITHOUT_IDS = ("MANO", "FLAME")  # to which smplx appends no vertices, or its own
ROOT = 2**32 - 1  # the parent of the root in SMPL's files: -1, unsigned


def save_body(body: SkinnedBody | TriangleBody, path: str | Path) -> None:
    """Write a body to `path`, whole or not at all: .npz, or .pkl for the package smplx.

    Both have SMPL's keys, float64 arrays, and all that a body has beside them; `load_body` returns
    the same numbers. A pickle holds numpy arrays only. STAR's features, bind poses, given joints
    and a TriangleBody are saved as .npz alone.

    The package smplx opens the .pkl of a body of 24 joints (SMPL), 52 (SMPL-H) and 16 (MANO), and
    the .npz of one of 55 (SMPL-X) that has SMPL-X's landmarks among its extras. It asks for a pose
    space of the hands: a .pkl of 16 or 52 joints without one says that the mean is zero and that
    the components are the coordinates themselves. Beside the .pkl, `<stem>_vertex_ids.json` says
    which vertices are the nose, the eyes, the finger tips and so on, which smplx appends to
    the joints; a mesh that is not SMPL's own needs it, or smplx takes SMPL's vertices. A hand of
    16 joints and FLAME have none of these:

        ids = json.loads(Path("models/smpl/SMPL_NEUTRAL_vertex_ids.json").read_text())
        smplx.create("models", model_type="smpl", vertex_ids=ids, num_betas=10)

    Give smplx `num_betas` of at most `body.n_betas`; of SMPL it shows no more than ten. Unless told
    `flat_hand_mean=True`, it adds the mean pose of hands to the given pose, of which it is a part
    here.

    Raises BadFile for another suffix, a folder that cannot be written, or a body that the
    format cannot hold.
    """
    if not isinstance(body, TriangleBody) and (
        wrong := why_not_skinned(body, "a body's file", "save its arrays")
    ):
        raise BadFile(wrong)
    if not isinstance(path, (str, PathLike)):
        raise BadFile(f"a body is saved to a path, not to a {type(path).__name__}")
    path = Path(path)
    if path.suffix not in (".npz", ".pkl"):
        raise BadFile(f"a body is saved as .npz or .pkl, not as {path.name!r}")
    if isinstance(body, TriangleBody) and path.suffix != ".npz":
        raise BadFile(
            f"body {body.name!r} is a TriangleBody, which the package smplx does not know; save "
            "it as .npz"
        )
    arrays = arrays_of(body)
    if isinstance(body, TriangleBody) or path.suffix == ".npz":
        write_arrays(path, arrays)
        return
    for unknown, what in (
        (body.bind_pose.any(), "is drawn in a pose that is not zero"),
        (body.rest_joints is not None, "is given its joints at rest"),
        (body.features is star_features, "has pose blend shapes by star_features"),
    ):
        if unknown:
            raise BadFile(f"body {body.name!r} {what}, which smplx does not know; save it as .npz")
    arrays = _pose_spaces(body.n_joints) | arrays
    if family(body.n_joints, body.parents) in WITHOUT_IDS:
        _write_pickle(arrays, path)
        return
    # the names come last: a model without them is whole, names without a model are not
    with replacing(path.with_name(f"{path.stem}_vertex_ids.json")) as names:
        names.write_text(json.dumps(vertex_ids(body), indent=2) + "\n")
        _write_pickle(arrays, path)


def arrays_of(body: SkinnedBody | TriangleBody) -> dict[str, NDArray[Any]]:
    """What `save_body` writes as .npz, by key. Raises BadFile for what the format cannot hold."""
    return _of_triangles(body) if isinstance(body, TriangleBody) else _skinned(body)


def _write_pickle(arrays: dict[str, NDArray[Any]], path: Path) -> None:
    with replacing(path) as temporary, temporary.open("wb") as file:
        pickle.dump(arrays, file, protocol=2)


def _pose_spaces(n_joints: int) -> dict[str, NDArray[Any]]:
    """The hands' pose spaces that smplx asks for, where a body has none: angles as they are."""
    return {
        f"hands_{what}{hand}": array
        for hand in HANDS_OF.get(n_joints, ())
        for what, array in (("mean", np.zeros(45)), ("components", np.eye(45)))
    }


def _of_triangles(body: TriangleBody) -> dict[str, NDArray[Any]]:
    """The body by the keys of `layouts.py`."""
    arrays = {"shapedirs": body.shapedirs, "posedirs": body.posedirs, "near": body.near}
    arrays |= _sparse("weights", body.weights) | _sparse("J_regressor", body.J_regressor)
    return dict(body.extras) | arrays | _of_every_kind(body, STYLE)


def _skinned(body: SkinnedBody) -> dict[str, NDArray[Any]]:
    """The body by SMPL's keys, and ours: nothing but arrays of numbers and texts."""
    if body.skinning is not linear_blend:
        raise BadFile(
            f"body {body.name!r} is not skinned by linear_blend, and its files say no other; "
            "save dataclasses.replace(body, skinning=linear_blend)"
        )
    if body.features not in (rotation_elements, star_features):
        raise BadFile(
            f"the pose blend shapes of body {body.name!r} go neither by rotation_elements nor by "
            "star_features, and its files say nothing else; keep it as a program that makes it"
        )
    arrays = dict(body.extras) | {
        "shapedirs": body.shapedirs,
        "posedirs": body.posedirs,
        "J_regressor": body.J_regressor.toarray(),
        "weights": body.weights,
    }
    if body.mirror is not None:
        arrays["vert_sym_idxs"] = body.mirror
    if body.bound_in is not None:
        arrays["bind_pose"] = body.bound_in
    if body.rest_joints is not None:
        arrays["rest_joints"] = body.rest_joints
    if body.capsules is not None:
        arrays |= {f"capsules/{key}": array for key, array in body.capsules.arrays().items()}
    return arrays | _of_every_kind(body, "lbs")


def _of_every_kind(body: SkinnedBody | TriangleBody, style: str) -> dict[str, NDArray[Any]]:
    names = [body.name, *body.joint_names]
    names += [name for landmarks in body.landmarks.values() for name in landmarks.names]
    if len(longest := max(names, key=len)) > LONGEST_NAME:
        raise BadFile(
            f"body {body.name!r:.60} has a name of {len(longest):,} characters, {longest!r:.60}; "
            f"in files names have at most {LONGEST_NAME}"
        )
    arrays: dict[str, NDArray[Any]] = {
        "v_template": body.template,
        "kintree_table": np.array(
            [(ROOT, *body.parents[1:]), range(body.n_joints)], dtype=np.uint32
        ),
        "f": body.faces.astype(np.uint32),
        "bs_style": np.array(style),
        "name": np.array(body.name),
        "joint_names": np.array(body.joint_names),
        "card": np.array(_card(body)),
    }
    for name, landmarks in body.landmarks.items():
        arrays[f"landmarks/{name}/names"] = np.array(landmarks.names, dtype=np.str_)
        arrays |= _sparse(f"landmarks/{name}", landmarks.regressor)
    return arrays


def _sparse(key: str, matrix: csr_array) -> dict[str, NDArray[Any]]:
    """The parts of a sparse matrix under the keys that a file has for them."""
    parts = (matrix.data, matrix.indices, matrix.indptr, np.array(matrix.shape))
    return {f"{key}/{name}": part for name, part in zip(SPARSE_PARTS, parts, strict=True)}


def _card(body: SkinnedBody | TriangleBody) -> str:
    try:
        return json.dumps(dict(body.card))
    except (TypeError, ValueError) as error:
        raise BadFile(
            f"the card of body {body.name!r} must hold texts, numbers, lists and dicts: {error}"
        ) from error


# smplx's names of vertices of the left side, or the middle: the landmark that each is, and a joint
SMPLX_VERTICES = {
    "nose": ("nose", "head"),
    "leye": ("left_eye", "head"),
    "lear": ("left_ear", "head"),
    "LBigToe": ("left_big_toe", "left_foot"),
    "LSmallToe": ("left_small_toe", "left_foot"),
    "LHeel": ("left_heel", "left_ankle"),
    **{f"l{finger}": (f"left_{finger}", f"left_{finger}3") for finger in FINGERS},
}


def vertex_ids(body: SkinnedBody) -> dict[str, int]:
    """The number of a vertex for each of smplx's 21 names: nose, leye, LBigToe, lthumb, ...

    It is the vertex nearest in the template to the body's landmark of that name or, where there is
    none, to a joint: for fingers without joints of their own the hand's.
    """
    places = dict(zip(body.joint_names, body.numeric.skeleton.mean, strict=True))
    for landmarks in body.landmarks.values():
        places |= dict(zip(landmarks.names, landmarks.regressor @ body.template, strict=True))
    root, numbers = body.numeric.skeleton.mean[0], {}
    for name, (landmark, joint) in SMPLX_VERTICES.items():
        for side, letter in (("left", name[0]), ("right", "R" if name[0] == "L" else "r")):
            candidates = (landmark, f"{landmark}_tip", joint, "left_hand", "left_wrist")
            keys = [key.replace("left", side) for key in candidates]
            place = next((places[key] for key in keys if key in places), root)
            away = np.linalg.norm(body.template - place, axis=1)
            numbers["nose" if name == "nose" else letter + name[1:]] = int(away.argmin())
    return numbers
