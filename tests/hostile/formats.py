"""Every kind of file that the workbench reads: how small valid ones are made, and who reads them.

A reader either raises a WorkbenchError or returns something sound: what a caller may rely on
without looking, above all finite numbers of the shapes that belong together. A new kind of file is
one more entry of `FORMATS`.
"""

import json
import pickle
from collections.abc import Callable
from dataclasses import dataclass, fields, is_dataclass, replace
from functools import cache
from importlib.resources import files
from pathlib import Path
from shutil import copyfile
from tempfile import TemporaryDirectory
from typing import Any

import casadi as cs
import numpy as np
from scipy.sparse import csr_array, issparse

from builder.ground_truth import GroundTruth, read_ground_truth
from builder.recordings import read_recording
from tests.bodies.model_files import MODELS, written
from tests.bodies.random_bodies import decorated, entries
from tests.fitting.mediapipe_made import mediapipe_results
from tests.fitting.test_cameras import CALIBRATIONS, colmap, put, stored
from tests.fitting.test_detector_files import READ
from tests.geometry.mesh_files import skinned
from tests.hostile.limits import Answer, Reader
from tests.motions.made_files import MARKER_FILES, MOTION_FILES
from tests.motions.made_results import RESULTS, truth
from workbench import Block, Problem, Residual, load_body, save_body, solve
from workbench.bodies import check_body_file, pose_space, shape_space
from workbench.bodies.catalogue import load_skinned, read_embedded
from workbench.bodies.files.joint_names import joint_names
from workbench.bodies.skinned import Landmarks
from workbench.bodies.triangles import TriangleBody, blend_scape
from workbench.comparison.ends import EndAnalysis
from workbench.comparison.record import KINDS, ROW, Description, ObservedRun, Record, RunEnding
from workbench.comparison.store import FolderStore
from workbench.errors import BadFile
from workbench.fitting.files.cameras import read_calibration
from workbench.fitting.files.keypoints import read_observations
from workbench.fitting.marker_files import read_markers
from workbench.fitting.scans.files import read_scan
from workbench.geometry.meshes import read_mesh, write_mesh
from workbench.motions import SoftTissue, load_tissue, read_motion, save_tissue
from workbench.priors.poses import read_pose_gaussian, read_pose_mixture
from workbench.sampling.checkpoint import SavedEnsemble, load, save
from workbench.solvers import Solution
from workbench.training.checkpoint import TrainingCheckpoint, read_checkpoint
from workbench.training.estimate import Estimate
from workbench.training.execution import LogEntry
from workbench.training.first_guess import Start, read_start, write_start
from workbench.training.folder import open_folder

Make = Callable[[Path], object]


def finite(found: object) -> None:
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


@dataclass(frozen=True)
class Format:
    """Files in a folder, and what is done with them; one of them is changed at a time.

    `make` writes valid ones, `read` is what is tried, and `sound` asserts what a caller relies on.
    """

    make: Make
    read: Callable[[Path], Any]
    sound: Callable[[Any], None] = finite
    megabytes: float = 1000.0  # the most that reading may take

    def check(self, folder: Path) -> None:
        """Read a folder soundly, or raise."""
        self.sound(self.read(folder))


@cache
def whole(name: str) -> dict[str, bytes]:
    """The valid files of a format, by their names below its folder."""
    with TemporaryDirectory() as folder:
        FORMATS[name].make(Path(folder))
        paths = sorted(path for path in Path(folder).rglob("*") if path.is_file())
        return {path.relative_to(folder).as_posix(): path.read_bytes() for path in paths}


def ask(
    reader: Reader, name: str, folder: Path, file: str | None = None, content: bytes = b""
) -> Answer:
    """What becomes of a format's valid files in a folder if one of them has another content."""
    for other, kept in whole(name).items():
        path = folder / other
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content if other == file else kept)
    return reader.ask(name, folder, megabytes=FORMATS[name].megabytes)


# ---- bodies ------------------------------------------------------------------------------------


def _npz_body(folder: Path) -> None:
    save_body(decorated(load_body("small")), folder / "body.npz")


def _raw_npz_body(folder: Path) -> None:
    np.savez(folder / "SMPL.npz", **entries(N=30, K=6, B=3))


def _pkl_body(folder: Path) -> None:
    with (folder / "SMPL.pkl").open("wb") as file:
        pickle.dump(entries(N=30, K=6, B=3), file, protocol=2)


def _body(make: Make, name: str, megabytes: float = 1000.0) -> Format:
    def sound(body: Any) -> None:
        finite([body.template, body.shapedirs, body.posedirs, body.weights])
        pose, betas = np.zeros((body.n_joints, 3)), np.zeros(body.n_betas)
        finite(body.vertices(pose, betas, np.zeros(3)))

    return Format(make, lambda folder: load_body(folder / name), sound, megabytes)


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


def _sound_triangles(body: Any) -> None:
    assert isinstance(body, TriangleBody), "a body of another kind"
    finite([body.weights, body.J_regressor, *(m.regressor for m in body.landmarks.values())])
    finite([body.template, body.shapedirs, body.posedirs])
    assert 0 <= body.faces.min() <= body.faces.max() < body.n_vertices
    finite([array for array in body.extras.values() if array.dtype.kind != "f"])


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


# ---- runs and comparisons ----------------------------------------------------------------------


@cache
def _solution() -> Solution:
    x, y = Block("x", (3,), "m"), Block("y", (1,), "1")
    residual = Residual("r", cs.vertcat(x.symbol - 1, y.symbol * x.symbol[0] - 2), sigma=1.0)
    return solve(Problem([residual], free=("x", "y")), {"x": np.zeros(3), "y": np.ones(1)})


def _record() -> Record:
    trace = np.arange(2.0 * ROW).reshape(2, ROW)[::-1]  # the cost, last, falls
    seen = ObservedRun((3,) * len(KINDS), (0.1,) * len(KINDS), 0, 0.2, np.ones(2), trace)
    told = ("lm", "rosenbrock", RunEnding.RETURNED, "done", seen, "a machine", "CONVERGED")
    return Record(*told, 0.5, 0.5, 1e-9, 8.0, end=np.ones(2))


def _description() -> Description:
    return Description("p", 3, 2, True, 1.0, np.nan, "", "which?")


def _judgement() -> EndAnalysis:
    return EndAnalysis((0, 1, 0), (1.0, 2.0), (0.0, 1e-9), (False, True), np.eye(2))


STORED: dict[str, tuple[Callable[[], Any], Any]] = {
    "record": (_record, Record),
    "description": (_description, Description),
    "judgement": (_judgement, EndAnalysis),
}


def _write_store(folder: Path) -> None:
    for key, (make, _) in STORED.items():
        FolderStore(folder / "comparison").put(key, make().stored())


def _read_store(folder: Path) -> list[Any]:
    """Whatever is not whole counts as none."""
    found = [
        FolderStore(folder / "comparison").get(key, kind.of) for key, (_, kind) in STORED.items()
    ]
    if any(one is None for one in found):
        raise BadFile(f"a {', '.join(STORED)} in {folder} counts as none")
    return found


DRAWN = {"entries": ["x", "y"], "ensembles": 2, "walkers": 4, "steps": 5, "thin": 1, "seed": 1}


def _draws(folder: Path) -> None:
    rng = np.random.default_rng(2)
    state = np.random.RandomState(3).get_state()
    chain, log_prob = rng.normal(size=(5, 4, 2)), rng.normal(size=(5, 4))
    save(folder / "draws.npz", [SavedEnsemble(chain, log_prob, np.ones(4), state)] * 2, DRAWN)


# ---- training ----------------------------------------------------------------------------------


@cache
def estimate() -> Estimate:
    """Two people in three poses, of eight vertices and three joints."""
    rng = np.random.default_rng(0)
    S, J, N, K = 2, 3, 8, 3
    return Estimate(
        templates=rng.normal(size=(S, N, 3)),
        joints=rng.normal(size=(S, K, 3)),
        posedirs=rng.normal(size=(N, 3, 9 * (K - 1))),
        weights=np.full((N, K), 1 / K),
        poses=rng.normal(size=(J, K, 3)),
        parents=(-1, 0, 1),
        regressor=csr_array(np.full((K, N), 1 / N)),
    )


def _write_checkpoint(folder: Path) -> None:
    entry = LogEntry("poses", {"data": 2.0}, {"data": 1.0}, {"steps": 3.0}, 0.1)
    TrainingCheckpoint(estimate(), (entry,), "a fingerprint").save(folder)


def _read_checkpoint(folder: Path) -> object:
    return read_checkpoint(folder, "a fingerprint", estimate(), ("poses", "surfaces"))


def _sound_checkpoint(found: Any) -> None:
    assert found is not None
    for name, array in estimate().arrays().items():
        if name in found.estimate.arrays():  # the regressor is left out where nothing learns it
            assert found.estimate.arrays()[name].shape == array.shape
    for entry in found.log:
        finite((entry.before, entry.after, float(entry.seconds)))
        assert isinstance(entry.block, str)
    finite(found.estimate.arrays())


def _write_start(folder: Path) -> None:
    write_start(Start.of(load_body("small")), folder / "start.npz")


def _sound_start(start: Start) -> None:
    K, N = len(start.parents), len(start.template)
    assert start.template.shape == (N, 3)
    assert start.faces.shape[1:] == (3,)
    assert ((start.faces >= 0) & (start.faces < N)).all()
    assert len(start.joint_names) == K
    assert all(-1 <= parent < k for k, parent in enumerate(start.parents))
    finite(start.template)


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
    return found.rows, found.read(slice(0, len(found.rows)))


def _sound_registrations(found: Any) -> None:
    rows, batch = found
    assert batch.vertices.shape == (len(rows), load_body("small").n_vertices, 3)
    finite((batch.vertices, batch.confidence))


def _truth(folder: Path) -> None:
    rng = np.random.default_rng(7)
    rest, joints = rng.random((2, 5, 3)), rng.random((2, 3, 3))
    poses, trans, weights = rng.random((4, 3, 3)), rng.random((4, 3)), rng.random((5, 3))
    GroundTruth(rest, joints, np.array([0, 0, 1, 1]), poses, trans, weights).save(folder)


# ---- meshes and scans --------------------------------------------------------------------------


def _mesh(suffix: str) -> Format:
    def make(folder: Path) -> None:
        body = load_body("small")
        faces = body.faces[(body.faces < 60).all(axis=1)]
        write_mesh(folder / f"mesh{suffix}", body.template[:60], faces)

    return Format(make, lambda folder: vars(read_mesh(folder / f"mesh{suffix}")))


def _polygons(folder: Path) -> None:
    """Polygons of three to five corners in both orders of bytes, and a flag for each."""
    V = load_body("small").template[:30].astype(np.float32)
    for order, kind in (("<", "binary_little_endian"), (">", "binary_big_endian")):
        head = f"ply\nformat {kind} 1.0\nelement vertex {len(V)}\nproperty float x\n"
        head += "property float y\nproperty float z\nelement face 20\nproperty uchar flag\n"
        head += "property list uchar int vertex_indices\nend_header\n"
        faces = b""
        for i in range(20):
            corners = np.arange(i, i + 3 + i % 3).astype(f"{order}i4")
            faces += bytes([i, len(corners)]) + corners.tobytes()
        content = head.encode() + V.astype(f"{order}f4").tobytes() + faces
        (folder / f"{kind}.ply").write_bytes(content)


def _read_polygons(folder: Path) -> object:
    return [vars(read_mesh(path)) for path in sorted(folder.glob("*.ply"))]


def cloud(form: str) -> bytes:
    """A .pcd of 369 points in "ascii", "binary" or "binary_compressed"."""
    points = load_body("small").template.astype("<f4")
    header = f"""FIELDS x y z
SIZE 4 4 4
TYPE F F F
COUNT 1 1 1
WIDTH {len(points)}
HEIGHT 1
VIEWPOINT 0 0 3 1 0 0 0
POINTS {len(points)}
DATA {form}
""".encode()
    if form == "ascii":
        return header + "".join(f"{x:g} {y:g} {z:g}\n" for x, y, z in points.tolist()).encode()
    if form == "binary":
        return header + points.tobytes()
    content = points.T.tobytes()  # field after field, packed by LZF without any repetition
    pieces = [content[i : i + 32] for i in range(0, len(content), 32)]
    packed = b"".join(bytes([len(piece) - 1]) + piece for piece in pieces)
    return header + np.array([len(packed), len(content)], "<u4").tobytes() + packed


def _scans(folder: Path) -> None:
    """In the formats that no mesh is read from."""
    body = load_body("small")
    for form in ("ascii", "binary", "binary_compressed"):
        (folder / f"{form}.pcd").write_bytes(cloud(form))
    np.save(folder / "scan.npy", body.template)
    np.savez(folder / "scan.npz", points=body.template, faces=body.faces)
    for name, separator in (("scan.xyz", " "), ("scan.csv", ",")):
        rows = (separator.join(map(repr, row)) for row in body.template.tolist())
        (folder / name).write_text("\n".join(rows))


def _read_scans(folder: Path) -> object:
    return [
        (scan.points, scan.normals, scan.weights)
        for path in sorted(folder.iterdir())
        for scan in [read_scan(path).scan]
    ]


# ---- keypoints and cameras ---------------------------------------------------------------------


def _people(folder: Path) -> None:
    rng = np.random.default_rng(4)
    flat = np.column_stack([rng.uniform(100, 900, (25, 2)), rng.uniform(0.2, 1, 25)]).ravel()
    hand = np.column_stack([rng.uniform(100, 900, (21, 2)), rng.uniform(0.2, 1, 21)]).ravel()
    person = {"person_id": [-1], "pose_keypoints_2d": flat.tolist(), "face_keypoints_2d": []}
    person |= {"hand_left_keypoints_2d": hand.tolist()}
    (folder / "people.json").write_text(json.dumps({"version": 1.3, "people": [person] * 2}))


def _annotations(folder: Path) -> None:
    rng = np.random.default_rng(5)
    flat = np.column_stack([rng.uniform(100, 900, (17, 2)), np.full(17, 2.0)]).ravel()
    said = {
        "images": [{"id": 7, "width": 1000, "height": 800, "file_name": "a.jpg"}],
        "annotations": [{"id": 1, "image_id": 7, "keypoints": flat.tolist(), "num_keypoints": 17}],
    }
    (folder / "coco.json").write_text(json.dumps(said))


def _mediapipe(folder: Path) -> None:
    for name, said in mediapipe_results().items():
        (folder / f"{name}.json").write_text(json.dumps(said))


def _observations(size: tuple[int, int] | None) -> Callable[[Path], object]:
    def read(folder: Path) -> object:
        paths = sorted(folder.glob("*.json"))
        return [vars(read_observations([path], size=size)) for path in paths]

    return read


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


def _published(folder: Path) -> None:
    """One for each way in which points, people and names are written."""
    known = ("MMPose with names", "Ultralytics 8.3", "EasyMocap", "DWPose in ComfyUI", "PoseNet")
    known += ("easy_ViTPose", "ViTPose of transformers", "objects by name", "numbers of 25")
    for i, name in enumerate(known):
        (folder / f"{i}.json").write_text(json.dumps(READ[name][1]))


def _calibrations(folder: Path) -> None:
    """One of each form in a folder of its own."""
    known = ("CMU Panoptic", "EasyMocap", "T of 4 x 4", "NeRF's transforms", "intrinsics apart")
    made = [CALIBRATIONS[name] for name in known]
    made += [colmap(), {"s.yml": stored(two=True)}, {"s.xml": stored(two=False, form="xml")}]
    for i, one in enumerate(made):
        (folder / str(i)).mkdir()
        put(folder / str(i), one)


def _read_calibrations(folder: Path) -> object:
    return [read_calibration(sorted(one.iterdir())[0]) for one in sorted(folder.iterdir())]


# ---- motions, markers, and what was learned from them ------------------------------------------


def _motions(folder: Path) -> None:
    for name, make in MOTION_FILES.items():
        make(folder / name)


RESULT_FILES = {  # of estimators, one for each way to write them
    **{"wham.joblib": "WHAM", "pare.joblib": "PARE", "tram.npy": "TRAM", "gvhmr.pt": "GVHMR"},
    **{"romp.npz": "ROMP", "3dpw.pkl": "3DPW", "fit3d.json": "Fit3D", "a.smpl": "smplcodec"},
    **{"motion-x.npy": "Motion-X", "named.npz": "smplx"},
}


def _result(name: str) -> Format:
    make = RESULTS[RESULT_FILES[name]][1]
    return Format(
        lambda folder: make(folder / name, truth()),
        lambda folder: [read_motion(folder / name)],
        _sound_motions,
    )


def _sound_motions(found: list[Any]) -> None:
    for motion in found:
        assert len(motion) == len(motion.pose) == len(motion.trans) > 0
        assert len(motion.joint_names) == motion.pose.shape[1]
        finite((motion.pose, motion.trans, motion.betas, motion.fps))
        if len(motion) < 10_000:
            finite(motion.resampled(motion.fps / 2).pose)
        if motion.bones is not None:
            finite(motion.joints())


def _markers(folder: Path) -> None:
    for name, make in MARKER_FILES.items():
        make(folder / name)


def _labels(folder: Path) -> None:
    MARKER_FILES["walk.trc"](folder / "walk.trc")
    (folder / "labels.csv").write_text("label,marker\nLFHD,ARIEL\nC7,\n\nLHEE,HEEL\n")


def _skinned(folder: Path) -> None:
    (folder / "mesh.glb").write_bytes(skinned()[0])


def _sound_markers(found: list[Any]) -> None:
    for recording in found:
        T, M, _ = recording.markers.shape
        assert T > 0
        assert len({*recording.labels}) == M
        assert recording.fps is None or 0 < recording.fps < 1e6
        finite(recording.markers[~np.isnan(recording.markers)])


def _tissue(folder: Path) -> None:
    rng = np.random.default_rng(3)
    directions, response = rng.random((5, 3, 2)), rng.random((2, 22))
    first, second, part = np.diag([0.5, 0.6]), np.zeros((2, 2)), np.array([0, 0, -1, -1, 0])
    tissue = SoftTissue(directions, first, second, response, part, 60.0, ("root", "tip"))
    save_tissue(folder / "tissue.npz", tissue)


PRIORS: dict[str, Callable[[Path], object]] = {
    "cmu_gaussian.npz": read_pose_gaussian,
    "cmu_mixture.npz": read_pose_mixture,
}


def _priors(folder: Path) -> None:
    for name in PRIORS:
        copyfile(str(files("workbench") / "data" / "poses" / name), folder / name)


def _poses(folder: Path) -> None:
    np.savez(
        folder / "mocap.npz",
        poses=np.zeros((4, 72)),
        ok=np.ones(4, bool),
        clip=np.zeros(4, np.uint8),
        clip_name=np.array(["walk"]),
        joint_names=np.array(joint_names(24)),
    )


FORMATS: dict[str, Format] = {
    "body.npz": _body(_npz_body, "body.npz"),
    "SMPL.npz": _body(_raw_npz_body, "SMPL.npz"),
    "SMPL.pkl": _body(_pkl_body, "SMPL.pkl", megabytes=500.0),
    "triangles.npz": Format(
        _triangle_body, lambda folder: load_body(folder / "triangles.npz"), _sound_triangles
    ),
    "model-files": Format(_models, _read_models),
    "embedded.npz": Format(
        _embedded, lambda folder: vars(read_embedded(folder / "small.npz"))["template"]
    ),
    "solution.npz": Format(
        lambda folder: _solution().save(folder / "fit.npz"),
        lambda folder: vars(Solution.load(folder / "fit.npz"))["values"],
    ),
    "comparison": Format(_write_store, _read_store, lambda found: finite(found[0].end)),
    "draws.npz": Format(
        _draws, lambda folder: [vars(one)["chain"] for one in load(folder / "draws.npz", DRAWN)]
    ),
    "training-checkpoint": Format(_write_checkpoint, _read_checkpoint, _sound_checkpoint),
    "training-start": Format(
        _write_start, lambda folder: read_start(folder / "start.npz"), _sound_start
    ),
    "training-folder": Format(_registrations, _read_registrations, _sound_registrations),
    "truth.npz": Format(_truth, read_ground_truth),
    "mesh.obj": _mesh(".obj"),
    "mesh.ply": _mesh(".ply"),
    "mesh.off": _mesh(".off"),
    "mesh.stl": _mesh(".stl"),
    "mesh.glb": _mesh(".glb"),
    "skinned.glb": Format(_skinned, lambda folder: vars(read_mesh(folder / "mesh.glb"))),
    "polygons.ply": Format(_polygons, _read_polygons),
    "scan-files": Format(_scans, _read_scans),
    "openpose.json": Format(_people, _observations((1000, 1000))),
    "coco.json": Format(_annotations, _observations(None)),
    "mediapipe.json": Format(_mediapipe, _observations((640, 480))),
    "keypoint-files": Format(_published, _observations((640, 480))),
    "cameras.json": Format(_calibration, lambda folder: read_calibration(folder / "cameras.json")),
    "cameras.toml": Format(_tables, lambda folder: read_calibration(folder / "cameras.toml")),
    "calibration-files": Format(_calibrations, _read_calibrations),
    "motion-files": Format(
        _motions,
        lambda folder: [read_motion(folder / name) for name in MOTION_FILES],
        _sound_motions,
    ),
    **{name: _result(name) for name in RESULT_FILES},
    "labels.csv": Format(
        _labels,
        lambda folder: [read_markers(folder / "walk.trc", labels=folder / "labels.csv")],
        _sound_markers,
    ),
    "marker-files": Format(
        _markers,
        lambda folder: [read_markers(folder / name) for name in MARKER_FILES],
        _sound_markers,
    ),
    "soft-tissue": Format(_tissue, lambda folder: load_tissue(folder / "tissue.npz")),
    "pose-priors": Format(
        _priors, lambda folder: [read(folder / name) for name, read in PRIORS.items()]
    ),
    "mocap.npz": Format(_poses, lambda folder: read_recording(folder / "mocap.npz")),
}
