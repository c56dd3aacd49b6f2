"""How warm was the tea, how warm is the room, and how quickly does the tea cool?"""

# A problem of your own. The text above is the question that its pages begin with. Try it:
#
#     workbench run NAME.py         solve it, and write a page with every number
#     workbench diagnose NAME.py    what the data do not determine, and what to do about it
#     workbench compare NAME.py     several solvers from the same start
#     workbench sample NAME.py      how uncertain each unknown is, by draws
#
# Then put your own blocks, data and formula in place of these, piece by piece.

import casadi as cs
import numpy as np

import workbench as wb

# 1. Blocks: a name, a shape and a unit for each group of numbers, unknown or given. Labels name the
#    rows, and appear wherever an entry is mentioned: `warmth[room]`.
warmth = wb.Block("warmth", (2,), "deg C", labels=("first", "room"))
tau = wb.Block("tau", (), "min")
minutes = wb.Block("minutes", (30,), "min")
seen = wb.Block("seen", (30,), "deg C")

# 2. Residuals: what should be zero, as an expression of the blocks' symbols, and `sigma`, the size
#    of an ordinary error in the same unit. A symbol of shape (N, 3) is a matrix 3 x N in here.
first, room = warmth.symbol[0], warmth.symbol[1]
cooling = room + (first - room) * cs.exp(-minutes.symbol / tau.symbol)
data = wb.Residual("thermometer", cooling - seen.symbol, sigma=0.3, unit="deg C")
usual = wb.Residual("usual room", room - 21.0, sigma=2.0, unit="deg C")  # known before the data

# 3. The problem: its residuals, and the names that are free. All other blocks are given. An entry
#    alone is free with free=["warmth[first]"], and bounds={"tau": (1.0, 100.0)} would bound tau.
problem = wb.Problem([data, usual], free=["warmth", "tau"], blocks=[warmth, tau, minutes, seen])

# 4. The start: an array for each block, free and given, in its unit. These data are made up.
rng = np.random.default_rng(0)
times = np.linspace(0.0, 45.0, 30)
measured = 22.0 + 60.0 * np.exp(-times / 18.0) + 0.3 * rng.standard_normal(30)
start: wb.Values = {
    "warmth": np.array([90.0, 15.0]),
    "tau": np.array(30.0),
    "minutes": times,
    "seen": measured,
}

# 5. What else the commands look for, by these names, if it is there:
priors = ["usual room"]  # residuals that are not data: `workbench diagnose --data-alone`
compared = ["levenberg-marquardt", "ipopt"]  # other solvers, for `workbench run`

if __name__ == "__main__":  # `python NAME.py`: the same in Python
    solution = wb.solve(problem, start)
    print(solution.status.name, solution.values)
    print(wb.diagnose(problem, start | solution.values).report())
