"""What meshes in motion leave open about a skeleton, in sentences."""

from collections.abc import Sequence

import numpy as np

from workbench.arrays import Array
from workbench.training.rigging.joints import ROUNDING, JointCandidate

CERTAIN = 2.0  # factor on the rms that any bones leave: a body that leaves more is doubted
STILL = 0.05  # rad, rms: bones that turn less against each other hardly turn


def notes_of(
    joints: Sequence[JointCandidate], names: Sequence[str], merged: int, rms: float, least: float
) -> tuple[str, ...]:
    """What is not certain, in sentences: the whole, merged bones, each such joint, and the root.

    `rms` is what the body leaves of the meshes, and `least` what bones in joints must leave (m).
    """
    found = []
    if rms > CERTAIN * least + ROUNDING:
        found.append(
            f"the body leaves {1e3 * rms:.2g} mm of the meshes (rms), and only "
            f"{1e3 * least:.1g} mm are more than any {len(names)} bones in joints can explain: "
            "either the skin does not follow linear blend skinning, or bones and tree are not the "
            "right ones; they are not certain"
        )
    if merged:
        found.append(
            f"{merged} {'bone' if merged == 1 else 'bones'} moved as another one did, and "
            f"{'was' if merged == 1 else 'were'} merged with it: the meshes do not tell them apart"
        )
    found += [sentence(joint, names) for joint in joints if len(joint.free)]
    found.append(
        f"no motion shows where the joint of {names[0]} is, because it may stand elsewhere and "
        "turn about another point: it is in the middle of the surface that it carries"
    )
    return tuple(found)


def sentence(joint: JointCandidate, names: Sequence[str]) -> str:
    """What is not determined of a joint, in a sentence."""
    above, own = (names[k] for k in joint.bones)
    if joint.parting[-1] > STILL and len(joint.free) > 1:
        return (
            f"{own} and {above} take their joint {1e3 * joint.gap:.1f} mm apart (rms), so that "
            "it is not known to within a centimetre"
        )
    if len(joint.free) == 1:
        return (
            f"{own} turns against {above} about one axis only: its joint may slide along "
            f"{in_words(joint.free[0])} by {_distance(joint.slides[0])}"
        )
    return (
        f"{own} hardly turns against {above} (by {np.degrees(joint.parting[-1]):.2g} degrees, "
        "rms): its joint may lie elsewhere, and the two may be one bone"
    )


def in_words(direction: Array) -> str:
    """A direction at rest, with its largest component positive: `(0.99, 0.10, 0.00)`."""
    d = direction * np.sign(direction[np.abs(direction).argmax()])
    rounded = [round(float(x), 2) + 0.0 for x in d]  # and no minus before a zero
    return f"({', '.join(f'{x:.2f}' for x in rounded)})"


def _distance(slide: float) -> str:
    return "any distance" if slide > 1 else f"{100 * slide:.0f} cm"
