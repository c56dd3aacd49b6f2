"""Rotations, rigid motions, cameras and mesh files: geometry that knows no body."""
