"""Training of the embedded hand by the project's own training, and its file.

The price of a pose blend shape grows with the distance from the joint, along the surface. Romero,
Tzionas and Black (Embodied Hands, 2017) made those of MANO local in this way: on a hand every joint
is near every other one in the tree, so that a number of bones says little.
"""

import json
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from importlib.metadata import version
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from scipy.sparse import csr_array

from builder import wheel as published
from builder.base_mesh import read_base_mesh
from builder.bodies import already_made, errors_at_rest, unposed
from builder.geometry import along_edges
from builder.ground_truth import read_ground_truth
from builder.hands.mesh import HandMesh, read_hand
from builder.hands.sets import ABOUT, RADIUS, HandPoses, make_hand_sets, pose_space
from builder.ridge import RidgeSums
from builder.sets import SetRecipe, regress
from builder.stored import LICENCE, in_steps, sparse, whole_shares, write_arrays
from builder.training import BlockLines, training_and_held_out
from builder.wheel import Wheel
from workbench.arrays import Array, Mask
from workbench.bodies import SkinnedBody
from workbench.bodies.body import Landmarks
from workbench.bodies.catalogue import read_embedded
from workbench.threads import limited_threads
from workbench.training.blend_shapes import local_features
from workbench.training.blocks import alternation
from workbench.training.estimate import Estimate
from workbench.training.evaluation import held_out_errors, shapes_explained
from workbench.training.execution import Execution, Processes
from workbench.training.first_guess import Start, read_start
from workbench.training.folder import open_folder
from workbench.training.objective import Objective
from workbench.training.pose_training import PoseModel, train_poses
from workbench.training.shape_training import (
    about_root,
    learn_shape_space,
    learn_shapes,
    unposing_jobs,
)
from workbench.training.shares import at_most

RIDGES = (1e-5, 1e-4, 1e-3)  # per pose, at the joint
PRICES = (
    1.0,
    10.0,
    30.0,
    100.0,
    300.0,
    1000.0,
)  # how many times the ridge, more, at the distance FAR
FAR = 0.04  # m
MOST = 0.07  # of squared posedirs, farther than FAR: a finished hand, a larger one, has more
REACH = 2  # bones from a joint that carries a vertex
N_BETAS = 10
SHAPE_STEP, POSE_STEP = 1e-6, 5e-6  # m
COMMAND = "python -m builder.hands WHEEL --work FOLDER --out workbench/data/bodies"
BORDER = 0.008  # m between two segments, over which the first weights change
LEAST = 0.02  # weights below it are cut
DRAWS = 4000  # poses from which the pose space is learned
PROVENANCE = (
    "The people were made, not measured: drawn from traits and shape targets that artists modelled."
    " Read no anthropometry off this hand.",
    "Trained from synthetic registrations: hands in poses on one mesh, their poses and joints "
    "unknown to the training. No scan was seen. What pose does to a surface is a synthetic "
    "teacher's: dual quaternion skinning with the artists' weights.",
    "The poses are synthetic too: fifteen angles with two synergies, whose share of the variance "
    "was set to what Santello, Flanders and Soechting (1998) report of grasps, within anatomical "
    "ranges; a last joint turns by 2/3 of the one before it. The principal components of poses "
    "(`hands_components`) are those of this distribution, and not of people.",
    "Cut from the base mesh along a loop of edges 2.7 cm behind the wrist, and collapsed to 778 "
    "vertices. At rest the hand is flat, palm down, by the exact inverse of linear blend skinning. "
    "There are no nails.",
)
DRAWN = "synthetic draws of hand poses"


@dataclass(frozen=True, eq=False)
class PricedBlends:
    """Posedirs, and how they were chosen.

    Attributes:
        posedirs: (N, 3, 9 (K - 1)) m.
        ridge: per pose, at the joint itself.
        price: the factor on the ridge at `FAR`, less one.
        far: the share of squared posedirs farther than `FAR` from their joints.
    """

    posedirs: Array
    ridge: float
    price: float
    far: float


def joint_distances(start: Start, joints: Array) -> Array:
    """From each joint but the root to every vertex, (N, K - 1) m.

    The larger of two distances: along edges from the ring where the joint's segment begins, and
    straight from the joint, whose places `joints` (K, 3) m are on the template of `start`.
    """
    rings = start.rings()
    sources = [rings[[k]].nonzero()[1].astype(np.int64) for k in range(1, len(start.parents))]
    along = along_edges(start.template, start.faces, sources).T
    straight = np.linalg.norm(start.template[:, None] - joints[None, 1:], axis=2)
    return np.asarray(np.maximum(along, straight))


def far_share(posedirs: Array, distances: Array) -> float:
    """The share of squared posedirs of joints farther than `FAR` from a vertex."""
    energy = (posedirs.reshape(len(posedirs), 3, -1, 9) ** 2).sum(axis=(1, 3))
    return float(energy[distances > FAR].sum() / energy.sum())


def priced_posedirs(
    objective: Objective,
    estimate: Estimate,
    start: Start,
    ridges: Sequence[float] = RIDGES,
    prices: Sequence[float] = PRICES,
) -> PricedBlends:
    """The blend shapes that explain held-out subjects best, of those that are local.

    Of all pairs of a ridge and a price, those are tried whose posedirs have at most the share
    `MOST` farther than `FAR` from their joints; if none has, the most local ones are taken.
    """
    learned, held_out = (
        RidgeSums.of(errors_at_rest(objective, estimate, rows))
        for rows in training_and_held_out(objective.registrations.subject)
    )
    mean = estimate.templates.mean(axis=0), estimate.joints.mean(axis=0)
    distances = joint_distances(replace(start, template=mean[0]), mean[1])
    support = local_features(estimate.weights, estimate.parents, REACH)

    def tried() -> Iterator[tuple[bool, float, float, float]]:
        for ridge, price in product(ridges, prices):
            found = solved(learned, support, distances, ridge, price)
            far = far_share(found, distances)
            local = far <= MOST
            yield not local, held_out.error(found) if local else far, ridge, price

    _, _, ridge, price = min(tried())
    posedirs = solved(learned + held_out, support, distances, ridge, price)
    return PricedBlends(posedirs, ridge, price, far_share(posedirs, distances))


def solved(sums: RidgeSums, support: Mask, distances: Array, ridge: float, price: float) -> Array:
    """Posedirs (N, 3, F) m by ridge regression, with a ridge of its own for each entry.

    It is ridge (1 + price (d / FAR)^4) for a vertex at the distance d (N, K - 1) m from the joint.
    """
    found = np.zeros_like(sums.products)
    prices = ridge * sums.n_poses * (1 + price * (distances / FAR) ** 4)
    for v, (features, own_prices) in enumerate(zip(support, prices, strict=True)):
        own = np.flatnonzero(features)
        gram = sums.features[np.ix_(own, own)] + np.diag(np.repeat(own_prices, 9)[own])
        found[v][:, own] = np.linalg.solve(gram, sums.products[v][:, own].T).T
    return found


@dataclass(frozen=True, eq=False)
class TrainedHand:
    """A hand before it is packed.

    Attributes:
        body: the hand, whose landmarks `tips` are the tips of its fingers.
        blends: how its posedirs were chosen.
        far: the share of squared posedirs farther than 4 cm from their joints, on this hand.
        explained: (10,), the share of the variance that each shape direction explains.
        model: the training's result.
        space: mean (45,) rad, components (45, 45) and deviations (45,) rad of the poses.
    """

    body: SkinnedBody
    blends: PricedBlends
    far: float
    explained: Array
    model: PoseModel
    space: tuple[Array, Array, Array]


class HandBuilder:
    """Trains the right hand and writes it; stopped, it goes on from what is in `work`."""

    def __init__(self, wheel: Wheel, recipe: SetRecipe, work: Path, jobs: int) -> None:
        self.wheel, self.recipe, self.work = wheel, recipe, work
        self.began = time.perf_counter()
        self.execution = Execution(Processes(jobs), BlockLines(self.say))

    def say(self, message: str) -> None:
        """Print a message after the seconds since the builder began."""
        print(f"{time.perf_counter() - self.began:6.1f} s  {message}", flush=True)

    def build(self, out: Path) -> Path:
        """Make the sets, train, measure and write `hand.npz` into the folder `out`."""
        if already_made(self.work / "hand", self.recipe, None, ABOUT, DRAWN):
            hand = read_hand(self.wheel, read_base_mesh(self.wheel))
        else:
            hand = make_hand_sets(self.wheel, self.recipe, self.work / "hand", self.say)
        trained = self._trained(hand)
        trial = self.work / "hand.npz"
        write_arrays(trial, packed(trained, {}))
        self.say("fitting held-out people")
        stored = read_embedded(trial)
        card = self._card(trained, stored)
        path = out / "hand.npz"
        write_arrays(path, packed(trained, card))
        self.say(f"wrote {path} ({path.stat().st_size / 1e6:.2f} MB): {card['held_out']}")
        self.say(f"{100 * trained.far:.1f} % of squared posedirs lie beyond 4 cm")
        return path

    def _trained(self, hand: HandMesh) -> TrainedHand:
        folder = self.work / "hand" / "train"
        start = read_start(str(folder / "start.npz"))
        every = open_folder(folder, len(start.template), start.faces)
        run = self.work / "run-hand"
        run.mkdir(parents=True, exist_ok=True)
        self.say("training the hand")
        plan = alternation(reach=REACH)
        model = train_poses(
            every.only("poses"), start, plan, folder=run, execution=self.execution, border=BORDER
        )
        with limited_threads():
            self.say("  local blend shapes")
            weights = own_finger(model.estimate.weights)
            estimate = replace(model.estimate, weights=weights)
            blends = priced_posedirs(model.objective, estimate, start)
            self.say(f"  ridge {blends.ridge:g}, price {blends.price:g}, far {blends.far:.3f}")
            sides = np.arange(len(start.template))
            names = start.joint_names
            regressor = regress(estimate.templates, estimate.joints, names, sides, RADIUS)
            # No registration shows where the root is: the wrist stays where the artists put it.
            truth = read_ground_truth(folder)
            wrist = regress(truth.rest, truth.joints[:, :1], names[:1], sides, RADIUS)
            regressor[0] = wrist[0]
            subjects = about_root(estimate.templates, csr_array(regressor))
            own = learn_shape_space(subjects, start.faces, None, min(N_BETAS, len(subjects) - 1))
            body = SkinnedBody(
                template=own.template,
                shapedirs=own.shapedirs,
                posedirs=blends.posedirs,
                J_regressor=csr_array(regressor),
                weights=weights,
                parents=start.parents,
                faces=start.faces,
                joint_names=names,
                landmarks={"tips": tips_of(hand)},
                name="hand",
            )
            self.say("  un-posing people")
            shapes = every.only("shapes")
            execution = self.execution
            stood = learn_shapes(
                body, shapes, n_betas=N_BETAS, mirror=None, execution=execution
            ).poses
            each = execution.executor(partial(unposed, body), unposing_jobs(shapes, stood))
            people = about_root(np.concatenate(list(each)), body.J_regressor)
            shape = learn_shape_space(people, start.faces, None, N_BETAS)
        signs = np.ones(N_BETAS)
        signs[0] = -np.sign(shape.shapedirs[hand.tips[1], 0, 0])  # the first is larger
        body = replace(body, template=shape.template, shapedirs=shape.shapedirs * signs)
        joints, ends = body.J_regressor @ body.template, body.template[hand.tips]
        draws = HandPoses(joints, ends).draw(DRAWS, np.random.default_rng(self.recipe.seed))
        space = pose_space(draws)
        mesh = replace(start, template=body.template)
        far = far_share(body.posedirs, joint_distances(mesh, joints))
        return TrainedHand(body, blends, far, shape.explained, model, space)

    def _card(self, trained: TrainedHand, stored: SkinnedBody) -> dict[str, Any]:
        folder, body, model = self.work / "hand" / "held_out", trained.body, trained.model
        held = open_folder(folder, body.n_vertices, body.faces)
        found = held_out_errors(stored, held.only("poses"), self.execution)
        found |= shapes_explained(stored, held.only("shapes"), self.execution)
        deviations = trained.space[2]
        shares = np.cumsum(deviations**2) / np.sum(deviations**2)
        explained = np.round(trained.explained, 5).tolist()
        return {
            "name": "hand",
            "n_vertices": body.n_vertices,
            "n_faces": len(body.faces),
            "source": {
                "wheel": f"{published.NAME}=={published.VERSION}",
                "sha256": published.SHA256,
            },
            "licence": LICENCE,
            "provenance": list(PROVENANCE),
            "builder": {
                "command": COMMAND,
                **asdict(self.recipe),
                "versions": {name: version(name) for name in ("numpy", "scipy")},
            },
            "trained_on": {
                "registrations": len(model.estimate.poses),
                "subjects": len(model.estimate.templates),
                "people_for_shape": self.recipe.people,
                "of": "neutral",
            },
            "alternation": {
                "blocks": ", ".join(entry.block for entry in model.log),
                "training_rms_mm_per_coordinate": round(
                    1e3 * model.objective.rms(model.estimate), 4
                ),
            },
            "pose_blend_shapes": {
                "reach_bones": REACH,
                "ridge_per_pose": trained.blends.ridge,
                "price_at_4_cm": trained.blends.price,
                "share_beyond_4_cm": round(trained.far, 4),
            },
            "held_out": found,
            "betas": {
                "unit": "standard deviations of the people it was trained on",
                "sign": "the first is larger",
                "explained_variance": explained,
                "cumulative": np.round(np.cumsum(explained), 5).tolist(),
            },
            "pose_space": {
                "what": "principal components of synthetic poses; no hand was measured",
                "share_of_the_first": {
                    str(n): round(float(shares[n - 1]), 4) for n in (1, 2, 6, 10, 15)
                },
            },
        }


def own_finger(weights: Array) -> Array:
    """At most four weights of each vertex (N, 16), and beyond a finger's first joint its own alone.

    Registrations tie neighbouring fingers together, because they bend together in most poses; a
    vertex that a second or third joint moves most follows no other finger.
    """
    kept = np.where(weights >= LEAST, weights, 0.0)
    finger = (np.arange(16) + 2) // 3  # 0 for the wrist
    leading = weights.argmax(axis=1)
    beyond = (leading > 0) & (leading % 3 != 1)
    foreign = (finger != finger[leading][:, None]) & (finger > 0)
    kept[beyond[:, None] & foreign] = 0.0
    return at_most(kept, 4)


def tips_of(hand: HandMesh) -> Landmarks:
    """The finger tips as landmarks: one vertex each."""
    rows, N = np.arange(5), len(hand.vertices)
    names = ("index_tip", "middle_tip", "pinky_tip", "ring_tip", "thumb_tip")
    return Landmarks(names, csr_array((np.ones(5), (rows, hand.tips)), shape=(5, N)))


def packed(trained: TrainedHand, card: dict[str, Any]) -> dict[str, Any]:
    """The arrays of the file, as `workbench.bodies.catalogue` reads them."""
    body, (mean, components, deviations) = trained.body, trained.space
    N, K = body.n_vertices, body.n_joints
    sides = np.arange(N), np.arange(K)
    influences = whole_shares(body.weights, sides[0], sides[1])
    joints = np.sort(np.argsort(-influences, axis=1, kind="stable")[:, :4], axis=1)
    regressor = whole_shares(body.J_regressor.toarray(), sides[1], sides[0])
    tips = body.landmarks["tips"]
    wrist = regressor[0] / regressor[0].sum() @ body.template
    return {
        "template": body.template - wrist,
        "shapedirs": in_steps(body.shapedirs, SHAPE_STEP),
        "shapedirs_step": np.array(SHAPE_STEP),
        "posedirs": in_steps(body.posedirs, POSE_STEP).transpose(2, 1, 0),
        "posedirs_step": np.array(POSE_STEP),
        "weight_joints": joints.astype(np.uint8),
        "weight_shares": influences[sides[0][:, None], joints].astype(np.uint16),
        **sparse("J_regressor", regressor),
        **sparse("tips", whole_shares(tips.regressor.toarray(), np.arange(5), sides[0])),
        "tips_names": np.array(tips.names),
        "hands_mean": mean,
        "hands_components": components.astype(np.float32),
        "hands_deviations": deviations,
        "faces": body.faces.astype(np.uint16),
        "joint_names": np.array(body.joint_names),
        "parents": np.array(body.parents, np.int8),
        "card": np.array(json.dumps(card)),
    }


assert FAR == 0.04  # m, as the card and what is printed say
