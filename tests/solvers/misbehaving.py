"""Every solver and every algorithm of NLopt on objectives that misbehave, in a process of its own.

Prints a line per call: algorithm, misbehaviour, seconds, status. What hangs, hangs here.
"""

import sys
import time
from dataclasses import replace

import casadi as cs
import numpy as np

from workbench import SOLVERS, Block, Nlopt, Problem, Residual
from workbench.solvers.nlopt import ALGORITHMS

KINDS = ("nan", "infinite", "now and then", "raises", "slow")
SECONDS = 0.15  # of every call

EVERYBODY = {name: Nlopt(name) for name in ALGORITHMS}
EVERYBODY |= {name: s for name, s in SOLVERS.items() if not name.startswith("nlopt-")}


class Misbehaving(cs.Callback):
    """x -> x for a while, and then something else."""

    def __init__(self, patience: int, kind: str) -> None:
        super().__init__()
        self.patience, self.kind = patience, kind
        self.construct("misbehaving", {"enable_fd": True})

    def get_sparsity_in(self, i: int) -> cs.Sparsity:
        return cs.Sparsity.dense(2, 1)

    def get_sparsity_out(self, i: int) -> cs.Sparsity:
        return cs.Sparsity.dense(2, 1)

    def eval(self, arguments: list[cs.DM]) -> list[cs.DM]:
        self.patience -= 1
        x = arguments[0]
        if self.patience >= 0:
            return [x]
        if self.kind == "raises":
            raise ValueError("out of patience")
        if self.kind == "slow":
            time.sleep(0.01)
            return [x]
        if self.kind == "now and then" and self.patience % 3:
            return [x]
        return [x * {"infinite": np.inf}.get(self.kind, np.nan)]


def main() -> None:
    for name, chosen in EVERYBODY.items():
        for kind in KINDS:
            misbehaving = Misbehaving(12, kind)
            y = misbehaving(Block("x", (2,)).symbol)
            valley = Residual("valley", cs.vertcat(10 * (y[1] - y[0] ** 2), 1 - y[0]), 1.0)
            bounds = {"x": (-3.0, 3.0)} if chosen.abilities.bounds else None
            case = Problem((valley,), ("x",), bounds)
            case.prepare()
            began = time.perf_counter()
            solver = replace(chosen, max_seconds=SECONDS, max_evaluations=10**6)
            solution = solver.solve(case, {"x": np.array([-1.2, 1.0])})
            seconds = time.perf_counter() - began
            print(f"{name}\t{kind}\t{seconds:.3f}\t{solution.status.name}", flush=True)
            assert np.isfinite(solution.values["x"]).all()


if __name__ == "__main__":
    sys.exit(main())
