"""Camera: a pinhole camera as blocks, which may be free or fixed."""

import numpy as np

import workbench as wb

camera = wb.Camera("front_")
print([block.name for block in camera.blocks])
K = np.array([[1000.0, 0.0, 640.0], [0.0, 1000.0, 360.0], [0.0, 0.0, 1.0]])
values = camera.values(K=K, t=[0.0, 0.0, 4.0])
print(camera.pixels(np.array([[0.0, 0.0, 0.0], [0.4, 0.2, 0.0]]), values))
