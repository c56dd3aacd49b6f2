"""Forward, Jacobian and Gauss-Newton step of every candidate, side by side, on every body."""

from typing import Any

from benchmarks import floor, ours, peers
from benchmarks.bodies_made_up import body_called
from benchmarks.candidates import Candidate, check
from benchmarks.timing import side_by_side

KINDS = ("forward", "jacobian", "step")


def measure(name: str, rounds: int, with_peers: bool = True) -> dict[str, Any]:
    """One body: seconds by kind and candidate, and how far each candidate is from the workbench.

    Raises Disagreement if one computes something else.
    """
    made = ours.cases(name, body_called(name))
    case = made[ours.NUMPY]
    x, *people = case.people(4)
    case = case.seeing(x)
    candidates = [ours.candidate(way, one.seeing(x)) for way, one in made.items()]
    candidates += peers.installed(case) if with_peers else []
    apart = {one.name: check(one, case, people[0]) for one in candidates}
    candidates.append(floor.candidate(case))
    return {
        "vertices": case.body.n_vertices,
        "unknowns": case.problem.free.size,
        "apart": apart,
        "remarks": {one.name: one.remark for one in candidates if one.remark},
        "seconds": {
            kind: side_by_side(_by_kind(candidates, kind), people, rounds) for kind in KINDS
        },
    }


def _by_kind(candidates: list[Candidate], kind: str) -> dict[str, Any]:
    return {one.name: getattr(one, kind) for one in candidates}
