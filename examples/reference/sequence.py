"""sequence: many frames as one problem, with a block of each frame and a shared one."""

import numpy as np

import workbench as wb

place, length = wb.Block("place", (1,), "m"), wb.Block("length", (1,), "m")
seen = wb.Block("seen", (1,), "m")
data = wb.Residual("data", place.symbol + length.symbol - seen.symbol, sigma=0.1, unit="m")
ruler = wb.Residual("ruler", length.symbol - 0.5, sigma=0.01, unit="m")
frame = wb.Problem([data, ruler], free=["place", "length"], blocks=[place, length, seen])
video = wb.sequence(
    [frame] * 4, shared="length", between=[wb.residuals.smooth("place", sigma=0.1, order=1)]
)
start = {
    "place": np.zeros((4, 1)),
    "length": np.zeros(1),
    "seen": np.array([[1.0], [1.2], [1.3], [1.6]]),
}
found = wb.solve(video, start).values
print(video.free.size, "unknowns")
print(found["place"].ravel().round(3), found["length"])
