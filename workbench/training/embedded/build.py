"""From the wheel to the embedded bodies."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from workbench.bodies.embedded import read_embedded
from workbench.training.embedded.base_mesh import N_BODY, BaseMesh, read_base_mesh
from workbench.training.embedded.card import card_of, rounding_error
from workbench.training.embedded.packing import BuiltBody, write_body
from workbench.training.embedded.population import Population, draw_population
from workbench.training.embedded.pose_blends import draw_poses, learn_pose_blends, measure
from workbench.training.embedded.regressors import regress, regression_errors
from workbench.training.embedded.rig import at_most_four, read_rig
from workbench.training.embedded.shape_targets import read_shape_targets
from workbench.training.embedded.skeleton import JOINT_NAMES, MIRRORED_JOINTS
from workbench.training.embedded.teacher import Teacher
from workbench.training.embedded.topology import read_topology
from workbench.training.embedded.wheel import Wheel
from workbench.training.mirror import Mirror
from workbench.training.pose_prior import PosePrior
from workbench.training.shape_space import learn_shape_space

Array = NDArray[np.float64]
Report = Callable[[str], None]

SEARCH_RADIUS = {"joints": 0.25, "keypoints": 0.15}  # m, of the vertices that may give a point


@dataclass(frozen=True)
class Recipe:
    """What can be chosen: how many, and the seed of every draw."""

    people: int = 800
    poses: int = 2500
    test_poses: int = 400
    seed: int = 0


@dataclass(frozen=True, eq=False)
class Sources:
    """What all three bodies are made from."""

    wheel: Wheel
    mesh: BaseMesh
    population: Population
    weights: Array  # (13380, 24)
    fine_weights: Array  # (13380, 32)
    keypoint_names: tuple[str, ...]


def gather_sources(wheel: Wheel, recipe: Recipe, report: Report) -> Sources:
    """Read the wheel and draw the population."""
    mesh = read_base_mesh(wheel)
    rig = read_rig(wheel, mesh)
    weights = at_most_four(rig.weights, mesh.mirror[:N_BODY])
    report("reading the shape targets")
    targets = read_shape_targets(wheel, len(mesh.vertices))
    keypoints = wheel.tensors("keypoints/coco.pth")
    report(f"drawing and un-posing {recipe.people} adults")
    population = draw_population(
        mesh,
        rig,
        weights,
        targets,
        csr_array(np.array([row / row.sum() for row in keypoints.values()])),
        n=recipe.people,
        seed=recipe.seed,
        report=report,
    )
    return Sources(wheel, mesh, population, weights, rig.fine_weights, tuple(keypoints))


@dataclass(frozen=True, eq=False)
class Result:
    """One body with what was found out while building it."""

    name: str
    body: BuiltBody
    fine_weights: csr_array  # (N, 32)
    explained: Array  # (10,)
    joint_errors: Array  # (24,) m
    keypoint_errors: Array  # (M,) m
    ridge: float


def build_body(
    name: str, sources: Sources, prior: PosePrior, recipe: Recipe, report: Report
) -> Result:
    """One of the embedded bodies: `default`, `small` or `full`."""
    topology = read_topology(sources.wheel, name, sources.mesh)
    mirror = Mirror(topology.mirror, MIRRORED_JOINTS)
    people = np.stack([topology.follows @ person for person in sources.population.vertices])
    report("  shape directions")
    space = learn_shape_space(people, topology.faces, mirror)
    report("  regressors")
    fitted = {}
    for kind, names in (("joints", JOINT_NAMES), ("keypoints", sources.keypoint_names)):
        points = getattr(sources.population, kind)
        rows = regress(people, points, names, topology.mirror, SEARCH_RADIUS[kind])
        fitted[kind] = rows, regression_errors(rows, people, points)
    J_regressor, joint_errors = fitted["joints"]
    weights = at_most_four(topology.follows @ sources.weights, topology.mirror)
    template = space.template - (J_regressor @ space.template)[0] * [0.0, 1.0, 1.0]
    fine = csr_array(topology.follows @ sources.fine_weights)
    report("  pose blend shapes")
    rng = np.random.default_rng(recipe.seed)
    poses = draw_poses(prior, recipe.poses, rng), draw_poses(prior, recipe.test_poses, rng)
    teacher = Teacher(template, J_regressor @ template, fine)
    posedirs, ridge = learn_pose_blends(teacher, weights, mirror, poses, report)
    body = BuiltBody(
        template=template,
        shapedirs=space.shapedirs,
        posedirs=posedirs,
        J_regressor=J_regressor,
        weights=weights,
        faces=topology.faces,
        mirror=topology.mirror,
        keypoint_names=sources.keypoint_names,
        keypoint_regressor=fitted["keypoints"][0],
    )
    errors = joint_errors, fitted["keypoints"][1]
    return Result(name, body, fine, space.explained, *errors, ridge)


def write_result(
    result: Result, sources: Sources, recipe: Recipe, tests: dict[str, Array], folder: Path
) -> Path:
    """Store a body as `<name>.npz`, with a card that states what was measured on it as stored."""
    path = folder / f"{result.name}.npz"
    write_body(result.body, {}, path)
    stored = read_embedded(path)
    teacher = Teacher(
        stored["template"], stored["J_regressor"] @ stored["template"], result.fine_weights
    )
    corrections = {
        name: measure(teacher, stored["weights"], stored["posedirs"], poses)
        for name, poses in tests.items()
    }
    rounding = rounding_error(result.body, stored, next(iter(tests.values()))[:20])
    write_body(result.body, card_of(result, sources, recipe, corrections, rounding), path)
    return path
