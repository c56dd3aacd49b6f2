"""Small trainings of bodies, each written as one Problem: the suites training and triangles."""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from workbench.arrays import Array
from workbench.blocks import Values
from workbench.bodies import SkinnedBody
from workbench.bodies.triangles import TriangleBody, blend_scape, scape
from workbench.errors import check_known
from workbench.experiments.experiment import Experiment
from workbench.experiments.synthetic_people import TIGHT, check_start, with_refined_answer
from workbench.fitting.setup import KnownAnswer, Measure, Setup, distances, rms
from workbench.geometry.triangles import gradients
from workbench.problem import Problem
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
from workbench.training.triangles import (
    PosedMeshes,
    SymbolicTriangles,
    learn_gradient_shapes,
    shape_term,
)

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


SYNTHETIC = (
    "the meshes are those of a random triangle body on a tube of 9 vertices, with noise; nobody "
    "was measured"
)
COMPARED = ("trust-region", "gauss-newton", "levenberg-marquardt", "dogleg", "ipopt", "scipy-trf")
MODELS: Mapping[str, Callable[[SkinnedBody], TriangleBody]] = {
    "scape": scape,
    "blend-scape": blend_scape,
}
LEARNED = {  # the arrays and blocks that are free beside the place of each mesh
    "bends": ("posedirs",),
    "persons": ("shapedirs",),
    "poses": ("posedirs", "pose"),
    "all": ("posedirs", "shapedirs", "pose"),
}
RIDGE, SMOOTHNESS = 1e-3, 1e-4  # m^2, of E_Q and E_D
BENT = 0.05  # per rad: of the true posedirs
POSE_SIGMA, START_SIGMA = 0.5, 0.3  # rad


def triangle_training(
    model: str = "blend-scape",
    learned: str = "all",
    subjects: int = 2,
    poses: int = 4,
    seed: int = 0,
    start: int = 0,
    noise: float = 0.002,
) -> Setup:
    """Learn the factors D and Q of a triangle body from posed meshes; noise in m.

    `model` is scape or blend-scape. `learned` says what is free beside the place of each mesh:
    `bends` (Q) and `persons` (D) are linear problems, `poses` frees Q and all poses, and `all`
    frees Q, D and all poses. What is not free is known exactly. At start 0 free factors are the
    identity and free poses are zero; start k > 0 has random poses of 0.3 rad. Raises UnknownName
    for another model or choice, and BadArgument for a negative start.
    """
    for what, given, known in (("model", model, MODELS), ("choice of unknowns", learned, LEARNED)):
        check_known(what, given, known)
    check_start(start)
    rng = np.random.default_rng(seed)
    true = _random_body(model, seed, rng)
    person = np.repeat(np.arange(subjects), poses)
    betas = rng.standard_normal((subjects, true.n_betas))
    turned = POSE_SIGMA * rng.standard_normal((len(person), true.n_joints, 3))
    exact = true.vertices(turned, betas[person])
    posed = PosedMeshes(exact + noise * rng.standard_normal(exact.shape), turned, person)
    D = np.eye(3) + np.einsum("fabk,sk->sfab", true.shapedirs, betas)
    form = SymbolicTriangles.of(true, D, posed)
    free = LEARNED[learned]
    terms = form.data()
    terms += form.small_posedirs(RIDGE) if "posedirs" in free else []
    terms += form.smooth_subjects(SMOOTHNESS) if "shapedirs" in free else []
    named = dict.fromkeys(name for r in terms for name in r.reads)
    problem = form.problem(
        terms, [name for name in named if name.rpartition("/")[2] in (*free, "trans")]
    )
    answer = form.values()
    begin = answer | {
        name: np.zeros_like(answer[name])
        for name in problem.free.names
        if not name.endswith("trans")
    }
    if start and "pose" in free:
        drawn = np.random.default_rng((seed, start))
        poses_of = [name for name in problem.free.names if name.endswith("/pose")]
        begin |= {
            name: START_SIGMA * drawn.standard_normal(answer[name].shape) for name in poses_of
        }

    def measures(values: Values) -> tuple[Measure, ...]:
        residual = problem.linearize(values).residual  # m, in the rows of the meshes
        off = [residual[problem.rows[r.name]].reshape(-1, 3) for r in form.data()]
        return (rms("vertex to mesh", distances(np.array(off), np.zeros(3))),)

    setup = Setup(
        problem=problem,
        start=begin,
        question=f"{subjects} synthetic people (seed {seed}) of the model {model} were meshed in "
        f"{poses} poses each, to {1e3 * noise:g} mm. Which {', '.join(free)} explain the meshes?",
        measures=measures,
        priors=tuple(r.name for r in terms if r.name.startswith("E_")),
        compared=COMPARED,
        synthetic=SYNTHETIC,
    )
    return with_refined_answer(setup, answer)


def triangle_shapes(n_betas: int = 2, people: int = 8, seed: int = 0, start: int = 1) -> Setup:
    """Learn the shape space of triangles: mean, directions and betas of people at rest.

    The minimum is principal component analysis (Eckart and Young 1936), so that its cost is known;
    every other stationary point is a saddle. At start 0 everything is zero, which is one of these;
    start k > 0 is random. Raises BadArgument for a negative start.
    """
    check_start(start)
    rng = np.random.default_rng(seed)
    body = random_smpl(limb(3, 3), max(n_betas + 2, 1), seed=seed)
    meshes = body.vertices(betas=rng.standard_normal((people, body.n_betas)))
    template = learn_gradient_shapes(meshes, body.faces, n_betas).template
    D = np.stack([gradients(template, one, body.faces) for one in meshes])
    residual, blocks = shape_term(D, n_betas)
    drawn = np.random.default_rng((seed, start))
    flat = D.reshape(people, -1)
    left = np.linalg.svd(flat - flat.mean(axis=0), compute_uv=False)[n_betas:]
    return Setup(
        problem=Problem([residual], [block.name for block in blocks], blocks=blocks),
        start={block.name: drawn.standard_normal(block.shape) * (start > 0) for block in blocks},
        question=f"{people} synthetic people (seed {seed}) are known at rest. Which mean and which "
        f"{n_betas} directions explain the deformations of their triangles best?",
        compared=COMPARED,
        known=KnownAnswer(
            "principal component analysis by the singular values of the deformations",
            0.5 * float(left @ left),
        ),
        synthetic=SYNTHETIC,
    )


def _random_body(model: str, seed: int, rng: np.random.Generator) -> TriangleBody:
    body = MODELS[model](random_smpl(limb(3, 3), 2, seed=seed))
    posedirs: Array = BENT * rng.standard_normal(body.posedirs.shape)
    return replace(body, posedirs=posedirs)


TRIANGLES = (
    Experiment(
        "triangles-bends", triangle_training, "Q of BlendSCAPE: linear", {"learned": "bends"}
    ),
    Experiment(
        "triangles-persons", triangle_training, "D of two people: linear", {"learned": "persons"}
    ),
    Experiment(
        "triangles-poses",
        triangle_training,
        "Q of BlendSCAPE and the poses of eight meshes",
        {"learned": "poses"},
    ),
    Experiment(
        "triangles-scape", triangle_training, "Q, D and all poses of SCAPE", {"model": "scape"}
    ),
    Experiment("triangles-blend-scape", triangle_training, "Q, D and all poses of BlendSCAPE"),
    Experiment("triangles-shapes", triangle_shapes, "the shape space: a bilinear problem"),
    Experiment(
        "triangles-shapes-saddle",
        triangle_shapes,
        "the shape space, from a start at a saddle point",
        {"start": 0},
    ),
)
