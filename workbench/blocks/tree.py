"""The kinematic tree of a pose, and which entries of which blocks turn each joint."""

from dataclasses import dataclass
from functools import cached_property

from workbench.blocks.layout import Layout

Place = tuple[str, int]  # a block's name, and the first of three entries in a row


@dataclass(frozen=True)
class Tree:
    """The joints that a pose turns, by which motions are named.

    Attributes:
        pose: the name of the block that holds their rotation vectors, or of all blocks that do.
        names: the names of the joints.
        parents: parents[k] < k is the parent of joint k, -1 for the root.
        given_places: where the three numbers of each joint stand: a block and the first entry.
            None for a joint whose numbers are no entries of a block, such as those that are made of
            coefficients of principal components. Without them, they stand one after the other in
            the block `pose`.
        rigid_bones: whether each joint keeps its place on the bone of its parent, as the rank law
            of observed joints requires; joints found on a surface that deforms do not.
    """

    pose: str
    names: tuple[str, ...]
    parents: tuple[int, ...]
    given_places: tuple[Place | None, ...] | None = None
    rigid_bones: bool = True

    @cached_property
    def places(self) -> tuple[Place | None, ...]:
        """The block and first entry of each joint's three numbers; None where there are none."""
        if self.given_places is not None:
            return self.given_places
        return tuple((self.pose, 3 * k) for k in range(len(self.names)))

    @cached_property
    def blocks(self) -> tuple[str, ...]:
        """The names of the blocks that hold rotation vectors."""
        return tuple(dict.fromkeys(place[0] for place in self.places if place is not None))

    def children(self, joint: int) -> tuple[int, ...]:
        """The joints whose parent is `joint`."""
        return tuple(k for k, parent in enumerate(self.parents) if parent == joint)

    def called(self, joint: int) -> str:
        """`pose[left_hip]`: the joint by the name of the block that its numbers stand in."""
        place = self.places[joint]
        return f"{self.pose if place is None else place[0]}[{self.names[joint]}]"

    def entries(self, joint: int, free: Layout) -> list[int]:
        """The places, among the free numbers, of those numbers of the joint that are free."""
        place = self.places[joint]
        if place is None or place[0] not in free.slices:
            return []
        name, first = place
        return [i for e in range(first, first + 3) if (i := free.place(name, e)) is not None]

    def turned(self, free: Layout) -> dict[int, slice]:
        """Joints whose three numbers are all free, and where these stand among the free ones."""
        found = {k: self.entries(k, free) for k in range(len(self.names))}
        return {k: slice(at[0], at[0] + 3) for k, at in found.items() if len(at) == 3}

    def moves(self, free: Layout) -> bool:
        """Whether any number of a joint is free."""
        return any(self.entries(k, free) for k in range(len(self.names)))


@dataclass(frozen=True)
class Rest:
    """Arrays of a skinned body that are unknowns, for whoever wants to name motions of them.

    Attributes:
        pose: the name of the block of rotation vectors, (K, 3) rad.
        trans: the name of the block of the translation, (3,) m.
        template: the name of the block of the rest surface (N, 3) m; None if it is no block.
        joints: the name of the block of the joints at rest (K, 3) m; None if it is none.
        posedirs: the name of the block of pose blend shapes (N, 3, 9 (K - 1)) m; None if none.
    """

    pose: str
    trans: str
    template: str | None = None
    joints: str | None = None
    posedirs: str | None = None
