"""All 24 joints are known exactly. How much of the pose is known? 40 of 72 numbers.

The rotations of the five leaf joints move no joint, and a bone can turn about itself if the next
joint turns back. The diagnosis counts and names these 32 directions.
"""

import numpy as np

import workbench as wb

body = wb.load_body("small")
pose, betas, trans = (block.symbol for block in body.blocks())
joints = body.joint_points(pose, betas, trans)
observed = wb.Block("observed", (24, 3), "m")
problem = wb.Problem(
    [wb.residuals.landmarks(joints, observed.symbol, sigma=0.01)], free=["pose"], blocks=[observed]
)
rng = np.random.default_rng(0)
somewhere = body.start() | {
    "pose": 0.3 * rng.standard_normal((24, 3)),
    "observed": np.zeros((24, 3)),
}
diagnosis = wb.diagnose(problem, somewhere)
twists = [d for d in diagnosis.null_directions if d.kind == "twist"]

# a twist in action: no joint moves, the forearm's skin does
twist = next(d for d in twists if d.joints == ("left_elbow", "left_wrist"))
turned = somewhere["pose"] + 1e-3 * twist.vector.reshape(24, 3)
joints_moved = np.abs(body.joints(turned) - body.joints(somewhere["pose"])).max()  # m
skin_moved = np.abs(body.vertices(turned) - body.vertices(somewhere["pose"])).max()  # m

if __name__ == "__main__":
    print(diagnosis)
    print(
        f"a twist of 1 mrad moves the joints {1e3 * joints_moved:.1e} mm, "
        f"the skin {1e3 * skin_moved:.1e} mm"
    )
