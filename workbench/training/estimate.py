"""The unknowns of training, and the standard deviation of each of its terms."""

from dataclasses import dataclass, fields, replace
from functools import cached_property

import numpy as np
from scipy.sparse import csr_array

from workbench.arrays import Array, Index
from workbench.bodies.forward.kinematics import ancestors
from workbench.bodies.forward.posing import Posing

Change = dict[str, Array]
NAMES = ("templates", "posedirs", "joints", "poses", "weights")


@dataclass(frozen=True, eq=False)
class Estimate:
    """The unknowns of training: S subjects in J registrations of N vertices on K joints.

    There are F = 9 (K - 1) pose features.

    Attributes:
        templates: (S, N, 3) in metres, each subject at rest.
        joints: (S, K, 3) in metres, each subject's joints at rest.
        posedirs: (N, 3, F) in metres per unit of pose feature.
        weights: (N, K) skinning weights; rows sum to one.
        poses: (J, K, 3) in radians, the pose of each registration.
        parents: the tree of the joints.
        regressor: (K, N) joints from templates; None until it is learned.
    """

    templates: Array
    joints: Array
    posedirs: Array
    weights: Array
    poses: Array
    parents: tuple[int, ...]
    regressor: csr_array | None = None

    @cached_property
    def posing(self) -> Posing:
        """The joints' rotations in every registration."""
        return Posing.of(self.poses, self.parents)

    @cached_property
    def subtree_weights(self) -> Array:
        """Each vertex's weight at or below each joint, (N, K)."""
        return self.weights @ ancestors(self.parents)

    def of_rows(self, rows: Index | slice, subject: Index) -> "tuple[Estimate, Index]":
        """Some registrations with only the subjects that they show, and how these are numbered.

        `subject` (c,) are the subjects of the rows. The regressor is left out.
        """
        own, numbered = np.unique(subject, return_inverse=True)
        theirs = replace(
            self,
            templates=self.templates[own],
            joints=self.joints[own],
            poses=self.poses[rows],
            regressor=None,
        )
        return theirs, numbered

    def moved(self, change: Change, share: float = 1.0) -> "Estimate":
        """The estimate after a share of a step; poses are turned, everything else is added."""
        found = {n: getattr(self, n) + share * d for n, d in change.items() if n != "poses"}
        if "poses" in change:
            found["poses"] = self.posing.turned(share * change["poses"]).poses
        return replace(self, **found)

    def zero_change(self, names: tuple[str, ...]) -> Change:
        """A step of length zero in these names."""
        return {name: np.zeros_like(getattr(self, name)) for name in names}

    def arrays(self) -> dict[str, Array]:
        """The arrays by name, as a checkpoint stores them."""
        found = {name: getattr(self, name) for name in NAMES}
        return found if self.regressor is None else found | {"regressor": self.regressor.toarray()}


@dataclass(frozen=True)
class Sigmas:
    """The standard deviation that each term expects; infinity switches a term off.

    The weights of the lectures are ratios of variances: lambda_P = (data / posedirs)^2 and so on,
    so that E = E_D + lambda_Y E_Y + lambda_J E_J + lambda_P E_P + lambda_W E_W is 2 data^2 times
    the cost.

    Attributes:
        data: in metres (E_D), of a registration from the model.
        symmetry: in metres (E_Y), of a template from its mirror image.
        joint_symmetry: in metres (E_Y), of the joints from their mirror image.
        rings: in metres (E_J), of the joints from the mean of the ring of vertices around them,
            and from the regressor once it is learned.
        posedirs: in metres per unit of pose feature (E_P), of posedirs from zero.
        weights: of the weights from the initial ones (E_W).
        subjects: in metres (E_T), of a subject's template from the first template.
    """

    data: float = 0.002
    symmetry: float = 0.01
    joint_symmetry: float = 0.01
    rings: float = 0.01
    posedirs: float = 0.01
    weights: float = 0.3
    subjects: float = 0.03

    @property
    def lambdas(self) -> dict[str, float]:
        """The weights of the lectures, by term."""
        return {name: (self.data / getattr(self, name)) ** 2 for name in TERMS}


TERMS = tuple(f.name for f in fields(Sigmas) if f.name != "data")
