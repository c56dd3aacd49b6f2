"""The folder that `workbench register` wrote, as scans and fits for a coregistration."""

import hashlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from workbench.arrays import Array, Index
from workbench.bodies import SkinnedBody
from workbench.bodies.catalogue import load_skinned
from workbench.errors import BadFile
from workbench.fitting.scans.scan import BadScan, Scan
from workbench.geometry.surface_tree import SurfaceTree
from workbench.reading.arrays import opened, optional, read_expected, reals
from workbench.reading.facts import json_in
from workbench.registration.coregistration.coregistering import Fitted
from workbench.training.folder import TABLE, Row, read_table

SUMMARY_FILE = "summary.json"
SCAN_FILE, BODY_FILE = "scan.npz", "start.npz"  # beside a registration, and in the folder of all
REMEDY = "repeat `workbench register`"


@dataclass(frozen=True, eq=False)
class RegisteredScans:
    """Scans that were registered one by one, read from the folders of their registrations in
    `place`; `rows` are the lines of its table, and `subject` (J,) numbers subjects by their first
    lines.
    """

    place: Path
    rows: tuple[Row, ...]
    subject: Index

    @property
    def names(self) -> tuple[str, ...]:
        """The name of each scan, which is that of its folder."""
        return tuple(Path(row.file).parent.name for row in self.rows)

    @property
    def subjects(self) -> tuple[str, ...]:
        """The names of the subjects, as they are numbered."""
        return tuple(dict.fromkeys(row.subject for row in self.rows))

    def read(self, row: int) -> Scan:
        """The points that were registered, with normals and areas. Raises BadFile."""
        path = (self.place / self.rows[row].file).with_name(SCAN_FILE)
        with opened(path, "registered scan", REMEDY) as archive:
            expected = {
                "points": reals("M", 3),
                "normals": optional(reals("M", 3)),
                "areas": optional(reals("M")),
            }
            arrays = read_expected(archive, expected)
            try:
                return Scan(arrays["points"], arrays.get("normals"), weights=arrays.get("areas"))
            except BadScan as error:
                raise BadFile(str(error)) from error

    def doubts(self) -> dict[str, tuple[str, ...]]:
        """What spoke against each registration by itself, by scans. Raises BadFile."""
        by_scan = {}
        for name, row in zip(self.names, self.rows, strict=True):
            path = (self.place / row.file).with_name(SUMMARY_FILE)
            warnings = json_in(path).get("warnings", []) if path.is_file() else []
            if warnings:
                by_scan[name] = tuple(map(str, warnings))
        return by_scan

    def fitted(self, row: int, body: SkinnedBody) -> Fitted:
        """The body as it was fitted to a scan. Raises BadFile."""
        return Fitted(**self._arrays(row, body, ("pose", "betas", "trans")))

    def registration(self, row: int, body: SkinnedBody) -> np.ndarray:
        """The vertices (N, 3) m of a scan's registration by itself. Raises BadFile."""
        return self._arrays(row, body, ("vertices",))["vertices"]

    def _arrays(self, row: int, body: SkinnedBody, names: tuple[str, ...]) -> dict[str, np.ndarray]:
        expected = {
            "pose": reals(body.n_joints, 3),
            "betas": reals(body.n_betas),
            "trans": reals(3),
            "vertices": reals(body.n_vertices, 3),
        }
        with opened(self.place / self.rows[row].file, "registration", REMEDY) as archive:
            return read_expected(archive, {name: expected[name] for name in names})


def open_registered(place: Path) -> tuple[SkinnedBody, RegisteredScans]:
    """The body and the scans of a folder that `workbench register` wrote, all of them checked.

    Raises BadFile for another folder, a scan that cannot be read, and two scans that are the same.
    """
    if not (place / TABLE).is_file() or not (place / BODY_FILE).is_file():
        raise BadFile(
            f"{place} holds no {TABLE} and {BODY_FILE} of registered scans; register them first "
            "with `workbench register SCANS/ --subjects TABLE.csv`, and give the folder that it "
            "writes"
        )
    body, rows = load_skinned(place / BODY_FILE), read_table(place / TABLE)
    number = {name: s for s, name in enumerate(dict.fromkeys(row.subject for row in rows))}
    scans = RegisteredScans(place, rows, np.array([number[row.subject] for row in rows]))
    known: dict[str, str] = {}
    for j, name in enumerate(scans.names):
        digest = hashlib.sha256(scans.read(j).points.tobytes()).hexdigest()
        if digest in known:
            raise BadFile(
                f"the scans {known[digest]} and {name} are the same points; leave one of them out "
                f"of {place / TABLE}, or one scan counts twice"
            )
        known[digest] = name
        scans.fitted(j, body)
    return body, scans


WITHIN, FACING = 0.05, 0.5  # m, and the cosine of the normals: points that are compared


def distances(scans: RegisteredScans, body: SkinnedBody, together: Array) -> dict[str, Array]:
    """For each scan (J,) the median distance in m of its points from the surface, for the scan's
    registration by itself (`apart`) and for those found `together` (J, N, 3) m; and the mean
    distance in m between the vertices of both (`moved`).
    """
    rows = []
    for j, vertices in enumerate(together):
        scan, apart = scans.read(j), scans.registration(j, body)
        medians = []
        for surface in (apart, vertices):
            tree = SurfaceTree(surface, body.faces)
            contacts = tree.closest(scan.points, WITHIN, scan.normals, FACING)
            medians.append(float(np.median(np.abs(contacts.distances[contacts.faces >= 0]))))
        rows.append([*medians, float(np.linalg.norm(vertices - apart, axis=1).mean())])
    apart_m, together_m, moved = np.array(rows).T
    return {"apart": apart_m, "together": together_m, "moved": moved}


def beyond_betas(body: SkinnedBody, templates: Array) -> Array:
    """(S, N) m, how far templates (S, N, 3) m are from the nearest shape that betas reach.

    A template may also stand elsewhere than that shape.
    """
    places = np.tile(np.eye(3), (body.n_vertices, 1))
    reached = np.concatenate([body.shapedirs.reshape(-1, body.n_betas), places], axis=1)
    away = (templates - body.template).reshape(len(templates), -1)
    known, *_ = np.linalg.lstsq(reached, away.T, rcond=None)
    left = away - (reached @ known).T
    return np.asarray(np.linalg.norm(left.reshape(templates.shape), axis=2))
