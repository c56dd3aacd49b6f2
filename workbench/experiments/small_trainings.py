"""Small trainings of SMPL, each written as one `Problem`: the suite `training`.

Synthetic people of 20 vertices on two joints, or of 12 vertices with an arm on each side of the
root, were registered in some poses. Unknown are everybody's template and joints, the pose blend
shapes and skinning weights that all share, and the pose and place of each registration (Loper et
al., SMPL, 2015, section 4.1). Only the people with two arms have sides, of which E_Y asks that
they be alike.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from workbench.blocks import Values
from workbench.errors import check_known
from workbench.experiments.experiment import Experiment
from workbench.experiments.synthetic_people import TIGHT, check_start, with_refined_answer
from workbench.fitting.setup import Measure, Setup, distances, rms
from workbench.solvers import Ipopt, exact_hessian
from workbench.synthetic.made_up import (
    CorruptedRegistrations,
    arms,
    draw_registrations,
    limb,
    random_smpl,
)
from workbench.training.estimate import Estimate, Sigmas
from workbench.training.first_guess import Start, first_estimate
from workbench.training.objective import Objective
from workbench.training.symbolic import TERMS, SymbolicTraining

GUESSES: Mapping[str, Callable[[], Start]] = {
    "limb": lambda: limb(5, 4),
    "arms": lambda: arms(3, 4),
}
FREE = ("trust-region", "gauss-newton", "levenberg-marquardt", "dogleg", "ipopt", "scipy-trf")
CONSTRAINED = ("ipopt", "ipopt-exact", "sqp", "nlopt-slsqp")
START_SIGMA = 0.3  # rad


def training(
    terms: str = " ".join(TERMS),
    weights: bool = True,
    subjects: int = 2,
    poses: int = 4,
    seed: int = 0,
    start: int = 0,
    noise: float = 0.002,
    turn: float = 1.0,
    person: str = "limb",
) -> Setup:
    """Learn a body from registrations by some terms of the cost; noise in m, turn in rad.

    With `weights` the skinning weights are free, not below zero, and sum to one for each vertex;
    without, the first ones are kept, and there are neither bounds nor constraints. Every joint of
    the people was turned by up to `turn`. Start 0 has the first template, joints and weights, no
    pose blend shapes, and poses of zero; start k > 0 has random poses of 0.3 rad. Raises
    UnknownName for another term or person, and BadArgument for a negative start.

    A `person` is a `limb` of 20 vertices with a tip, which has no sides, so that E_Y is no term of
    its cost; or `arms`, 12 vertices with an arm on the left and one on the right. The two arms of
    the people that are registered differ, so that E_Y pulls against E_D.
    """
    chosen = terms.split()
    for term in chosen:
        check_known("term of training", term, TERMS)
    check_start(start)
    check_known("person of a training", person, GUESSES)
    guess = GUESSES[person]()
    mirror = guess.mirror()
    body = random_smpl(guess, 2, seed=seed)
    exact, truth = draw_registrations(body, subjects, poses, seed + 1, turn=turn)
    data = CorruptedRegistrations(exact, seed=seed + 2, noise=noise)
    rings, first_weights = guess.rings(), guess.weights()
    objective = Objective(
        data, rings, first_weights, mirror, Sigmas(data=noise or 1e-3), guess.template
    )
    form = SymbolicTraining.of(body, objective)
    problem = form.problem(chosen)
    if not weights:
        problem = problem.freeing(*(name for name in problem.free.names if name != "weights"))
    first = first_estimate(data, guess, weights=first_weights, rings=rings)
    if start:
        rng = np.random.default_rng((seed, start))
        first = replace(first, poses=START_SIGMA * rng.standard_normal(truth.poses.shape))
    people = body.vertices(betas=truth.betas)
    answer = Estimate(
        templates=people,
        joints=np.stack([body.J_regressor @ person for person in people]),
        posedirs=body.posedirs,
        weights=body.weights if weights else first_weights,
        poses=truth.poses,
        parents=body.parents,
    )

    def measures(values: Values) -> tuple[Measure, ...]:
        residual = objective.sigmas.data * problem.linearize(values).residual  # m, in rows of E_D
        scans = [
            residual[problem.rows[name]].reshape(-1, 3) for name in problem.rows if is_data(name)
        ]
        return (rms("vertex to registration", distances(np.concatenate(scans), np.zeros(3))),)

    written = [term for term in chosen if term != "E_Y" or mirror is not None]
    held = "" if weights else ", the skinning weights being held"
    setup = Setup(
        problem=problem,
        start=form.values(first),
        question=f"{subjects} synthetic people (seed {seed}) were registered in {poses} poses "
        f"each, to {1e3 * noise:g} mm. Which templates, joints, pose blend shapes and poses make "
        f"{' + '.join(written)} least{held}?",
        measures=measures,
        priors=tuple(r.name for r in problem.residuals if not is_data(r.name)),
        compared=CONSTRAINED if weights else FREE,
        synthetic=f"the registrations are those of a random SMPL body on a tube of "
        f"{body.n_vertices} vertices, in random poses and with noise; nobody was measured",
    )
    newton = Ipopt(hessian=exact_hessian, gradient_tolerance=TIGHT)  # soon at weights of zero
    return with_refined_answer(setup, form.values(answer), solver=newton if weights else None)


def is_data(name: str) -> bool:
    """Whether a residual of this name compares with a registration."""
    return name.startswith("E_D")


TRAINING = (
    Experiment("training", training, "all terms; weights are at least zero and sum to one"),
    Experiment(
        "training-weights-held",
        training,
        "all terms but E_W; weights are fixed",
        {"weights": False},
    ),
    Experiment(
        "training-turned",
        training,
        "weights are fixed; joints turn by up to 2 rad, from a start at zero",
        {"weights": False, "turn": 2.0},
    ),
    Experiment(
        "training-two-sides",
        training,
        "weights held, people with a left and a right arm: E_Y takes part",
        {"weights": False, "person": "arms"},
    ),
    Experiment(
        "training-data-alone",
        training,
        "E_D alone, weights are fixed: rank-deficient",
        {"weights": False, "terms": "E_D", "poses": 12},
    ),
)
