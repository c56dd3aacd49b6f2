"""Registering a person outside the shape space: the distance that remains is the model's error."""

from dataclasses import replace

import numpy as np

from workbench.bodies.catalogue import load_body
from workbench.bodies.files.embedded import UNTRAINED
from workbench.errors import UnknownName
from workbench.fitting.body_priors import shape_prior
from workbench.fitting.known_points import mesh_fit
from workbench.fitting.placing import placed
from workbench.fitting.setup import LARGE, Setup
from workbench.reading.arrays import read_expected, reals, shipped
from workbench.solvers import solve


def registration(
    body: str = "default",
    person: int = 0,
    seed: int = 0,
    pose_sigma: float = 0.2,
    compared: tuple[str, ...] = LARGE,
) -> Setup:
    """Fit a posed person who was not among the training subjects, with all correspondences given.

    `pose_sigma` in rad. Raises UnknownName for a body without such people, or another person.
    """
    model = load_body(body)
    with shipped("bodies/held_out_people.npz", "file of held-out people") as archive:
        mesh, *_ = UNTRAINED.get(body, (body,))  # that of a triangle body is a skinned body's
        if mesh not in archive.headers:
            raise UnknownName("body with held-out people", body, archive.headers)
        templates = read_expected(archive, {mesh: reals("people", model.n_vertices, 3)})[mesh]
    if not 0 <= person < len(templates):
        raise UnknownName("person", str(person), hint=f"0 to {len(templates) - 1}")
    shape = replace(model, template=templates[person], name="held-out person")
    rng = np.random.default_rng(seed)
    truth = {
        "pose": pose_sigma * rng.standard_normal((model.n_joints, 3)),
        "betas": np.zeros(model.n_betas),
        "trans": rng.normal(0.0, 0.2, 3),
    }
    observed = shape.vertices(**truth)
    prior = shape_prior(model)
    setup = mesh_fit(
        model,
        observed,
        f"Person {person} (synthetic) was drawn from the same population, but is not one of those "
        "whom the shape directions were learned from. Every vertex is known; how near can ten "
        "directions come?",
        sigma=0.005,
        priors=(prior,),
        start=placed(model, observed),
        compared=compared,
        synthetic="the person is a mesh that a program made from artists' shapes, posed by the "
        "model's own skinning; nobody was measured",
    )
    nearest = solve(setup.problem.without(prior.name), setup.start | truth).values
    floor = setup.measures(setup.start | nearest)[0]  # vertex to observation, rms
    known = replace(floor, name="floor: without the prior, from the true pose, rms")
    return replace(setup, measures=lambda values: (*setup.measures(values), known))
