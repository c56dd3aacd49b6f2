"""Shapes that lectures and examples teach with: tubes, limbs, and bodies in pieces."""
