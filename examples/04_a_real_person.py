"""A real person on a beam, seen by four cameras: the main experiment, from Python.

Which pose, shape and place of the body explain the 2D keypoints? Seven solvers are asked the same
question from the same start.
"""

from pathlib import Path

from workbench.experiments import EXPERIMENTS, run

outcome = run(EXPERIMENTS["balance"])
measures = {measure.name: measure.value for measure in outcome.measures}
costs = {name: solution.cost for name, solution in outcome.compared.items()}

if __name__ == "__main__":
    from workbench.plots import house_style, plot_overlay, png, sheet

    for name, value in measures.items():
        print(f"{name:40}{value:8.2f}")
    for name, cost in costs.items():
        print(f"{name:40}{cost:12.6f}")
    with house_style():
        figure, axes = sheet(13, 4.6, columns=4)
        for view, ax in enumerate(axes):
            plot_overlay(outcome, view, ax=ax)
    Path(__file__).with_name("balance.png").write_bytes(png(figure))
