"""Keypoints, calibrations and typed arguments made to hang, to fill the memory or to break in."""

import json
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.hardening.within_limits import Reader, reader
from workbench.errors import BadArgument, BadFile
from workbench.experiments.arguments import converted
from workbench.reports.folder import SUMMARY, refuse_foreign

SECONDS, MEGABYTES = 5.0, 1000


@pytest.fixture(scope="module")
def keypoints() -> Iterator[Reader]:
    yield from reader("workbench.fitting.keypoint_files:read_keypoints", SECONDS, MEGABYTES)


@pytest.fixture(scope="module")
def cameras() -> Iterator[Reader]:
    yield from reader("workbench.fitting.calibration_files:read_calibration", SECONDS, MEGABYTES)


DEEP = "[" * 200_000 + "]" * 200_000
LONG = "x" * 1_000_000
DIGITS = "9" * 5_000
BODY = str([100.0, 200.0, 0.9] * 17)


def people(keypoints: str, beside: str = "") -> str:
    """OpenPose's JSON with one person."""
    return f'{{{beside}"people": [{{"pose_keypoints_2d": {keypoints}}}]}}'


def annotated(keypoints: str, beside: str = "", entries: str = "") -> str:
    """COCO's JSON with one person."""
    return f'{{{entries}"annotations": [{{{beside}"keypoints": {keypoints}}}]}}'


NO_JSON = "cannot be read as JSON"
KEYPOINTS: dict[str, tuple[Callable[[], str | bytes], str]] = {
    "nothing": (lambda: "", NO_JSON),
    "a mark of byte order alone": (lambda: "\ufeff", NO_JSON),
    "zeros": (lambda: bytes(100), NO_JSON),
    "bytes that are no UTF-8": (lambda: b'{"people": "\xff\xfe"}', NO_JSON),
    "half of a surrogate in UTF-16": (lambda: b"\xff\xfe\x00\xd8", NO_JSON),
    "cut off": (lambda: people(BODY)[:-9], NO_JSON),
    "lists in lists": (lambda: DEEP, f"{NO_JSON}: RecursionError"),
    "objects in objects": (lambda: '{"a":' * 200_000, f"{NO_JSON}: RecursionError"),
    "lists in lists as keypoints": (lambda: people(DEEP), f"{NO_JSON}: RecursionError"),
    "lists in lists, not too deep for JSON": (
        lambda: people("[" * 900 + "]" * 900),
        r"keypoints must be numbers, not \[\[\[\.\.\.\]\]\]",
    ),
    "lists in lists as people": (
        lambda: '{"people": [' + "[" * 900 + "]" * 900 + "]}",
        r"people\[0\] must be an object",
    ),
    "lists in lists as the number of an image": (
        lambda: annotated(
            BODY,
            f'"image_id": {"[" * 900}{"]" * 900}, ',
            f'"images": [{{"id": {"[" * 900}{"]" * 900}, "width": 1}}], ',
        ),
        "image_id must be a number or a text",
    ),
    "a number of 5,000 digits": (lambda: people(f"[{DIGITS}, 1, 1]"), f"{NO_JSON}.*digits"),
    "a number of 4,000 digits": (
        lambda: people(f"[{'9' * 4000}]"),
        r"numbers, not \[a whole number of 13,288 bits\]",
    ),
    "infinity as a number": (
        lambda: annotated(f"[1e999, 1, 1{', 1, 1, 1' * 16}]"),
        r"nose at \[inf",
    ),
    "NaN as a confidence": (lambda: annotated(f"[1, 1, NaN{', 1, 1, 1' * 16}]"), "confidence nan"),
    "minus infinity as a confidence": (
        lambda: annotated(f"[1, 1, -Infinity{', 1, 1, 1' * 16}]"),
        "confidence -inf",
    ),
    "null as a place": (lambda: annotated(f"[null, 1, 1{', 1, 1, 1' * 16}]"), r"nose at \[nan"),
    "a long text as keypoints": (lambda: people(json.dumps(LONG)), r"not 'xxx.*\.\.\.'"),
    "a million numbers as keypoints": (
        lambda: people(str([0] * 1_000_000)),
        "but 1000000 numbers are not a multiple|are 1000000 numbers",
    ),
    "texts as keypoints": (
        lambda: people('["a", "b", "c"]'),
        "must be numbers, not .'a', 'b', 'c'",
    ),
    "objects as keypoints": (lambda: people("{}"), "must be numbers, not a dict of 0 entries"),
    "500,000 people": (
        lambda: '{"people": [' + "{}," * 500_000 + "{}]}",
        "holds 500,001 people, and at most 300,000 are read",
    ),
    "a million texts as people": (
        lambda: '{"people": [' + '"",' * 1_000_000 + '""]}',
        r"people\[0\] must be an object, not ''",
    ),
    "a million images": (
        lambda: annotated(BODY, "", '"images": [' + "{}," * 999_998 + "0], "),
        "images.999998. must be an object, not 0",
    ),
    "6 million empty lists": (
        lambda: "[" + "[]," * 6_000_000 + "0]",
        "6,000,001 lists and objects, too many for its",
    ),
    "a list where an object belongs": (
        lambda: '[["people"]]',
        r"annotations\[0\] must be an object",
    ),
    "two lists of people": (
        lambda: people(BODY, '"people": [], '),
        "an object in it has two entries called 'people'",
    ),
    "keypoints twice": (
        lambda: annotated(BODY, '"keypoints": [], '),
        "has two entries called 'keypoints'",
    ),
    "100,000 entries of one name": (
        lambda: "{" + '"a":0,' * 100_000 + '"b":0}',
        "two entries called 'a'",
    ),
    "a name that no terminal prints": (
        lambda: '{"\\u001b[2J\\ud800": 0, "\\u001b[2J\\ud800": 0}',
        r"called '\\x1b\[2J\\ud800'",
    ),
    "an image of endless size": (
        lambda: annotated(
            BODY, '"image_id": 1, ', '"images": [{"id": 1, "width": 1e999, "height": 5}], '
        ),
        r"the size \[inf, 5\]",
    ),
    "an image of a size that no image has": (
        lambda: annotated(
            BODY, '"image_id": 1, ', '"images": [{"id": 1, "width": 1e300, "height": 5}], '
        ),
        r"the size \[1e\+300, 5\]",
    ),
}


@pytest.mark.parametrize("name", KEYPOINTS)
def test_keypoints(keypoints: Reader, tmp_path: Path, name: str) -> None:
    make, says = KEYPOINTS[name]
    said = keypoints.refusal(written(tmp_path / "k.json", make()))
    assert re.search(says, said), said


def written(path: Path, content: str | bytes) -> Path:
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


@pytest.mark.parametrize(
    "make",
    [
        lambda: "\ufeff" + annotated(BODY),
        lambda: annotated(BODY).encode("utf-16"),
        lambda: annotated(BODY, '"extra": ' + "[" * 500 + "]" * 500 + ", "),
        lambda: annotated(BODY, "".join(f'"kpts_{i}": [1], ' for i in range(100_000))),
        lambda: '{"people": [' + "{}," * 200_000 + f'{{"pose_keypoints_2d": {[0.5] * 75}}}]}}',
    ],
    ids=[
        "a mark of byte order",
        "UTF-16",
        "lists in lists",
        "100,000 more points",
        "200,000 people",
    ],
)
def test_keypoints_that_are_read(
    keypoints: Reader, tmp_path: Path, make: Callable[[], str | bytes]
) -> None:
    answer = keypoints.within_limits(written(tmp_path / "k.json", make()))
    assert answer.kind == "read", answer.message


K = "[[800.0, 0, 320], [0, 800, 240], [0, 0, 1]]"


def toml(change: str = "", name: str = "a") -> str:
    """Pose2Sim's calibration of one camera, with lines before it."""
    return (
        f"{change}\n[{name}]\nmatrix = {K}\nrotation = [0.0, 0.0, 0.0]\n"
        "translation = [0.0, 0.0, 3.0]\n"
    )


NO_TOML = "cannot be read as TOML"
TOML: dict[str, tuple[Callable[[], str | bytes], str]] = {
    "nothing": (lambda: "", "holds no cameras"),
    "bytes that are no UTF-8": (lambda: b"\xff\xfe", f"{NO_TOML}.*invalid start byte"),
    "zeros": (lambda: bytes(100), NO_TOML),
    "two megabytes": (lambda: "#" * 2_000_000, f"{NO_TOML}: it has more than 1,048,576 bytes"),
    "lists in lists": (lambda: "a = " + "[" * 200_000, NO_TOML),
    "tables in tables": (lambda: "a = " + "{a = " * 50_000, NO_TOML),
    "a key of 100,000 parts": (
        lambda: "x = 1\na" + ".a" * 100_000 + " = 1",
        "a key in line 2 has more than 20 parts",
    ),
    "a key of spaced parts": (lambda: "a" + " . a" * 100_000 + " = 1", "line 1 has more than 20"),
    "a key of quoted parts": (
        lambda: '"="' + """.'"'."#".x""" * 50_000 + " = 1",
        "line 1 has more than 20 parts",
    ),
    "a table of 100,000 parts": (lambda: "[" + "a." * 100_000 + "a]", "more than 20 parts"),
    "a table of a list of 100,000 parts": (
        lambda: "[[" + "a." * 100_000 + "a]]",
        "more than 20 parts",
    ),
    "keys that overwrite each other": (lambda: "a = 1\n" * 100_000, f"{NO_TOML}.*overwrite"),
    "a table twice": (lambda: toml() + toml(), f"{NO_TOML}.*twice"),
    "a number of 5,000 digits": (lambda: f"a = {DIGITS}", f"{NO_TOML}.*digits"),
    "a long hexadecimal number as a matrix": (
        lambda: f"[a]\nmatrix = 0x{'f' * 5000}\nrotation = 1\ntranslation = 1",
        "K of camera 'a' must be numbers, not a whole number of 20,000 bits",
    ),
    "a long hexadecimal number in a matrix": (
        lambda: f"[a]\nmatrix = [0x{'f' * 5000}]\nrotation = 1\ntranslation = 1",
        r"must be numbers, not \[a whole number of 20,000 bits\]",
    ),
    "a long hexadecimal number as a size": (
        lambda: toml() + f"size = 0x{'f' * 5000}",
        "size must be numbers, not a whole number",
    ),
    "infinity in a matrix": (
        lambda: toml().replace("800.0", "inf"),
        "needs finite numbers, but K is .*inf",
    ),
    "NaN in a translation": (
        lambda: toml().replace("3.0", "nan"),
        "needs finite numbers, but t is .*nan",
    ),
    "a rotation of 1e308": (
        lambda: toml().replace("rotation = [0.0", "rotation = [1e308"),
        "finite numbers, but R is",
    ),
    "a date as a matrix": (lambda: toml().replace(K, "1979-05-27"), "numbers, not a date"),
    "100,000 NaN of distortion": (
        lambda: toml() + f"distortions = {['nan'] * 100_000}".replace("'", ""),
        "finite numbers, but",
    ),
    "a long name": (
        lambda: toml() + f'name = "{LONG}"',
        r"camera .xxx.*has a name of 1,000,000 characters",
    ),
    "a list as a name": (
        lambda: toml() + "name = [1]",
        r"the name of camera table \[a\] must be a text, not \[1\]",
    ),
    "a name that no terminal prints": (
        lambda: toml(name='"\\u001b[2J"').replace("3.0]", "3.0, 1]"),
        r"camera '\\x1b\[2J': a camera",
    ),
    "2,000 cameras": (
        lambda: "".join(toml(name=f"c{i}") for i in range(2000)),
        "2,000 cameras, and at most 1,000",
    ),
    "100,000 tables": (lambda: "".join(f"[t{i}]\n" for i in range(100_000)), "holds no cameras"),
    "a table without a matrix": (
        lambda: f"[{'x' * 1000}]\nrotation = 1",
        r"camera table \[xxx.*\.\.\.\] has no matrix",
    ),
}


@pytest.mark.parametrize("name", TOML)
def test_toml(cameras: Reader, tmp_path: Path, name: str) -> None:
    make, says = TOML[name]
    said = cameras.refusal(written(tmp_path / "c.toml", make()))
    assert re.search(says, said), said


CAMERA = f'{{"K": {K}, "R": [0, 0, 0], "t": [0, 0, 3]}}'
CALIBRATIONS: dict[str, tuple[Callable[[], str], str]] = {
    "lists in lists": (lambda: DEEP, f"{NO_JSON}: RecursionError"),
    "two cameras of one name": (
        lambda: f'{{"a": {CAMERA}, "a": {CAMERA}}}',
        "two entries called 'a'",
    ),
    "a matrix twice": (lambda: f'{{"a": {CAMERA[:-1]}, "K": 5}}}}', "two entries called 'K'"),
    "2,000 cameras": (
        lambda: "{" + ", ".join(f'"c{i}": {CAMERA}' for i in range(2000)) + "}",
        "at most 1,000",
    ),
    "a long name": (lambda: f'{{"{LONG}": 5}}', r"has a name of 1,000,000 characters"),
    "a long text as a matrix": (
        lambda: f'{{"a": {CAMERA.replace(K, json.dumps(LONG))}}}',
        r"numbers, not 'xxx.*\.\.\.'",
    ),
    "lists in lists as a matrix": (
        lambda: f'{{"a": {CAMERA.replace(K, "[" * 900 + "]" * 900)}}}',
        r"not \[\[\[\.\.\.\]\]\]",
    ),
    "a million numbers as a matrix": (
        lambda: f'{{"a": {CAMERA.replace(K, str([0] * 10**6))}}}',
        r"not \(1000000,\)",
    ),
    "endless numbers": (
        lambda: f'{{"a": {CAMERA.replace("800.0", "1e999")}}}',
        "finite numbers, but K is",
    ),
    "true as a matrix": (lambda: f'{{"a": {CAMERA.replace(K, "true")}}}', "numbers, not True"),
}


@pytest.mark.parametrize("name", CALIBRATIONS)
def test_calibrations_in_json(cameras: Reader, tmp_path: Path, name: str) -> None:
    make, says = CALIBRATIONS[name]
    said = cameras.refusal(written(tmp_path / "c.json", make()))
    assert re.search(says, said), said


def test_calibrations_that_are_read(cameras: Reader, tmp_path: Path) -> None:
    lines = '# 0.1.2.3.4.5\n"v. 1.2.3" = "a.b.c"\nnumbers = [1.5, 2.5, 3.5]'
    for name, content in (("c.toml", "\ufeff" + toml(lines)), ("c.json", f'{{"a": {CAMERA}}}')):
        answer = cameras.within_limits(written(tmp_path / name, content))
        assert answer.kind == "read", answer.message


def test_a_device_without_end_is_left(cameras: Reader, keypoints: Reader) -> None:
    """/dev/zero says that it has no bytes, and gives them for ever."""
    for one in (cameras, keypoints):
        assert "is a folder or a device" in one.refusal(Path("/dev/zero"))


# What is typed on the command line as the argument of an experiment.


@pytest.mark.parametrize(
    ("annotation", "typed", "said"),
    [
        (int, "9" * 5000, "x must be a whole number, not '999.*\\.\\.\\.'"),
        (int, "1e999", "a whole number, not '1e999'"),
        (float, "1e999", "a finite number, not '1e999'"),
        (float, "9" * 100_000, "a finite number, not '999"),
        (float, "nan", "a finite number, not 'nan'"),
        (bool, LONG, r"true or false, not 'xxx.*\.\.\.'"),
        (tuple[str, ...], DEEP, r"a name, or names such as .*, not '\[\[\["),
        (tuple[str, ...], f"[{DIGITS}]", r"names such as .*, not '\[999"),
        (dict, DEEP, r"x must be anything, not '\[\[\["),
        (int, object(), "a whole number, not a object"),
        (int, [[[[5]]]], r"a whole number, not \[\[\[\.\.\.\]\]\]"),
        (str, 10**5000, "a text, not a whole number of 16,610 bits"),
    ],
    ids=lambda value: value[:25] if isinstance(value, str) else type(value).__name__,
)
def test_typed_arguments(annotation: object, typed: Any, said: str) -> None:
    with pytest.raises(BadArgument, match=said) as refusal:
        converted("x", annotation, typed)
    assert len(str(refusal.value)) < 300


def test_a_digit_too_many_is_a_text() -> None:
    """Where anything is taken, what is no JSON is the text that was typed."""
    assert converted("x", dict, DIGITS) == DIGITS


@pytest.mark.parametrize(
    "summary",
    ["", DEEP, "[]", DIGITS, '{"made_by": "workbench", "made_by": 5}', '{"made_by": "else"}'],
    ids=["nothing", "lists in lists", "a list", "a long number", "twice", "another's"],
)
def test_a_folder_with_a_strange_summary_is_not_ours(tmp_path: Path, summary: str) -> None:
    (tmp_path / SUMMARY).write_text(summary)
    with pytest.raises(BadFile, match="of a report, so it is not overwritten"):
        refuse_foreign(tmp_path)
