"""Parts of a pose: free by name, made of pieces, made of principal components; and its graph.

1. The root first, then everything: entries of a block are free by name.
2. A pose that is made of two blocks. The directions that joints do not see have the same names.
3. A pose that is made of coefficients: five numbers in the place of 72.
4. The graph of the problem, for whoever wants to look at it with CasADi.
"""

import casadi as cs
import numpy as np

import workbench as wb

body = wb.load_body("small")
K, rng = body.n_joints, np.random.default_rng(0)
pose, betas, trans = body.blocks()
truth = {
    "pose": rng.normal(scale=0.3, size=(K, 3)),
    "betas": np.zeros(betas.shape),
    "trans": np.array([0.4, 0.1, -0.2]),
}
seen = body.vertices(*truth.values())


def distance(*arguments: cs.MX) -> wb.Residual:
    return wb.residuals.vertices(body.points(*arguments), seen, sigma=0.005)


# 1. Entries. The value of a block is always the whole array.

whole = wb.Problem([distance(pose.symbol, betas.symbol, trans.symbol)], ("trans", "pose"))
root = whole.freeing("trans", "pose[pelvis]")
placed = wb.solve(root, body.start())
stages = wb.Staged((("trans", "pose[pelvis]"), ("trans", "pose[pelvis]", "pose[0:4]")))
staged = wb.solve(whole, body.start(), solver=stages)

# 2. Pieces.

first = wb.Block("root", (1, 3), "rad", body.joint_names[:1])
rest = wb.Block("rest", (K - 1, 3), "rad", body.joint_names[1:])
glued = cs.horzcat(first.symbol, rest.symbol)
joints = body.joint_points(glued, betas.symbol, trans.symbol)
looked_at = wb.Problem(
    [wb.residuals.landmarks(joints, body.joints(*truth.values()), sigma=0.01)],
    ("root", "rest"),
    blocks=(first, rest),
)
diagnosis = wb.diagnose(looked_at, truth | {"root": truth["pose"][:1], "rest": truth["pose"][1:]})
unseen = [direction.name for direction in diagnosis.null_directions]

# 3. Principal components.

mean, components = truth["pose"].T, np.linalg.qr(rng.normal(size=(3 * K, 5)))[0]
coefficients = wb.Block("coefficients", (5,))
made = cs.DM(mean) + cs.reshape(cs.DM(components) @ coefficients.symbol, 3, K)
few = wb.Problem([distance(made, betas.symbol, trans.symbol)], ("coefficients", "trans"))
start = body.start() | {"coefficients": np.full(5, 0.2)}
found = wb.solve(few, start)

# 4. The graph: MX of the blocks' symbols.

graph = whole.graph()
J = cs.jacobian(graph, pose.symbol)
share = J.sparsity().nnz() / J.numel()
function = cs.Function("fit", [pose.symbol, betas.symbol, trans.symbol], [graph, J])

if __name__ == "__main__":
    print([root.free.label(i) for i in range(root.free.size)])
    print(f"cost {placed.cost:.0f} with the root alone, {staged.cost:.1e} at last")
    print(f"rank {diagnosis.rank} of {looked_at.free.size}; {unseen[-1]}")
    print(f"coefficients {np.abs(found.values['coefficients']).max():.1e} from the mean")
    print(f"{J.shape[0]} x {J.shape[1]}, {share:.0%} nonzeros")
