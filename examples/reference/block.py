"""Block, Layout, Values: named arrays, and how they stand in one vector."""

import numpy as np

import workbench as wb

height = wb.Block("height", (2,), "m", labels=("left", "right"))
angle = wb.Block("angle", (), "rad")
layout = wb.Layout((height, angle))
values: wb.Values = {"height": np.array([1.7, 1.8]), "angle": np.array(0.5)}
vector = layout.pack(values)
print(vector)
for k in range(layout.size):
    print(k, layout.label(k), layout.unit(k))
print(layout.unpack(vector))
