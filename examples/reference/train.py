"""train, Trained, Registrations, InMemory, Batch, Start, Plan, Stage, BlockOptions, Sigmas: a body
learned from meshes of people in poses.
"""

import workbench as wb
from workbench.synthetic.made_up import draw_registrations, jointed_tube, random_smpl

start: wb.Start = jointed_tube(7, 5)  # a template, its tree, and the joint that carries each vertex
true = random_smpl(start, 2, seed=3)
drawn, _ = draw_registrations(true, subjects=4, poses_each=8, seed=0)
registrations: wb.Registrations = wb.InMemory(drawn.vertices, drawn.subject)
batch: wb.Batch = registrations.read(slice(0, 3))
print(batch.vertices.shape, "metres, of the subjects", batch.subject)
sigmas = wb.Sigmas(data=0.002, weights=0.5)  # what each term expects, as standard deviations
options = wb.BlockOptions(linear_tolerance=1e-4)  # when a block may stop
plan = wb.Plan((wb.Stage(sigmas, ("rest", "surfaces", "poses"), rounds=3, options=options),))
trained: wb.Trained = wb.train(registrations, start, plan=plan, n_betas=1)
body = trained.body
print(body.n_vertices, "vertices,", len(body.joint_names), "joints,", body.n_betas, "betas")
