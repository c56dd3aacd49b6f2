"""A folder of registrations: what is read, and what is refused before any work is lost."""

from pathlib import Path

import numpy as np
import pytest

from workbench.arrays import Array, Index
from workbench.errors import BadBody, BadFile
from workbench.geometry.meshes import write_mesh
from workbench.synthetic.made_up import draw_registrations, jointed_tube, random_smpl
from workbench.training.first_guess import Start, read_start, write_start
from workbench.training.folder import FolderRegistrations, open_folder

START = jointed_tube(7, 5)
DATA, _ = draw_registrations(random_smpl(START, 2, seed=3), 3, 3, seed=4)
N = len(START.template)


def made_folder(folder: Path) -> list[str]:
    """Nine registrations in every format; the lines of their table."""
    lines = ["file,subject,gender,set"]
    for j, vertices in enumerate(DATA.vertices[:6]):
        name = f"mesh {j}.{('ply', 'obj', 'off')[j % 3]}"
        write_mesh(folder / name, vertices, START.faces)
        lines.append(f"{name},person {DATA.subject[j]},{('female', 'male')[j % 2]},poses")
    np.savez(folder / "six.npz", vertices=DATA.vertices[6], confidence=np.ones(N))
    np.save(folder / "two.npy", DATA.vertices[7:9].astype(np.float32))
    lines += ["six.npz,person 2,,", "two.npy#0,person 2,,shapes", "two.npy#1,person 9,,shapes"]
    (folder / "registrations.csv").write_text("\n".join(lines) + "\n")
    return lines


def opened(folder: Path) -> FolderRegistrations:
    return open_folder(folder, N, START.faces)


def test_formats_are_read_in_the_order_of_the_table(tmp_path: Path) -> None:
    made_folder(tmp_path)
    registrations = opened(tmp_path)
    assert registrations.subjects == ("person 0", "person 1", "person 2", "person 9")
    assert registrations.subject.tolist() == [0, 0, 0, 1, 1, 1, 2, 2, 3]
    batch = registrations.read(slice(0, 9))
    np.testing.assert_allclose(batch.vertices, DATA.vertices, atol=1e-6)
    poses, shapes = registrations.only("poses"), registrations.only("shapes")
    assert (len(poses.rows), len(shapes.rows)) == (7, 2)
    assert shapes.subject.tolist() == [0, 1]  # numbered anew
    assert len(registrations.only("poses", "female").rows) == 3
    np.testing.assert_allclose(shapes.read(slice(1, 2)).vertices[0], DATA.vertices[8], atol=1e-6)


def test_confidence_is_read(tmp_path: Path) -> None:
    made_folder(tmp_path)
    confidence = np.linspace(0.1, 1, N)
    np.savez(tmp_path / "six.npz", vertices=DATA.vertices[6], confidence=confidence)
    np.testing.assert_array_equal(opened(tmp_path).read(slice(6, 7)).confidence[0], confidence)


OTHER = START.faces.copy()
OTHER[0, 0] = 17
ORDER = np.random.default_rng(0).permutation(N)
ONE = DATA.vertices[1]
NAN = np.where(np.arange(N)[:, None] == 3, np.nan, ONE)


@pytest.mark.parametrize(
    ("vertices", "faces", "reason"),
    [
        (ONE, OTHER, "connects its vertices otherwise"),
        (ONE[ORDER], np.argsort(ORDER)[START.faces], "connects its vertices otherwise"),
        (np.tile(ONE, (2, 1)), START.faces, r"\(70, 3\), but the topology has \(35, 3\)"),
        (NAN, START.faces, "nan"),
        (ONE * [-1, 1, 1], START.faces, "mirrored"),
        (1000 * ONE, START.faces, "millimetres"),
        (None, None, ""),
    ],
)
def test_spoiled_registrations_are_named(
    tmp_path: Path, vertices: Array | None, faces: Index | None, reason: str
) -> None:
    made_folder(tmp_path)
    path = tmp_path / "mesh 1.obj"
    path.unlink()
    if vertices is not None:
        lines = ["v {} {} {}".format(*v) for v in vertices.tolist()]
        lines += ["f {} {} {}".format(*(f + 1)) for f in faces]
        path.write_text("\n".join(lines))
    with pytest.raises(BadFile, match=f"(?s)1 of 9 registrations.*mesh 1.obj.*{reason}"):
        opened(tmp_path)


def test_faces_may_be_listed_in_another_order(tmp_path: Path) -> None:
    made_folder(tmp_path)
    shuffled = np.roll(START.faces, 1, axis=1)[::-1]
    write_mesh(tmp_path / "mesh 1.obj", DATA.vertices[1], shuffled)
    assert len(opened(tmp_path).rows) == 9


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("mesh 0.ply,,female,poses", "line 11: file and subject"),
        ("mesh 0.ply,x,unknown,poses", "no gender is called 'unknown'"),
        ("mesh 0.ply,x,female,walks", "no set is called 'walks'"),
        ("mesh 0.txt,x,female,poses", "is none of"),
        ("mesh 0.ply,x,female,poses", "2 times"),
    ],
)
def test_wrong_lines_of_the_table_are_refused(tmp_path: Path, line: str, said: str) -> None:
    lines = made_folder(tmp_path)
    (tmp_path / "registrations.csv").write_text("\n".join([*lines, line]))
    with pytest.raises(BadFile, match=said):
        opened(tmp_path)


def test_tables_that_cannot_be_read_are_refused(tmp_path: Path) -> None:
    with pytest.raises(BadFile, match="cannot read the subject table"):
        opened(tmp_path)
    for table, reason in (
        ("file,subject\n", "names no registrations"),
        ("mesh,subject\na.ply,b\n", "no column 'file'"),
        ("file,subject,gendre\na.ply,b,female\n", "gendre"),  # it would train one of everybody
        ("file,subject,subject\na.ply,b,c\n", "two columns of one name"),
        ("file,subject\na.ply,b,female\n", "line 2 has more cells than the table has columns"),
    ):
        (tmp_path / "registrations.csv").write_text(table)
        with pytest.raises(BadFile, match=reason):
            opened(tmp_path)


def test_start_round_trips(tmp_path: Path) -> None:
    write_start(START, tmp_path / "start.npz")
    start = read_start(tmp_path / "start.npz")
    np.testing.assert_array_equal(start.template, START.template)
    np.testing.assert_array_equal(start.segmentation, START.segmentation)
    assert (start.parents, start.joint_names) == (START.parents, START.joint_names)
    small = read_start("small")
    assert isinstance(small, Start)
    assert len(small.template) == 369
    with np.load(tmp_path / "start.npz") as file:
        np.savez(tmp_path / "bad.npz", **{n: file[n] for n in file.files if n != "parents"})
    with pytest.raises(BadFile, match="parents missing"):
        read_start(tmp_path / "bad.npz")
    with pytest.raises(BadBody, match="segmentation"):
        Start(START.template, START.faces, START.parents, START.joint_names, np.zeros(3, int))


def test_stl_is_no_registration(tmp_path: Path) -> None:
    lines = made_folder(tmp_path)
    write_mesh(tmp_path / "soup.stl", START.template, START.faces)
    (tmp_path / "registrations.csv").write_text("\n".join([*lines, "soup.stl,x,,"]))
    with pytest.raises(BadFile, match=r"soup\.stl: an \.stl holds three vertices of its own"):
        opened(tmp_path)
