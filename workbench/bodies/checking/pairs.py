"""A left and a right hand compared: which arrays of one are mirror images of the other's."""

from collections.abc import Iterator

import numpy as np

from workbench.arrays import Array
from workbench.bodies.checking.findings import FileFinding
from workbench.bodies.checking.model_arrays import ModelArrays
from workbench.geometry.mirror import AXIAL, Mirror

CLOSE = 1e-3  # of the largest entry, to which one array is the other's mirror image


def about_pair(model: ModelArrays, other: ModelArrays) -> Iterator[FileFinding]:
    """Findings about the arrays of a model that are no mirror images, x -> -x, of those of another.

    Both have the same vertices and joints in the same order.
    """
    if model.template is None or other.template is None:
        return
    if model.template.shape != other.template.shape or model.n_joints != other.n_joints:
        yield FileFinding(
            "v_template",
            f"The other hand has {len(other.template):,} vertices and {other.n_joints} joints, and "
            f"this one {len(model.template):,} and {model.n_joints}: only hands of one mesh can be "
            "compared. Give the two files of one release.",
        )
        return
    mirror = Mirror(np.arange(len(model.template)), np.arange(model.n_joints))
    smpl = 9 * (model.n_joints - 1)
    pairs: list[tuple[str, Array | None, Array | None, Array | None]] = [
        ("v_template", model.template, other.template, mirror.points(other.template))
    ]
    if other.shapedirs is not None:
        turned = mirror.directions(other.shapedirs)
        pairs.append(("shapedirs", model.shapedirs, other.shapedirs, turned))
    if other.posedirs is not None and other.posedirs.shape[2] == smpl:
        turned = mirror.posedirs(other.posedirs)
        pairs.append(("posedirs", model.posedirs, other.posedirs, turned))
    for key in ("hands_mean", "hands_components"):
        own, theirs = model.extra(key), other.extra(key)
        if own is not None and theirs is not None and theirs.size % 3 == 0:
            axes = theirs.reshape(*theirs.shape[:-1], -1, 3) * AXIAL
            pairs.append((key, own, theirs, axes.reshape(theirs.shape)))
    for key, own, theirs, mirrored in pairs:
        if own is None or theirs is None or mirrored is None or own.shape != theirs.shape:
            continue
        yield from _compared(key, own, theirs, mirrored)


def _compared(key: str, own: Array, theirs: Array, mirrored: Array) -> Iterator[FileFinding]:
    scale = float(abs(theirs).max(initial=0.0))
    off, same = (float(abs(own - a).max(initial=0.0)) for a in (mirrored, theirs))
    if off <= CLOSE * scale:
        return
    what = f"{key} differs from the mirror image of the other hand's by up to {off:.3g}"
    if same <= CLOSE * scale:
        how = (
            "multiply its rotation vectors by (1, -1, -1)"
            if key.startswith("hands")
            else f"change the sign of x: {key}[..., 0] *= -1"
            if key == "v_template"
            else f"change the sign of x: {key}[:, 0, :] *= -1"
            if key == "shapedirs"
            else "mirror it with workbench.bodies.mirrored"
        )
        yield FileFinding(key, f"{what}, and is equal to it unmirrored. To mend it, {how}.")
    else:
        yield FileFinding(
            key,
            f"{what}. If both hands are meant to be of one person, make one of the other with "
            "workbench.bodies.mirrored; hands that were learned apart may differ.",
            warning=False,
        )
