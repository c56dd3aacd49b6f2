"""Checking the file of a body model: a card, and findings with what to do about each."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from workbench.bodies.checking.findings import FileFinding
from workbench.bodies.checking.hands import about_hands
from workbench.bodies.checking.model_arrays import ModelArrays, model_arrays
from workbench.bodies.checking.model_card import facts_of, keys_of, left_out_of
from workbench.bodies.checking.numbers import about_numbers
from workbench.bodies.checking.pairs import about_pair
from workbench.bodies.checking.places import about_places
from workbench.bodies.checking.spaces import about_spaces
from workbench.bodies.checking.trees import about_tree
from workbench.bodies.files.contents import contents_of
from workbench.bodies.files.entries import Contents
from workbench.bodies.files.extras import REQUIRED
from workbench.bodies.files.smpl_layout import INSTEAD, body_from
from workbench.bodies.files.triangle_layout import is_triangle_body, triangle_body_from
from workbench.environment import expanded
from workbench.errors import BadFile, WorkbenchError, cut, some

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


def check_body_file(path: str | Path, other_hand: str | Path | None = None) -> FileCheck:
    """A card of a model file, and findings about it: what is wrong, what follows, what to do.

    The file is an .npz or a pickle in SMPL's layout (SMPL, SMPL-H, SMPL-X, MANO, FLAME, STAR), or
    one that `save_body` wrote; nothing in it is run. The checks go on where `load_body` refuses a
    file. Two hands of one mesh are compared if the other one's file is given. Raises BadFile if a
    file cannot be read, or holds no body at all.
    """
    file = expanded(path)
    raw = contents_of(file)
    findings = []
    if other_hand is not None:
        other = expanded(other_hand)
        both = (raw, str(file)), (contents_of(other), str(other))
        findings = list(about_pair(*(model_arrays(_body_in(*one), one[1]) for one in both)))
    return check_contents(raw, str(file), file.stat().st_size, findings)


def check_contents(
    raw: Contents, where: str, size: int = 0, more: list[FileFinding] | None = None
) -> FileCheck:
    """The same for entries that were read from a file, or are to be written to one."""
    findings = list(more or [])
    if is_triangle_body(raw):
        refused = _refusal(raw, where)
        facts = {"model": "a TriangleBody", "loads": refused or "yes"}
        findings += (
            [FileFinding("file", f"The file is refused by load_body: {refused}.")]
            if refused
            else []
        )
        return FileCheck(where, facts, keys_of(raw), _sorted(findings))
    model = model_arrays(_body_in(raw, where), where)
    findings += [*model.findings, *_checked(model)]
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


def _left_out(key: str, reason: str) -> FileFinding:
    return FileFinding(key, f"{key} is left out, because it {reason}.", warning=False)


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
