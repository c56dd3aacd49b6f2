"""JSON, TOML and typed arguments made to hang, to fill the memory or to paint on a terminal."""

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from builder.bodies import already_made
from builder.sets import SetRecipe
from tests.hostile.limits import READ, Reader
from workbench.comparison.store import FolderStore
from workbench.errors import BadFile
from workbench.reports.folder import SUMMARY, refuse_foreign, replacing_folder
from workbench.training.evaluation import CARD

KEYPOINTS = "workbench.fitting.files.keypoints:read_keypoints"
CAMERAS = "workbench.fitting.files.cameras:read_calibration"
DEEP = "[" * 200_000 + "]" * 200_000
DEEPISH = "[" * 900 + "]" * 900  # not too deep for JSON
LONG = "x" * 1_000_000
DIGITS = "9" * 5_000
BODY = str([100.0, 200.0, 0.9] * 17)
K = "[[800.0, 0, 320], [0, 800, 240], [0, 0, 1]]"
CAMERA = f'{{"K": {K}, "R": [0, 0, 0], "t": [0, 0, 3]}}'


def people(keypoints: str, beside: str = "") -> str:
    """OpenPose's JSON with one person."""
    return f'{{{beside}"people": [{{"pose_keypoints_2d": {keypoints}}}]}}'


def annotated(keypoints: str, beside: str = "", entries: str = "") -> str:
    """COCO's JSON with one person."""
    return f'{{{entries}"annotations": [{{{beside}"keypoints": {keypoints}}}]}}'


def sized(width: str) -> str:
    """The same in an image of that width."""
    images = f'"images": [{{"id": 1, "width": {width}, "height": 5}}], '
    return annotated(BODY, '"image_id": 1, ', images)


def toml(change: str = "", name: str = "a") -> str:
    """Pose2Sim's calibration of one camera, with lines before it."""
    rest = "rotation = [0.0, 0.0, 0.0]\ntranslation = [0.0, 0.0, 3.0]\n"
    return f"{change}\n[{name}]\nmatrix = {K}\n{rest}"


JSON: dict[str, Callable[[], str | bytes]] = {  # contents that no file in JSON may have
    "nothing": lambda: "",
    "bytes that are no UTF-8": lambda: b'{"people": "\xff\xfe"}',
    "cut off": lambda: people(BODY)[:-9],
    "lists in lists": lambda: DEEP,
    "a name that paints": lambda: '{"\\u001b[2J\\ud800": 0, "\\u001b[2J\\ud800": 0}',
}
FILES: dict[str, tuple[str, dict[str, Callable[[], str | bytes]]]] = {
    "keypoints.json": (
        KEYPOINTS,
        {
            **JSON,
            "deep keypoints": lambda: people(DEEPISH),
            "a long text as keypoints": lambda: people(json.dumps(LONG)),
            "an image of endless size": lambda: sized("1e999"),
            "an image of a size that none has": lambda: sized("1e300"),
        },
    ),
    "cameras.toml": (
        CAMERAS,
        {
            "nothing": lambda: "",
            "bytes that are no UTF-8": lambda: b"\xff\xfe",
            "two megabytes": lambda: "#" * 2_000_000,
            "lists in lists": lambda: "a = " + "[" * 200_000,
            "a key of 100,000 parts": lambda: "x = 1\na" + ".a" * 100_000 + " = 1",
            "a table of 100,000 parts": lambda: "[[" + "a." * 100_000 + "a]]",
            "a number of 5,000 digits": lambda: f"a = {DIGITS}",
            "infinity in a matrix": lambda: toml().replace("800.0", "inf"),
            "a long name": lambda: toml() + f'name = "{LONG}"',
            "a name that paints": lambda: toml(name='"\\u001b[2J"').replace("3.0]", "3.0, 1]"),
        },
    ),
    "cameras.json": (
        CAMERAS,
        {
            "two cameras of one name": lambda: f'{{"a": {CAMERA}, "a": {CAMERA}}}',
            "a long name": lambda: f'{{"{LONG}": 5}}',
            "a long text as a matrix": lambda: f'{{"a": {CAMERA.replace(K, json.dumps(LONG))}}}',
            "endless numbers": lambda: f'{{"a": {CAMERA.replace("800.0", "1e999")}}}',
        },
    ),
}


@pytest.mark.parametrize("file", FILES)
def test_hostile_texts_are_refused(reader: Reader, tmp_path: Path, file: str) -> None:
    read, contents = FILES[file]
    for make in contents.values():
        reader.refusal(read, written(tmp_path / file, make()))


def written(path: Path, content: str | bytes) -> Path:
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


VALID: dict[str, tuple[str, Callable[[], str | bytes]]] = {
    "mark of byte order.json": (KEYPOINTS, lambda: "\ufeff" + annotated(BODY)),
    "UTF-16.json": (KEYPOINTS, lambda: annotated(BODY).encode("utf-16")),
    "deep.json": (KEYPOINTS, lambda: annotated(BODY, f'"extra": {DEEPISH}, ')),
    "marked.toml": (CAMERAS, lambda: "\ufeff" + toml('# 0.1.2.3\n"v. 1.2" = "a.b"\nn = [1.5]')),
    "one camera.json": (CAMERAS, lambda: f'{{"a": {CAMERA}}}'),
}


def test_unusual_texts_are_read(reader: Reader, tmp_path: Path) -> None:
    for file, (read, make) in VALID.items():
        answer = reader.ask(read, written(tmp_path / file, make()))
        assert answer.outcome == READ, f"{file}: {answer.what}"


@pytest.mark.thorough
def test_devices_without_end_are_refused(reader: Reader) -> None:
    """/dev/zero says that it has no bytes, and gives them for ever."""
    for read in (KEYPOINTS, CAMERAS):
        assert "a pipe or a device" in reader.refusal(read, Path("/dev/zero"))


OTHERS = ("[]", "null", "5", '{"made_by": "me"}', '{"kind": ["comparison"]}', '{"a": 1, "a": 2}')
CONTENTS = [*(make() for name, make in JSON.items() if "million" not in name), *OTHERS]


def test_folders_of_others_are_not_overwritten(tmp_path: Path) -> None:
    """Whatever the file says that marks a folder of a report, a comparison or a set as ours."""
    (tmp_path / "train").mkdir()
    (tmp_path / "held_out").mkdir()
    for content in CONTENTS:
        with pytest.raises(BadFile, match="holds no comparison"):
            FolderStore(written(tmp_path / "comparison.json", content).parent)
        written(tmp_path / SUMMARY, content)
        with pytest.raises(BadFile, match="of a report, so it is not overwritten"):
            refuse_foreign(tmp_path)
        with pytest.raises(BadFile, match="is not overwritten"), replacing_folder(tmp_path):
            pass
        written(tmp_path / "train" / CARD, content)
        written(tmp_path / "held_out" / CARD, content)
        with pytest.raises(BadFile, match="were made otherwise"):
            already_made(tmp_path, SetRecipe(), None)


def test_summaries_take_away_only_files_that_they_name(tmp_path: Path) -> None:
    (tmp_path / "report").mkdir()
    (tmp_path / "report/mine.txt").write_text("kept")
    for files in (5, None, "index.html", [5, None, []], {"a": 1}, ["../other.txt"]):
        (tmp_path / "other.txt").write_text("kept")
        told = {"made_by": "workbench", "files": files}
        (tmp_path / "report" / SUMMARY).write_text(json.dumps(told))
        with replacing_folder(tmp_path / "report") as fresh:
            (fresh / SUMMARY).write_text("{}")
        assert (tmp_path / "report/mine.txt").read_text() == "kept"
        assert (tmp_path / "other.txt").read_text() == "kept"
