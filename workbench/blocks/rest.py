"""A body at rest, as far as its arrays are blocks, and the blocks that move it from there."""

from dataclasses import dataclass


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
