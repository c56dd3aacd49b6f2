# %% [markdown]
# # One wrong measurement
#
# **How far can a single wrong measurement move an estimate?**
#
# Somebody measures the length of a table ten times. The readings differ by a few millimetres, but
# for one of them the tape began at the wrong end. Lengths are in metres.
#
# (This text is an example; put your own in its place. A lecture goes from a question to a naive
# method, to its failure in a number and in a figure, to the idea that repairs it, and to the lines
# of the library that do so.)

# %% slide [markdown]
# ## One tape begins at the wrong end
#
# - Ten readings of a table: nine are off by millimetres, one by ten centimetres.
#
# (A cell like this is a slide: a headline, up to three bullets, the figure drawn since the last
# slide. `workbench lecture slides FOLDER slides` makes them; what stands above becomes notes.)

# %%
import numpy as np
from numpy.typing import ArrayLike

import workbench as wb
from workbench.course import Picture, source
from workbench.plots import house_style, sheet
from workbench.residuals import Kernel, huber
from workbench.residuals.kernels import Huber

# %% [markdown]
# ## The mean
#
# The estimate $x$ that minimises $\sum_i (x - y_i)^2$ is the mean of the readings $y_i$.

# %%
rng = np.random.default_rng(0)
TRUTH, SIGMA = 1.200, 0.003  # m
readings = TRUTH + SIGMA * rng.standard_normal(10)
wrong = readings.copy()
wrong[-1] += 0.100  # m, by which the tape was off

print(f"mean of ten good readings: {readings.mean():.4f} m")
print(f"mean with a wrong one:     {wrong.mean():.4f} m")

# %% [markdown]
# The wrong reading moves the mean by {{ 1000 * (wrong.mean() - readings.mean()):.0f}} mm, a tenth
# of its own error, whatever the others say. (Numbers in braces come from the cells above.)
#
# ## Errors that count less
#
# Huber's kernel counts a residual $r$ as its square up to $k$ standard deviations, and beyond that
# only as a multiple of $|r|$. Its derivative, by which a reading pulls at the estimate, then no
# longer grows.


# %%
def estimate(values: ArrayLike, kernel: Kernel) -> float:
    """The length that minimises the sum of the kernel's costs, in m."""
    length, readings = wb.Block("length", (), "m"), np.asarray(values, dtype=float)
    rows = wb.Residual("readings", length.symbol - readings, sigma=SIGMA, unit="m", kernel=kernel)
    problem = wb.Problem([rows], free="length", blocks=[length])
    return float(wb.solve(problem, {"length": np.array(np.median(readings))}).values["length"])


robust = estimate(wrong, huber(1.345))
print(f"Huber's estimate:          {robust:.4f} m")

# %%
offs = np.linspace(0.0, 0.1, 21)
means, robusts = [], []
for off in offs:
    moved = readings.copy()
    moved[-1] += off
    means.append(1000 * (moved.mean() - TRUTH))
    robusts.append(1000 * (estimate(moved, huber(1.345)) - TRUTH))
with house_style():
    figure, (ax,) = sheet(7.5, 3.8)
    ax.plot(1000 * offs, means, label="mean")
    ax.plot(1000 * offs, robusts, label="Huber's estimate")
    ax.set(xlabel="error of the wrong reading (mm)", ylabel="error of the estimate (mm)")
    ax.legend()
Picture(
    figure,
    "The mean follows the wrong reading without limit. Huber's estimate moves a little, and then "
    "stays.",
)

# %% slide [markdown]
# ## The mean follows one wrong reading without limit
#
# - Wrong by 100 mm: the mean moves by {{ 1000 * (wrong.mean() - readings.mean()):.0f}} mm,
#   Huber's estimate is off by {{ 1000 * abs(robust - TRUTH):.1f}} mm.

# %% [markdown]
# ## The library
#
# Huber's estimate is off by {{ 1000 * abs(robust - TRUTH):.1f}} mm. (The next braces hold what was
# said, and show nothing.){{ abs(robusts[-1]) < means[-1] / 2 }}
#
# The kernel is a factor by which a residual shrinks before it is squared:

# %%
source(Huber.__call__)

# %% [markdown]
# ## What to remember
#
# A squared error lets one reading move the estimate as far as it likes. A kernel bounds the pull of
# each reading.

# %% slide [markdown]
# ## What to remember
#
# - A squared error lets one reading move the estimate as far as it likes.
# - A kernel bounds the pull of each reading.
