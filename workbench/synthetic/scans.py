"""Scans of a surface by depth cameras, simulated, with everything known that a scan does not say.

Each scanner sees what the rays of its pixels hit first, so that parts of the body that touch or
hide each other are scanned as they would be: only the outermost surface gives points.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from workbench.arrays import Array, Index, Mask
from workbench.blocks import Values
from workbench.blocks.checks import numbers, reals, several
from workbench.errors import BadArgument
from workbench.fitting.scans.scan import BadScan, Scan
from workbench.geometry.meshes import Mesh
from workbench.geometry.solids import vertex_normals
from workbench.synthetic.clutter import Clutter, Strewn, strewn
from workbench.synthetic.measured_views import Losses, angles, measured_view, noisy
from workbench.synthetic.scan_effects import Clothing, Holes, Noise, Region
from workbench.synthetic.scan_grids import Joining, areas
from workbench.synthetic.scanners import Scanner

CLOTHING, HOLES, CLUTTER, NOISE = range(4)  # each effect has a stream of random numbers of its own


@dataclass(frozen=True, eq=False)
class SimulatedScan:
    """A scan of M points, and the truth about each of them and about the N vertices.

    Attributes:
        scan: what the scanners give. The weights are the areas behind the pixels of each view, so
            that what two scanners see counts twice.
        view: (M,) the number of the scanner that each point comes from.
        clutter: (M,) which points do not belong to the body.
        face: (M,) the face on which the ray of each point hit the surface; -1 for clutter.
        shares: (M, 3) the barycentric coordinates of that place; 0 for clutter.
        surface: (N, 3) m, what was scanned, clothing included.
        skin: (N, 3) m, the surface without clothing.
        faces: (F, 3) those of the surface.
        seen: (N,) which vertices some scanner saw, at whatever resolution: in its image, with
            nothing before them, not in a hole, not too steep, and not cut off.
        scanners: the scanners, in the order of their numbers.
        made_of: the values from which the skin was made, if they were given.

    >>> from workbench import load_body
    >>> from workbench.synthetic import Noise, scan, scanners
    >>> body = load_body("small")
    >>> simulated = scan(body.vertices(), body.faces, scanners(2), noise=Noise(), seed=0)
    >>> off = simulated.scan.points - simulated.true_points
    >>> bool(0.004 < off.std() * 3**0.5 < 0.01)  # m, at a distance of 2 m
    True
    """

    scan: Scan
    view: Index
    clutter: Mask
    face: Index
    shares: Array
    surface: Array
    skin: Array
    faces: Index
    seen: Mask
    scanners: tuple[Scanner, ...]
    made_of: Values | None = None

    @property
    def true_points(self) -> Array:
        """Where the rays hit the surface, (M, 3) m; NaN for clutter."""
        found = np.einsum("mk,mki->mi", self.shares, self.surface[self.faces[self.face]])
        found[self.clutter] = np.nan
        return np.asarray(found)

    def some(self, chosen: Mask) -> "SimulatedScan":
        """The points that a mask (M,) chooses, with their truth; `seen` stays as it is.

        Raises BadScan if no point is left, or for a mask of another shape.
        """
        return replace(
            self,
            scan=self.scan.some(chosen),
            view=self.view[chosen],
            clutter=self.clutter[chosen],
            face=self.face[chosen],
            shares=self.shares[chosen],
        )


def scan(
    vertices: ArrayLike,
    faces: ArrayLike,
    scanners: Sequence[Scanner],
    *,
    seed: int,
    noise: Noise | None = None,
    holes: Holes | None = None,
    steepest: float = np.pi / 2,
    clutter: Clutter | None = None,
    clothing: Clothing | None = None,
    region: Region | None = None,
    joining: Joining | None = None,
    made_of: Mapping[str, ArrayLike] | None = None,
) -> SimulatedScan:
    """A scan of a surface with vertices (N, 3) m and faces (F, 3), counterclockwise from outside.

    Without effects, every point lies exactly on the surface. Each effect can be left out without a
    change of the random numbers of the others: `noise` of the depth, `holes`, the angle in rad
    between ray and normal beyond which a pixel is lost (`steepest`), `clutter`, `clothing`, the
    `region` to which a partial scan is cut, and the `joining` of pixels to triangles, without which
    the scan has no faces. The resolution is that of the scanners. The same `seed` gives the same
    scan. `made_of` is stored beside the scan.

    Raises BadMesh for a surface that does not fit together, BadArgument for a negative seed and if
    there are no scanners, and BadScan if nothing of the surface is left.
    """
    mesh = Mesh(reals("vertices", vertices), numbers("faces", faces).astype(np.int64, copy=False))
    some = several("scanners", scanners, Scanner)
    if not some or seed < 0:
        raise BadArgument(
            f"a scan is made by one scanner or more, with a seed from 0 on; not by {len(some)} "
            f"with the seed {seed}"
        )
    surface = mesh.vertices
    if clothing is not None:
        rng = np.random.default_rng((seed, CLOTHING))
        offsets = clothing.offsets(mesh.vertices, rng)
        surface = surface + offsets[:, None] * vertex_normals(mesh.vertices, mesh.faces)
    discs = (holes or Holes(0)).discs(surface, mesh.faces, np.random.default_rng((seed, HOLES)))
    losses = Losses(discs, steepest, region)
    views = []
    for number, scanner in enumerate(some):
        errors = np.random.default_rng((seed, NOISE, number)).standard_normal(scanner.n_pixels)
        views.append(measured_view(surface, mesh.faces, scanner, losses, noise, errors, joining))
    n_body = [len(view.points) for view in views]
    other = strewn(
        clutter or Clutter(0),
        (clutter or Clutter(0)).count(sum(n_body)),
        surface,
        some,
        [view.image for view in views],
        region,
        np.random.default_rng((seed, CLUTTER)),
    )
    C = len(other.points)
    if not sum(n_body):
        raise BadScan(
            "the scanners measure nothing of the surface: it is outside of their images, or what "
            "they see of it is cut off or lost; `scanners(n, target=...)` looks at a place"
        )
    points, normals, weights = _seen_clutter(other, some, noise)
    begin = np.cumsum([0, *n_body])
    triangles = [view.triangles + at for view, at in zip(views, begin[:-1], strict=True)]
    return SimulatedScan(
        scan=Scan(
            np.concatenate([*(view.points for view in views), points]),
            np.concatenate([*(view.normals for view in views), normals]),
            None if joining is None else np.concatenate(triangles),
            np.concatenate([*(view.weights for view in views), weights]),
        ),
        view=np.concatenate([np.repeat(np.arange(len(some)), n_body), other.view]),
        clutter=np.arange(begin[-1] + C) >= begin[-1],
        face=np.concatenate([*(view.face for view in views), np.full(C, -1)]),
        shares=np.concatenate([*(view.shares for view in views), np.zeros((C, 3))]),
        surface=surface,
        skin=mesh.vertices,
        faces=mesh.faces,
        seen=np.any([view.seen for view in views], axis=0),
        scanners=some,
        made_of=None
        if made_of is None
        else {name: reals(name, value) for name, value in made_of.items()},
    )


def _seen_clutter(
    other: Strewn, scanners: Sequence[Scanner], noise: Noise | None
) -> tuple[Array, Array, Array]:
    """Points (C, 3) m of clutter with noise, their normals (C, 3), and their weights (C,) m^2."""
    points, weights = other.points.copy(), np.zeros(len(other.points))
    for number, scanner in enumerate(scanners):
        mine = other.view == number
        at, normals = points[mine], other.normals[mine]
        exact = scanner.seen(at)[:, 2]
        rays = (at - scanner.place) / exact[:, None]
        depth = noisy(exact, angles(at, normals, scanner), noise, other.error[mine])
        points[mine] = scanner.place + depth[:, None] * rays
        weights[mine] = areas(depth, normals, rays, scanner.focal)
    return points, other.normals, weights
