"""Ways to predict from the pose what skinning gets wrong, trained on the same data and compared."""
