"""read_motion: a motion from a file, .npz as of AMASS or .bvh, with what was guessed."""

from pathlib import Path
from tempfile import TemporaryDirectory

import workbench as wb

BVH = """HIERARCHY
ROOT hips
{
  OFFSET 0 0 0
  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
  JOINT chest
  {
    OFFSET 0 50 0
    CHANNELS 3 Zrotation Xrotation Yrotation
    End Site
    {
      OFFSET 0 40 0
    }
  }
}
MOTION
Frames: 2
Frame Time: 0.04
0 90 0 0 0 0 0 0 0
0 90 1 0 10 0 0 20 0
"""
with TemporaryDirectory() as folder:
    file = Path(folder) / "nod.bvh"
    file.write_text(BVH)
    motion = wb.read_motion(file)
print(motion.fps, motion.joint_names, motion.joints().round(3).tolist())
print(*motion.notes, sep="\n")
