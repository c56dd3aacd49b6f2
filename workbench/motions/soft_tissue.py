"""Soft tissue that follows a motion: dynamic blend shapes, and a model of their coefficients.

Dynamic blend shapes are added to the rest surface, as those of shape and pose are (Pons-Moll et
al., Dyna, 2015, and DMPL in Loper et al., SMPL, 2015, section 7):

    T = template + B_S(betas) + B_P(pose) + gain(betas) sum_c phi_c D_c

Their coefficients at frame t follow from those of the two frames before and from what moves,

    phi_t = A_1 phi_(t-1) + A_2 phi_(t-2) + B x_t

with x_t the inputs of `tissue_inputs`. Joints are those of the person without tissue, as in the
paper.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from importlib.resources import as_file, files
from pathlib import Path
from typing import Any

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csr_array

from workbench.arrays import Array, Index
from workbench.blocks.checks import reals as as_reals
from workbench.bodies import SkinnedBody
from workbench.bodies.body import Body, why_not_skinned
from workbench.bodies.readonly import locked
from workbench.bodies.spaces import body_mass_index, body_mass_index_of
from workbench.environment import expanded
from workbench.errors import BadArgument, BadFile
from workbench.motions.motion import FEWEST, Motion, splined
from workbench.motions.tissue_inputs import MovingFrames, tissue_inputs
from workbench.reading.arrays import opened, read_expected, reals, texts, wholes
from workbench.writing import write_arrays

LARGEST_RADIUS = 0.999  # of a model that is taken; at 60 frames a second it dies away in 17 s
SAME_RATE = 1e-6  # relative


@dataclass(frozen=True, eq=False)
class SoftTissue:
    """Dynamic blend shapes of a body of N vertices and the second-order model that drives them.

    The coefficients of frame t are phi_t = A_1 phi_(t-1) + A_2 phi_(t-2) + B x_t, x_t being inputs
    that follow from the motion.

    Raises BadArgument if the arrays do not fit together, or if the model is not stable: a spectral
    radius of `LARGEST_RADIUS` or more.

    Attributes:
        directions: (N, 3, C) m per unit of a coefficient, orthonormal up to a factor.
        first: (C, C), A_1.
        second: (C, C), A_2.
        response: (C, X), B.
        part: (N,) the soft part of each vertex; -1 if it is in none.
        fps: frames a second of the model.
        joint_names: of the body.
        n_betas: how many betas are among the inputs.
        power: gain(betas) = (body mass index / that of the mean person)^power.
        card: where its numbers come from.
    """

    directions: Array
    first: Array
    second: Array
    response: Array
    part: Index
    fps: float
    joint_names: tuple[str, ...]
    n_betas: int = 0
    power: float = 0.0
    card: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        names = ("directions", "first", "second", "response")
        given = {name: as_reals(name, getattr(self, name)) for name in names}
        given["part"] = np.asarray(self.part, dtype=np.int64)
        N, C = given["directions"].shape[0], given["directions"].shape[-1]
        X = 6 * len(self.joint_names) + 6 + 3 * (int(given["part"].max(initial=-1)) + 1)
        shapes = {"directions": (N, 3, C), "first": (C, C), "second": (C, C), "part": (N,)}
        shapes["response"] = (C, X + self.n_betas + 1)
        for name, shape in shapes.items():
            if given[name].shape != shape or not np.isfinite(given[name]).all():
                raise BadArgument(
                    f"{name} of soft tissue are {shape} finite numbers, not {given[name].shape}"
                )
        if not self.fps > 0:
            raise BadArgument(f"fps is a number above 0, not {self.fps!r:.60}")
        self.__dict__.update({name: locked(array.copy()) for name, array in given.items()})
        if not (radius := self.spectral_radius) < LARGEST_RADIUS:
            raise BadArgument(
                f"the model of the coefficients has a spectral radius of {radius:.4f}, so that "
                f"they would not die away; make it less than {LARGEST_RADIUS}, as `stabilized` of "
                "lecture 19 does"
            )

    @property
    def n_coefficients(self) -> int:
        """C, the number of dynamic blend shapes."""
        return int(self.directions.shape[2])

    @property
    def poles(self) -> Array:
        """The 2 C eigenvalues of the companion matrix of A_1 and A_2, complex."""
        return np.asarray(np.linalg.eigvals(companion(self.first, self.second)))

    @property
    def spectral_radius(self) -> float:
        """The largest size of a pole: what is left of a wobble after one frame."""
        return float(np.abs(self.poles).max(initial=0.0))

    def gain(self, body: SkinnedBody, betas: ArrayLike | None = None) -> float:
        """How much more the tissue of a person moves than that of the mean person."""
        return float((body_mass_index(body, betas) / body_mass_index(body)) ** self.power)

    def coefficients(self, body: SkinnedBody, motion: Motion) -> Array:
        """The coefficients (T, C) in a motion, frame by frame from the inputs alone.

        The first two frames begin at zero. The motion has the model's rate: see `prepared`.
        Raises BadArgument for another rate or another body.
        """
        self._check(body, motion)
        frames = MovingFrames.of(body, motion)
        x = tissue_inputs(frames, self.part, self.n_betas)
        return free_run(self.first, self.second, x @ self.response.T)

    def displacements(self, body: SkinnedBody, coefficients: ArrayLike, betas: Any = None) -> Array:
        """What coefficients (..., C) add to the rest surface of a person, (..., N, 3) m."""
        phi = as_reals("coefficients", coefficients)
        if phi.shape[-1:] != (self.n_coefficients,):
            raise BadArgument(
                f"this tissue has {self.n_coefficients} coefficients a frame, not {phi.shape}"
            )
        flat = self.directions.reshape(-1, self.n_coefficients)
        moved = (self.gain(body, betas) * phi) @ flat.T
        return np.asarray(moved.reshape(*phi.shape[:-1], -1, 3))

    def vertices(self, body: SkinnedBody, motion: Motion, exaggeration: float = 1.0) -> Array:
        """The surface (T, N, 3) m in a motion; the tissue moves `exaggeration` times as far.

        At an exaggeration of 0 the surface is that of `motion.vertices`, to the last bit.
        """
        phi = exaggeration * self.coefficients(body, motion)
        return self.surface(body, motion, phi)

    def surface(self, body: SkinnedBody, motion: Motion, coefficients: ArrayLike) -> Array:
        """The surface (T, N, 3) m in a motion with these coefficients (T, C).

        Each displacement is turned as the vertex is, by its blend of rotations.
        """
        self._check(body, motion)
        frames = MovingFrames.of(body, motion)
        bare = frames.motion.vertices(body)
        added = self.displacements(body, coefficients, frames.motion.betas)
        for t, d in enumerate(added):
            R = frames.turns[t].reshape(body.n_joints, 9)
            bare[t] += np.einsum("nij,nj->ni", (body.weights @ R).reshape(-1, 3, 3), d)
        return bare

    def prepared(self, motion: Motion) -> Motion:
        """The motion at the model's rate: as it is, or splined (`splined`)."""
        same = abs(motion.fps / self.fps - 1) < SAME_RATE
        return motion if same else splined(motion, self.fps)

    def gain_of(self, body: SkinnedBody, betas: cs.MX) -> cs.MX:
        """`gain` (1, 1) in symbols, of betas (B, 1): see `body_mass_index_of` for its derivatives.

        It is the number 1 if the power is 0.
        """
        if not self.power:
            return cs.MX(1)
        return (body_mass_index_of(body, betas) / body_mass_index(body)) ** self.power

    def _checked(self, body: Body) -> SkinnedBody:
        if reason := why_not_skinned(body, "soft tissue", "give the skinned body it was made from"):
            raise BadArgument(reason)
        if body.n_vertices != len(self.part) or tuple(body.joint_names) != self.joint_names:
            raise BadArgument(
                f"this soft tissue is that of {self.card.get('body', 'another body')!r} with "
                f"{len(self.part)} vertices and {len(self.joint_names)} joints, not that of body "
                f"{body.name!r} with {body.n_vertices} and {body.n_joints}"
            )
        assert isinstance(body, SkinnedBody)
        return body

    def _check(self, body: SkinnedBody, motion: Motion) -> None:
        self._checked(body)
        if abs(motion.fps / self.fps - 1) > SAME_RATE:
            do = "tissue.prepared(motion) splines it" if len(motion) >= FEWEST else "record it anew"
            raise BadArgument(
                f"this soft tissue moves at {self.fps:g} frames a second, and the motion has "
                f"{motion.fps:g}; {do}"
            )


def companion(first: Array, second: Array) -> Array:
    """The matrix (2 C, 2 C) that takes (phi_(t-1), phi_(t-2)) to (phi_t, phi_(t-1))."""
    C = len(first)
    return np.block([[first, second], [np.eye(C), np.zeros((C, C))]])


def free_run(first: Array, second: Array, driven: Array, start: Array | None = None) -> Array:
    """phi_t = A_1 phi_(t-1) + A_2 phi_(t-2) + driven_t, from zeros or from `start` (2, C)."""
    found = np.zeros((len(driven) + 2, driven.shape[1]))
    if start is not None:
        found[:2] = start
    for t, pushed in enumerate(driven, start=2):
        found[t] = first @ found[t - 1] + second @ found[t - 2] + pushed
    return found[2:]


def with_tissue(body: Body, tissue: SoftTissue) -> SkinnedBody:
    """The body with B + C betas, the last C of which displace its tissue and move no joint.

    The regressor is the one nearest to the body's of those that give its joints (least squares).
    With a block phi (C,) of coefficients its points are those of a person's tissue in symbols:
    `points(pose, cs.vertcat(betas, tissue.gain_of(body, betas) * phi), trans)`. Raises BadArgument
    for a body that this is not the tissue of.
    """
    body = tissue._checked(body)
    N = body.n_vertices
    seen = np.hstack([np.ones((N, 1)), body.template, body.shapedirs.reshape(N, -1)])
    every = np.hstack([seen, tissue.directions.reshape(N, -1)])
    wanted = np.zeros((body.n_joints, every.shape[1]))
    wanted[:, : seen.shape[1]] = body.J_regressor @ seen
    change = np.linalg.lstsq(every.T, (wanted - body.J_regressor @ every).T)[0].T
    return replace(
        body,
        shapedirs=np.concatenate([body.shapedirs, tissue.directions], axis=2),
        J_regressor=csr_array(body.J_regressor.toarray() + change),
        capsules=None,
        extras={**body.extras, "tissue": np.array(tissue.n_coefficients)},
        name=f"{body.name} with soft tissue",
    )


def with_dmpls(body: SkinnedBody, path: str | Path, count: int = 8) -> SkinnedBody:
    """The body with B + C betas, of which the last C are those of DMPL's dynamic blend shapes.

    `path` is the file of DMPL for the body, dmpls/GENDER/model.npz with `eigvec` (N, 3, ...), of
    which AMASS uses the first 8. The body then moves as human_body_prior's BodyModel does, in which
    joints follow the displaced surface: a motion with `dmpls` plays them (`Motion.betas_on`).
    Raises BadFile for another file, or one for another number of vertices.
    """
    with opened(path, "file of DMPL's directions", "give dmpls/GENDER/model.npz") as archive:
        found = read_expected(archive, {"eigvec": reals("N", 3, "C")})["eigvec"][:, :, :count]
        if len(found) != body.n_vertices:
            raise BadFile(f"it is for {len(found)} vertices, and the body has {body.n_vertices}")
    return replace(
        body,
        shapedirs=np.concatenate([body.shapedirs, found], axis=2),
        capsules=None,
        extras={**body.extras, "dmpls": np.array(found.shape[2])},
        name=f"{body.name} with DMPL",
    )


def betas_with_tissue(
    body: Body, tissue: SoftTissue, motion: Motion, exaggeration: float = 1.0
) -> Array:
    """The betas (T, B + C) of `with_tissue` in a motion of the tissue's rate, frame by frame.

    Raises BadArgument for another rate or another body.
    """
    body = tissue._checked(body)
    phi = tissue.coefficients(body, motion)
    gain = exaggeration * tissue.gain(body, motion.named(body).betas)
    own = np.broadcast_to(motion.betas_on(body), (len(motion), body.n_betas))
    return np.hstack([own, gain * phi])


def displaced_by(tissue: SoftTissue, betas: Array) -> Array:
    """How far tissue is displaced at rest, (T, N, 3) m, by betas (T, B + C) of a body with it."""
    phi = betas[:, betas.shape[1] - tissue.n_coefficients :]
    displaced: Array = np.einsum("tc,ndc->tnd", phi, tissue.directions)
    return displaced


EMBEDDED = ("default",)
EXPECTED = {
    "directions": reals("N", 3, "C"),
    "first": reals("C", "C"),
    "second": reals("C", "C"),
    "response": reals("C", "X"),
    "part": wholes("N"),
    "fps": reals(),
    "power": reals(),
    "n_betas": wholes(),
    "joint_names": texts("K"),
    "card": texts(),
}


def save_tissue(path: str | Path, tissue: SoftTissue) -> None:
    """Write soft tissue as an .npz, in single precision. Raises BadFile."""
    reals_of = ("directions", "first", "second", "response", "fps", "power")
    arrays = {name: np.asarray(getattr(tissue, name), np.float32) for name in reals_of}
    others = {
        "part": tissue.part.astype(np.int16),
        "n_betas": np.array(tissue.n_betas),
        "joint_names": np.array(tissue.joint_names),
        "card": np.array(json.dumps(dict(tissue.card))),
    }
    write_arrays(path, {**arrays, **others})


def load_tissue(name_or_path: str | Path = "default") -> SoftTissue:
    """The embedded soft tissue of the body `default`, or that of a file of `save_tissue`.

    The embedded one was learned from simulated tissue (`data/tissue/PROVENANCE.md`). Raises BadFile
    if there is no such file, or it holds something else.
    """
    if isinstance(name_or_path, str) and name_or_path in EMBEDDED:
        with as_file(files("workbench") / "data" / "tissue" / f"{name_or_path}.npz") as path:
            return _read(path)
    path = expanded(name_or_path)
    if not path.exists():
        raise BadFile(
            f"no soft tissue is called {str(name_or_path)!r}, and there is no such file; there is "
            f"{EMBEDDED[0]!r}, or give an .npz that save_tissue wrote"
        )
    return _read(path)


def _read(path: Path) -> SoftTissue:
    with opened(path, "soft tissue", "give an .npz that save_tissue wrote") as archive:
        found = read_expected(archive, EXPECTED)
        try:
            card = json.loads(str(found["card"]))
            return SoftTissue(
                directions=found["directions"],
                first=found["first"],
                second=found["second"],
                response=found["response"],
                part=found["part"],
                fps=float(found["fps"]),
                joint_names=tuple(map(str, found["joint_names"])),
                n_betas=int(found["n_betas"]),
                power=float(found["power"]),
                card=card if isinstance(card, dict) else {},
            )
        except (BadArgument, ValueError) as error:
            raise BadFile(str(error)) from error
