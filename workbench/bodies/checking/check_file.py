"""Checking the file of a body model: a card, and findings with what to do about each."""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from workbench.bodies.checking.findings import (
    DECIDED,
    SIZES,
    about_hands,
    about_numbers,
    about_places,
    about_spaces,
    about_tree,
    axis_of,
    directions,
    hands_in_file,
    model_of,
)
from workbench.bodies.checking.model_arrays import (
    FileFinding,
    ModelArrays,
    kind_of,
    model_arrays,
    used_keys,
)
from workbench.bodies.files.layouts import (
    INSTEAD,
    body_from,
    is_triangle_body,
    triangle_body_from,
)
from workbench.bodies.files.pickles import Contents
from workbench.bodies.files.reading import (
    CAPSULES,
    MIRROR,
    OURS,
    REQUIRED,
    Entries,
    contents_of,
    is_npz,
    sorted_out,
)
from workbench.bodies.spaces import COUNTS, WITH_FACE
from workbench.environment import expanded
from workbench.errors import BadFile, WorkbenchError, cut, some
from workbench.reading.facts import parsed

LICENCE = re.compile(r"licen[cs]e|copyright|terms", re.IGNORECASE)
LONGEST = 2000  # characters of the text of a licence


def facts_of(model: ModelArrays, size: int) -> dict[str, str]:
    """Sizes and kinds by name, for a file of `size` bytes."""
    N = 0 if model.template is None else len(model.template)
    return {
        "model": _model(model),
        "file": f"{_kind(model.where)}, {size / 1e6:.1f} MB",
        "vertices": f"{N:,}",
        "faces": "0" if model.faces is None else f"{len(model.faces):,}",
        "joints": f"{model.n_joints}: {some(model.names)}" if model.names else "none",
        "betas": _betas(model),
        "pose features": _features(model),
        "size": _size(model),
        **({"side": _side(model)} if model.family == "MANO" else {"axes": _axes(model)}),
        **_texts(model.raw, "gender"),
        **licence_of(model.raw),
    }


def _model(model: ModelArrays) -> str:
    card, name = own_card(model.raw), model_of(model)
    said = next((card[key] for key in ("model", "name") if isinstance(card.get(key), str)), "")
    layout = f"in the layout of {name}" if name != "SMPL-like" else "of another tree than SMPL's"
    return f"{cut(said, 60)}, {layout}" if said else layout


def _kind(where: str) -> str:
    path = Path(where)
    if not path.is_file():
        return "embedded"
    return ".npz" if is_npz(path) else "pickle, of which no code was run"


def _betas(model: ModelArrays) -> str:
    if model.shapedirs is None:
        return "unknown"
    B = int(model.shapedirs.shape[2])
    if model.family in WITH_FACE and B in COUNTS:
        return f"{B}: {COUNTS[B][0]} of shape and {COUNTS[B][1]} of expression"
    return f"{B} of shape"


def _features(model: ModelArrays) -> str:
    if model.posedirs is None:
        return "unknown"
    P, K = model.posedirs.shape[2], model.n_joints
    kind = {
        9 * (K - 1): "elements of rotation matrices, as in SMPL",
        4 * (K - 1) + 1: "quaternions and beta 2, as in STAR",
    }.get(P, "of an unknown kind")
    return f"{P}, {kind}"


def _size(model: ModelArrays) -> str:
    if model.template is None or not np.isfinite(model.size):
        return "unknown"
    x, y, z = np.ptp(model.template, axis=0)
    unit = "m" if model.family in SIZES else "m, if it is in metres"
    return f"{x:.3f} wide, {y:.3f} high, {z:.3f} deep, in {unit}"


def _axes(model: ModelArrays) -> str:
    said = [f"{name} is {axis_of(way)}" for name, way in directions(model).items()]
    return ", ".join(said) or "unknown: the joints have no names that say it"


def _side(model: ModelArrays) -> str:
    for hand in hands_in_file(model):
        if abs(hand.chirality) > DECIDED:
            return f"a {'left' if hand.chirality > 0 else 'right'} hand, by its mean pose"
    return "unknown: there is no mean pose that closes the fingers"


def _texts(raw: Contents, key: str) -> dict[str, str]:
    text = Entries(raw, "").text(key, "")
    return {key: cut(text, 60)} if text else {}


def own_card(raw: Contents) -> dict[str, Any]:
    """The card in a file that the workbench wrote; empty for other files."""
    try:
        card = parsed(Entries(raw, "").text("card", "null"))
    except BadFile:
        return {}
    return card if isinstance(card, dict) else {}


def licence_of(raw: Contents) -> dict[str, str]:
    """The text of the licence, if the file has one, by the key that it has there."""
    found = {}
    for key, value in own_card(raw).items():
        if LICENCE.search(key) and isinstance(value, str):
            found["licence"] = cut(value, LONGEST)
    for key in raw:
        if LICENCE.search(key):
            text = Entries(raw, "").text(key, "")
            found[key] = cut(text, LONGEST) if text else f"there, but {kind_of(raw[key])}"
    return found or {"licence": "the file has no text of one; ask where it is from"}


def left_out_of(raw: Contents) -> dict[str, str]:
    """The keys that `load_body` cannot keep, each with the reason: `is a dict, not an array`."""
    _, left_out = sorted_out(raw, {*used_keys(raw), *OURS, *CAPSULES, MIRROR})
    return {line.partition(", which ")[0]: line.partition(", which ")[2] for line in left_out}


def keys_of(raw: Contents) -> tuple[tuple[str, str, str], ...]:
    """Each key, its shape and type, and what becomes of it when the file is loaded and saved."""
    used = used_keys(raw)
    kept, _ = sorted_out(raw, {*used, *OURS, *CAPSULES, MIRROR})
    fates = dict.fromkeys(raw, "read as the workbench's own")
    fates |= dict.fromkeys(left_out_of(raw), "left out, for the reason below")
    fates |= dict.fromkeys(kept, "kept, and saved again") | dict.fromkeys(used, "computed with")
    order = sorted(raw, key=lambda name: (name not in used, name in kept, name))
    return tuple((cut(key, 60), kind_of(raw[key]), fates[key]) for key in order)


CHECKS = (about_numbers, about_tree, about_places, about_spaces, about_hands)
LEAST = 3  # arrays of SMPL's that a file must have to count as a body's


@dataclass(frozen=True)
class FileCheck:
    """What a model file is, and what is wrong with it.

    Attributes:
        path: the file.
        facts: what it is: sizes, joints, unit, licence, by name.
        keys: each key with its shape and type, and what becomes of it.
        findings: warnings first.
    """

    path: str
    facts: dict[str, str]
    keys: tuple[tuple[str, str, str], ...]
    findings: tuple[FileFinding, ...]

    @property
    def warnings(self) -> tuple[FileFinding, ...]:
        """The findings that make the model compute something wrong."""
        return tuple(finding for finding in self.findings if finding.warning)

    def report(self) -> str:
        """The card, the keys and the findings as text."""
        widest = max(map(len, self.facts))
        lines = [self.path, *(f"  {name:{widest}}  {text}" for name, text in self.facts.items())]
        widths = [max((len(row[i]) for row in self.keys), default=0) for i in (0, 1)]
        lines += ["", "keys"]
        lines += [f"  {a:{widths[0]}}  {b:{widths[1]}}  {c}" for a, b, c in self.keys]
        return "\n".join([*lines, "", *self.lines()])

    def lines(self) -> list[str]:
        """Each finding as a line."""
        return [
            f"{'warning' if finding.warning else 'note'}: {finding.part}: {finding.text}"
            for finding in self.findings
        ] or ["nothing was found to be wrong"]


def check_body_file(path: str | Path) -> FileCheck:
    """A card of a model file, and findings about it: what is wrong, what follows, what to do.

    The file is an .npz or a pickle in SMPL's layout (SMPL, SMPL-H, SMPL-X, MANO, FLAME, STAR), or
    one that `save_body` wrote; nothing in it is run. The checks go on where `load_body` refuses a
    file. Raises BadFile if a file cannot be read, or holds no body at all.
    """
    file = expanded(path)
    raw = contents_of(file)
    return check_contents(raw, str(file), file.stat().st_size)


def check_contents(raw: Contents, where: str, size: int = 0) -> FileCheck:
    """The same for entries that were read from a file, or are to be written to one."""
    if is_triangle_body(raw):
        refused = _refusal(raw, where)
        facts = {"model": "a TriangleBody", "loads": refused or "yes"}
        return FileCheck(where, facts, keys_of(raw), (_refused(refused),) if refused else ())
    model = model_arrays(_body_in(raw, where), where)
    findings = [*model.findings, *_checked(model)]
    refused = _refusal(raw, where)
    if refused and not any(finding.warning for finding in findings):
        findings.append(_refused(refused))
    findings += [
        FileFinding(
            cut(key, 60), f"{cut(key, 60)} is left out, because it {reason}.", warning=False
        )
        for key, reason in left_out_of(raw).items()
    ]
    facts = {**facts_of(model, size), "loads": f"no: {refused}" if refused else "yes"}
    return FileCheck(where, facts, keys_of(raw), _sorted(findings))


def _checked(model: ModelArrays) -> Iterator[FileFinding]:
    with np.errstate(all="ignore"):  # what is made of absurd numbers passes no comparison
        for check in CHECKS:
            yield from check(model)


def _body_in(raw: Contents, where: str) -> Contents:
    """The entries, if they are those of a body. Raises BadFile."""
    have = {key.partition("/")[0] for key in raw}
    if len(have & {*REQUIRED}) >= LEAST:
        return raw
    instead = next((f" It looks like {what}." for keys, what in INSTEAD if keys <= have), "")
    raise BadFile(
        f"{where} holds no body: it has {some(sorted(have))}.{instead} A body has "
        f"{', '.join(REQUIRED)}"
    )


def _refused(why: str) -> FileFinding:
    return FileFinding("file", f"The file is refused by load_body: {why}.")


def _refusal(raw: Contents, where: str) -> str:
    """Why `load_body` refuses the file; empty if it does not."""
    make = triangle_body_from if is_triangle_body(raw) else body_from
    try:
        make(raw, Path(where).stem, where)
    except WorkbenchError as error:
        return cut(error).removeprefix(where).removeprefix(":").strip()
    return ""


def _sorted(findings: list[FileFinding]) -> tuple[FileFinding, ...]:
    return tuple(sorted(findings, key=lambda finding: not finding.warning))
