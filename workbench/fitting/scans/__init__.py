"""Scans of people: unlabelled points, read from files, cleaned, with normals and areas."""
