"""train, Trained, Registrations, InMemory, Start: a body learned from meshes of people in poses."""

import workbench as wb
from workbench.synthetic.made_up import draw_registrations, random_smpl, worm

start: wb.Start = worm(7, 5)  # a template, its tree, and the joint that carries each vertex
true = random_smpl(start, 2, seed=3)
drawn, _ = draw_registrations(true, subjects=4, poses_each=8, seed=0)
registrations: wb.Registrations = wb.InMemory(drawn.vertices, drawn.subject)
trained: wb.Trained = wb.train(registrations, start, n_betas=1)
body = trained.body
print(body.n_vertices, "vertices,", len(body.joint_names), "joints,", body.n_betas, "betas")
