"""What joints are called: names of many skeletons as those of SMPL, whatever their spelling.

The names are a table (`data/motions/joints.csv`): a line for each kind of skeleton, a column for
each joint of SMPL, and where the names are from. Names in one cell are alternatives. A joint that
lies elsewhere than SMPL's, as the collars of CMU's BVH files do, has none.
"""

import csv
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from pathlib import Path

from workbench.errors import BadFile, cut, shown, some
from workbench.reading.facts import bounded

SIDES = {"left": "left", "right": "right", "l": "left", "r": "right"}
SIDED = ("hip", "knee", "ankle", "foot", "collar", "shoulder", "elbow", "wrist")
ELSEWHERE = ("pelvis", "spine1", "spine2", "spine3", "neck", "head", "collar", "foot")
FINGERS = ("thumb", "index", "middle", "ring", "pinky")
WORD = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|[0-9]+")
MOST_TABLE = 2**20  # bytes of a table of names
HEADS = (["name", "joint"], ["label", "marker"])


@dataclass(frozen=True)
class SkeletonNames:
    """What one kind of skeleton calls the joints of SMPL.

    Attributes:
        name: of the kind.
        signs: readings of names that only this kind has; none if others tell it.
        joints: the readings of the names that a joint of SMPL may have, the first one preferred.
        source: where the names are from.
    """

    name: str
    signs: tuple[str, ...]
    joints: Mapping[str, tuple[str, ...]]
    source: str

    def matched(self, by_reading: Mapping[str, Sequence[int]]) -> dict[str, int]:
        """Which of the labels each joint is, by the `readings` of all labels."""
        if not all(sign in by_reading for sign in self.signs):
            return {}
        names = {
            joint: next((name for name in alternatives if name in by_reading), None)
            for joint, alternatives in self.joints.items()
        }
        return {joint: by_reading[name][0] for joint, name in names.items() if name is not None}


def words_of(label: str) -> list[str]:
    """The words of a label: `LeftUpLeg`, `left_up_leg` are left, up, leg; `spine_01` is spine, 1.

    A pinky is also called little.
    """
    words = [word.lower().lstrip("0") or "0" for word in WORD.findall(label)]
    return ["pinky" if word == "little" else word for word in words]


def reading(words: Sequence[str]) -> list[str]:
    """How words may be read, the likeliest first: `left upleg` for l, up, leg and for lupleg.

    The side comes first, wherever it is said; L5 has none.
    """
    plain, forms = "".join(words), []
    side = next((k for k, word in enumerate(words) if word in SIDES), None)
    if side is not None:
        rest = "".join([*words[:side], *words[side + 1 :]])
        if rest and not rest.isdecimal():
            forms.append(f"{SIDES[words[side]]} {rest}")
    forms.append(plain)
    return forms + [f"{SIDES[s]} {plain[len(s) :]}" for s in SIDES if plain.startswith(s)]


def readings(labels: Sequence[str]) -> dict[str, list[int]]:
    """The labels that may be read as a name, those first of which it is the likeliest reading.

    Words with which most labels begin, such as `mixamorig` or `Subject01`, are left out.
    """
    spelled = [words_of(re.split(r"[:|]", label)[-1]) for label in labels]
    while True:
        first = Counter(words[0] for words in spelled if len(words) > 1)
        word, count = first.most_common(1)[0] if first else ("", 0)
        if 2 * count <= len(spelled) or word in SIDES:
            break
        spelled = [words[1:] if len(words) > 1 and words[0] == word else words for words in spelled]
    by_reading: dict[str, list[int]] = {}
    possible = [reading(words) for words in spelled]
    for rank in range(max(map(len, possible), default=0)):
        for k, forms in enumerate(possible):
            if rank < len(forms) and (rank == 0 or forms[rank] not in by_reading):
                by_reading.setdefault(forms[rank], []).append(k)
    return by_reading


@cache
def skeletons() -> tuple[SkeletonNames, ...]:
    """All kinds of skeletons of the table."""
    text = (files("workbench") / "data" / "motions" / "joints.csv").read_text(encoding="utf-8")
    kinds = []
    for row in csv.DictReader(text.splitlines()):
        joints = {}
        for joint in (*row,)[2:-2]:
            plain = ["".join(words_of(name)) for name in row[joint].split()]
            for side in ("left", "right") if joint in SIDED else ("",):
                names = tuple(f"{side} {name}".strip() for name in plain)
                joints[f"{side}_{joint}".strip("_")] = names
        for finger in FINGERS if row["fingers"] else ():
            for n in "123":
                forms = [form.replace("*", f"{finger}{n}") for form in row["fingers"].split()]
                for side in ("left", "right"):
                    names = tuple(f"{side} {''.join(words_of(form))}" for form in forms)
                    joints[f"{side}_{finger}{n}"] = names
        signs = tuple(reading(words_of(sign))[0] for sign in row["sign"].split())
        kinds.append(SkeletonNames(row["skeleton"], signs, joints, row["source"]))
    return tuple(kinds)


def is_elsewhere(joint: str) -> bool:
    """Whether each kind of skeleton has a joint in another place: those of trunk and toes."""
    return joint.removeprefix("left_").removeprefix("right_") in ELSEWHERE


def renamed(labels: Sequence[str], table: Path) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Joints or markers under other names, empty for those to leave out, and notes.

    The table is text with a line for each: its name in the file, a comma, semicolon or tab, and its
    new name, or nothing. Names that it does not have stay. A line `name,joint` or `label,marker` is
    its head. Raises BadFile for another table, and for names of which none is in the file.
    """
    names: dict[str, str] = {}
    try:
        text = bounded(table, MOST_TABLE).decode("utf-8-sig")
        separator = next((mark for mark in "\t;" if mark in text), ",")
        for n, row in enumerate(csv.reader(text.splitlines(), delimiter=separator), start=1):
            cells = [cell.strip() for cell in row]
            if not any(cells) or [cell.lower() for cell in cells] in HEADS:
                continue
            if len(cells) != 2 or not cells[0]:
                raise BadFile(f"line {n} is {shown(row)}, but must be a name and its new one")
            if cells[0] in names:
                raise BadFile(f"line {n} names {shown(cells[0])} a second time")
            names[cells[0]] = cells[1]
        if not {*names} & {*labels}:
            raise BadFile(f"it names {some(names)}, and the file has {some(labels)}")
        new = tuple(names.get(label, label) for label in labels)
        repeated = [name for name, count in Counter(new).items() if name and count > 1]
        if repeated:
            raise BadFile(f"several would be called {some(sorted(repeated))}")
    except (OSError, UnicodeDecodeError, csv.Error, BadFile) as error:
        raise BadFile(f"{table} is no table of names, such as `LASI,LFWT`: {cut(error)}") from error
    missing = sorted({*names} - {*labels})
    note = f"{table.name} names {some(missing)}, which the file does not have"
    return new, (note,) * bool(missing)
