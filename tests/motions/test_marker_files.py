"""Markers in C3D and TRC files, against the numbers they were made of and against other readers."""

import re
from pathlib import Path

import numpy as np
import pytest

from tests.motions.made_files import LABELS, MARKER_FILES, c3d_bytes, marker_places, trc_text
from workbench.errors import BadArgument, BadFile
from workbench.fitting import read_markers
from workbench.fitting.marker_files import write_markers
from workbench.geometry.guesses import UP_TO_Y
from workbench.motions import Trajectories, read_c3d, read_trc, write_trc

PLACES = marker_places()


@pytest.mark.parametrize("name", MARKER_FILES)
def test_marker_formats_hold_the_same_markers(tmp_path: Path, name: str) -> None:
    MARKER_FILES[name](tmp_path / name)
    markers = read_markers(tmp_path / name)
    exact = PLACES @ UP_TO_Y["z"].T / 1000
    rounding = 5.1e-5 if name == "integers.c3d" else 1e-7  # half of its scale, 0.1 mm
    np.testing.assert_allclose(markers.markers, exact, atol=rounding)
    assert (markers.labels, markers.fps) == (LABELS, 100.0)
    assert any("mm" in note for note in markers.notes)
    assert any(note.startswith("z is taken to be up") for note in markers.notes)
    assert ("2 measurements a frame of other devices are not read" in markers.notes) == (
        name.endswith("c3d")
    )


@pytest.mark.parametrize("kind", ["<", ">", "dec"])
@pytest.mark.parametrize("scale", [-1.0, 0.0625])
def test_analog_samples_between_the_frames_are_passed_over(
    tmp_path: Path, kind: str, scale: float
) -> None:
    """Four samples of three channels in each frame, in a group or not, or in that alone."""
    exact = np.round(PLACES / 0.0625) * 0.0625  # as floats and as whole numbers
    for channels in (0, 3):
        content = c3d_bytes(exact, LABELS, kind=kind, scale=scale, analog=12, channels=channels)
        markers = read_c3d(c3d_with(tmp_path, content))
        np.testing.assert_array_equal(markers.places, exact)
        assert markers.notes == ("12 measurements a frame of other devices are not read",)
    markers = read_c3d(c3d_with(tmp_path, content[:4] + b"\0\0" + content[6:]))
    np.testing.assert_array_equal(markers.places, exact)
    assert markers.notes[0] == "its header says 0 measurements of other devices, ANALOG 12"


def test_c3d_parameters_count_where_the_header_says_another_rate(tmp_path: Path) -> None:
    markers = read_c3d(c3d_with(tmp_path, c3d_bytes(PLACES, LABELS, rate=60.0)))
    assert markers.fps == 100.0
    assert markers.notes == ("its header says 60, and POINT:RATE 100, which counts",)
    content = c3d_bytes(PLACES, LABELS, scale=0.0625)
    wrong = content[:12] + c3d_bytes(PLACES, LABELS, scale=0.5)[12:16] + content[16:]
    markers = read_c3d(c3d_with(tmp_path, wrong))
    np.testing.assert_allclose(markers.places, PLACES, atol=0.032)
    assert markers.notes == ("its header says 0.5, and POINT:SCALE 0.0625, which counts",)


def c3d_with(tmp_path: Path, content: bytes) -> Path:
    path = tmp_path / "walk.c3d"
    path.write_bytes(content)
    return path


def test_unnamed_points_get_numbers(tmp_path: Path) -> None:
    names = ("A", "", "A", "", "B", "C", "D", "E")
    markers = read_c3d(c3d_with(tmp_path, c3d_bytes(PLACES, names)))
    assert markers.labels == ("A", "point_1", "A_2", "point_3", "B", "C", "D", "E")
    assert markers.notes == ("3 of 8 points had no name or that of another, and got a number",)


WHOLE = c3d_bytes(PLACES, LABELS)


def test_damaged_c3d_is_refused(tmp_path: Path) -> None:
    for content, said in [
        (b"", "does not begin as a C3D file does"),
        (b"\2Q" + WHOLE[2:], "does not begin as a C3D file does"),
        (WHOLE[:600], "the parameter 'UNITS' is damaged"),
        (WHOLE[:-512], "ends before 6 frames of 8 points"),
        (WHOLE.replace(b"\1\x50\1\x54", b"\1\x50\1\x44", 1), "processor has the number 68"),
        (WHOLE[:2] + b"\7\0" + WHOLE[4:], "header says 7 points, and POINT:USED says 8"),
        (WHOLE[:12] + b"\0\0\0\x40" + WHOLE[16:], "header says scale 2, and POINT:SCALE says -1"),
        (WHOLE[:8] + b"\0\0" + WHOLE[10:], "frames go from 1 to 0"),
        (WHOLE[:8] + b"\xff\xff" + WHOLE[10:], "ends before 65,535 frames"),
    ]:
        with pytest.raises(BadFile, match=said) as refused:
            read_markers(c3d_with(tmp_path, content))
        assert "walk.c3d is no C3D file of markers (" in str(refused.value)


def test_trc_survives_its_file(tmp_path: Path) -> None:
    given = Trajectories(PLACES, LABELS, 120.0, "mm")
    write_trc(tmp_path / "walk.trc", given)
    markers = read_trc(tmp_path / "walk.trc")
    np.testing.assert_allclose(markers.places, PLACES, rtol=1e-8)
    assert (markers.labels, markers.fps, markers.unit, markers.notes) == (LABELS, 120.0, "mm", ())
    for wrong in (
        Trajectories(PLACES, LABELS, None, "mm"),
        Trajectories(PLACES, LABELS, 1.0, None),
    ):
        with pytest.raises(BadArgument, match="states its rate and its unit"):
            write_trc(tmp_path / "again.trc", wrong)


@pytest.mark.parametrize("suffix", [".trc", ".npz"])
def test_markers_are_written_in_metres_with_y_up(tmp_path: Path, suffix: str) -> None:
    MARKER_FILES["floats.c3d"](tmp_path / "walk.c3d")
    markers = read_markers(tmp_path / "walk.c3d")
    write_markers(tmp_path / f"out{suffix}", markers)
    again = read_markers(tmp_path / f"out{suffix}")
    np.testing.assert_allclose(again.markers, markers.markers, atol=1e-8)
    assert any(note.startswith("y is taken to be up") for note in again.notes)
    with pytest.raises(BadFile, match=r"are written as \.trc or \.npz"):
        write_markers(tmp_path / "out.c3d", markers)


TEXT = trc_text(PLACES, LABELS)


def test_damaged_trc_is_refused(tmp_path: Path) -> None:
    for text, said in [
        ("", "begins with '', and not PathFileType"),
        (TEXT.replace("\t\t\t".join(LABELS), ""), "it names no markers"),
        (TEXT.partition("\n1\t0.000")[0], "it has no frames"),
        (TEXT.replace("\n2\t0.010\t", "\n2\t0.010\t1\t"), "line 8 has more than 8 markers"),
        (re.sub(r"\t0\.0\d+\t", "\t0\t", TEXT.replace("100.00", "0")), "DataRate is '0'"),
        (TEXT.replace("\n2\t0.010\t", "\n2\t0.010\tx"), "could not convert string to float"),
        (TEXT.replace("\n2\t0.010\t", "\n2\t0.010\t1e300"), "which is no place|could not convert"),
    ]:
        (tmp_path / "walk.trc").write_text(text)
        with pytest.raises(BadFile, match=said) as refused:
            read_markers(tmp_path / "walk.trc")
        assert "walk.trc is no TRC file of markers (" in str(refused.value)


VARIANTS = {
    "decimal commas": lambda text: re.sub(r"(\d)\.(\d)", r"\1,\2", text),
    "commas": lambda text: text.replace("\t", ","),
    "semicolons": lambda text: re.sub(r"(\d)\.(\d)", r"\1,\2", text).replace("\t", ";"),
    "spaces": lambda text: text.replace("\t" * 4, "\tnan" * 3 + "\t").replace("\t", " "),
    "a byte-order mark": lambda text: "\ufeff" + text,
    "returns": lambda text: text.replace("\n", "\r\n"),
    "tabs at ends": lambda text: text.replace("\n", "\t\t\n"),
    "no tabs at ends": lambda text: re.sub("\t+\n", "\n", text),
    "no line of axes": lambda text: re.sub("\n\t\tX1.*\n", "\n", text),
    "no empty line": lambda text: text.replace("\n\n", "\n"),
    "no unit": lambda text: text.replace("\tmm\t", "\t\t"),
    "NaN": lambda text: text.replace("\t\t\t\t", "\tNaN\tNaN\tNaN\t"),
}


@pytest.mark.parametrize("name", VARIANTS)
def test_variants_of_trc_hold_the_same_markers(tmp_path: Path, name: str) -> None:
    (tmp_path / "walk.trc").write_bytes(VARIANTS[name](TEXT).encode())
    markers = read_trc(tmp_path / "walk.trc")
    np.testing.assert_allclose(markers.places, PLACES, atol=1e-5)  # mm, as it is written
    assert (markers.labels, markers.fps, markers.notes) == (LABELS, 100.0, ())
    assert markers.unit == (None if name == "no unit" else "mm")


@pytest.mark.parametrize(
    ("change", "fps", "said"),
    [
        (("\t6\t8", "\t6\t9"), 100.0, "its header says 9 markers, and it has 8, which are read"),
        (("\t6\t8", "\tsix\t8"), 100.0, "its header says six frames, and it has 6, which are read"),
        (("\n100.00", "\n0"), 100.0, "its rate is CameraRate, for DataRate is '0'"),
        (
            ("100.00\t100.00", "\t"),
            100.0,
            "its header says no rate; by its times it is 100",
        ),
        (("100.00\t6", "200.00\t6"), 100.0, None),
    ],
)
def test_doubtful_headers_of_trc_are_noted(
    tmp_path: Path, change: tuple[str, str], fps: float, said: str | None
) -> None:
    (tmp_path / "walk.trc").write_text(TEXT.replace(*change))
    markers = read_trc(tmp_path / "walk.trc")
    np.testing.assert_allclose(markers.places, PLACES, atol=1e-5)
    assert markers.fps == pytest.approx(fps)
    assert markers.notes == ((said,) if said else ())


def test_tables_of_labels_rename_and_leave_out(tmp_path: Path) -> None:
    (tmp_path / "walk.trc").write_text(TEXT)
    table, (first, second, *kept) = tmp_path / "map.csv", LABELS
    for mark in ",;\t":
        lines = ["\ufefflabel,marker", f"{first},Top", "", f' {second} ,""', "ELSE,RHEE"]
        table.write_text("\n".join(lines).replace(",", mark))
        markers = read_markers(tmp_path / "walk.trc", labels=table)
        assert markers.labels == ("Top", *kept)
        exact = (PLACES @ UP_TO_Y["z"].T / 1000)[:, [0, *range(2, 8)]]
        np.testing.assert_allclose(markers.markers, exact, atol=1e-8)
        assert markers.notes[-1] == "map.csv names ELSE, which the file does not have"
    for wrong, said in [
        ("", "it names none, and the file has LFHD"),
        ("ELSE,RHEE", "it names ELSE, and the file has LFHD"),
        (f"{first}", "line 1 is .'LFHD'., but must be a name and its new one"),
        (f"{first},A,B", "line 1 is"),
        (",A", "line 1 is"),
        (f"{first},A\n{first},B", "line 2 names 'LFHD' a second time"),
        (f"{first},{second}", f"several would be called {second}"),
        ("\0" * 2**20 + "\0", "it has more than 1,048,576 bytes"),
    ]:
        table.write_text(wrong)
        with pytest.raises(BadFile, match=f"map.csv is no table of names.*{said}"):
            read_markers(tmp_path / "walk.trc", labels=table)
