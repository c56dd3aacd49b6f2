"""Predicting what skinning gets wrong from the pose: the ways, taught the same and compared."""
