"""Every kind of file that the workbench reads: how a small valid one is made, and who reads it.

A reader either raises a WorkbenchError or returns something sound: what a caller may rely on
without looking, above all finite numbers of the shapes that belong together.
"""

import json
from collections.abc import Callable
from dataclasses import dataclass, fields, is_dataclass, replace
from functools import cache
from importlib.resources import files
from pathlib import Path
from shutil import copyfile
from typing import Any

import casadi as cs
import numpy as np
from scipy.sparse import csr_array, issparse

from tests.bodies.model_files import MODELS, written
from tests.bodies.random_bodies import decorated, entries
from tests.fitting.mediapipe_made import mediapipe_results
from tests.motions.made_files import MARKER_FILES, MOTION_FILES
from workbench import Block, Problem, Residual, load_body, save_body, solve
from workbench.bodies import check_body_file, pose_space, shape_space
from workbench.bodies.catalogue import load_skinned
from workbench.bodies.files.embedded import read_embedded
from workbench.bodies.skinned import Landmarks
from workbench.bodies.triangles import TriangleBody, blend_scape
from workbench.comparison.log import KINDS, ROW, Observed
from workbench.comparison.record import Ending, Record
from workbench.comparison.store import Folder
from workbench.errors import BadFile
from workbench.fitting.calibration_files import read_calibration
from workbench.fitting.keypoint_files import read_observations
from workbench.fitting.marker_files import read_markers
from workbench.geometry.meshes import read_mesh, write_mesh
from workbench.motions import read_motion
from workbench.sampling.checkpoint import SavedEnsemble, load, save
from workbench.solvers import Solution
from workbench.training.checkpoint import Checkpoint, read_checkpoint
from workbench.training.estimate import Estimate
from workbench.training.first_guess import Start, read_start, write_start
from workbench.training.folder import open_folder
from workbench.training.progress import LogEntry

SECONDS, MEGABYTES = 5.0, 1000.0  # the most that a reader may take beyond a valid file
OF_PICKLES = 2.0, 500.0


@dataclass(frozen=True)
class Format:
    """Files in a folder, and what is done with them; one of them is changed at a time."""

    make: Callable[[Path], None]
    read: Callable[[Path], object]
    seconds: float = SECONDS
    megabytes: float = MEGABYTES
    patience: int = 60  # s of wall time before a reader is interrupted


def sound(found: object) -> None:
    """Assert that whatever numbers are in a result are finite."""
    pending = [found]
    while pending:
        one = pending.pop()
        if isinstance(one, np.ndarray):
            assert one.dtype.kind in "fiubUS", f"an array of {one.dtype}"
            assert one.dtype.kind != "f" or np.isfinite(one).all(), "an array that is not finite"
        elif issparse(one):
            pending.append(one.data)
        elif isinstance(one, float):
            assert np.isfinite(one), f"the number {one}"
        elif isinstance(one, dict):
            pending += [*one.keys(), *one.values()]
        elif isinstance(one, (list, tuple)):
            pending += one
        elif is_dataclass(one):
            pending += [getattr(one, part.name) for part in fields(one)]


def _npz_body(folder: Path) -> None:
    save_body(decorated(load_body("small")), folder / "body.npz")


def _triangle_body(folder: Path) -> None:
    rng = np.random.default_rng(6)
    body = blend_scape(load_body("small"))
    marks = Landmarks(("nose", "chin"), csr_array(np.eye(2, body.n_vertices)))
    given = {
        "posedirs": rng.normal(0, 0.1, body.posedirs.shape),
        "landmarks": {"face": marks},
        "card": {"source": "made up", "numbers": [1, 0.1]},
        "extras": {"limits": np.ones(3)},
    }
    save_body(replace(body, **given), folder / "triangles.npz")


def _read_triangle_body(folder: Path) -> object:
    body = load_body(folder / "triangles.npz")
    sound([body.weights, body.J_regressor, *(m.regressor for m in body.landmarks.values())])
    assert isinstance(body, TriangleBody), "a body of another kind"
    assert body.faces.min() >= 0
    assert body.faces.max() < body.n_vertices
    sound([body.template, body.shapedirs, body.posedirs])
    return [array for array in body.extras.values() if array.dtype.kind != "f"]


def _raw_npz_body(folder: Path) -> None:
    np.savez(folder / "SMPL.npz", **entries(N=30, K=6, B=3))


def _pkl_body(folder: Path) -> None:
    import pickle

    with (folder / "SMPL.pkl").open("wb") as file:
        pickle.dump(entries(N=30, K=6, B=3), file, protocol=2)


def _body(name: str) -> Callable[[Path], object]:
    def read(folder: Path) -> object:
        body = load_body(folder / name)
        for array in (body.template, body.shapedirs, body.posedirs, body.weights):
            sound(array)
        return body.vertices(np.zeros((body.n_joints, 3)), np.zeros(body.n_betas), np.zeros(3))

    return read


def _models(folder: Path) -> None:
    """One file of each model of the family, with all of its keys."""
    for model, (make, suffix) in MODELS.items():
        written(make(12), folder / f"{model}{suffix}")


def _read_models(folder: Path) -> object:
    """Loaded, taken apart and checked, each as a user would; a refusal of one is one of the file.

    Betas of a body are those of a shape and an expression, and hands are posed by coefficients.
    """
    found: list[object] = []
    for model, (_, suffix) in MODELS.items():
        path = folder / f"{model}{suffix}"
        check = check_body_file(path)
        assert all(len(finding.text) < 1200 for finding in check.findings)
        assert len(check.report()) < 100_000
        body = load_skinned(path)
        found += [body.template, body.shapedirs, body.posedirs, body.weights]
        space = shape_space(body)
        some = space.first(min(2, len(space.shape)), min(1, len(space.expression)))
        found.append(some.numbers(np.ones(len(some.shape))))
        for hand in ("left", "right") if body.n_joints > 50 else (None,):
            keys = ("hands_mean", "hands_components")
            if all(key + (hand or " ")[0].strip() in body.extras for key in keys):
                hands = pose_space(body, None, hand)
                found.append(hands.poses(body, np.zeros(hands.n_components)))
    return found


def _embedded(folder: Path) -> None:
    copyfile(str(files("workbench") / "data" / "bodies" / "small.npz"), folder / "small.npz")


def _read_embedded(folder: Path) -> object:
    body = read_embedded(folder / "small.npz")
    return body.template, body.shapedirs, body.posedirs, body.weights, body.J_regressor


@cache
def _solution() -> Solution:
    x, y = Block("x", (3,), "m"), Block("y", (1,), "1")
    residual = Residual("r", cs.vertcat(x.symbol - 1, y.symbol * x.symbol[0] - 2), sigma=1.0)
    return solve(Problem([residual], free=("x", "y")), {"x": np.zeros(3), "y": np.ones(1)})


def _write_solution(folder: Path) -> None:
    _solution().save(folder / "fit.npz")


def _read_solution(folder: Path) -> object:
    found = Solution.load(folder / "fit.npz")
    str(found), found.converged, found.iterations, found.linear_algebra
    for i in found.trace:
        assert i.values.keys() == found.values.keys()
        for name, value in i.values.items():
            assert value.shape == found.values[name].shape
        sound((i.values, i.seconds, i.evaluations))
        assert isinstance(i.cost, float)  # which may be NaN, and so may be kept
    assert isinstance(found.message, str), "a message that is no text"
    assert all(isinstance(name, str) for name in (*found.lost, *found.unnoticed))
    assert isinstance(found.cost, float)
    return found.values, float(found.seconds), found.evaluations


KEY = "0123456789abcdef"


def _write_store(folder: Path) -> None:
    trace = np.arange(2.0 * ROW).reshape(2, ROW)[::-1]  # the cost, last, falls
    seen = Observed((3,) * len(KINDS), (0.1,) * len(KINDS), 0, 0.2, np.ones(2), trace)
    record = Record(
        "lm",
        "rosenbrock",
        Ending.RETURNED,
        "done",
        seen,
        "a machine",
        "CONVERGED",
        0.5,
        0.5,
        1e-9,
        8.0,
        end=np.ones(2),
    )
    Folder(folder / "comparison").put(KEY, record.stored())


def _read_store(folder: Path) -> object:
    """Whatever is not whole counts as none."""
    record = Folder(folder / "comparison").get(KEY, Record.of)
    if record is None:
        raise BadFile("none")
    assert isinstance(record.solver, str)
    assert isinstance(record.message, str)
    assert record.observed.trace.shape[1] == ROW
    return (
        record.end,
        record.observed.trace,
        float(record.observed.seconds),
        record.observed.evaluations,
    )


@cache
def _estimate() -> Estimate:
    rng = np.random.default_rng(0)
    S, J, N, K = 2, 3, 8, 3
    return Estimate(
        templates=rng.normal(size=(S, N, 3)),
        joints=rng.normal(size=(S, K, 3)),
        posedirs=rng.normal(size=(N, 3, 9 * (K - 1))),
        weights=np.full((N, K), 1 / K),
        poses=rng.normal(size=(J, K, 3)),
        parents=(-1, 0, 1),
    )


def _write_checkpoint(folder: Path) -> None:
    entry = LogEntry("poses", {"data": 2.0}, {"data": 1.0}, {"steps": 3.0}, 0.1)
    Checkpoint(_estimate(), (entry,), "a fingerprint").save(folder)


def _read_checkpoint(folder: Path) -> object:
    found = read_checkpoint(folder, "a fingerprint", _estimate(), ("poses", "surfaces"))
    assert found is not None
    for name, array in _estimate().arrays().items():
        assert found.estimate.arrays()[name].shape == array.shape
    for entry in found.log:
        sound((entry.before, entry.after, float(entry.seconds)))
        assert isinstance(entry.block, str)
    return found.estimate.arrays()


def _write_start(folder: Path) -> None:
    write_start(Start.of(load_body("small")), folder / "start.npz")


def _read_start(folder: Path) -> object:
    start = read_start(folder / "start.npz")
    K, N = len(start.parents), len(start.template)
    assert start.template.shape == (N, 3)
    assert start.faces.shape[1:] == (3,)
    assert ((start.faces >= 0) & (start.faces < N)).all()
    assert len(start.joint_names) == K
    assert all(-1 <= parent < k for k, parent in enumerate(start.parents))
    return start.template


def _registrations(folder: Path) -> None:
    body = load_body("small")
    rng = np.random.default_rng(1)
    some = [body.template + rng.normal(0, 1e-3, 3) for _ in range(4)]
    write_mesh(folder / "a.ply", some[0], body.faces)
    write_mesh(folder / "b.obj", some[1], body.faces)
    np.savez(folder / "c.npz", vertices=some[2], faces=body.faces, confidence=np.ones(len(some[2])))
    np.save(folder / "many.npy", np.stack(some))
    text = "file,subject,gender,set\na.ply,anna,female,poses\nb.obj,bob,male,shapes\n"
    text += "c.npz,anna,female,poses\nmany.npy#3,carl,,\n"
    (folder / "registrations.csv").write_text(text)


def _read_registrations(folder: Path) -> object:
    body = load_body("small")
    found = open_folder(folder, body.n_vertices, body.faces)
    batch = found.read(slice(0, len(found.rows)))
    assert batch.vertices.shape == (len(found.rows), body.n_vertices, 3)
    return batch.vertices, batch.confidence


def _draws(folder: Path) -> None:
    rng = np.random.default_rng(2)
    state = np.random.RandomState(3).get_state()
    saved = [
        SavedEnsemble(rng.normal(size=(5, 4, 2)), rng.normal(size=(5, 4)), np.ones(4), state)
    ] * 2
    save(folder / "draws.h5", saved, {"names": ["x", "y"], "steps": 5, "seed": 1})


def _read_draws(folder: Path) -> object:
    saved, settings = load(folder / "draws.h5")
    assert isinstance(settings, dict)
    for one in saved:
        S, W, _ = one.chain.shape
        assert one.log_prob.shape == (S, W)
        assert one.accepted.shape == (W,)
        np.random.RandomState().set_state(one.random_state)
        sound((one.chain, one.accepted))
        assert not np.isnan(one.log_prob).any()
    return ()


def _mesh(suffix: str) -> Format:
    def make(folder: Path) -> None:
        body = load_body("small")
        faces = body.faces[(body.faces < 60).all(axis=1)]
        write_mesh(folder / f"mesh{suffix}", body.template[:60], faces)

    return Format(make, lambda folder: vars(read_mesh(folder / f"mesh{suffix}")))


def _polygons(folder: Path) -> None:
    """Triangles and quads in both orders of bytes, and a flag for each."""
    V = load_body("small").template[:30].astype(np.float32)
    for order, kind in (("<", "binary_little_endian"), (">", "binary_big_endian")):
        head = f"ply\nformat {kind} 1.0\nelement vertex {len(V)}\nproperty float x\n"
        head += "property float y\nproperty float z\nelement face 20\nproperty uchar flag\n"
        head += "property list uchar int vertex_indices\nend_header\n"
        faces = b""
        for i in range(20):
            corners = np.arange(i, i + 3 + i % 2).astype(f"{order}i4")
            faces += bytes([i, len(corners)]) + corners.tobytes()
        content = head.encode() + V.astype(f"{order}f4").tobytes() + faces
        (folder / f"{kind}.ply").write_bytes(content)


def _read_polygons(folder: Path) -> object:
    return [vars(read_mesh(path)) for path in sorted(folder.glob("*.ply"))]


def _people(folder: Path) -> None:
    rng = np.random.default_rng(4)
    flat = np.column_stack([rng.uniform(100, 900, (25, 2)), rng.uniform(0.2, 1, 25)]).ravel()
    hand = np.column_stack([rng.uniform(100, 900, (21, 2)), rng.uniform(0.2, 1, 21)]).ravel()
    person = {"person_id": [-1], "pose_keypoints_2d": flat.tolist(), "face_keypoints_2d": []}
    person |= {"hand_left_keypoints_2d": hand.tolist()}
    (folder / "people.json").write_text(json.dumps({"version": 1.3, "people": [person] * 2}))


def _read_people(folder: Path) -> object:
    return vars(read_observations([folder / "people.json"], size=(1000, 1000)))


def _annotations(folder: Path) -> None:
    rng = np.random.default_rng(5)
    flat = np.column_stack([rng.uniform(100, 900, (17, 2)), np.full(17, 2.0)]).ravel()
    said = {
        "images": [{"id": 7, "width": 1000, "height": 800, "file_name": "a.jpg"}],
        "annotations": [{"id": 1, "image_id": 7, "keypoints": flat.tolist(), "num_keypoints": 17}],
    }
    (folder / "coco.json").write_text(json.dumps(said))


def _read_annotations(folder: Path) -> object:
    return vars(read_observations([folder / "coco.json"]))


def _mediapipe(folder: Path) -> None:
    for name, said in mediapipe_results().items():
        (folder / f"{name}.json").write_text(json.dumps(said))


def _read_mediapipe(folder: Path) -> object:
    return [
        vars(read_observations([path], size=(640, 480))) for path in sorted(folder.glob("*.json"))
    ]


def _camera(given: Any) -> dict[str, Any]:
    K = [[900.0, 0.0, 500.0], [0.0, 900.0, 400.0], [0.0, 0.0, 1.0]]
    return {"K": K, "R": [0.1, 0.2, 0.3], "t": [0.0, 0.0, 3.0], "size": [1000, 800]} | given


def _calibration(folder: Path) -> None:
    said = {"left": _camera({"distortion": [0.1, 0, 0, 0, 0]}), "right": _camera({})}
    (folder / "cameras.json").write_text(json.dumps(said))


def _tables(folder: Path) -> None:
    lines = []
    for name in ("cam_1", "cam_2"):
        camera = _camera({})
        lines += [f"[{name}]", f'name = "{name}"', f"size = {camera['size']}"]
        lines += [f"matrix = {camera['K']}", f"rotation = {camera['R']}"]
        lines += [f"translation = {camera['t']}", "distortions = [0.0, 0.0, 0.0, 0.0]", ""]
    (folder / "cameras.toml").write_text("\n".join([*lines, "[metadata]", "error = 0.1"]))


def _cameras(name: str) -> Callable[[Path], object]:
    def read(folder: Path) -> object:
        return {
            n: {k: v for k, v in c.items() if k != "unread"}
            for n, c in read_calibration(folder / name).items()
        }

    return read


def _motions(folder: Path) -> None:
    for name, make in MOTION_FILES.items():
        make(folder / name)


def _read_motions(folder: Path) -> object:
    found: list[object] = []
    for name in MOTION_FILES:
        motion = read_motion(folder / name)
        assert len(motion) == len(motion.pose) == len(motion.trans) > 0
        assert len(motion.joint_names) == motion.pose.shape[1]
        found.append((motion.pose, motion.trans, motion.betas, motion.fps))
        if len(motion) < 10_000:
            found.append(motion.resampled(motion.fps / 2).pose)
        if motion.bones is not None:
            found.append(motion.joints())
    return found


def _markers(folder: Path) -> None:
    for name, make in MARKER_FILES.items():
        make(folder / name)


def _read_markers(folder: Path) -> object:
    found: list[object] = []
    for name in MARKER_FILES:
        recording = read_markers(folder / name)
        T, M, _ = recording.markers.shape
        assert T > 0
        assert len({*recording.labels}) == M
        assert recording.fps is None or 0 < recording.fps < 1e6
        found.append(recording.markers[~np.isnan(recording.markers)])
    return found


FORMATS: dict[str, Format] = {
    "body.npz": Format(_npz_body, _body("body.npz")),
    "triangles.npz": Format(_triangle_body, _read_triangle_body),
    "SMPL.npz": Format(_raw_npz_body, _body("SMPL.npz")),
    "SMPL.pkl": Format(_pkl_body, _body("SMPL.pkl"), *OF_PICKLES),
    "model-files": Format(_models, _read_models),
    "embedded.npz": Format(_embedded, _read_embedded),
    "solution.npz": Format(_write_solution, _read_solution),
    "comparison": Format(_write_store, _read_store),
    "training-checkpoint": Format(_write_checkpoint, _read_checkpoint),
    "training-start": Format(_write_start, _read_start),
    "training-folder": Format(_registrations, _read_registrations),
    "draws.h5": Format(_draws, _read_draws),
    "mesh.obj": _mesh(".obj"),
    "mesh.ply": _mesh(".ply"),
    "polygons.ply": Format(_polygons, _read_polygons),
    "mesh.off": _mesh(".off"),
    "mesh.stl": _mesh(".stl"),
    "mesh.glb": _mesh(".glb"),
    "openpose.json": Format(_people, _read_people),
    "coco.json": Format(_annotations, _read_annotations),
    "mediapipe.json": Format(_mediapipe, _read_mediapipe),
    "cameras.json": Format(_calibration, _cameras("cameras.json")),
    "cameras.toml": Format(_tables, _cameras("cameras.toml")),
    "motion-files": Format(_motions, _read_motions),
    "marker-files": Format(_markers, _read_markers),
}
