"""Fits of the embedded hand to points, skeletons and scans, against the truth."""
