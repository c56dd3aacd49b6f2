"""People: the artists' shape targets, traits of adults, and adults un-posed in the T-pose."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.sparse import csr_array

from builder.base_mesh import N_BODY, BaseMesh, MakeHumanRig, read_base_mesh, read_rig
from builder.wheel import Wheel
from lectures.material.teacher import (
    JOINT,
    N_JOINTS,
    at_most_four,
    joint_positions,
    offsets,
)
from workbench.arrays import Array, Mask
from workbench.bodies.forward.skinning import blend_matrices
from workbench.geometry.mirror import REFLECTION
from workbench.geometry.solids import volume

Factors = dict[str, float]

# MakeHuman's levels of each trait, as they are written in the names of the targets.
LEVELS = {
    "gender": ("male", "female"),
    "age": ("young", "old"),
    "muscle": ("minmuscle", "averagemuscle", "maxmuscle"),
    "weight": ("minweight", "averageweight", "maxweight"),
    "height": ("minheight", "maxheight"),
    "proportions": ("uncommonproportions", "idealproportions"),
    "cupsize": ("mincup", "averagecup", "maxcup"),
    "firmness": ("minfirmness", "averagefirmness", "maxfirmness"),
    "race": ("african", "asian", "caucasian"),
}
LOCAL_SECTIONS = (
    *("arms", "legs", "torso", "stomach", "buttocks", "hip", "neck", "feet", "hands", "head"),
    "pelvis",
)
# Local changes that are no variation between standing adults: bent, moved or expecting ones.
LEFT_OUT = (
    *("trans-in", "trans-forw", "trans-back", "pregnant", "age", "head-fat", "asym", "nipple"),
    "bulge",
)
# Local changes that make trunk and limbs thicker: they grow together with a person's girth.
GIRTH_SECTIONS = ("arms", "legs", "torso", "buttocks", "hip")
GIRTH_WORDS = ("fat", "circ", "volume", "scale-depth", "scale-horiz")
DENSITY = 985.0  # kg / m^3, of a human body with air in the lungs
LOCAL_SHARE, LOCAL_SPREAD = 0.5, 0.18  # how many of the local changes a person has; how large
# Found by trial, so that both genders have a body mass index of about 25 +- 4 kg / m^2: the
# artists' bodies are thinner than people, and extending their weight much further looks wrong.
WEIGHT_MEAN, WEIGHT_SPREAD = 0.9, 0.2
GIRTH_MEANS, GIRTH_SPREAD = {"female": 0.15, "male": 0.02}, 0.14
X, DOWN, FRONT = np.array([1.0, 0, 0]), np.array([0, -1.0, 0]), np.array([0, 0, 1.0])
THIGH = np.array([0.05, -1.0, 0])  # the left thigh of the T-pose leaves the hip slightly outwards
JITTER = 0.05  # rad, of every joint about every axis: no two people at rest stand alike
SEARCH_RADIUS = {"joints": 0.25, "keypoints": 0.15}  # m, of the vertices that may give a point


@dataclass(frozen=True)
class Traits:
    """The traits of one adult, each from 0 (least) to 1 (most), as Anny names them.

    Attributes:
        gender: 0 is male, 1 female.
        age: 0 is about 25 years, 1 about 90.
        race: the weights of the three levels, which sum to one.
        local: from -1 to 1, one for each local change.
    """

    gender: float
    age: float
    muscle: float
    weight: float
    height: float
    proportions: float
    cupsize: float
    firmness: float
    race: tuple[float, float, float]
    local: tuple[float, ...] = ()

    @property
    def female(self) -> bool:
        """Whether the person is more female than male."""
        return self.gender > 0.5

    def factors(self) -> Factors:
        """The share of each level of each trait; the levels of a trait sum to at most one.

        Gender and age are interpolated between two levels, and muscle, weight, cup size and
        firmness between three. Height and proportions have two levels, and in the middle both
        shares are zero.
        """
        shares: dict[str, tuple[float, ...]] = {
            "gender": (1 - self.gender, self.gender),
            "age": (1 - self.age, self.age),
            "height": _two_ends(self.height),
            "proportions": _two_ends(self.proportions),
            "race": self.race,
        }
        for trait in ("muscle", "weight", "cupsize", "firmness"):
            low, high = _two_ends(getattr(self, trait))
            shares[trait] = (low, 1 - low - high, high)
        return {
            level: share
            for trait, levels in LEVELS.items()
            for level, share in zip(levels, shares[trait], strict=True)
        }


def _two_ends(x: float) -> tuple[float, float]:
    return max(0.0, 1 - 2 * x), max(0.0, 2 * x - 1)


@dataclass(frozen=True, eq=False)
class ShapeTargets:
    """Displacements (T, 3 V) m: one for each combination of levels, then those of local changes.

    Among the local ones, those for more of each property come first, and then those for less of it.
    """

    combinations: tuple[tuple[str, ...], ...]
    local: tuple[str, ...]
    displacements: Array

    @property
    def girth(self) -> Array:
        """One for each local change that makes trunk and limbs thicker, else zero."""
        sections = (name.split("/")[0] in GIRTH_SECTIONS for name in self.local)
        thicker = (any(word in name for word in GIRTH_WORDS) for name in self.local)
        return np.array([float(a and b) for a, b in zip(sections, thicker, strict=True)])

    def coefficients(self, person: Traits) -> Array:
        """How much of each displacement makes this person, (T,): products of factors."""
        factors = person.factors()
        macro = [np.prod([factors[level] for level in levels]) for levels in self.combinations]
        amounts = np.array(person.local or np.zeros(len(self.local)))
        return np.concatenate([macro, np.maximum(amounts, 0), np.maximum(-amounts, 0)])


def read_shape_targets(wheel: Wheel, n_vertices: int) -> ShapeTargets:
    """The targets that apply to adults of both genders, the same on both sides."""
    macro = dict(_macro_targets(wheel))
    local = dict(_local_targets(wheel))
    more = [_sum(wheel, plus, n_vertices) for plus, _ in local.values()]
    less = [_sum(wheel, minus, n_vertices) for _, minus in local.values()]
    single = [wheel.target(path, n_vertices) for path in macro.values()]
    stacked = np.stack([*single, *more, *less]).reshape(-1, 3 * n_vertices)
    return ShapeTargets(tuple(macro), tuple(local), stacked)


def _macro_targets(wheel: Wheel) -> Iterator[tuple[tuple[str, ...], str]]:
    """Combinations of levels, each with the path of its target."""
    for levels in _all("gender", "age", "muscle", "weight"):
        yield levels, "macrodetails/universal-" + "-".join(levels)
    for trait in ("height", "proportions"):
        for levels in _all("gender", "age", "muscle", "weight", trait):
            yield levels, f"macrodetails/{trait}/" + "-".join(levels)
    for levels in _all("race", "gender", "age"):
        yield levels, "macrodetails/" + "-".join(levels)
    there = set(wheel.targets("breast"))  # of the average cup and firmness there is none
    for levels in _all("gender", "age", "muscle", "weight", "cupsize", "firmness"):
        if "-".join(levels) in there:
            yield levels, "breast/" + "-".join(levels)


def _all(*traits: str) -> Iterator[tuple[str, ...]]:
    return product(*(LEVELS[trait] for trait in traits))


def _local_targets(wheel: Wheel) -> Iterator[tuple[str, tuple[list[str], list[str]]]]:
    """Pairs of opposite local changes, left and right together: paths of more and of less."""
    sections = wheel.json("mpfb2/targets/target.json")
    for section in LOCAL_SECTIONS:
        for category in sections[section]["categories"]:
            name, opposites = category["name"], category.get("opposites")
            if not opposites or any(word in name for word in LEFT_OUT):
                continue
            plus, minus = (
                [
                    f"{section}/{opposites[f'{sign}-{side}']}"
                    for side in ("left", "right", "unsided")
                    if opposites.get(f"{sign}-{side}")
                ]
                for sign in ("positive", "negative")
            )
            if plus and minus:
                yield f"{section}/{name}", (plus, minus)


def _sum(wheel: Wheel, paths: list[str], n_vertices: int) -> Array:
    total: Array = np.sum([wheel.target(path, n_vertices) for path in paths], axis=0)
    return total


Report = Callable[[str], None]


@dataclass(frozen=True, eq=False)
class Population:
    """P adults in the T-pose, pelvis joint at the origin, alike on both sides.

    Attributes:
        female: (P,).
        vertices: (P, 13380, 3) m.
        joints: (P, 24, 3) m.
        keypoints: (P, M, 3) m, those that were asked for.
        masses: (P,) kg.
    """

    female: Mask
    vertices: Array
    joints: Array
    keypoints: Array
    masses: Array


def draw_person(rng: np.random.Generator, female: bool, thicker: Array) -> Traits:
    """One adult at random; `thicker` (L,) says which local changes grow with girth."""
    lean = min(abs(rng.normal(0, 0.08)), 0.3)

    def trait(mean: float, std: float, low: float = 0.0, high: float = 1.0) -> float:
        return float(np.clip(rng.normal(mean, std), low, high))

    has = rng.random(len(thicker)) < LOCAL_SHARE
    girth = trait(GIRTH_MEANS["female" if female else "male"], GIRTH_SPREAD, -0.25, 0.45)
    changes = rng.normal(0, LOCAL_SPREAD, len(thicker)) * has + girth * thicker
    return Traits(
        gender=1 - lean if female else lean,
        age=float(rng.beta(1.2, 2.0)),
        muscle=trait(0.5, 0.16, 0.05, 0.95),
        weight=trait(WEIGHT_MEAN, WEIGHT_SPREAD, 0.1, 1.2),
        height=trait(0.5, 0.055, 0.3, 0.7),
        proportions=trait(0.55, 0.2),
        cupsize=trait(0.5, 0.2),
        firmness=trait(0.5, 0.2),
        race=tuple(rng.dirichlet([0.6] * 3)),
        local=tuple(changes.clip(-0.5, 0.5)),
    )


def draw_population(
    mesh: BaseMesh,
    rig: MakeHumanRig,
    weights: Array,
    targets: ShapeTargets,
    keypoints: csr_array,
    *,
    n: int,
    seed: int,
    report: Report,
) -> Population:
    """`n` adults, women and men in turn.

    With `weights` (13380, 24) they are brought into the rest pose; `keypoints` (M, 19158) are means
    of vertices of the base mesh.
    """
    rng = np.random.default_rng(seed)
    people = [draw_person(rng, i % 2 == 0, targets.girth) for i in range(n)]
    vertices, joints = np.empty((n, N_BODY, 3)), np.empty((n, 24, 3))
    marks, masses = np.empty((n, keypoints.shape[0], 3)), np.empty(n)
    for i, person in enumerate(people):
        drawn = targets.coefficients(person) @ targets.displacements
        a_pose = mesh.without_nipples(mesh.symmetrised(mesh.vertices + drawn.reshape(-1, 3)))
        standing = rig.joints @ a_pose
        rest = to_t_pose(a_pose[:N_BODY], standing, rig.knuckles @ a_pose, weights)
        # The head does not turn, so helpers (the eyes) move with the pelvis.
        all_vertices = np.concatenate([rest.vertices, a_pose[N_BODY:] - standing[0]])
        vertices[i], joints[i] = mesh.symmetrised(rest.vertices), rest.joints
        marks[i] = keypoints @ all_vertices
        masses[i] = DENSITY * volume(a_pose[:N_BODY], mesh.triangles)
        if (i + 1) % 100 == 0:
            report(f"  {i + 1} of {n} adults")
    return Population(np.array([p.female for p in people]), vertices, joints, marks, masses)


@dataclass(frozen=True, eq=False)
class RestPose:
    """One person in the T-pose: `vertices` (N, 3) m and `joints` (24, 3) m, pelvis at the origin.

    `rotations` (24, 3, 3) took each joint from the A-pose to the T-pose.
    """

    vertices: Array
    joints: Array
    rotations: Array


def direction(v: Array) -> Array:
    """The vector scaled to unit length."""
    unit: Array = v / np.linalg.norm(v)
    return unit


def frame(first: Array, second: Array) -> Array:
    """The orthonormal frame (3, 3) whose columns begin along `first` and lean to `second`."""
    x = direction(first)
    y = direction(second - x * (x @ second))
    return np.stack([x, y, np.cross(x, y)], axis=1)


def smallest_rotation(origin: Array, goal: Array) -> Array:
    """The rotation (3, 3) by the smallest angle that takes one direction to another."""
    u, v = direction(origin), direction(goal)
    c, (x, y, z) = u @ v, np.cross(u, v)
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    R: Array = np.eye(3) + K + K @ K / (1 + c)
    return R


def t_pose_rotations(joints: Array, knuckles: Array) -> Array:
    """World rotations (24, 3, 3) from the A-pose to the T-pose, right as the mirror of left.

    Legs straight down, arms straight along x, the elbow's axis vertical, so that it bends
    forwards, palms down and index finger forward; the trunk, head and feet stay.
    `joints` (24, 3) m; `knuckles` (3, 3) m of the left index, middle and little finger.
    """
    at = {name: joints[k] for name, k in JOINT.items()}
    upper, fore = (at["left_elbow"] - at["left_shoulder"], at["left_wrist"] - at["left_elbow"])
    index, middle, little = knuckles
    shoulder = frame(X, FRONT) @ frame(upper, fore).T
    hand = frame(X, FRONT) @ frame(middle - at["left_wrist"], index - little).T
    left = {
        "left_hip": smallest_rotation(at["left_knee"] - at["left_hip"], THIGH),
        "left_knee": smallest_rotation(at["left_ankle"] - at["left_knee"], DOWN),
        "left_shoulder": shoulder,
        "left_elbow": smallest_rotation(shoulder @ fore, X) @ shoulder,
        "left_wrist": hand,
        "left_hand": hand,
    }
    rotations = np.tile(np.eye(3), (N_JOINTS, 1, 1))
    for name, R in left.items():
        rotations[JOINT[name]] = R
        rotations[JOINT[name.replace("left", "right")]] = R * np.outer(REFLECTION, REFLECTION)
    return rotations


def unskin(posed: Array, weights: Array, R: Array, shifts: Array) -> Array:
    """The points (N, 3) m that linear blend skinning takes to `posed`: its exact inverse.

    The motion of joint k is v -> R_k v + o_k, with rotations R (K, 3, 3) and `shifts` o (K, 3) m.
    """
    turned = (posed - weights @ shifts)[..., None]
    return np.asarray(np.linalg.solve(blend_matrices(weights, R), turned)[..., 0])


def to_t_pose(vertices: Array, joints: Array, knuckles: Array, weights: Array) -> RestPose:
    """The rest surface that linear blend skinning takes back to `vertices` (N, 3) exactly.

    `joints` (24, 3) m of the A-pose, `knuckles` (3, 3) m as in
    `t_pose_rotations`, `weights` (N, 24).
    """
    R = t_pose_rotations(joints, knuckles)
    rest = joint_positions(R, joints)
    rest -= rest[0]
    back = R.transpose(0, 2, 1)
    shifts = offsets(back, joints, rest)
    return RestPose(unskin(vertices, weights, back, shifts), rest, R)


@dataclass(frozen=True, eq=False)
class Sources:
    """Everyone on the base mesh, before any body's own mesh is chosen.

    Attributes:
        weights: (13380, 24), for linear blend skinning.
        fine_weights: (13380, 32), for the teacher.
    """

    wheel: Wheel
    mesh: BaseMesh
    population: Population
    weights: Array
    fine_weights: Array


def gather_sources(
    wheel: Wheel, people: int, seed: int, report: Report, keypoints: csr_array | None = None
) -> Sources:
    """Read the wheel and draw so many people.

    `keypoints` (M, 19158) are weighted means of base vertices that are wanted of every person.
    """
    mesh = read_base_mesh(wheel)
    rig = read_rig(wheel, mesh)
    weights = at_most_four(rig.weights, mesh.mirror[:N_BODY])
    report("reading the shape targets")
    targets = read_shape_targets(wheel, len(mesh.vertices))
    report(f"drawing and un-posing {people} adults")
    population = draw_population(
        mesh,
        rig,
        weights,
        targets,
        csr_array((0, len(mesh.vertices))) if keypoints is None else keypoints,
        n=people,
        seed=seed,
        report=report,
    )
    return Sources(wheel, mesh, population, weights, rig.fine_weights)
