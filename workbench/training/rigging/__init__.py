"""Rigging: bones, weights, joints, a tree and a body from meshes of one topology in motion."""
