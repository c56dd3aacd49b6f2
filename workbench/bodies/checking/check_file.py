"""Checking the file of a body model: a card, and findings with what to do about each."""

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from workbench.bodies.checking import findings as about
from workbench.bodies.checking.model_arrays import (
    FileFinding,
    ModelArrays,
    kind_of,
    model_arrays,
    used_keys,
)
from workbench.bodies.files.layouts import (
    LOOKALIKES,
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
    kept_and_left_out,
)
from workbench.bodies.spaces import FACE_BETAS, WITH_FACE
from workbench.environment import expanded
from workbench.errors import BadFile, WorkbenchError, cut, some
from workbench.reading.facts import parsed

LICENCE = re.compile(r"licen[cs]e|copyright|terms", re.IGNORECASE)
LONGEST_LICENCE = 2000  # characters of the text of a licence


def facts_of(model: ModelArrays, size: int) -> dict[str, str]:
    """Sizes and kinds by name, for a file of `size` bytes."""
    card, name, path = own_card(model.raw), about.model_of(model), Path(model.where)
    title = next((card[key] for key in ("model", "name") if isinstance(card.get(key), str)), "")
    layout = f"in the layout of {name}" if name != "SMPL-like" else "of another tree than SMPL's"
    kind = "embedded"
    if path.is_file():
        kind = ".npz" if is_npz(path) else "pickle, of which no code was run"
    betas = features = extent = "unknown"
    if model.shapedirs is not None:
        B = int(model.shapedirs.shape[2])
        betas = f"{B} of shape"
        if model.family in WITH_FACE and B in FACE_BETAS:
            betas = f"{B}: {FACE_BETAS[B][0]} of shape and {FACE_BETAS[B][1]} of expression"
    if model.posedirs is not None:
        P, K = model.posedirs.shape[2], model.n_joints
        kinds_of_features = {
            9 * (K - 1): "elements of rotation matrices, as in SMPL",
            4 * (K - 1) + 1: "quaternions and beta 2, as in STAR",
        }
        features = f"{P}, {kinds_of_features.get(P, 'of an unknown kind')}"
    if model.template is not None and np.isfinite(model.size):
        x, y, z = np.ptp(model.template, axis=0)
        unit = "m" if model.family in about.SIZES else "m, if it is in metres"
        extent = f"{x:.3f} wide, {y:.3f} high, {z:.3f} deep, in {unit}"
    gender = Entries(model.raw, "").text("gender", "")
    return {
        "model": f"{cut(title, 60)}, {layout}" if title else layout,
        "file": f"{kind}, {size / 1e6:.1f} MB",
        "vertices": f"{0 if model.template is None else len(model.template):,}",
        "faces": f"{0 if model.faces is None else len(model.faces):,}",
        "joints": f"{model.n_joints}: {some(model.names)}" if model.names else "none",
        "betas": betas,
        "pose features": features,
        "size": extent,
        **({"side": _side(model)} if model.family == "MANO" else {"axes": _axes(model)}),
        **({"gender": cut(gender, 60)} if gender else {}),
        **licence_of(model.raw),
    }


def _axes(model: ModelArrays) -> str:
    axes = [f"{name} is {about.axis_of(way)}" for name, way in about.directions(model).items()]
    return ", ".join(axes) or "unknown: the joints have no names that say it"


def _side(model: ModelArrays) -> str:
    for hand in about.hands_in_file(model):
        if abs(hand.chirality) > about.DECIDED:
            return f"a {'left' if hand.chirality > 0 else 'right'} hand, by its mean pose"
    return "unknown: there is no mean pose that closes the fingers"


def own_card(raw: Contents) -> dict[str, Any]:
    """The card in a file that the workbench wrote; empty for other files."""
    try:
        card = parsed(Entries(raw, "").text("card", "null"))
    except BadFile:
        return {}
    return card if isinstance(card, dict) else {}


def licence_of(raw: Contents) -> dict[str, str]:
    """The text of the licence, if the file has one, by the key that it has there."""
    texts = {}
    for key, value in own_card(raw).items():
        if LICENCE.search(key) and isinstance(value, str):
            texts["licence"] = cut(value, LONGEST_LICENCE)
    for key in filter(LICENCE.search, raw):
        text = Entries(raw, "").text(key, "")
        texts[key] = cut(text, LONGEST_LICENCE) if text else f"there, but {kind_of(raw[key])}"
    return texts or {"licence": "the file has no text of one; ask where it is from"}


def left_out_of(raw: Contents) -> dict[str, str]:
    """The keys that `load_body` cannot keep, each with the reason: `is a dict, not an array`."""
    _, left_out = kept_and_left_out(raw, {*used_keys(raw), *OURS, *CAPSULES, MIRROR})
    return {line.partition(", which ")[0]: line.partition(", which ")[2] for line in left_out}


def keys_of(raw: Contents) -> tuple[tuple[str, str, str], ...]:
    """Each key, its shape and type, and what becomes of it when the file is loaded and saved."""
    used = used_keys(raw)
    kept, _ = kept_and_left_out(raw, {*used, *OURS, *CAPSULES, MIRROR})
    fates = dict.fromkeys(raw, "read as the workbench's own")
    fates |= dict.fromkeys(left_out_of(raw), "left out, for the reason below")
    fates |= dict.fromkeys(kept, "kept, and saved again") | dict.fromkeys(used, "computed with")
    order = sorted(raw, key=lambda name: (name not in used, name in kept, name))
    return tuple((cut(key, 60), kind_of(raw[key]), fates[key]) for key in order)


FEWEST_ARRAYS = 3  # arrays of SMPL's that a file must have to count as a body's


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
    triangles = is_triangle_body(raw)
    refused = ""
    try:
        (triangle_body_from if triangles else body_from)(raw, Path(where).stem, where)
    except WorkbenchError as error:
        refused = cut(error).removeprefix(where).removeprefix(":").strip()
    findings: list[FileFinding] = []
    if triangles:
        facts = {"model": "a TriangleBody"}
    else:
        _refuse_others(raw, where)
        model = model_arrays(raw, where)
        findings += model.findings
        with np.errstate(all="ignore"):  # what is made of absurd numbers passes no comparison
            findings += [finding for check in about.CHECKS for finding in check(model)]
            facts = facts_of(model, size)
    if refused and not any(finding.warning for finding in findings):
        findings.append(FileFinding("file", f"The file is refused by load_body: {refused}."))
    if not triangles:
        findings += [
            FileFinding(cut(key, 60), f"{cut(key, 60)} is left out, because it {reason}.", False)
            for key, reason in left_out_of(raw).items()
        ]
    facts["loads"] = f"no: {refused}" if refused else "yes"
    findings.sort(key=lambda finding: not finding.warning)
    return FileCheck(where, facts, keys_of(raw), tuple(findings))


def _refuse_others(raw: Contents, where: str) -> None:
    """Raise BadFile for entries that are not those of a body."""
    have = {key.partition("/")[0] for key in raw}
    if len(have & {*REQUIRED}) < FEWEST_ARRAYS:
        instead = next((f" It looks like {what}." for keys, what in LOOKALIKES if keys <= have), "")
        raise BadFile(
            f"{where} holds no body: it has {some(sorted(have))}.{instead} A body has "
            f"{', '.join(REQUIRED)}"
        )
