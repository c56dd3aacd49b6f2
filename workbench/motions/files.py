"""Reading a motion from whatever file holds one."""

from pathlib import Path

from workbench.bodies.body import Body
from workbench.errors import BadArgument, BadFile
from workbench.motions.bvh import read_bvh
from workbench.motions.gltf import read_glb
from workbench.motions.motion import Motion
from workbench.motions.smpl_files import read_amass

ARRAYS = (".npz", ".npy", ".pkl", ".pickle", ".joblib", ".pt", ".pth", ".json", ".smpl")
SUFFIXES = (".bvh", ".glb", ".gltf", *ARRAYS)


def read_motion(
    path: str | Path,
    *,
    unit: str | None = None,
    up: str | None = None,
    fps: float | None = None,
    body: Body | None = None,
    person: str | None = None,
    animation: str | None = None,
) -> Motion:
    """Read a motion: of SMPL or a relative, as AMASS and estimators write it; .bvh, .glb, .gltf.

    `unit` (m, cm, mm, in, cmu) and `up`, an axis such as z, are guessed and said in the motion's
    `notes` if they are not given; `fps` takes the place of the file's rate. For files of arrays
    (.npz, .npy, .pkl, .pt, .json, .smpl, or a folder of them) `body` is the one for which a file
    was made, and `person` one of several: see `read_amass`. `animation` is one of several
    in a .glb or .gltf, by name or number (`read_glb`). Raises BadFile for what is no such file.
    """
    suffix = Path(path).suffix.lower()
    if animation is not None and suffix not in (".glb", ".gltf"):
        raise BadArgument(f"an animation is one of a .glb or .gltf, and {path} is neither")
    if suffix == ".bvh":
        return read_bvh(path, unit=unit, up=up, fps=fps)
    if suffix in (".glb", ".gltf"):
        return read_glb(path, unit=unit, up=up, fps=fps, animation=animation)
    if suffix in ARRAYS or Path(path).is_dir():
        return read_amass(path, unit=unit, up=up, fps=fps, body=body, person=person)
    raise BadFile(
        f"the name of {path} does not say what it holds; a motion is a file that ends in "
        f"{', '.join(SUFFIXES)}"
    )
