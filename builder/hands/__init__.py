"""The embedded hands: another rig, cut from the same base mesh and trained in the same way."""
