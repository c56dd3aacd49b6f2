"""SequenceDiagnosis: what a long sequence of frames cannot see, frame after frame."""

import numpy as np

import workbench as wb

frames = 5_000
place, length = wb.Block("place", (1,), "m"), wb.Block("length", (1,), "m")
data = wb.Residual("data", place.symbol + length.symbol - 1.0, sigma=0.1, unit="m")
frame = wb.Problem([data], free=["place", "length"], blocks=[place, length])
video = wb.sequence([frame] * frames, shared="length")
diagnosis = wb.diagnose(video, {"place": np.zeros((frames, 1)), "length": np.zeros(1)})
assert isinstance(diagnosis, wb.SequenceDiagnosis)  # more than 4,000 unknowns
print("rank", diagnosis.rank, "of", diagnosis.free.size)
for unseen in diagnosis.null_directions:
    print(unseen.count, "direction that no residual sees:", unseen.name)
