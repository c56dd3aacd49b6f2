"""SMPL, SCAPE and BlendSCAPE learned from the same synthetic people, and compared."""
