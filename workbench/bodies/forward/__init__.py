"""From pose, betas and trans to points.

In symbols: `kinematics`, `skinning`, `surface`, and `sources`, which residuals get. In numbers:
`named_points` (blocks to arguments), `posed_points`, `motion` (the joints), then `mesh` by NumPy or
`compiled` (with `c_functions`, `mesh.c` and `joint.c`), and `few_points` for joints and landmarks.
`freed` is the surface of a body whose arrays are unknowns, and `posing` many poses of one tree.
"""
