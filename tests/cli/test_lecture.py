"""`workbench lecture`: list, show, run, start, check, pack, try, mark."""

import json
from pathlib import Path

import pytest

from tests.cli.conftest import Run
from workbench.course.outline import lecture


def test_lecture_is_listed_and_shown(workbench: Run) -> None:
    code, out, _ = workbench("lecture", "list")
    assert code == 0
    assert "Rotations" in out
    assert "Fitting images" in out
    code, out, _ = workbench("lecture", "show", "2")
    assert code == 0
    for name in lecture(2).exercises:
        assert name in out
    assert "in a pack, with other numbers for each student:" in " ".join(out.split())


@pytest.mark.thorough
def test_lecture_run_writes_its_figures(workbench: Run) -> None:
    code, out, _ = workbench("lecture", "run", "6", "--out", "here")
    assert code == 0
    assert "difference quotient" in out
    assert "\n    Jᵀ J p = − Jᵀ e.\n" in out  # formulas in letters
    assert "UPPER, LOWER = 0.30" not in out
    assert "the code: " in out
    assert "lecture.py; --code shows it" in out
    pictures = sorted(path.name for path in Path("here/lec06_least_squares").iterdir())
    assert pictures == [f"figure-{k}.png" for k in (1, 2, 3, 4)]


@pytest.mark.thorough
def test_lecture_start_and_check_of_solutions(workbench: Run) -> None:
    code, out, _ = workbench("lecture", "start", "2", "mine")
    assert code == 0
    assert "lecture check 2 mine/lec02_rotations.py" in out
    code, out, _ = workbench("lecture", "check", "2", "mine")
    assert code == 1
    assert "not attempted" in out
    assert "0 of" in out
    code, _, err = workbench("lecture", "start", "2", "mine")
    assert code == 2
    assert "left as it is" in err
    Path("mine/lec02_rotations.py").write_text((lecture(2).folder / "solutions.py").read_text())
    code, out, _ = workbench("lecture", "check", "2", "mine/lec02_rotations.py", "--json")
    assert code == 0
    data = json.loads(out)
    assert data["passed"]
    assert data["points"] == data["of"] == sum(check.points for check in lecture(2).checks)
    assert [one["number"] for one in data["exercises"]][:2] == ["2.1", "2.2"]


@pytest.mark.thorough
def test_lecture_check_tells_why_an_answer_is_wrong(workbench: Run) -> None:
    Path("lec02_rotations.py").write_text(
        "import numpy as np\ndef hat(w):\n    return np.cross(np.eye(3), -w)\n"
    )
    code, out, _ = workbench("lecture", "check", "2")
    assert code == 1
    for told in ("failed", "expected", "returned", "perhaps", "v x w", "no such name in the file"):
        assert told in out
    code, _, err = workbench("lecture", "check", "6")
    assert code == 2
    assert "there is no file" in err


def test_notebooks_of_others_are_not_written_over(workbench: Run) -> None:
    Path("books").mkdir()
    Path("books/lec06_least_squares.ipynb").write_text("a student's evening")
    code, _, err = workbench("lecture", "notebooks", "books")
    assert code == 2
    assert "somebody's work" in err
    assert Path("books/lec06_least_squares.ipynb").read_text() == "a student's evening"
    assert len(list(Path("books").iterdir())) == 1


PACK = ("lecture", "pack", "4.2", "--for", "geometry", "--to", "out")


@pytest.mark.thorough
def test_pack_is_handed_out_tried_and_marked(workbench: Run) -> None:
    Path("class.csv").write_text("mail,nick\na@x.org,ada\nb@x.org,ben\n")
    code, out, _ = workbench(*PACK, "--students", "class.csv", "--column", "nick", "--seed", "1")
    assert code == 0
    assert "students are named by nick" in out
    assert "1 exercise, 3 points, about 15 minutes as estimated, for 2 students" in out
    assert "workbench lecture mark HANDED_IN --keys out-keys" in out
    assert "the seed, 1, is also in the keys" in out
    again = "4.2 --for geometry --students class.csv --seed 1 --column nick --to NEW_FOLDER"
    assert again in out
    assert Path("out-keys").stat().st_mode & 0o077 == 0
    path = Path("out/ada/lec04_skinning.py")
    code, out, _ = workbench("lecture", "try", str(path))
    assert code == 1
    assert "4.2 radius_left  not yet" in out
    assert "not attempted" in out
    book = Path("out/ada/lec04_skinning.ipynb")
    answer = "def radius_left(weight, angle):\\n    return 1 / 0  #"
    book.write_text(book.read_text().replace("def radius_left(", answer))
    code, out, _ = workbench("lecture", "try", str(book))
    assert code == 1
    assert "ZeroDivisionError" in out
    book.unlink()
    code, out, _ = workbench("lecture", "mark", "out", "--keys", "out-keys", "--csv", "m.csv")
    assert code == 0
    assert "1 of 2 ada  0 of 3" in out
    assert "2 of 2 ben  0 of 3" in out
    assert "not attempted" in Path("m.csv").read_text(encoding="utf-8-sig")


def test_pack_commands_refuse_missing_files(workbench: Run) -> None:
    code, _, err = workbench(*PACK[:-1], "out", "--students", "none.csv")
    assert code == 2
    assert "cannot read none.csv" in err
    code, _, err = workbench("lecture", "mark", ".", "--keys", "nowhere")
    assert code == 2
    assert "`workbench lecture pack` wrote" in " ".join(err.split())
    code, _, err = workbench("lecture", "try", "nothing.py")
    assert code == 2
    assert not list(Path().iterdir())
