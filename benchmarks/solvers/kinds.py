"""Problems by kind: what makes a problem easy for one solver and hard for another.

The problems of bodies and the sums of squares of Moré and Wild come from `workbench.experiments`.
Made here are what these suites lack: noise, constraints and many unknowns.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import casadi as cs
import numpy as np

import workbench as wb
from benchmarks.solvers.sums import FUNCTIONS
from workbench.blocks import Values
from workbench.experiments import SUITES, Experiment
from workbench.experiments.more_wild import more_wild
from workbench.experiments.synthetic_people import likely_person, random_start
from workbench.fitting.setup import Setup

JACOBIAN = (
    "trust-region",
    "levenberg-marquardt",
    "levenberg-marquardt-columns",
    "gauss-newton",
    "dogleg",
    "scipy-trf",
    "scipy-lm",
)
GENERAL = ("ipopt", "ipopt-lbfgs", "sqp", "nlopt-lbfgs", "nlopt-slsqp")
BOUNDED = ("trust-region", "levenberg-marquardt", "scipy-trf", "scipy-dogbox", "nlopt-bobyqa")
CONSTRAINED = ("ipopt", "ipopt-exact", "ipopt-lbfgs", "sqp", "nlopt-slsqp")
MANY = 1000  # unknowns
WITHOUT = "no derivatives"


@dataclass(frozen=True)
class Kind:
    """A kind of problem, some problems of that kind, and the solvers that are tried on them."""

    name: str
    meaning: str  # how a reader recognises it, in a sentence
    problems: tuple[Experiment, ...]
    solvers: tuple[str, ...]
    seeds: int
    tau: float = 1e-5  # of the way from the start's cost to the lowest known one that may be left


def noisy(function: str = "rosenbrock", n: int = 2, level: float = 1e-3, start: int = 0) -> Setup:
    """A sum of squares with deterministic noise: its cost is multiplied by 1 + level phi(x).

    phi is between -1 and 1 and oscillates quickly (Moré and Wild, Benchmarking derivative-free
    optimization algorithms, SIAM J. Optimization 20(1), 2009, section 4.3). The derivative of the
    noise is a derivative too, and of no use.
    """
    setup = more_wild(function, n, start=start)
    x = setup.problem.free.blocks[0].symbol
    phi = 0.9 * cs.sin(100 * cs.norm_1(x)) * cs.cos(100 * cs.norm_inf(x))
    phi += 0.1 * cs.cos(cs.sqrt(cs.sumsqr(x) + 1e-12))
    factor = cs.sqrt(1 + level * phi * (4 * phi**2 - 3))
    (clean,) = setup.problem.residuals
    rough = wb.Residual(function, clean.expression * factor, 1.0)
    problem = wb.Problem([rough], ["x"], blocks=setup.problem.free.blocks)
    return replace(setup, problem=problem, known=None, measures=lambda values: ())


def standing(seed: int = 0, start: int = 0) -> Setup:
    """Joints known to 10 mm, both feet on the floor, and wrists no nearer than they really are."""
    body = wb.load_body("small")
    rng = np.random.default_rng(seed)
    truth = likely_person(body, rng)
    joints = body.joints(**truth)
    pose, betas, trans = body.blocks()
    points = body.joint_points(pose.symbol, betas.symbol, trans.symbol)
    observed = wb.Block("observed", joints.shape, "m", body.joint_names)
    feet = [body.joint_names.index(f"{side}_foot") for side in ("left", "right")]
    wrists = [body.joint_names.index(f"{side}_wrist") for side in ("left", "right")]
    floor = float(joints[feet, 1].mean())
    apart = points.symbol[:, wrists[0]] - points.symbol[:, wrists[1]]
    constraints = [
        wb.Constraint("feet", points.symbol[1, feet].T, floor, floor, "m", (points,)),
        wb.Constraint(
            "wrists",
            cs.sumsqr(apart),
            float(np.sum((joints[wrists[0]] - joints[wrists[1]]) ** 2)),
            np.inf,
            "m^2",
            (points,),
        ),
    ]
    residuals = [
        wb.residuals.landmarks(points, observed.symbol, sigma=0.01, name="joints"),
        wb.residuals.gaussian(pose.symbol, covariance=0.5**2, unit="rad", name="pose prior"),
        wb.residuals.gaussian(betas.symbol, name="shape prior"),
    ]
    free = [block.name for block in body.blocks()]
    problem = wb.Problem(residuals, free, blocks=[observed], constraints=constraints)
    begun: Values = random_start(body, seed, start, 0.3)
    seen = joints + 0.01 * rng.standard_normal(joints.shape)
    return Setup(problem, begun | {"observed": seen}, "Who stands on the floor like this?")


def many(function: str = "mgh-extended-rosenbrock", start: int = 0) -> Setup:
    """A published sum of squares of 1,000 unknowns, each of which meets a few others."""
    one = FUNCTIONS[function]
    x = wb.Block("x", (MANY,))
    moved = 0.1 * np.random.default_rng(start).standard_normal(MANY) if start else 0.0
    problem = wb.Problem([wb.Residual("rows", one.residual(x.symbol), 1.0)], ["x"], blocks=[x])
    begin = np.resize(np.array(one.start, dtype=float), MANY)
    return Setup(problem, {"x": begin + moved}, "Is the least sum of squares found?")


def _of(suite: str, *names: str) -> tuple[Experiment, ...]:
    by_name = {one.name: one for one in SUITES[suite]}
    return tuple(by_name[f"body-{name}"] for name in names)


def _far() -> tuple[Experiment, ...]:
    return tuple(one for one in SUITES["more-wild"] if one.name.endswith("-far"))


def _small() -> tuple[tuple[str, int], ...]:
    """Functions of Moré and Wild with at most six unknowns, near starts."""
    found = []
    for one in SUITES["more-wild"]:
        n = int(one.arguments["n"])
        if n <= 6 and one.arguments.get("scale", 1.0) == 1.0:
            found.append((str(one.arguments["function"]), n))
    return tuple(found)


def _experiments(build: Callable[..., Setup], prefix: str = "") -> tuple[Experiment, ...]:
    return tuple(
        Experiment(f"{prefix}{function}-{n}", build, "", {"function": function, "n": n})
        for function, n in _small()
    )


KINDS: Mapping[str, Kind] = {
    one.name: one
    for one in (
        Kind(
            "well-behaved",
            "the start is near, the residuals at the answer are small, and the data determine all "
            "unknowns",
            _of("bodies", "vertices", "vertices-noisy", "joints", "four-cameras"),
            (*JACOBIAN, *GENERAL),
            3,
        ),
        Kind(
            "far start",
            "the start is ten times as far from the origin as the usual one",
            _far(),
            (*JACOBIAN, *GENERAL, "newton", "ipopt-exact"),
            1,
        ),
        Kind(
            "noisy",
            "the cost is a sum of squares times 1 + 0.001 phi(x), where phi oscillates quickly",
            _experiments(noisy, "noisy-"),
            (*JACOBIAN, *GENERAL, "nlopt-bobyqa"),
            2,
            1e-3,
        ),
        Kind(
            "bounds",
            "some unknowns end at their bounds",
            _of("bodies", "bounds"),
            (*BOUNDED, *GENERAL),
            8,
        ),
        Kind(
            "constraints",
            "the answer has to satisfy equations and inequalities",
            (Experiment("standing", standing, "feet on the floor, wrists apart"),),
            CONSTRAINED,
            8,
        ),
        Kind(
            "many unknowns",
            "there are hundreds or thousands of unknowns, and each shares residuals with only a "
            "few others",
            (
                Experiment("chained-valleys", many, "extended Rosenbrock, 1,000 unknowns"),
                Experiment("tridiagonal", many, "", {"function": "mgh-broyden-tridiagonal"}),
                *_of("bodies", "video"),
            ),
            ("levenberg-marquardt", "gauss-newton", "scipy-trf", *GENERAL),
            3,
        ),
        Kind(
            WITHOUT,
            "a program that cannot be differentiated computes the residual, and there are at most "
            "six unknowns",
            _experiments(more_wild),
            ("trust-region", "levenberg-marquardt", "scipy-lm", "nlopt-lbfgs", "nlopt-bobyqa"),
            2,
        ),
        Kind(
            "several minima",
            "the cost has several minima, and a start may lead to one that is not the lowest",
            _of("bodies", "one-camera", "outliers-geman-mcclure"),
            (*JACOBIAN, "ipopt", "nlopt-lbfgs"),
            10,
        ),
    )
}
