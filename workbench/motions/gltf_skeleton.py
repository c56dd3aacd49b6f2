"""The skeleton of a skin in a glTF file, and where its joints are in every frame."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from workbench.arrays import Array
from workbench.errors import some_of
from workbench.geometry.gltf import GlbDocument, children, local_motion, several
from workbench.motions.gltf_tracks import Track, local_motions

MOST_NODES = 10_000
TOGETHER = 500  # frames whose motions are in memory at once


@dataclass(frozen=True, eq=False)
class Nodes:
    """The nodes of a file, each after its parent.

    Attributes:
        order: the numbers of the nodes.
        parents: the parent of each node by its number; -1 for one without.
        base: the motion (4, 4) of each node in its parent, when nothing is animated.
        json: the nodes as the file has them.
    """

    order: tuple[int, ...]
    parents: dict[int, int]
    base: dict[int, Array]
    json: list[dict[str, Any]]

    @staticmethod
    def of(document: GlbDocument) -> "Nodes":
        """The nodes of a document. Raises ValueError for those that hang on each other."""
        nodes = several(document.json, "nodes")
        if len(nodes) > MOST_NODES:
            raise ValueError(
                f"it has {len(nodes):,} nodes, and a skeleton has {MOST_NODES:,} at most"
            )
        parents = dict.fromkeys(range(len(nodes)), -1)
        for number, node in enumerate(nodes):
            for child in children(node, "children"):
                document.entry("nodes", child)
                if parents[child] != -1 or child == number:
                    raise ValueError(f"nodes[{child}] hangs on two others, or on itself")
                parents[child] = number
        order: list[int] = []
        waiting = [number for number, parent in parents.items() if parent == -1]
        while waiting:
            number = waiting.pop()
            order.append(number)
            waiting += children(nodes[number], "children")
        if len(order) < len(nodes):
            raise ValueError("its nodes hang on each other in a circle")
        base = {number: local_motion(nodes[number]) for number in order}
        return Nodes(tuple(order), parents, base, nodes)

    def above(self, some: set[int]) -> tuple[int, ...]:
        """These nodes and all those that they hang on, each after its parent."""
        found: set[int] = set()
        for number in some:
            while number != -1 and number not in found:
                found.add(number)
                number = self.parents[number]
        return tuple(number for number in self.order if number in found)

    def world(self, some: set[int], tracks: dict[tuple[int, str], Track], times: Array) -> Array:
        """The motions (S, len(some), 4, 4) of some nodes, in rising order, at times (S,) s."""
        found: dict[int, Array] = {}
        for number in self.above(some):
            parts = {
                path: track.at(times) for (node, path), track in tracks.items() if node == number
            }
            own = local_motions(self.base[number], self.json[number], parts, len(times))
            above = self.parents[number]
            found[number] = own if above == -1 else found[above] @ own
        return np.stack([found[number] for number in sorted(some)], axis=1)


@dataclass(frozen=True, eq=False)
class Skin:
    """K joints of a skin, each after its parent.

    Attributes:
        nodes: the number of each joint's node.
        parents: (K,) with parents[0] == -1.
        names: (K,) different names.
        to_rest: (K, 4, 4) from the world in which the skin was bound to the joint's node.
        rest: (K, 3) where the joints were in that world.
    """

    nodes: tuple[int, ...]
    parents: tuple[int, ...]
    names: tuple[str, ...]
    to_rest: Array
    rest: Array

    def only(self, kept: list[int]) -> "Skin":
        """Some of the joints, of which the first is the root."""
        place = {k: i for i, k in enumerate(kept)}
        return Skin(
            tuple(self.nodes[k] for k in kept),
            tuple(place.get(self.parents[k], -1) if i else -1 for i, k in enumerate(kept)),
            tuple(self.names[k] for k in kept),
            self.to_rest[kept],
            self.rest[kept],
        )

    def below(self, root: int) -> list[int]:
        """A joint and all those below it."""
        found = [root]
        for k in range(root + 1, len(self.parents)):
            if self.parents[k] in found:
                found.append(k)
        return found

    def motions(self, nodes: Nodes, tracks: dict[tuple[int, str], Track], times: Array) -> Array:
        """What takes the joints from rest to where they are, (S, K, 4, 4), at times (S,) s."""
        some = {*self.nodes}
        column = {number: i for i, number in enumerate(sorted(some))}
        columns = [column[number] for number in self.nodes]
        found = np.empty((len(times), len(self.nodes), 4, 4))
        for first in range(0, len(times), TOGETHER):
            part = slice(first, first + TOGETHER)
            found[part] = nodes.world(some, tracks, times[part])[:, columns] @ self.to_rest
        return found


def skin_of(document: GlbDocument, nodes: Nodes) -> tuple[Skin, tuple[str, ...]]:
    """The skin with most joints, and sentences on what is left out. Raises ValueError."""
    skins = several(document.json, "skins")
    joints: list[list[Any]] = [
        j if isinstance(j := skin.get("joints"), list) else [] for skin in skins
    ]
    sizes = [len(j) for j in joints]
    if not any(sizes):
        raise ValueError("it has no skin with joints, so that nothing in it is a skeleton")
    number = int(np.argmax(sizes))
    notes = (
        [f"of {len(skins)} skins, that with {max(sizes)} joints is read"] if len(skins) > 1 else []
    )
    listed = joints[number]
    for one in listed:
        document.entry("nodes", one)
    if len({*listed}) < len(listed):
        raise ValueError("a skin lists the same joint twice")
    inverse = np.tile(np.eye(4), (len(listed), 1, 1))
    worn = next((i for i, node in enumerate(nodes.json) if node.get("skin") == number), None)
    bound = np.eye(4) if worn is None else nodes.world({worn}, {}, np.zeros(1))[0, 0]
    if "inverseBindMatrices" in skins[number]:
        flat = document.values(skins[number]["inverseBindMatrices"], "MAT4", 16)
        if len(flat) < len(listed):
            raise ValueError(f"a skin has {len(listed)} joints and {len(flat)} bind matrices")
        inverse = flat[: len(listed)].reshape(-1, 4, 4).transpose(0, 2, 1)
    else:  # bound where the nodes are
        world = nodes.world({*listed}, {}, np.zeros(1))[0]
        inverse = np.linalg.inv(world[np.argsort(np.argsort(listed))]) @ bound
    try:
        rest = (bound @ np.linalg.inv(inverse))[:, :3, 3]
        to_rest = inverse @ np.linalg.inv(bound)
    except np.linalg.LinAlgError as error:
        raise ValueError("a bind matrix of its skin has no inverse") from error
    if not np.isfinite(to_rest).all() or not np.isfinite(rest).all():
        raise ValueError("a bind matrix of its skin is not finite")
    skin, more = _tree(nodes, listed, to_rest, rest)
    return skin, (*notes, *more)


def _tree(
    nodes: Nodes, listed: list[int], to_rest: Array, rest: Array
) -> tuple[Skin, tuple[str, ...]]:
    """The largest tree of the joints: the parent of each is the next joint that it hangs on.

    They are in the order of the skin, if each comes after its parent there.
    """
    where = {number: k for k, number in enumerate(listed)}
    order = [where[number] for number in nodes.order if number in where]
    if all(
        where[up] < k
        for k, one in enumerate(listed)
        for up in nodes.above({one})
        if up in where and up != one
    ):
        order = [*range(len(listed))]
    place = {k: i for i, k in enumerate(order)}
    parents = []
    for k in order:
        above = nodes.parents[listed[k]]
        while above != -1 and above not in where:
            above = nodes.parents[above]
        parents.append(-1 if above == -1 else place[where[above]])
    names: list[str] = []
    for i, k in enumerate(order):
        name = str(nodes.json[listed[k]].get("name") or f"joint_{i}")[:100]
        names.append(name if name not in names else f"{name}_{i}")
    skin = Skin(
        tuple(listed[k] for k in order), tuple(parents), tuple(names), to_rest[order], rest[order]
    )
    roots = [i for i, parent in enumerate(parents) if parent == -1]
    if len(roots) == 1:
        return skin, ()
    trees = [skin.below(root) for root in roots]
    kept = max(trees, key=len)
    lost = [name for i, name in enumerate(names) if i not in kept]
    return skin.only(kept), (f"joints in trees of their own are left out: {some_of(lost)}",)
