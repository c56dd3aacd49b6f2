"""Rigging: bones, weights, joints, a tree and a body from meshes of one topology in motion.

`bones` is smooth skinning decomposition with rigid bones (Le and Deng, 2012): weights and bones in
turn. `decomposition` decides how many there are and where they begin. Alternation creeps where
bones share much of a surface, so that `joint_steps` takes steps in both at once. For every pair of
bones `joints` finds the point that both move most nearly to the same place; the tree is the
spanning tree of the smallest sum of gaps. `rig` runs training's own blocks on that tree.
Blend shapes are left out: free, they would make up for wrong weights and joints. If the error is
more than twice `least_rms`, the least that any skeleton of so many bones can reach, a note says so.
"""

from workbench.training.rigging.steps import RigSteps

__all__ = ["RigSteps"]
