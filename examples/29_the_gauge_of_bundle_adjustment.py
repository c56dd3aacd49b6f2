"""Three cameras see twenty points. What can images never tell? Where all of it is, and how large.

Moving, turning or scaling the points and the cameras together changes no image: seven directions.
The diagnosis names them. Fixing all points would hold 60 numbers where 7 are unknown; the least
remedy holds one camera and one more number, and loses nothing.
"""

import casadi as cs
import numpy as np

import workbench as wb
from workbench.geometry.camera import Camera

rng = np.random.default_rng(0)
points = wb.Block("points", (20, 3), "m")
scene = rng.normal(size=(20, 3))
cameras = [Camera(f"camera {k}/") for k in range(3)]
images, values = [], {"points": scene}
for k, camera in enumerate(cameras):
    R = [[np.cos(k), 0, np.sin(k)], [0, 1, 0], [-np.sin(k), 0, np.cos(k)]]
    known = camera.values(K=[[900, 0, 320], [0, 900, 240], [0, 0, 1]], R=R, t=[0.1 * k, 0, 6])
    seen = camera.pixels(scene, known) + rng.normal(size=(20, 2))
    difference = cs.vec(camera.project(points.symbol) - cs.DM(seen.T))
    images.append(wb.Residual(f"image {k}", difference, sigma=1.0, unit="px"))
    values |= known
free = ["points", *(f"camera {k}/{part}" for k in range(3) for part in ("rotation", "translation"))]
problem = wb.Problem(images, free, blocks=[points])
diagnosis = wb.diagnose(problem, values)
gauges = [direction.name for direction in diagnosis.null_directions]
remedies = [suggestion for suggestion in diagnosis.suggestions if suggestion.kind == "least"]
solution = wb.solve(remedies[0].problem, values)

if __name__ == "__main__":
    print(f"rank {diagnosis.rank} of {diagnosis.shape[1]}; no image changes under")
    print("\n".join(f"  {name}" for name in gauges))
    for remedy in remedies:
        print(f"{remedy.what}: {remedy.before} -> {remedy.after}")
    print(f"with the first of these: {solution.status.name}, cost {solution.cost:.1f}")
