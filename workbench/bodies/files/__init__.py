"""Files of bodies: SMPL's and its relatives' in, the workbench's own in and out, glTF out."""
