"""An experiment: a problem with arguments, made-up data, and numbers by which it is judged."""

# An experiment of your own. Its arguments are those of `setup`, with their defaults:
#
#     workbench run NAME.py --set noise=0.1      solve it, and write a page with every number
#     workbench diagnose NAME.py --set beacons=3
#     workbench compare NAME.py --seeds 3        several solvers, on the data of three seeds
#     workbench sample NAME.py                   how uncertain each unknown is, by draws

import casadi as cs
import numpy as np

import workbench as wb


def setup(seed: int = 0, noise: float = 0.05, beacons: int = 6) -> wb.Setup:
    """A receiver in a hall is at known distances from beacons, up to an offset of its clock.

    `seed` numbers the data, which `workbench compare --seeds` makes use of; `noise` is the standard
    deviation of a distance in m; `beacons` is how many there are, each at a random place.
    """
    # 1. The data. All randomness follows from the seed, so that a run can be repeated.
    rng = np.random.default_rng(seed)
    places = rng.uniform((0, 0, 0), (20, 4, 20), size=(beacons, 3))  # (M, 3) m
    truth = {"receiver": np.array([8.0, 1.2, 11.0]), "offset": np.array(0.7)}
    distances = np.linalg.norm(places - truth["receiver"], axis=1) + truth["offset"]
    observed = distances + noise * rng.standard_normal(beacons)

    # 2. The problem; see `workbench new problem` for each of these lines.
    receiver, offset = wb.Block("receiver", (3,), "m"), wb.Block("offset", (), "m")
    beacon, seen = wb.Block("beacon", (beacons, 3), "m"), wb.Block("seen", (beacons,), "m")
    away = beacon.symbol - cs.repmat(receiver.symbol, 1, beacons)  # (3, M) m
    ranges = cs.sqrt(cs.sum1(away**2)).T + offset.symbol  # (M, 1) m
    data = wb.Residual("ranges", ranges - seen.symbol, sigma=max(noise, 1e-4), unit="m")
    usual = wb.Residual("usual clock", offset.symbol, sigma=2.0, unit="m")
    problem = wb.Problem(
        [data, usual], free=["receiver", "offset"], blocks=[receiver, offset, beacon, seen]
    )

    # 3. What is looked at when it has been solved: numbers with units, for the summary.
    def measures(values: wb.Values) -> tuple[wb.Measure, ...]:
        off = float(np.linalg.norm(values["receiver"] - truth["receiver"]))
        return (wb.Measure("distance from the truth", 1000 * off, "mm"),)

    return wb.Setup(
        problem,
        start={
            "receiver": np.array([10.0, 2.0, 10.0]),
            "offset": np.array(0.0),
            "beacon": places,
            "seen": observed,
        },
        question="Where is the receiver?",
        measures=measures,
        priors=("usual clock",),
        compared=("levenberg-marquardt", "ipopt"),
        synthetic=f"Distances to {beacons} beacons were made up, with errors of {noise:g} m.",
        made_of=truth,  # where the data come from, before noise; a known minimum goes to `known`
    )


if __name__ == "__main__":  # `python NAME.py`
    made = setup()
    solution = wb.solve(made.problem, made.start)
    print(solution.status.name, *made.measures(made.start | solution.values))
