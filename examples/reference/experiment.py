"""Experiment, Setup, KnownAnswer, Measure: a problem with a name, its start, its answer and its
numbers.
"""

import numpy as np

import workbench as wb


def line(points: int = 5) -> wb.Setup:
    x, y = np.arange(points), 1.0 + 2.0 * np.arange(points)
    slope = wb.Block("slope", (), "m")
    data = wb.Residual("data", slope.symbol * x + 1.0 - y, sigma=0.1, unit="m")
    return wb.Setup(
        wb.Problem([data], free="slope", blocks=[slope]),
        start={"slope": np.array(0.0)},
        question="How steep is the line?",
        measures=lambda found: (wb.Measure("slope", float(found["slope"]), "m"),),
        known=wb.KnownAnswer("the line that was drawn", cost=0.0, values={"slope": np.array(2.0)}),
    )


experiment = wb.Experiment("line", line, "a line through points", {"points": 9})
setup = experiment.setup()
solution = wb.solve(setup.problem, setup.start)
for measure in setup.measures(solution.values):
    print(measure.name, measure.value, measure.unit)
