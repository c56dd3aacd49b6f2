"""The experiments by name, and those that a user's own file describes."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from workbench.errors import BadArgument, BadFile, UnknownName, check_known
from workbench.experiments.balance import balance, balance_monocular, balance_video
from workbench.experiments.body_fits import (
    BODIES,
    MODEL_FITS,
    known_correspondences,
    registration,
    self_contact,
    shape_from_landmarks,
)
from workbench.experiments.experiment import (
    OPTIONAL_NAMES,
    REQUIRED_NAMES,
    Experiment,
    converted,
    parameters,
    run_file,
    user_errors,
)
from workbench.experiments.more_wild import MORE_WILD
from workbench.experiments.moving_people import markers
from workbench.experiments.nist import NIST
from workbench.fitting.setup import Setup

SUITES: Mapping[str, tuple[Experiment, ...]] = {
    "nist": NIST,
    "more-wild": MORE_WILD,
    "bodies": (*BODIES, *MODEL_FITS),
}
SUMMARIES: Mapping[str, str] = {
    "nist": "regressions, answers certified by NIST",
    "bodies": "fits of synthetic people, graded",
    "more-wild": "sums of squares of Moré and Wild",
}


EXPERIMENTS: Mapping[str, Experiment] = {
    experiment.name: experiment
    for experiment in (
        Experiment("balance", balance, "a real person on a beam, four cameras"),
        Experiment("balance-monocular", balance_monocular, "a real person on a beam, one camera"),
        Experiment("balance-video", balance_video, "the real person in five frames of one camera"),
        Experiment(
            "known-correspondences",
            known_correspondences,
            "every vertex is seen, and its number is known",
        ),
        Experiment("landmarks", shape_from_landmarks, "shape from 3D joints alone"),
        Experiment("markers", markers, "motion capture: shape, poses and places of 41 markers"),
        Experiment("registration", registration, "a person who is not in the shape space"),
        Experiment("self-contact", self_contact, "a pose that goes through the body, kept apart"),
    )
}


def find(name: str, arguments: Mapping[str, Any] | None = None) -> Experiment:
    """Find an experiment of the catalogue, a suite or a Python file, and change its arguments.

    A file defines `experiment` (an Experiment), or `setup` (a Setup, or a function that returns
    one, whose parameters are the arguments), or `problem` and `start`. Beside these two it may
    define `priors` (names of the residuals that are not data, or these residuals), `body` (a
    SkinnedBody or TriangleBody, to draw), `compared` (names of solvers to run as well),
    `candidates` (residuals that could be measured next) and `gauges` (motions that change no
    residual); its docstring is the question. If it defines several of the three, the first one in
    this order counts.

    Arguments are values, or the texts that were typed for them. Raises UnknownName, BadArgument, or
    BadFile with the line of the file that failed.
    """
    members = {member.name: member for suite in SUITES.values() for member in suite}
    if name in EXPERIMENTS or name in members:
        experiment = EXPERIMENTS.get(name) or members[name]
    elif name.endswith(".py"):
        experiment = _from_file(Path(name))
    else:
        if name in SUITES:
            raise BadArgument(
                f"{name} is a suite; give one of its {len(SUITES[name])} problems, such as "
                f"{SUITES[name][0].name}: `workbench run {name} --list` names them"
            )
        others = "the members of suites (workbench run SUITE --list names them), or give a FILE.py"
        raise UnknownName("experiment", name, EXPERIMENTS, hint=others)
    changed = dict(arguments or {})
    with user_errors(experiment.source):
        known = parameters(experiment.build)
    for argument, value in changed.items():
        check_known(f"argument of {experiment.name}", argument, known)
        what = f"{argument} of {experiment.name}"
        changed[argument] = converted(what, known[argument].annotation, value)
    return replace(experiment, arguments={**experiment.arguments, **changed})


def _from_file(path: Path) -> Experiment:
    module, source = run_file(path, f"one of {', '.join(EXPERIMENTS)}")
    with user_errors(source):
        return replace(_described(module, path), source=source)


def _described(module: Any, path: Path) -> Experiment:
    """The experiment that a module defines, in any of the three ways."""
    experiment = getattr(module, "experiment", None)
    if isinstance(experiment, Experiment):
        if Path(experiment.name).name != experiment.name:
            raise BadFile(f"an experiment's name is that of a folder, not {experiment.name!r}")
        return experiment
    setup = getattr(module, "setup", None)
    if isinstance(setup, Setup):
        return Experiment(path.stem, lambda: setup, path.name)
    if callable(setup):
        return Experiment(path.stem, setup, path.name)
    if hasattr(module, "problem") and hasattr(module, "start"):
        question = (module.__doc__ or f"The problem of {path.name}.").strip()
        described = Setup(
            module.problem,
            module.start,
            question,
            body=getattr(module, "body", None),
            priors=getattr(module, "priors", ()),
            compared=getattr(module, "compared", ()),
            candidates=getattr(module, "candidates", {}),
            gauges=getattr(module, "gauges", ()),
        )
        return Experiment(path.stem, lambda: described, path.name)
    lacks = "it defines no experiment"
    for present, missing in (("problem", "start"), ("start", "problem")):
        if hasattr(module, present):
            lacks = f"it defines `{present}`, but no `{missing}`"
    raise BadFile(f"{lacks}; it needs {REQUIRED_NAMES}; {OPTIONAL_NAMES}")
