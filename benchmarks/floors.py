"""Compiled bodies beside JAX's forward and the least that is possible: forward, Jacobian, step.

The floors say what limits each number: the bytes that have to be read and written, the products
that have to be formed, and J'J.
"""

from importlib.util import find_spec
from typing import Any

from benchmarks import floor, floor_of_arithmetic, ours, peers
from benchmarks.bodies_made_up import body_called
from benchmarks.candidates import check
from benchmarks.derivatives import KINDS
from benchmarks.timing import side_by_side

BODIES = ("default", "full", "6890")
OFTEN = {"forward": 4}  # times as many rounds, of what is quick


def measure(names: list[str], rounds: int, with_peers: bool = True) -> dict[str, Any]:
    """By body: seconds by kind and candidate, bytes that are stored, read and written.

    Bodies that are too small to be compiled are left out, and all where there is no compiler.
    """
    found = {}
    for name in names:
        made = ours.cases(name, body_called(name))
        if ours.COMPILED not in made:
            continue
        case = made[ours.COMPILED]
        x, *people = case.people(4)
        case = case.seeing(x)
        mine, (own, stored) = ours.candidate(ours.COMPILED, case), floor.of_own_bytes(case)
        candidates = [mine, own, floor_of_arithmetic.candidate(case), floor.candidate(case)]
        if with_peers and find_spec("jax") is not None:
            candidates.append(peers.in_jax(case))
            check(candidates[-1], case, people[0])
        N, n = case.body.n_vertices, case.problem.free.size
        found[name] = {
            "vertices": N,
            "stored": stored,
            "written": 8 * 3 * N * n,
            "seconds": {
                kind: side_by_side(
                    {one.name: getattr(one, kind) for one in candidates if _asked(one.name, kind)},
                    people,
                    rounds * OFTEN.get(kind, 1),
                )
                for kind in KINDS
            },
        }
    return found


def _asked(name: str, kind: str) -> bool:
    of_arithmetic = name == floor_of_arithmetic.ARITHMETIC and kind == "step"
    return not of_arithmetic and (name != peers.JAX or kind == "forward")
