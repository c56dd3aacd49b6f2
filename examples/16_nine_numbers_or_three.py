"""A rotation as nine numbers with six constraints, or as three numbers: what do solvers pay?

Markers on a chain of one or four turned parts are seen with noise. Each rotation is either a
matrix R with the six equations R'R = I, or a rotation vector (Rodrigues' formula). Both have the
same data, start (no turn) and tolerance, so that IPOPT and SQP show what the form costs;
Gauss-Newton and Levenberg-Marquardt take no constraints, and so only the three numbers. Lectures
call nine numbers with six constraints "suboptimal for optimization". Over 20 seeds for each case,
this is not so for one turn by 30 degrees, where nine numbers take fewer iterations. For one turn by
90 degrees SQP takes as many, and IPOPT more; for larger turns and for chains both take more. All
data are synthetic.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import casadi as cs
import numpy as np

import workbench as wb
from workbench.geometry.rotation import matrix_from_vector, rodrigues

SIGMA = 0.01  # m
SEEDS = 20
BONE = cs.DM([0, 0.3, 0])  # m, from one joint to the next
CASES = {  # how many rotations, and by how many degrees each of them turns
    "1 rotation by 30": (1, 30),
    "1 rotation by 90": (1, 90),
    "1 rotation by 150": (1, 150),
    "4 rotations by 30": (4, 30),
    "4 rotations by 90": (4, 90),
}
ASKED = (
    ("nine", "ipopt"),
    ("nine", "sqp"),
    ("three", "ipopt"),
    ("three", "sqp"),
    ("three", "gauss-newton"),
    ("three", "levenberg-marquardt"),
)


def seen(turns: Sequence[cs.MX | cs.DM], markers: Sequence[cs.DM]) -> cs.MX | cs.DM:
    """Where the markers (3, 8) m of each part are after its turn and those of the parts before."""
    G, joint, places = cs.DM.eye(3), cs.DM.zeros(3), []
    for R, part in zip(turns, markers, strict=True):
        G = G @ R
        places.append(G @ part + cs.repmat(joint, 1, 8))
        joint = joint + G @ BONE
    return cs.vec(cs.horzcat(*places))


def nine(count: int) -> tuple[wb.Block, list[cs.MX], list[wb.Constraint], np.ndarray]:
    """Matrices below each other, with six equations for each."""
    block = wb.Block("matrices", (3 * count, 3))
    turns = [rows.T for rows in cs.horzsplit(block.symbol, 3)]  # a symbol is (3, N)
    upper = [cs.vertcat(*[(R.T @ R)[i, j] for i in range(3) for j in range(i, 3)]) for R in turns]
    unit = [1, 0, 0, 1, 0, 1]
    six = [wb.Constraint(f"R'R = I, {k}", c, unit, unit) for k, c in enumerate(upper)]
    return block, turns, six, np.tile(np.eye(3), (count, 1))


def three(count: int) -> tuple[wb.Block, list[cs.MX], list[wb.Constraint], np.ndarray]:
    """Rotation vectors in radians, without constraints."""
    block = wb.Block("vectors", (count, 3), "rad")
    return block, cs.horzsplit(rodrigues(block.symbol), 3), [], np.zeros((count, 3))


FORMS: dict[str, Callable[[int], tuple[wb.Block, list[cs.MX], list[wb.Constraint], np.ndarray]]]
FORMS = {"nine": nine, "three": three}


@dataclass(frozen=True)
class Run:
    """What one solver found for one form of one problem.

    Attributes:
        solution: the solver's answer.
        unknowns: how many numbers were free.
        off: the rms distance of the markers from where they truly are, in mm.
        violation: the largest entry of |R'R - I|, over all rotations.
    """

    solution: wb.Solution
    unknowns: int
    off: float
    violation: float


def run(case: str, form: str, solver: str, seed: int) -> Run:
    """Solve one problem; the seed makes the markers, the turns and the noise."""
    count, degrees = CASES[case]
    rng = np.random.default_rng(seed)
    axes = rng.standard_normal((count, 3))
    truth = np.radians(degrees) * axes / np.linalg.norm(axes, axis=1, keepdims=True)
    markers = [cs.DM(0.1 * rng.standard_normal((3, 8))) for _ in range(count)]
    clean = seen([cs.DM(R) for R in matrix_from_vector(truth)], markers)
    observed = clean + cs.DM(SIGMA * rng.standard_normal(clean.shape))
    block, turns, constraints, start = FORMS[form](count)
    data = wb.Residual("markers", seen(turns, markers) - observed, sigma=SIGMA, unit="m")
    problem = wb.Problem([data], [block.name], blocks=[block], constraints=constraints)
    solution = wb.solve(problem, {block.name: start}, wb.SOLVERS[solver])
    values = solution.values[block.name]
    found = values.reshape(count, 3, 3) if form == "nine" else matrix_from_vector(values)
    off = np.asarray(seen([cs.DM(R) for R in found], markers) - clean)
    violation = np.abs(np.swapaxes(found, 1, 2) @ found - np.eye(3)).max()
    return Run(solution, problem.free.size, 1e3 * np.sqrt(3 * np.mean(off**2)), float(violation))


runs = {
    (case, form, solver): [run(case, form, solver, seed) for seed in range(SEEDS)]
    for case in CASES
    for form, solver in ASKED
}
best = {
    (case, seed): min(runs[case, *asked][seed].solution.cost for asked in ASKED)
    for case in CASES
    for seed in range(SEEDS)
}
iterations = {key: [len(one.solution.trace) - 1 for one in some] for key, some in runs.items()}
calls = {key: [one.solution.evaluations.total for one in some] for key, some in runs.items()}
at_best = {  # how many runs end at the lowest cost that any of them found
    key: sum(one.solution.cost <= 1.001 * best[key[0], s] for s, one in enumerate(some))
    for key, some in runs.items()
}
sooner = {  # in how many seeds IPOPT takes fewer iterations with three numbers, as many, more
    case: [
        int(np.sum(sign == np.sign(np.subtract(*(iterations[case, f, "ipopt"] for f in FORMS)))))
        for sign in (1, 0, -1)
    ]
    for case in CASES
}

if __name__ == "__main__":
    from workbench.plots import house_style, png, sheet

    print(f"median (largest) of {SEEDS} seeds; turns in degrees; best: runs at the lowest cost")
    print(
        "case              numbers  solver              iterations  evaluations |R'R-I|  best    mm"
    )
    for (case, form, solver), some in runs.items():
        key = case, form, solver
        print(
            f"{case:19}{some[0].unknowns:3} {form:6}{solver:19}"
            f"{np.median(iterations[key]):6.1f} ({max(iterations[key]):3})"
            f"{np.median(calls[key]):7.1f} ({max(calls[key]):4})"
            f"{max(one.violation for one in some):9.0e}{at_best[key]:4}"
            f"{np.median([one.off for one in some]):7.2f}"
        )
    for case, (fewer, equal, more) in sooner.items():
        print(
            f"{case}: IPOPT takes fewer iterations with three numbers for {fewer} seeds, as many "
            f"for {equal}, more for {more}"
        )
    with house_style():
        figure, axes = sheet(11, 4.2, columns=2)
        WHAT = ("iterations", "evaluations")
        for ax, counts, label in zip(axes, (iterations, calls), WHAT, strict=True):
            for i, (form, solver) in enumerate(ASKED):
                for c, case in enumerate(CASES):
                    place = c + 0.13 * (i - 2.5)
                    spread = np.linspace(-0.04, 0.04, SEEDS)
                    name = f"{form}, {solver}" if c == 0 else None
                    values = counts[case, form, solver]
                    ax.plot(place + spread, values, ".", ms=4, color=f"C{i}", label=name)
            ax.set_yscale("log")
            ax.set_xticks(range(len(CASES)), [case.replace(" by", "\nby") + "°" for case in CASES])
            ax.set_ylabel(label)
        named = axes[0].get_legend_handles_labels()
        figure.legend(*named, loc="outside upper center", ncols=len(ASKED), fontsize=8)
    Path(__file__).with_name("nine_numbers_or_three.png").write_bytes(png(figure))
    print(
        "Each dot is one seed, and the vertical axes are logarithmic. Only for one rotation by 30"
    )
    print(
        "degrees do nine numbers take fewer iterations in the median; otherwise three numbers do."
    )
