"""Bodies whose triangles deform one by one and are then stitched: SCAPE and BlendSCAPE."""

from workbench.bodies.triangles.body import TriangleBody, blend_scape, scape

__all__ = ["TriangleBody", "blend_scape", "scape"]
