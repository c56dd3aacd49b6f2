"""A body as one page in which theta and beta can be moved, computed in the browser."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from workbench.bodies import SkinnedBody
from workbench.bodies.triangles import TriangleBody
from workbench.reports.page import page
from workbench.reports.replay.recording import skinned_data, triangle_data
from workbench.writing import write_file

NOTE = (
    "This page computes what the workbench computes, in double precision; only {single} stored in "
    "single precision. A test compares its vertices in a browser with those of Python: they differ "
    "by less than {millimetres} mm. The page's address keeps the settings, so that a link to it "
    "shows the same body."
)


@dataclass(frozen=True)
class Part:
    """A switch of the page.

    Attributes:
        id: what the page's program calls the part.
        label: what the reader sees.
        on: whether it is on at first; the whole model has all parts in this state.
    """

    id: str
    label: str
    on: bool = True


SKINNED = (
    Part("weights", "blend weights"),
    Part("pose_shapes", "pose blend shapes"),
    Part("shape_shapes", "shape blend shapes"),
    Part("dual", "dual quaternions instead of linear blending", on=False),
)
STITCHED = (
    Part("pose_shapes", "Q, what the pose does to each triangle"),
    Part("shape_shapes", "D, what the shape does to each triangle"),
    Part("stitched", "stitching; without it, each triangle is deformed about its own centre"),
)
BLENDED = Part("weights", "blending of the parts' rotations, of which each triangle has several")


def write_sliders(
    body: SkinnedBody | TriangleBody,
    path: str | Path,
    start: Mapping[str, Any] | None = None,
    origin: str = "",
) -> Path:
    """Write the page of a body. Raises BadArgument for one that it cannot show, and BadFile.

    See `sliders_page` for `start` and `origin`.
    """
    text, path = sliders_page(body, start, origin), Path(path)
    write_file(path, text)
    return path


def sliders_page(
    body: SkinnedBody | TriangleBody, start: Mapping[str, Any] | None = None, origin: str = ""
) -> str:
    """The page of a body as HTML. Raises BadArgument for a body that it cannot show.

    `start` is what the page opens with, as `settings_of` makes it, and `origin` says where it is
    from; without it the elbows are bent.
    """
    if isinstance(body, TriangleBody):
        data, script = triangle_data(body), "scape.js"
        single, millimetres = "the deformations of triangles are", "0.00005"
        parts = STITCHED if data["model"] == "SCAPE" else (BLENDED, *STITCHED)
    else:
        data, script = skinned_data(body), "smpl.js"
        single, millimetres = "the pose blend shapes are", "0.00001"
        parts = SKINNED
    return page(
        "sliders.html",
        title=f"Moving theta and beta: {body.name}",
        data=data,
        parts=parts,
        script=script,
        start=None if start is None else {**start, "pose_shapes": False},
        origin=origin,
        note=NOTE.format(single=single, millimetres=millimetres),
    )
