"""A problem ready to be solved: its start, its known answer, and what is measured afterwards."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from types import NoneType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from workbench.arrays import Array
from workbench.blocks import Values, checks
from workbench.bodies import SkinnedBody
from workbench.bodies.triangles import TriangleBody
from workbench.diagnostics.design.candidates import Given
from workbench.diagnostics.gauges import Gauge
from workbench.errors import BadSetup, WorkbenchError, check_known, listed
from workbench.geometry.camera import Camera
from workbench.motions import Motion
from workbench.problem import Problem
from workbench.residuals import Residual
from workbench.solvers import SOLVERS, Solver

CERTIFIED_DIGITS = 11  # of NIST's parameters: more cannot agree
# which solvers a setup compares, by their names in SOLVERS
SECOND_ORDER = ("trust-region", "gauss-newton", "levenberg-marquardt", "ipopt")
LARGE = (*SECOND_ORDER, "nlopt-lbfgs")  # also of problems whose exact Hessian takes long
GRADED = (*SECOND_ORDER, "ipopt-exact", "nlopt-lbfgs")
MANY = (*GRADED, "nlopt-tnewton", "nlopt-slsqp")
BOUNDED = ("ipopt", "ipopt-exact", "nlopt-lbfgs", "nlopt-slsqp")


@dataclass(frozen=True, eq=False)
class KnownAnswer:
    """The answer of a problem, or the lowest known cost, and its source.

    Raises BadSetup for an empty source, and for numbers or values that are none.

    Attributes:
        source: `NIST StRD, certified to 11 digits`, `best of 100 starts, polished`.
        cost: the certified or the best known cost.
        values: those of the free blocks, where the answer is known and there is only one.
        deviations: the standard deviations of the values, block by block.
        residual_deviation: that of one observation, as estimated from the residual.
    """

    source: str
    cost: float | None = None
    values: Values | None = None
    deviations: Values | None = None
    residual_deviation: float | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.source, str) or not self.source.strip():
            raise BadSetup(f"a known answer needs its source as a text, not {self.source!r:.80}")
        for name in ("cost", "residual_deviation"):
            if (number := getattr(self, name)) is None:
                continue
            if not isinstance(number, (int, float, np.number)) or not 0 <= number < np.inf:
                raise BadSetup(f"the known {name} must be a number from 0 on, not {number!r:.80}")
            object.__setattr__(self, name, float(number))
        for name in ("values", "deviations"):
            kind = Mapping, NoneType
            _check_kind(f"known {name}", getattr(self, name), kind, "a dict of arrays by blocks")
        if self.deviations is not None and self.values is None:
            raise BadSetup(
                "known deviations are those of known values, which are missing; give them too"
            )

    def check(self, problem: Problem) -> None:
        """Raise BadSetup unless values and deviations cover exactly the problem's free blocks."""
        for name in ("values", "deviations"):
            blocks = getattr(self, name)
            if blocks is None:
                continue
            foreign = set(blocks) - set(problem.free.names)
            if foreign:
                raise BadSetup(
                    f"the known {name} hold {', '.join(sorted(foreign))}, which is not free; the "
                    f"free blocks are {', '.join(problem.free.names)}"
                )
            try:
                flat = problem.free.pack(blocks)
            except WorkbenchError as error:
                raise BadSetup(f"the known {name} are not the problem's: {error}") from error
            if name == "deviations" and (flat < 0).any():
                raise BadSetup(
                    f"the known deviation of {problem.free.label(int(np.argmin(flat)))} "
                    f"is {flat.min():g}; it must be from 0 on"
                )


def digits(found: Mapping[str, ArrayLike], certified: Mapping[str, ArrayLike]) -> float:
    """How many digits agree, of the parameter that agrees worst: 0 to 11.

    The log relative error -log10 |found - certified| / |certified| (McCullough, The American
    Statistician 52, 1998), absolute where the certified number is 0. Raises BadSetup for a block
    that was not found.
    """
    fewest = float(CERTIFIED_DIGITS)
    for name, numbers in certified.items():
        if name not in found:
            raise BadSetup(f"no values of {name} to compare; there are {listed(found)}")
        c, x = np.asarray(numbers, dtype=float), np.asarray(found[name], dtype=float)
        error = np.abs(x - c) / np.where(c == 0, 1.0, np.abs(c))
        worst = float(np.max(np.where(np.isfinite(error), error, np.inf), initial=0.0))
        fewest = min(fewest, -np.log10(worst) if worst > 0 else np.inf)
    return max(0.0, float(fewest))


def names(named: str | Residual | Iterable[str | Residual]) -> tuple[str, ...]:
    """These names as a tuple, also if it is a single one; a residual stands for its name."""
    several = (named,) if isinstance(named, str | Residual) else named
    return tuple(item.name if isinstance(item, Residual) else item for item in several)


@dataclass(frozen=True)
class Measure:
    """One number of a run's summary, with its unit, such as a mean distance.

    Attributes:
        name: what was measured: `reprojection, camera 1`.
        value: the number; NaN where it cannot be computed.
        unit: `px`, `mm`, `sd`, or `1` for none.
        over: what the value is a mean over: `17 keypoints with a confidence above 0.2`.
    """

    name: str
    value: float
    unit: str
    over: str = ""


def distances(found: Array, reference: Array) -> Array:
    """How far points (..., 3) m are from their reference points, in mm."""
    return np.asarray(1e3 * np.linalg.norm(found - reference, axis=-1))


def rms(name: str, differences: Array, unit: str = "mm") -> Measure:
    """The root mean square of differences that are given in `unit`, as a measure."""
    return Measure(f"{name}, rms", float(np.sqrt(np.mean(differences**2))), unit)


def largest_beta(betas: Array) -> Measure:
    """The coefficient of the shape that is farthest from the mean person's, as a measure."""
    return Measure("largest |beta|", float(np.max(np.abs(betas), initial=0.0)), "sd")


@dataclass(frozen=True, eq=False)
class View:
    """One camera and the landmarks that it observed.

    Attributes:
        name: the camera's name.
        camera: the camera model; its numbers are among the values of the setup.
        size: width and height of the image in px.
        landmarks: the landmark set of the body that was observed, or `joints`.
        observed: (M, 2) px, one row per landmark of the set.
        confidence: (M,) how far each observation is trusted, from 0 (not observed) to 1.
        held_out: whether the view is only measured and drawn, and not fitted.
    """

    name: str
    camera: Camera
    size: tuple[int, int]
    landmarks: str
    observed: Array
    confidence: Array
    held_out: bool = False


@dataclass(frozen=True, eq=False)
class Moving:
    """A body that moves through T frames, and the cameras that filmed it.

    Its pose (T, K, 3) and trans (T, 3) are among the values of the setup, and there is a view for
    each camera, with `observed` (T, M, 2) and `confidence` (T, M). `data` names the residuals of
    keypoints, and `frame` is the problem of a frame by itself, where there is one.
    """

    body: SkinnedBody | TriangleBody
    views: tuple[View, ...]
    fps: float
    data: tuple[str, ...] = ()
    frame: Problem | None = None

    def motion(self, values: Values) -> Motion:
        """The motion that values describe. Raises BadArgument if each frame has its own betas."""
        pose, betas, trans = (values[block.name] for block in self.body.blocks())
        return Motion(pose, trans, self.fps, self.body.joint_names, betas, origin="a clip")


@dataclass(frozen=True, eq=False)
class Setup:
    """A problem ready to be solved, and what is looked at when it has been solved.

    Raises BadSetup if a field is not of its kind, UnknownName for a solver or residual that does
    not exist, and what `Problem.split` raises for a start that does not fit the problem.

    Attributes:
        problem: the least-squares problem.
        start: values of every block, free and fixed, where a solver begins.
        question: what the fit is to answer, in a sentence or two.
        body: the body that is fitted and drawn, where there is one.
        views: the cameras that observed it.
        truth: (N, 3) m, the true surface, where it is known.
        measures: a function from the values found to the numbers of the summary.
        priors: the names of the residuals that are priors, not data.
        compared: names of `SOLVERS` that solve the same problem from the same start.
        known: the answer or the lowest known cost, where there is one beforehand.
        synthetic: what was made up, in a sentence; empty if all data were measured.
        notes: sentences on data that were given but not used, or that were not checked.
        made_of: values of the blocks that synthetic data were made of, before noise was added.
        strategy: how it is solved, in stages or from several starts: a function that makes the
            whole solver out of the one that is named, or out of None for the usual one. Without it,
            that solver is applied to the problem as it is.
        moving: the body that moves through frames, where the problem is a sequence.
        candidates: measurements that could be made, by name; see `workbench design`.
        doubts: a function from the values found to what speaks against them, in sentences, beside
            what `fitting.doubts` looks for in every fit.
        gauges: motions that the problem is invariant to, where `workbench diagnose` does not find
            them by itself.
    """

    problem: Problem
    start: Values
    question: str
    body: SkinnedBody | TriangleBody | None = None
    views: tuple[View, ...] = ()
    truth: Array | None = None
    measures: Callable[[Values], tuple[Measure, ...]] = lambda values: ()
    priors: tuple[str, ...] = ()
    compared: tuple[str, ...] = ()
    known: KnownAnswer | None = None
    synthetic: str = ""
    notes: tuple[str, ...] = ()
    made_of: Values | None = None
    strategy: Callable[[Solver | None], Solver] | None = None
    moving: Moving | None = None
    candidates: Given = field(default_factory=dict)
    doubts: Callable[[Values], Iterable[str]] = lambda values: ()
    gauges: tuple[Gauge, ...] = ()

    def __post_init__(self) -> None:
        bodies = SkinnedBody, TriangleBody, NoneType
        for name, kind, expected in (
            ("problem", Problem, "a Problem"),
            ("start", Mapping, "a dict of arrays by the names of blocks"),
            ("body", bodies, "a SkinnedBody, a TriangleBody or None"),
            ("question", str, "a text"),
            ("known", (KnownAnswer, NoneType), "a KnownAnswer or None"),
            ("compared", (Iterable, Residual), "names of solvers"),
            ("priors", (Iterable, Residual), "names of residuals"),
            ("candidates", Mapping, "a dict of residuals by name"),
            ("made_of", (Mapping, NoneType), "a dict of arrays by block, or None"),
            ("strategy", (Callable, NoneType), "a function that makes a solver out of a solver"),
        ):
            _check_kind(f"`{name}` of a setup", getattr(self, name), kind, expected)
        for name, entry_type in (("views", View), ("gauges", Gauge)):
            entries = getattr(self, name)
            entries = (entries,) if isinstance(entries, entry_type) else entries
            entries = checks.several(f"`{name}`", entries, entry_type, BadSetup)
            object.__setattr__(self, name, entries)
        shape = None if self.body is None else self.body.template.shape
        if self.truth is not None and shape not in (None, np.shape(self.truth)):
            raise BadSetup(
                f"`truth` of a setup must have the shape {shape} of the body's vertices, not "
                f"{np.shape(self.truth)}"
            )
        for name in ("compared", "priors", "notes"):  # a single text is one name
            object.__setattr__(self, name, names(getattr(self, name)))
        for solver in self.compared:
            check_known("solver", solver, SOLVERS)
        self.problem.rows_named(self.priors)
        self.problem.split(self.start)
        if self.known is not None:
            self.known.check(self.problem)
        if self.made_of is not None:
            self.problem.free.pack(dict(self.start) | dict(self.made_of))


def _check_kind(name: str, value: object, kind: Any, expected: str) -> None:
    """Raise BadSetup unless a value is of a kind, or of several, which `expected` describes."""
    if not isinstance(value, kind):
        raise BadSetup(f"{name} must be {expected}, not {value!r:.80}")
