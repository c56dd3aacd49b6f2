"""From registrations to bodies: the data, the blocks, the plan and the evaluation.

Training is fitting with other names free: besides the poses of all registrations, the arrays of the
body. `symbolic` writes every term of the `Objective` as residuals, for the diagnosis. For thousands
of vertices the Jacobian of that problem cannot be stored: every pose shares rows with all numbers
of every vertex. `SkinningPass` therefore evaluates skinning with its tangent and adjoint, and
`NormalEquations` multiplies by J'J in one pass over the registrations, of which only a few are in
memory. Terms and lambdas are those of the lectures Body Models II (Pons-Moll and Swoboda, 2018),
written as `Sigmas` with units.

Who follows `workbench train FOLDER` reads, in this order: `folder` (what is read, and refused),
`first_guess` (template, tree and segments; first joints and poses), `training`, `pose_training`
(the plan is run, with `checkpoint`), `blocks` (what each does, and the plans), `objective` (the
cost), `estimate` (the unknowns, and how they pose a mesh), `normal_equations`, `shares` and `poses`
(three ways in which a block solves), `shape_training`, `evaluation`.
"""
