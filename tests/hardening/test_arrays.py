"""Every reader of arrays refuses what is damaged, in one sentence that names the file."""

import warnings
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, replace
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.sparse import csr_array

from tests.bodies.random_bodies import entries
from tests.comparison.made_up import record
from tests.hardening.archives import DAMAGES, OTHERS, arrays_in, with_arrays, with_facts
from workbench.blocks import Block
from workbench.bodies import Landmarks
from workbench.bodies.catalogue import load_body
from workbench.bodies.files.embedded import read_embedded
from workbench.bodies.files.joint_names import joint_names
from workbench.bodies.files.saving import save_body
from workbench.bodies.files.smpl_layout import body_from
from workbench.comparison.description import PROBES, Description
from workbench.comparison.end_analysis import EndAnalysis
from workbench.comparison.explanation import Component, Explanation
from workbench.comparison.record import Record
from workbench.comparison.store import Folder
from workbench.errors import WorkbenchError
from workbench.motions import SoftTissue, load_tissue, save_tissue
from workbench.priors.mocap import read_mocap
from workbench.priors.poses import read_pose_gaussian, read_pose_mixture
from workbench.priors.tailed_poses import read_pose_student
from workbench.problem import Problem
from workbench.residuals import gaussian
from workbench.solvers import Solution, solve
from workbench.synthetic.ground_truth import FILE as TRUTH
from workbench.synthetic.ground_truth import GroundTruth, read_ground_truth
from workbench.synthetic.made_up import jointed_tube
from workbench.training.checkpoint import Checkpoint, read_checkpoint
from workbench.training.estimate import Estimate
from workbench.training.first_guess import read_start, write_start
from workbench.training.folder import FolderRegistrations, Row
from workbench.training.progress import LogEntry

START = jointed_tube(7, 5)
N, K = len(START.template), len(START.parents)
rng = np.random.default_rng(3)
POSES = files("workbench") / "data" / "poses"
BODIES = files("workbench") / "data" / "bodies"
SHARES = rng.dirichlet(np.ones(K), size=N)
ESTIMATE = Estimate(
    rng.random((2, N, 3)),
    rng.random((2, K, 3)),
    rng.random((N, 3, 9 * (K - 1))),
    SHARES,
    rng.random((4, K, 3)),
    START.parents,
    csr_array(SHARES.T / SHARES.sum(axis=0)[:, None]),
)
TISSUE = SoftTissue(
    rng.random((5, 3, 2)),
    np.diag([0.5, 0.6]),
    np.zeros((2, 2)),
    rng.random((2, 22)),
    np.array([0, 0, -1, -1, 0]),
    60.0,
    ("root", "tip"),
)
BLOCKS = ("rest", "poses", "weights")
COSTS = {"E_D": 3.0, "E_Y": 0.5}
CHECKPOINT = Checkpoint(
    ESTIMATE,
    (LogEntry("rest", COSTS, COSTS, {"kkt": 1e-9}, 0.5), LogEntry("poses", COSTS, COSTS, {}, 1.0)),
    "mark",
)
DESCRIPTION = Description(
    "p",
    3,
    2,
    True,
    np.zeros(2),
    1.0,
    np.ones(len(PROBES)),
    {"residual": 1e-5, "gradient": 1e-5, "jacobian": 1e-5},
    np.nan,
    "",
    False,
    "which?",
)
JUDGEMENT = EndAnalysis(
    (0, 1, 0),
    (1.0, 2.0),
    (0.0, 1e-9),
    (0.5, -0.1),
    (0, 0, 1),
    (0, 2, 0),
    np.eye(2),
    {1: Explanation(2.0, 1.0, 3.0, 0.5, (Component("a twist", 1.0, 0.1),), "the rest", 0.0)},
)


@dataclass(frozen=True)
class Reader:
    """How a good file is written, and how any file in its place is read."""

    file: str
    write: Callable[[Path], object]
    read: Callable[[Path], object]
    facts: str = ""  # the array that holds JSON


def saved_body(path: Path) -> None:
    body = body_from(entries(N=12, K=4), "b", "b")
    few = Landmarks(("a", "b"), csr_array(np.eye(2, 12)))
    save_body(replace(body, landmarks={"few": few}, card={"name": "b"}), path)


def solved() -> Solution:
    block = Block("x", (2, 3))
    problem = Problem((gaussian(block.symbol, mean=1.0),), (block.name,))
    return solve(problem, {"x": np.zeros((2, 3))})


def recorded(path: Path) -> None:
    np.savez(
        path,
        poses=np.zeros((4, 72)),
        ok=np.ones(4, bool),
        clip=np.zeros(4, np.uint8),
        clip_name=np.array(["walk"]),
        joint_names=np.array(joint_names(24)),
    )


def copied(name: str) -> Callable[[Path], object]:
    folder = BODIES if name == "small.npz" else POSES
    return lambda path: path.write_bytes((folder / name).read_bytes())


def stored(of: Any, thing: Any) -> Reader:
    def write(path: Path) -> None:
        Folder(path.parents[1]).put("key", thing.stored())

    def read(path: Path) -> object:
        found = Folder(path.parents[1]).get("key", of)
        if found is None:
            raise WorkbenchError(f"{path} counts as none")
        return found

    return Reader("runs/key.npz", write, read, "facts")


def one_registration(path: Path) -> object:
    rows = (Row(path.name, "somebody"),)
    return FolderRegistrations(path.parent, rows, N, START.faces).read(slice(0, 1))


READERS = {
    "body": Reader("body.npz", saved_body, load_body),
    "embedded body": Reader("small.npz", copied("small.npz"), read_embedded, "card"),
    "solution": Reader("run.npz", solved().save, Solution.load, "solution"),
    "record": stored(Record.of, record("p", "s", [3.0, 2.0, 1.0])),
    "description": stored(Description.of, DESCRIPTION),
    "judgement": stored(EndAnalysis.of, JUDGEMENT),
    "checkpoint": Reader(
        "checkpoint.npz",
        lambda path: CHECKPOINT.save(path.parent),
        lambda path: read_checkpoint(path.parent, "mark", ESTIMATE, BLOCKS),
        "facts",
    ),
    "start": Reader("start.npz", lambda path: write_start(START, path), read_start),
    "registration": Reader(
        "one.npz",
        lambda path: np.savez(
            path, vertices=START.template, confidence=np.ones(N), faces=START.faces
        ),
        one_registration,
    ),
    "truth": Reader(
        TRUTH,
        lambda path: GroundTruth(
            rng.random((2, 5, 3)),
            rng.random((2, 3, 3)),
            np.array([0, 0, 1, 1]),
            rng.random((4, 3, 3)),
            rng.random((4, 3)),
            rng.random((5, 3)),
        ).save(path.parent),
        lambda path: read_ground_truth(path.parent),
    ),
    "soft tissue": Reader("tissue.npz", lambda path: save_tissue(path, TISSUE), load_tissue),
    "pose prior": Reader("prior.npz", copied("cmu_gaussian.npz"), read_pose_gaussian),
    "mixture": Reader("mixture.npz", copied("cmu_mixture.npz"), read_pose_mixture),
    "prior with tails": Reader("tails.npz", copied("cmu_student.npz"), read_pose_student),
    "recording": Reader("mocap.npz", recorded, read_mocap),
}
EACH_READER = pytest.mark.parametrize("name", READERS)


@pytest.fixture(autouse=True)
def numpy_may_warn_of_python_2() -> Iterator[None]:
    """Its parser of headers does, and a reader need not."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Reading `.npy` or `.npz` file required additional")
        yield


def written(reader: Reader, folder: Path) -> Path:
    path = folder / reader.file
    reader.write(path)
    return path


def refused(reader: Reader, path: Path, damaged: bytes, *says: str) -> None:
    """It is refused in one sentence, of a length that can be read, which names the file."""
    path.write_bytes(damaged)
    with pytest.raises(WorkbenchError) as caught:
        reader.read(path)
    told = str(caught.value)
    assert path.name in told or path.stem in told
    assert len(told) < 1500
    assert "\n" not in told or reader is READERS["registration"]
    for text in says:
        assert text in told


@EACH_READER
def test_the_undamaged_file_is_read(name: str, tmp_path: Path) -> None:
    """So what is refused below is refused for the damage."""
    reader = READERS[name]
    path = written(reader, tmp_path)
    assert reader.read(path) is not None
    whole = path.read_bytes()
    path.write_bytes(with_arrays(whole, {}))  # packed anew
    assert reader.read(path) is not None


@pytest.mark.parametrize("damage", DAMAGES)
@EACH_READER
def test_a_damaged_archive_is_refused(name: str, damage: str, tmp_path: Path) -> None:
    reader = READERS[name]
    path = written(reader, tmp_path)
    damaged = DAMAGES[damage](path.read_bytes())
    assert damaged != path.read_bytes()
    refused(reader, path, damaged)


ARRAYS = {  # the arrays of numbers of each reader whose file says nothing but what it must
    "embedded body": (
        "template",
        "shapedirs",
        "posedirs_step",
        "weight_shares",
        "coco_rows",
        "J_regressor_columns",
        "faces",
        "mirror",
        "parents",
    ),
    "solution": ("value:x", "trace:x"),
    "record": ("best", "trace"),
    "description": ("start",),
    "judgement": ("points",),
    "checkpoint": ("templates", "joints", "posedirs", "weights", "poses", "regressor"),
    "start": ("template", "faces", "parents", "segmentation"),
    "registration": ("vertices", "confidence", "faces"),
    "truth": ("rest", "joints", "subject", "poses", "trans", "weights"),
    "soft tissue": ("directions", "first", "second", "response", "part"),
    "pose prior": ("mean", "covariance", "n_frames"),
    "mixture": ("shares", "means", "covariances"),
    "prior with tails": ("mean", "scale", "dof"),
    "recording": ("poses", "clip"),
}
OPTIONAL = {("checkpoint", "regressor"), ("registration", "confidence"), ("registration", "faces")}
NAMED = ("complex", "truth values", "dates", "columns", "bytes", "half precision", "long double")
EACH_ARRAY = pytest.mark.parametrize(
    ("name", "array"), [(name, array) for name, arrays in ARRAYS.items() for array in arrays]
)


@EACH_ARRAY
def test_another_array_in_its_place_is_refused(name: str, array: str, tmp_path: Path) -> None:
    reader = READERS[name]
    path = written(reader, tmp_path)
    whole = path.read_bytes()
    there = arrays_in(whole)[array]
    for other, change in OTHERS.items():
        if other == "missing" and (name, array) in OPTIONAL:
            continue
        if (name, array) == ("record", "best") and other in ("NaN", "infinite"):
            continue  # where a cost is finite at such a point, that is what was seen
        if (name, array, other) == ("judgement", "points", "flat, and of another size"):
            continue  # a judgement knows how many basins there are, and not how many unknowns
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)  # of numbers too large for a half
            damaged = with_arrays(whole, {array: change(there)})
        told = other in NAMED and not reader.file.startswith("runs")
        refused(reader, path, damaged, *((array,) if told else ()))


KEPT = [(n, a) for n in ("solution", "checkpoint") for a in ARRAYS[n]]


@pytest.mark.parametrize(("name", "array"), KEPT)
def test_single_precision_is_not_what_was_saved(name: str, array: str, tmp_path: Path) -> None:
    reader = READERS[name]
    path = written(reader, tmp_path)
    single = arrays_in(path.read_bytes())[array].astype(np.float32)
    refused(reader, path, with_arrays(path.read_bytes(), {array: single}), array, "float64")


@pytest.mark.parametrize("name", ["solution", "checkpoint"])
def test_an_array_that_was_never_saved_is_refused(name: str, tmp_path: Path) -> None:
    reader = READERS[name]
    path = written(reader, tmp_path)
    further = with_arrays(path.read_bytes(), {"further": np.zeros(3)})
    refused(reader, path, further, "further")


NO_NUMBERS = (None, True, "1.0", [], {}, [1.0], -(10**400))
NO_TEXTS = (None, True, 5, [], {})
NO_COUNTS = (None, True, "3", 2.5, -1, 2**70, [])
WRONG = {
    "solution": {
        "cost": (*NO_NUMBERS, -1.0),
        "optimality": NO_NUMBERS,
        "seconds": (*NO_NUMBERS, -1.0),
        "missed": NO_NUMBERS,
        "status": (*NO_TEXTS, "GREAT", "converged"),
        "message": NO_TEXTS,
        "solver": NO_TEXTS,
        "lost": ("a", [5], None),
        "unnoticed": (5, [None], {"a": 1}),
        "evaluations": (None, [], 5, {}, {"residual": -1}, {"guesses": 1}),
        "trace": (None, "rows", {}, [], [[]], [None], [[1.0] * 6], [[1.0] * 8]),
    },
    "record": {
        "cost": NO_NUMBERS,
        "optimality": NO_NUMBERS,
        "digits": NO_NUMBERS,
        "seconds": NO_NUMBERS,
        "claimed_cost": NO_NUMBERS,
        "solver": NO_TEXTS,
        "instance": NO_TEXTS,
        "claim": NO_TEXTS,
        "message": NO_TEXTS,
        "machine": NO_TEXTS,
        "ending": (*NO_TEXTS, "HAPPY"),
        "inside": (None, 1, "true"),
        "taken": (None, 0, "false"),
        "not_finite": NO_COUNTS,
        "counts": (None, [], [1, 2], ["1"] * 7, [1.5] * 7),
        "spent": (None, [], [None] * 7),
    },
    "description": {
        "rows": NO_COUNTS,
        "unknowns": (*NO_COUNTS, 5),
        "bounded": (None, 1),
        "start_cost": NO_NUMBERS,
        "seconds": (None, {}, {"jacobian": "1"}, {"jacobian": 1.0}),
        "known_cost": NO_NUMBERS,
        "known_source": NO_TEXTS,
        "certified": (0, None),
        "question": NO_TEXTS,
        "instance": NO_TEXTS,
    },
    "judgement": {
        "where": (None, [0.5], [5], ["0"]),
        "costs": (None, [], ["1", "2"], [1.0]),
        "optimality": (None, [1.0]),
        "message": NO_TEXTS,
        "explanations": (None, [], {"5": {}}, {"1": {}}, {"1": None}, {"one": {}}),
    },
    "checkpoint": {
        "fingerprint": (*NO_TEXTS, "another's"),
        "parents": (None, [], [0, 1], "parents"),
        "log": (None, {}, "log", [None], [{}], [5], [asdict(CHECKPOINT.log[1])]),
    },
}


@pytest.mark.parametrize(("name", "key"), [(n, k) for n, keys in WRONG.items() for k in keys])
def test_a_fact_that_is_none_is_refused(name: str, key: str, tmp_path: Path) -> None:
    reader = READERS[name]
    path = written(reader, tmp_path)
    whole = path.read_bytes()
    for value in WRONG[name][key]:
        changed = with_facts(whole, reader.facts, lambda told, v=value: told | {key: v})
        refused(reader, path, changed)
    if key not in ("missed", "lost", "unnoticed"):  # which older files do not say
        less = with_facts(
            whole, reader.facts, lambda told: {k: v for k, v in told.items() if k != key}
        )
        refused(reader, path, less)


@pytest.mark.parametrize(
    ("at", "value"),
    [
        ("block", 5),
        ("before", {"E_D": "3"}),
        ("before", {"E_X": 3.0}),
        ("after", {"E_D": np.nan, "E_Y": 0.5}),
        ("after", None),
        ("facts", {"kkt": None}),
        ("facts", 3),
        ("seconds", "long"),
        ("seconds", -1.0),
        ("seconds", np.inf),
    ],
)
def test_an_entry_of_the_log_that_is_none_is_refused(
    at: str, value: object, tmp_path: Path
) -> None:
    reader = READERS["checkpoint"]
    path = written(reader, tmp_path)

    def change(told: Any) -> Any:
        told["log"][0][at] = value
        return told

    refused(reader, path, with_facts(path.read_bytes(), "facts", change), "log[0]")


TEXTS = {
    "no text": "",
    "no JSON": "cost: 1",
    "a list": "[1, 2]",
    "nothing": "null",
    "a number": "9" * 5000,
    "brackets that do not close": "[" * 100_000,
    "names in names": '{"a":' * 50_000 + "1" + "}" * 50_000,
    "no facts": "{}",
    "a letter that stands alone": '{"cost": "\\',
}


@pytest.mark.parametrize("text", TEXTS)
@pytest.mark.parametrize("name", [name for name, reader in READERS.items() if reader.facts])
def test_facts_that_are_no_facts_are_refused(name: str, text: str, tmp_path: Path) -> None:
    if (name, text) == ("embedded body", "no facts"):
        return  # a card may be empty
    reader = READERS[name]
    path = written(reader, tmp_path)
    refused(reader, path, with_arrays(path.read_bytes(), {reader.facts: np.array(TEXTS[text])}))


@pytest.mark.parametrize("given", [np.array(5.0), np.array(["a", "b"]), np.array(b"{}")])
@pytest.mark.parametrize("name", [name for name, reader in READERS.items() if reader.facts])
def test_facts_are_one_text(name: str, given: np.ndarray, tmp_path: Path) -> None:
    reader = READERS[name]
    path = written(reader, tmp_path)
    refused(reader, path, with_arrays(path.read_bytes(), {reader.facts: given}))


@EACH_READER
def test_what_is_no_file_is_refused_at_once(name: str, tmp_path: Path) -> None:
    """A pipe would be waited for."""
    reader = READERS[name]
    path = written(reader, tmp_path)
    path.unlink()
    path.mkdir()
    with pytest.raises(WorkbenchError, match=path.stem):
        reader.read(path)


CONTRADICTIONS = {
    "faces of vertices that are not there": {"faces": START.faces + N},
    "a face before the first vertex": {"faces": START.faces - 1},
    "no faces": {"faces": START.faces[:0]},
    "a vertex too few": {"template": START.template[1:]},
    "no vertices": {
        "template": START.template[:0],
        "segmentation": START.segmentation[:0],
    },
    "a parent after its child": {"parents": np.array(START.parents[::-1])},
    "two roots": {"parents": np.full(K, -1)},
    "a root with a parent": {"parents": np.array((0, *START.parents[1:]))},
    "a segment beyond the joints": {"segmentation": START.segmentation + 1},
    "a joint without a vertex": {"segmentation": np.zeros(N, dtype=np.int64)},
    "two joints of one name": {"joint_names": np.array(["root"] * K)},
    "a left joint without a right one": {
        "joint_names": np.array([*START.joint_names[1:], "left_3"]),
    },
    "names that are bytes": {"joint_names": np.array(START.joint_names, dtype="S")},
    "fewer names than joints": {"joint_names": np.array(START.joint_names[1:])},
}


@pytest.mark.parametrize("changed", CONTRADICTIONS)
def test_a_start_that_contradicts_itself_is_refused(changed: str, tmp_path: Path) -> None:
    reader = READERS["start"]
    path = written(reader, tmp_path)
    refused(
        reader,
        path,
        with_arrays(path.read_bytes(), CONTRADICTIONS[changed]),
        "is no start for training",
    )


SIZES = {
    "checkpoint": {
        "poses": ESTIMATE.poses[1:],
        "weights": 2 * ESTIMATE.weights,
        "joints": np.full((2, K, 3), 1e9),
        "regressor": -ESTIMATE.weights.T,
    },
    "start": {"template": 1e9 * START.template},
    "solution": {"value:x": np.zeros((3, 2)), "trace:x": np.zeros((1, 2, 3))},
    "record": {"trace": np.zeros((4, 3)), "best": np.zeros(5), "end": np.full(1, np.nan)},
    "description": {"start": np.zeros(3), "probes": np.zeros(2)},
    "judgement": {"points": np.float64(1.0)},
    "truth": {"subject": np.array([0, 0, 1, 2]), "weights": np.zeros((4, 3))},
    "embedded body": {
        "weight_joints": np.full((369, 4), 24, dtype=np.uint8),
        "weight_shares": np.zeros((369, 4), dtype=np.uint16),
        "coco_columns": np.full(183, 369, dtype=np.uint16),
        "faces": np.full((734, 3), 369, dtype=np.uint16),
        "J_regressor_shares": np.zeros(285, dtype=np.uint16),
    },
    "registration": {
        "vertices": 1e9 * START.template,
        "faces": START.faces[::-1, ::-1],
        "confidence": np.full(N, 2.0),
    },
    "recording": {"clip": np.full(4, 1, dtype=np.uint8), "joint_names": np.array(["a"] * 24)},
    "pose prior": {"covariance": np.zeros((3, 3))},
    "mixture": {"shares": -np.ones(8), "covariances": np.zeros((8, 3))},
}


@pytest.mark.parametrize(("name", "array"), [(n, a) for n, arrays in SIZES.items() for a in arrays])
def test_arrays_that_contradict_each_other_are_refused(
    name: str, array: str, tmp_path: Path
) -> None:
    reader = READERS[name]
    path = written(reader, tmp_path)
    refused(reader, path, with_arrays(path.read_bytes(), {array: SIZES[name][array]}))


BODIES_SPOILED: dict[str, tuple[dict[str, object], str]] = {
    "halves in place of faces": ({"f": np.full((80, 3), 0.5)}, "f must hold whole numbers"),
    "faces of half precision": (
        {"f": np.full((80, 3), np.inf, dtype=np.float16)},
        "f must hold whole numbers",
    ),
    "faces beyond float64": ({"f": np.full((80, 3), 1e300)}, "f must hold whole numbers"),
    "a template beyond float64": (
        {"v_template": np.full((12, 3), np.longdouble(10) ** 1000)},
        "is not finite",
    ),
    "weights of another size": ({"weights": np.ones((12, 3)) / 3}, "weights has shape"),
    "weights of no axes": ({"weights": np.float64(1)}, "weights has shape"),
    "complex weights": ({"weights": np.ones((12, 4), complex)}, "weights holds complex128"),
    "a regressor on its side": (
        {"J_regressor": np.ones((12, 4)) / 12},
        "J_regressor has shape",
    ),
    "a regressor with three axes": ({"J_regressor": np.ones((4, 12, 1))}, "J_regressor has"),
    "posedirs of dates": ({"posedirs": np.zeros((12, 3, 27), "M8[s]")}, "posedirs holds"),
    "a tree that is text": ({"kintree_table": np.full((2, 4), "0")}, "kintree_table holds"),
    "landmarks without numbers": ({"landmarks/few/data": None}, "landmarks/few"),
    "landmarks without rows": ({"landmarks/few/indptr": None}, "no landmarks/few/indptr"),
    "landmarks beyond the mesh": (
        {"landmarks/few/indices": np.array([0, 99])},
        "no sparse matrix",
    ),
    "landmarks of a huge matrix": (
        {"landmarks/few/shape": np.array([2**62, 2**62])},
        "no sparse matrix",
    ),
    "landmarks of a negative matrix": (
        {"landmarks/few/shape": np.array([-2, 12])},
        "no sparse matrix",
    ),
    "landmarks of three axes": ({"landmarks/few/shape": np.array([2, 2, 3])}, "no sparse"),
    "landmarks whose shape is a column": (
        {"landmarks/few/shape": np.array([[2], [12]])},
        "no sparse matrix",
    ),
    "landmarks in rows": ({"landmarks/few/data": np.ones((2, 2))}, "no sparse matrix"),
    "names that are numbers": ({"landmarks/few/names": np.arange(2)}, "list of names"),
    "a joint too many": ({"joint_names": np.array(list("abcde"))}, "names for 4 joints"),
    "a card that is a list": ({"card": np.array("[1]")}, "card is a list"),
    "a card of brackets": ({"card": np.array("[" * 100_000)}, "card is no JSON"),
    "a card that is cut off": ({"card": np.array('{"name": ')}, "card is no JSON"),
    "another way of skinning": ({"bs_style": np.array("x" * 10**6)}, "there is lbs, of SMPL"),
}


@pytest.mark.parametrize("name", BODIES_SPOILED)
def test_a_body_s_file_that_is_none_is_refused(name: str, tmp_path: Path) -> None:
    reader, (changed, says) = READERS["body"], BODIES_SPOILED[name]
    path = written(reader, tmp_path)
    refused(reader, path, with_arrays(path.read_bytes(), changed), says)


@pytest.mark.parametrize("left_out", [5, None, {"a": 1}, "text"])
def test_what_a_card_says_was_left_out_may_be_anything(left_out: object, tmp_path: Path) -> None:
    """A further sentence is added to it when a further entry is left out."""
    path = written(READERS["body"], tmp_path)
    card = with_facts(path.read_bytes(), "card", lambda told: told | {"left_out": left_out})
    path.write_bytes(with_arrays(card, {"odd": np.zeros(3, [("x", "f8")])}))
    said = load_body(path).card["left_out"]
    assert said[0] == left_out
    assert "odd" in said[-1]


def test_arrays_keep_their_order_in_memory(tmp_path: Path) -> None:
    """A run that goes on from a checkpoint sums in the same order as one that never stopped."""
    turned = replace(ESTIMATE, posedirs=np.asfortranarray(ESTIMATE.posedirs))
    replace(CHECKPOINT, estimate=turned).save(tmp_path)
    found = read_checkpoint(tmp_path, "mark", ESTIMATE, BLOCKS)
    assert found is not None
    assert found.estimate.posedirs.flags.f_contiguous
    assert found.estimate.templates.flags.c_contiguous
    np.testing.assert_array_equal(found.estimate.posedirs, ESTIMATE.posedirs)


def test_a_regressor_that_was_learned_is_there(tmp_path: Path) -> None:
    path = tmp_path / "checkpoint.npz"
    replace(CHECKPOINT, log=(LogEntry("regressor", COSTS, COSTS, {}, 0.5),)).save(tmp_path)
    assert read_checkpoint(tmp_path, "mark", ESTIMATE, ("regressor",)) is not None
    path.write_bytes(with_arrays(path.read_bytes(), {"regressor": None}))
    with pytest.raises(WorkbenchError, match="regressor missing"):
        read_checkpoint(tmp_path, "mark", ESTIMATE, ("regressor",))
