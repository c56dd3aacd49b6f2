"""What SCAPE and BlendSCAPE learn, each written as one `Problem`: the suite `triangles`.

The meshes are those of a tube of 9 vertices on two joints (Anguelov et al., SCAPE, 2005;
Hirshberg et al., Coregistration, 2012).
"""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from workbench.arrays import Array
from workbench.blocks import Values
from workbench.bodies import SkinnedBody
from workbench.bodies.triangles import TriangleBody, blend_scape, scape
from workbench.errors import check_known
from workbench.experiments.experiment import Experiment
from workbench.experiments.synthetic_people import check_start, with_refined_answer
from workbench.fitting.setup import KnownAnswer, Measure, Setup, distances, rms
from workbench.geometry.triangles import gradients
from workbench.problem import Problem
from workbench.synthetic.made_up import limb, random_smpl
from workbench.training.triangles.learning import PosedMeshes
from workbench.training.triangles.shape_space import learn_shapes
from workbench.training.triangles.symbolic_form import SymbolicTriangles, shape_term

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
    template = learn_shapes(meshes, body.faces, n_betas).template
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
