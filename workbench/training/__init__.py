"""From registrations to bodies: the data, the blocks, the plan and the evaluation.

Training is fitting with other names free: besides the poses of all registrations, the arrays of the
body. `symbolic` writes every term of the `Objective` as residuals, for the diagnosis and for
tests, which hold that both agree. For thousands of vertices the Jacobian of that problem cannot be
stored: every pose shares rows with all numbers of every vertex. `SkinningPass` therefore evaluates
skinning in the form in which everything but rotations is linear, with tangent and adjoint, and
`NormalEquations` multiplies by J'J in one pass over the registrations, of which only a few are in
memory. Terms and lambdas are those of the lectures Body Models II (Pons-Moll and Swoboda, 2018),
written as `Sigmas` with units; E_T, which keeps templates near the first, is ours: without it each
subject would get another zero pose.

A `Plan` runs blocks in turn (`BLOCKS`). When one ends, the cost must not have risen and the result
is stored, so that a killed run ends with the same body. Blend shapes are added when poses are
nearly right, because those learned from wrong poses keep the poses wrong, and those of a vertex
follow only the joints near it (`blend_shapes`). Large meshes begin with some of their vertices
(`subsampling`). The translation of a registration is always at its optimum and no unknown, so that
the data do not determine the root joint; its row of the regressor is that of the first guess.

Who follows `workbench train FOLDER` reads, in this order: `folder` (what is read, and refused),
`first_guess` (template, tree and segments; first joints and poses), `training`, `pose_training`
(the plan is run, with `checkpoint`), `blocks` (what each does, and the plans), `objective` (the
cost), `estimate` (the unknowns, and how they pose a mesh), `normal_equations`, `shares` and `poses`
(three ways in which a block solves), `shape_training`, `evaluation`.
"""
