"""Small files of motions and of markers, made by other means than those that the workbench writes.

The BVH and the C3D are put together here, byte by byte, from what their descriptions say.
"""

import struct
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from tests.motions.made_glb import made, write_text
from workbench import load_body
from workbench.arrays import Array
from workbench.bodies.files.joint_names import BODY, HANDS
from workbench.geometry.guesses import UP_TO_Y
from workbench.motions import Motion, save_motion

RNG = np.random.default_rng(7)
T = 6
LABELS = ("LFHD", "RFHD", "C7", "STRN", "LANK", "RANK", "LHEE", "RHEE")

# Two legs and an arm, channels in several orders, a root that rests elsewhere than at the origin.
HIERARCHY = """HIERARCHY
ROOT Hips
{
	OFFSET 1.0 2.0 3.0
	CHANNELS 6 Xposition Yposition Zposition Zrotation Yrotation Xrotation
	JOINT Left Leg
	{
		OFFSET 10.0 -5.0 0.0
		CHANNELS 3 Xrotation Yrotation Zrotation
		JOINT LeftFoot
		{
			OFFSET 0.0 -85.0 1.0
			CHANNELS 3 Yrotation Zrotation Xrotation
			End Site
			{
				OFFSET 0.0 0.0 12.5
			}
		}
	}
	JOINT Chest {
		OFFSET 0.0 55.0 0.0
		CHANNELS 2 Zrotation Xrotation
		End Site
		{
			OFFSET 0.0 30.0 0.0
		}
	}
}
MOTION
"""


def bvh_text(rows: Array, time: str = "0.0333333") -> str:
    """The hierarchy above with these numbers (T, 14)."""
    lines = [" ".join(f"{x:.6f}" for x in row) for row in rows]
    return f"{HIERARCHY}Frames: {len(rows)}\nFrame Time: {time}\n" + "\n".join(lines) + "\n"


def bvh_rows() -> Array:
    """Numbers (T, 14) of a person who stands at about 0.9 m and turns every joint."""
    rows = np.random.default_rng(8).uniform(-60, 60, (T, 14))
    rows[:, :3] = np.random.default_rng(9).uniform(-5, 5, (T, 3)) + [0, 90, 0]
    return rows


# A root that stands still and hips that move below it, a prop, scales, comments, decimal commas.
ODD = """﻿HIERARCHY  # exported
ROOT Prop
{
	OFFSET 5,0 0,0 0,0
	CHANNELS 0
	End Site
	{
		OFFSET 0,0 9,5 0,0
	}
}
ROOT Reference
{
	OFFSET 0,0 0,0 4,0
	CHANNELS 6 Xposition Yposition Zposition Zrotation Yrotation Xrotation
""" + HIERARCHY[HIERARCHY.index("ROOT Hips") :].replace("ROOT", "JOINT").replace(
    "1.0 2.0 3.0", "0.0 0.0 0.0"
).replace(".", ",").replace("MOTION", "}\nMOTION // numbers").replace(
    "CHANNELS 2 Zrotation", "CHANNELS 3 Yscale Zrotation"
)
REFERENCE = (10.0, -3.0, 20.0, 5.0, 30.0, -7.0)  # its six channels, in cm and degrees


def odd_text() -> str:
    """The file `ODD` with the rows of `bvh_rows`, below a reference that is turned; one too few."""
    rows = bvh_rows()
    scaled = np.column_stack([np.tile(REFERENCE, (T, 1)), rows[:, :-2], np.ones(T), rows[:, -2:]])
    lines = [" ".join(f"{x:.6f}" for x in row).replace(".", ",") for row in scaled]
    return f"{ODD}Frames: {T + 1}\nFrame Time: 0,0333333\n" + "\n".join(lines) + "\n"


def _bvh(path: Path) -> None:
    path.write_text(bvh_text(bvh_rows()))


def _odd(path: Path) -> None:
    path.write_text(odd_text(), encoding="utf-8")


def random_motion(K: int, names: Sequence[str], frames: int = T) -> Motion:
    """A motion of small turns about an upright root."""
    rng = np.random.default_rng(10)
    pose = rng.normal(0, 0.3, (frames, K, 3))
    return Motion(pose, rng.normal(0, 1, (frames, 3)), 60.0, tuple(names), rng.normal(0, 1, 10))


def amass_entries(motion: Motion) -> dict[str, np.ndarray]:
    """The older layout, z up, with entries that are not read."""
    there = motion.turned(UP_TO_Y["z"].T)
    return {
        "poses": there.pose.reshape(len(there), -1),
        "trans": there.trans,
        "betas": np.concatenate([motion.betas, np.zeros(6)]),
        "mocap_framerate": np.array(motion.fps),
        "gender": np.array("female"),
        "dmpls": np.zeros((len(there), 8)),
    }


def newer_entries(motion: Motion) -> dict[str, np.ndarray]:
    """The newer layout of SMPL-X, z up: parts beside the whole."""
    old = amass_entries(motion)
    flat = old["poses"]
    return {
        "surface_model_type": np.array("smplx"),
        "mocap_frame_rate": np.array(motion.fps),
        "gender": np.array(b"neutral"),
        "num_betas": np.array(16),
        "poses": flat,
        "root_orient": flat[:, :3],
        "pose_body": flat[:, 3:66],
        "pose_jaw": flat[:, 66:69],
        "pose_eye": flat[:, 69:75],
        "pose_hand": flat[:, 75:],
        "trans": old["trans"],
        "betas": old["betas"],
    }


def _amass(path: Path) -> None:
    np.savez(path, **amass_entries(random_motion(52, (*BODY, *HANDS))))


def _newer(path: Path) -> None:
    names = (*BODY, "jaw", "left_eye", "right_eye", *HANDS)
    np.savez(path, **newer_entries(random_motion(55, names)))


def _own(path: Path) -> None:
    body = load_body("small")
    save_motion(path, random_motion(body.n_joints, body.joint_names))


def marker_places() -> Array:
    """Places (T, 8, 3) mm, z up, of markers as high as a person; one of them is never seen once."""
    heights = np.repeat([1700.0, 1500.0, 100.0, 50.0], 2)
    across = np.random.default_rng(11).uniform(-200, 200, (len(LABELS), 2))
    places = np.column_stack([across, heights]) + np.random.default_rng(12).normal(0, 20, (T, 8, 3))
    places[2, 3] = np.nan
    return places


def c3d_bytes(
    places: Array,
    labels: Sequence[str],
    *,
    kind: str = "<",
    scale: float = -1.0,
    analog: int = 0,
    channels: int = 0,
    rate: float = 100.0,
) -> bytes:
    """A C3D of places (T, M, 3) in mm at 100 frames a second: floats, or whole numbers times scale.

    `kind` is `<` for Intel, `>` for MIPS, and `dec`, whose floats are those of a VAX. With
    `channels`, the `analog` measurements of a frame are samples of these in an ANALOG group. `rate`
    is what the header says.
    """
    order, (frames, M, _) = ">" if kind == ">" else "<", places.shape

    def word(x: int) -> bytes:
        return struct.pack(order + "H", x % 65536)

    def real(x: float) -> bytes:
        if kind != "dec":
            return struct.pack(order + "f", x)
        raw = struct.pack("<f", 4 * x)
        return raw[2:] + raw[:2]

    def group(name: str, number: int) -> bytes:
        return struct.pack("bb", len(name), -number) + name.encode() + word(3) + b"\0"

    def parameter(
        name: str, type_: int, dims: Sequence[int], data: bytes, number: int = 1
    ) -> bytes:
        rest = struct.pack("bB", type_, len(dims)) + bytes(dims) + data + b"\0"
        return struct.pack("bb", len(name), number) + name.encode() + word(len(rest) + 2) + rest

    wide = max(map(len, labels))
    text = "".join(label.ljust(wide) for label in labels).encode()
    body = group("POINT", 1)
    body += parameter("USED", 2, (), word(M)) + parameter("FRAMES", 2, (), word(frames))
    body += parameter("SCALE", 4, (), real(scale)) + parameter("RATE", 4, (), real(100.0))
    body += parameter("UNITS", -1, (4,), b"mm  ")
    start = len(body) + len(parameter("DATA_START", 2, (), b"")) - 1
    body += parameter("DATA_START", 2, (), word(0))
    body += parameter("LABELS", -1, (wide, len(labels)), text)
    if channels:
        body += group("ANALOG", 2) + parameter("USED", 2, (), word(channels), 2)
        body += parameter("RATE", 4, (), real(100.0 * analog / channels), 2)
        body += parameter("GEN_SCALE", 4, (), real(1.0), 2)
        body += parameter("SCALE", 4, (channels,), real(1.0) * channels, 2)
        body += parameter("OFFSET", 2, (channels,), word(0) * channels, 2)
        names = "".join(f"Fz{k}" for k in range(channels)).encode()
        body += parameter("LABELS", -1, (3, channels), names, 2)
        body += parameter("UNITS", -1, (1, channels), b"N" * channels, 2)
        body += parameter("FORMAT", -1, (6,), b"SIGNED", 2)
    body += b"\0\0"
    blocks = -(-(len(body) + 4) // 512)
    body = body[:start] + word(2 + blocks) + body[start + 2 :]
    number = {"<": 84, "dec": 85, ">": 86}[kind]
    parameters = (bytes((1, 80, blocks, number)) + body).ljust(512 * blocks, b"\0")
    head = bytes((2, 80)) + word(M) + word(analog) + word(1) + word(frames) + word(10) + real(scale)
    head += word(2 + blocks) + word(analog // channels if channels else analog) + real(rate)
    data = b""
    for t, frame in enumerate(places):
        for place in frame:
            lost = not np.isfinite(place).all()
            numbers = [0.0, 0.0, 0.0, -1.0] if lost else [*place, 0.0]
            if scale < 0:
                data += b"".join(real(x) for x in numbers)
            else:
                data += b"".join(word(round(x / scale)) for x in numbers[:3]) + word(
                    int(numbers[3])
                )
        data += b"".join(real(t + a / 2) if scale < 0 else word(t - a) for a in range(analog))
    return head.ljust(512, b"\0") + parameters + data.ljust(-(-len(data) // 512) * 512, b"\0")


def _c3d(scale: float, kind: str, channels: int = 0) -> Callable[[Path], None]:
    def write(path: Path) -> None:
        told = {"kind": kind, "scale": scale, "analog": 2, "channels": channels}
        content = c3d_bytes(marker_places(), LABELS, **told)  # type: ignore[arg-type]
        path.write_bytes(content)

    return write


def trc_text(places: Array, labels: Sequence[str]) -> str:
    """A .trc in mm at 100 frames a second, with empty cells where a marker was not seen."""
    rows = []
    for t, frame in enumerate(places):
        cells = ["" if np.isnan(x) else f"{x:.5f}" for x in frame.ravel()]
        rows.append("\t".join([str(t + 1), f"{t / 100:.3f}", *cells]))
    axes = "\t".join(f"X{m}\tY{m}\tZ{m}" for m in range(1, len(labels) + 1))
    return "\n".join(
        [
            "PathFileType\t4\t(X/Y/Z)\twalk.trc",
            "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate",
            f"100.00\t100.00\t{len(places)}\t{len(labels)}\tmm\t100.00",
            "Frame#\tTime\t" + "\t\t\t".join(labels) + "\t\t",
            f"\t\t{axes}",
            "",
            *rows,
            "",
        ]
    )


def _trc(path: Path) -> None:
    path.write_text(trc_text(marker_places(), LABELS))


def _arrays(path: Path) -> None:
    np.savez(path, markers=marker_places(), labels=np.array(LABELS), fps=np.array(100.0))


def _glb(path: Path) -> None:
    path.write_bytes(made())


MOTION_FILES: dict[str, Callable[[Path], None]] = {
    "walk.bvh": _bvh,
    "odd.bvh": _odd,
    "amass.npz": _amass,
    "newer-amass.npz": _newer,
    "motion.npz": _own,
    "walk.glb": _glb,
    "walk.gltf": write_text,
}
MARKER_FILES: dict[str, Callable[[Path], None]] = {
    "floats.c3d": _c3d(-1.0, "<"),
    "integers.c3d": _c3d(0.1, ">"),
    "vax.c3d": _c3d(-1.0, "dec"),
    "analog.c3d": _c3d(-1.0, "<", 2),
    "walk.trc": _trc,
    "markers.npz": _arrays,
}
