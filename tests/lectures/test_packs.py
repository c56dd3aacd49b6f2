"""Packs: what is handed out has no answers in it, and what is handed in is marked fairly."""

import csv
import json
import re
import shutil
from pathlib import Path

import pytest

from workbench.course.outline import root
from workbench.course.packs.handing_out import EXAMPLES, read_students, write_pack
from workbench.course.packs.keys import KEYS, QUESTIONS, ClassKey, read_keys
from workbench.course.packs.marking import (
    answers_of_class,
    mark_class,
    try_file,
)
from workbench.course.packs.submissions import (
    attempted,
    collect,
    owner,
    read_sheet,
    remarks_of,
)
from workbench.course.plain import decode
from workbench.course.process import ProcessLimits
from workbench.errors import BadArgument, BadFile

SIX = read_students("Ada Lovelace, ben, cleo, dora, emil, fay").names
GOOD = "    return abs(1 - weight + weight * np.exp(1j * (1 + BACK) * angle))\n"


@pytest.fixture(scope="module")
def pack(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path, ClassKey]:
    place = tmp_path_factory.mktemp("pack")
    key = write_pack(["4.2"], "geometry", SIX, place / "out", place / "keys", seed=3)
    return place / "out", place / "keys", key


def answered(folder: Path, student: str, body: str, ending: str = "py") -> Path:
    path = folder / student / f"lec04_skinning.{ending}"
    text = path.read_text(encoding="utf-8")
    stub = '    raise Unsolved("radius_left")'
    if ending == "py":
        path.write_text(text.replace(stub + "\n", body), encoding="utf-8")
    else:
        book = json.loads(text)
        for cell in book["cells"]:
            cell["source"] = "".join(cell["source"]).replace(stub, body.rstrip())
        path.write_text(json.dumps(book), encoding="utf-8")
    return path


def test_pack_has_no_answers_in_it(pack: tuple[Path, Path, ClassKey]) -> None:
    out, keys, key = pack
    assert {path.name for path in out.iterdir()} == set(SIX)
    assert (keys / KEYS).is_file()
    text = "".join(path.read_text() for path in out.rglob("*") if path.is_file())
    for hidden in ("np.sin", "sqrt", '"seed"', "tries"):
        assert hidden not in text
    for some in key.keys.values():
        for arguments, answer in (*some[0].tries, *some[0].edges):
            assert json.dumps(arguments) not in text.replace("\n", "").replace(" ", "")
            assert f"{decode(answer):.10g}"[:9] not in text or decode(answer) in (0, 1)
    shown = json.loads((out / "ben" / EXAMPLES).read_text())["exercises"]
    assert list(shown) == ["lec04_skinning.radius_left"]
    numbers = {json.dumps(some[0].numbers) for some in key.keys.values()}
    assert len(numbers) == len(SIX)
    assert read_keys(keys) == key


@pytest.mark.thorough
def test_answers_of_a_class_are_marked(pack: tuple[Path, Path, ClassKey], tmp_path: Path) -> None:
    out, keys, key = pack
    folder = tmp_path / "in"
    shutil.copytree(out, folder)
    path = answered(folder, "ada-lovelace", GOOD)
    published = (keys / "answer-4.2-radius_left.py").read_text()
    answered(folder, "ben", re.findall(r"    return .*\n", published)[0])
    answered(folder, "cleo", "    from workbench.lectures import lec04_skinning\n    return 1\n")
    shutil.copy(path, folder / "dora" / "lec04_skinning.py")
    answered(folder, "emil", "    while True:\n        pass\n")
    shutil.rmtree(folder / "fay")
    (folder / "nobody.py").write_text("x = 1\n")
    found, table = collect(folder, key), tmp_path / "marks.csv"
    told = {one.path.name: one for one in found.unused}
    assert "belongs to nobody" in told["nobody.py"].why
    assert set(told) == {"nobody.py", "examples.json", "lec04_skinning.ipynb"}
    assert [len(sheets) for sheets in found.sheets.values()] == [1, 1, 1, 1, 1, 0]
    limits = ProcessLimits(seconds=1.5)
    marks = mark_class(found, key, keys, table, limits, workers=2)
    assert [one.points for one in marks] == [3, 3, 0, 0, 0, 0]
    with table.open(encoding="utf-8-sig") as file:
        rows = {row["folder"]: row for row in csv.DictReader(file)}
    told = {student: row["remarks"] for student, row in rows.items()}
    assert rows["ada-lovelace"]["student"] == "Ada Lovelace"
    assert rows["ben"]["4.2"] == "3"
    assert "lec04_skinning.py names workbench.lectures, where published" in told["cleo"]
    assert "handed out to Ada Lovelace" in told["dora"]
    assert "stopped after 1.5 s" in told["emil"]
    assert told["fay"] == "4.2: not handed in"
    # the same command goes on: nothing is marked again but what has changed
    answered(folder, "cleo", "")
    shutil.copytree(out / "fay", folder / "fay")
    answered(folder, "fay", "    # mine\n" + GOOD, "ipynb")
    before: dict[str, bool] = {}
    again = mark_class(
        collect(folder, key),
        key,
        keys,
        table,
        limits,
        lambda student, mark, kept: before.update({student: kept}),
    )
    assert [student for student, kept in before.items() if not kept] == ["fay"]
    assert again[-1].points == 3


def test_answers_found_without_the_keys_are_marked_beside_them(
    pack: tuple[Path, Path, ClassKey], tmp_path: Path
) -> None:
    """`questions.json` is all that the machine needs on which the files of strangers run."""
    out, keys, key = pack
    folder, elsewhere, table = tmp_path / "in", tmp_path / "elsewhere", tmp_path / "m.csv"
    shutil.copytree(out / "ben", folder / "ben")
    answered(folder, "ben", GOOD)
    elsewhere.mkdir()
    shutil.copy(keys / QUESTIONS, elsewhere)
    questions = read_keys(elsewhere, QUESTIONS)
    text = (elsewhere / QUESTIONS).read_text()
    for _, answer in key.keys["ben"][0].tries:
        assert json.dumps(answer) not in text
    limits = ProcessLimits()
    sent = json.loads(json.dumps(answers_of_class(collect(folder, questions), questions, limits)))
    marks = mark_class(collect(folder, key), key, tmp_path, table, limits, answers=sent)
    assert [one.points for one in marks] == [0, 3, 0, 0, 0, 0]
    marks = mark_class(collect(folder, key), key, tmp_path, table, limits, answers={})
    assert "not in the file of answers" in marks[1].exercises[0].remarks[0]


def test_files_are_recognised_by_whole_names(tmp_path: Path) -> None:
    for name, sheet in (
        ("ada_exam.py", "exam"),
        ("exam-2.py", "exam"),
        ("example_of_mine.py", ""),
        ("ada.exam.part.py", "exam.part"),
    ):
        (tmp_path / name).write_text("x = 1\n")
        assert read_sheet(tmp_path / name, {"exam": [], "exam.part": []}).name == sheet


def test_files_that_are_not_marked_have_a_reason(
    pack: tuple[Path, Path, ClassKey], tmp_path: Path
) -> None:
    """A flat folder with names of the students' own."""
    out, _, key = pack
    folder = tmp_path / "in"
    folder.mkdir()
    shutil.copy(out / "ben" / "lec04_skinning.ipynb", folder / "ben-lec04.ipynb")
    shutil.copy(out / "cleo" / "lec04_skinning.py", folder / "homework.PY")
    (folder / "dora_hw1.py").write_text("x = 1\n")
    (folder / "emil.zip").write_bytes(b"PK")
    (folder / "fay.txt").write_text("later")
    found = collect(folder, key)
    assert {who: [one.name for one in some] for who, some in found.sheets.items() if some} == {
        "ben": ["lec04_skinning"],
        "cleo": ["lec04_skinning"],
    }
    told = {one.path.name: (one.student, one.why) for one in found.unused}
    assert set(told) == {"dora_hw1.py", "emil.zip", "fay.txt"}
    assert told["dora_hw1.py"][0] == "dora"
    assert "call it dora_lec04_skinning.py" in told["dora_hw1.py"][1]
    assert told["emil.zip"][0] == "emil"
    assert "unpack it" in told["emil.zip"][1]
    assert "neither a file of Python" in told["fay.txt"][1]
    assert "emil.zip is not marked: it is an archive" in remarks_of(found, key)["emil"][0]


def test_folders_of_learning_platforms_find_their_students() -> None:
    folders = {"ben": "Ben", "ben-o-neil": "Ben O'Neil", "cho-kim": "Cho Kim", "zoë": "Zoë"}
    key = ClassKey("g", 1, folders, {}, {})

    def whose(name: str, file: str = "x.py") -> str | None:
        return owner(Path(name) / file if file else Path(name), key)

    assert whose("Ben O'Neil_20413_assignsubmission_file_") == "ben-o-neil"
    assert whose("cho_kim") == "cho-kim"
    assert whose("ZOE\u0308_1") == "zoë"
    assert whose("BEN-O-NEIL.py", "") == "ben-o-neil"
    assert whose("ben_2_lec04_skinning.py", "") == "ben"
    assert whose("benjamin_2") is None
    twins = ClassKey("g", 1, {"cho-kim": "Cho Kim", "cho_kim": "cho_kim"}, {}, {})
    assert owner(Path("cho_kim/x.py"), twins) == "cho_kim"
    with pytest.raises(BadFile, match="may belong to Cho Kim and cho_kim; name it as the pack"):
        owner(Path("cho kim_7/x.py"), twins)


def test_file_of_a_lecturer_is_packed(tmp_path: Path) -> None:
    """The one that the guide shows."""
    guide = (root() / "GUIDE.md").read_text()
    (tmp_path / "mine.py").write_text(guide.split("```python\n")[1].split("```")[0])
    mine = str(tmp_path / "mine.py")
    key = write_pack([mine], "geometry", {"ada": "ada"}, tmp_path / "out", tmp_path / "keys")
    assert key.keys["ada"][0].number == "mine.1"
    assert "STIFFNESS = " in (tmp_path / "out" / "ada" / "mine.py").read_text()
    arguments, answer = key.keys["ada"][0].tries[0]
    (force,) = decode(arguments)
    assert decode(answer) == pytest.approx(force / key.keys["ada"][0].numbers["STIFFNESS"])
    dotted = tmp_path / "a.b.py"
    shutil.copy(mine, dotted)
    write_pack([str(dotted)], "geometry", {"ada": "ada"}, tmp_path / "dots", tmp_path / "of-dots")
    (tried,) = try_file(tmp_path / "dots" / "ada" / "a.b.py", ProcessLimits())
    assert (tried.exercise, tried.remarks) == ("stretched", ("not attempted",))
    with pytest.raises(BadFile, match="exists already"):
        write_pack([mine], "geometry", {"ada": "ada"}, tmp_path / "out", tmp_path / "k")
    with pytest.raises(BadArgument, match="must not be inside"):
        write_pack([mine], "g", {"ada": "ada"}, tmp_path / "new", tmp_path / "new" / "keys")
    assert not (tmp_path / "new").exists()
    (tmp_path / "keys" / KEYS).write_text('{"keys": {"ada": [{"number": 1}]}}')
    with pytest.raises(BadFile, match="is damaged"):
        read_keys(tmp_path / "keys")


def test_students_come_from_a_list_or_a_file(tmp_path: Path) -> None:
    assert read_students("Zoë Müller, O'Neil").names == {
        "zoe-muller": "Zoë Müller",
        "o-neil": "O'Neil",
    }
    (folder,) = read_students("李雷").names  # no Latin letters
    assert re.fullmatch(r"student-[0-9a-f]{6}", folder)
    path = tmp_path / "class.csv"
    path.write_text("\ufeffid;Name\n1;Ada\n2;Ben\n", encoding="utf-8")
    assert read_students(str(path)).names == {"ada": "Ada", "ben": "Ben"}
    path.write_text("First name;Surname;ID number;E-mail address\nBen;O'Neil;7;b@x.org\n")
    assert read_students(str(path)).names == {"ben-o-neil": "Ben O'Neil"}
    assert read_students(str(path)).columns == ("First name", "Surname")
    assert read_students(str(path), "id NUMBER").names == {"7": "7"}
    with pytest.raises(BadArgument, match="no column 'mail'; its columns are 'First name'"):
        read_students(str(path), "mail")
    path.write_text("First name,ID number,Email address\nBen,7,b@x.org\n")
    assert read_students(str(path)).columns == ("ID number",)
    path.write_text("matriculation,mail\n7,b@x.org\n")
    with pytest.raises(BadFile, match=r"has 'matriculation', 'mail'\. Choose one with --column"):
        read_students(str(path))
    with pytest.raises(BadArgument, match="which is not given"):
        read_students("ada,ben", "name")
    with pytest.raises(BadArgument, match="would share the folder"):
        read_students("Ada B, ada-b")
    with pytest.raises(BadArgument, match="no students"):
        read_students(" , ")
    with pytest.raises(BadFile, match="cannot read"):
        read_students(str(tmp_path / "none.csv"))


def test_file_is_attempted_unless_it_is_as_handed_out() -> None:
    assert not attempted('def f(x):\n    """Do."""\n    raise Unsolved("f")\n', ["f"])
    assert attempted("def f(x):\n    return 1\n", ["f"])
    assert attempted("def f(", ["f"])
