"""Rigging: bones, weights, joints, a tree and a body from meshes of one topology in motion.

`rig` decides how many bones there are and where they begin (`decomposition`), finds bones and
weights (`bones`), the points at which pairs of bones meet and the tree of these (`joints`), and
runs training's own blocks on that tree. Blend shapes are left out: free, they would make up for
wrong weights and joints.
"""

from workbench.training.rigging.steps import RigSteps

__all__ = ["RigSteps"]
