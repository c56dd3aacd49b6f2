"""`workbench lecture pack`, `try` and `mark`."""

from pathlib import Path

from tests.cli.conftest import Run

PACK = ("lecture", "pack", "4.2", "--for", "geometry", "--to", "out")


def test_a_pack_is_handed_out_tried_and_marked(workbench: Run) -> None:
    Path("class.csv").write_text("mail,nick\na@x.org,ada\nb@x.org,ben\n")
    code, out, _ = workbench(*PACK, "--students", "class.csv", "--column", "nick", "--seed", "1")
    assert code == 0
    assert "2 students, named by the column nick" in out
    assert "1 exercise, 3 points, about 15 minutes as estimated, for 2 students" in out
    assert "workbench lecture mark HANDED_IN --keys out-keys --csv marks.csv" in out
    assert "the seed is 1; " in out
    again = "4.2 --for geometry --students class.csv --column nick --seed 1 --to NEW_FOLDER"
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


def test_what_is_wrong_is_said(workbench: Run) -> None:
    code, _, err = workbench(*PACK[:-1], "out", "--students", "none.csv")
    assert code == 2
    assert "cannot read none.csv" in err
    code, _, err = workbench("lecture", "mark", ".", "--keys", "nowhere")
    assert code == 2
    assert "`workbench lecture pack` wrote" in " ".join(err.split())
    code, _, err = workbench("lecture", "try", "nothing.py")
    assert code == 2
    assert not list(Path().iterdir())
