"""Which side of a scan is outside, by the normals of its file, its faces or its camera."""

from dataclasses import replace

import numpy as np

from workbench.arrays import Array, Index
from workbench.fitting.scan_boundary import edges_of_one_face
from workbench.fitting.scan_contents import Contents
from workbench.fitting.scan_surface import (
    filled,
    normals_of_faces,
    normals_of_neighbours,
    towards,
)
from workbench.geometry.solids import face_vectors, volume


def with_normals(contents: Contents, camera: Array | None) -> Contents:
    """The scan with unit normals that point outwards, or without any if this is not known.

    Faces of a closed mesh that look inwards, and faces that look away from the camera, are turned
    round. A cloud has only the normals of its file, or those of neighbouring points turned to the
    camera. What is done is said in a note.
    """
    if contents.faces is not None:
        contents = _with_faces_outwards(contents, contents.faces, camera)
    points, faces, notes = contents.points, contents.faces, contents.notes
    normals = None if contents.normals is None else filled(points, contents.normals)
    if normals is not None and normals.any():
        source = "normals are those of the file"
    elif faces is not None:
        normals, source = (
            filled(points, normals_of_faces(points, faces)),
            "normals are of the faces",
        )
    elif camera is not None:
        normals, source = normals_of_neighbours(points), "normals are estimated from neighbours"
    else:
        normals = None
        source = "there are no normals: nothing says on which side of the points the inside is"
    if normals is not None and not normals.any():
        normals, source = None, "there are no normals: no face has an area"
    if normals is not None and camera is not None:
        turned = towards(normals, points, camera)
        count = int((turned != normals).any(axis=1).sum())
        if "estimated" in source:
            source += " and turned to the camera"
        elif count:
            source += f"; {count:,} are turned to the camera"
        normals = turned
    return replace(contents, normals=normals, notes=(*notes, source))


def _with_faces_outwards(contents: Contents, faces: Index, camera: Array | None) -> Contents:
    points = contents.points
    if not len(edges_of_one_face(faces)):
        inwards, why = volume(points - points.mean(axis=0), faces) < 0, "look inwards"
    elif camera is not None:
        middles = points[faces].mean(axis=1)
        facing = ((camera - middles) * face_vectors(points, faces)).sum()
        inwards, why = bool(facing < 0), "look away from the camera"
    else:
        inwards, why = False, ""
    if not inwards:
        return contents
    turned = np.ascontiguousarray(faces[:, ::-1])
    note = f"the faces {why}, and are turned round"
    return replace(contents, faces=turned, notes=(*contents.notes, note))
