"""Joints or landmarks of a body as C code that depends on nothing but the C library.

CasADi writes the code of the symbolic function (Andersson et al., CasADi: a software framework for
nonlinear optimization and optimal control, 2019). What is added here is a header for people.
"""

import re
import tempfile
from collections.abc import Sequence
from pathlib import Path
from textwrap import wrap

import casadi as cs

from workbench.bodies.body import Body
from workbench.errors import BadArgument, UnknownName
from workbench.writing import replacing

JOINTS = "joints"
MOST_INSTRUCTIONS = 300_000  # instructions: a compiler takes minutes from there on
LINE_WIDTH = 90  # characters of a line of names


def write_c(path: str | Path, body: Body, points: str = JOINTS) -> None:
    """Write the function of a body's joints, or of one of its landmark sets, as NAME.c and NAME.h.

    The function is called as the set is, and takes pose (K, 3) rad, betas (B,) and trans (3,) m, in
    the order of NumPy's arrays, to points (M, 3) m. The header says the order of its arguments,
    their units, and the names of joints and points. Both files are written, or none.

    Raises BadArgument for a path that does not end in .c, and for functions of more than 300,000
    instructions; UnknownName for a landmark set that the body does not have.
    """
    path = Path(path)
    if path.suffix != ".c":
        raise BadArgument(f"C code goes into a file that ends in .c, not {path}")
    if points != JOINTS and points not in body.landmarks:
        raise UnknownName("landmark set", points, (JOINTS, *body.landmarks))
    blocks = body.blocks()
    symbols = [block.symbol for block in blocks]
    name = re.sub(r"\W", "_", points)
    name = name if name[:1].isalpha() else f"points_{name}"
    inputs, outputs = ["pose", "betas", "trans"], ["points"]
    expression = cs.densify(body.landmark_points(points, *symbols).source.expression)
    function = cs.Function(name, symbols, [expression], inputs, outputs).expand()
    if function.n_instructions() > MOST_INSTRUCTIONS:
        raise BadArgument(
            f"{points!r} of body {body.name!r} take {function.n_instructions():,} instructions, "
            f"and C code is written of {MOST_INSTRUCTIONS:,} at most; give fewer landmarks"
        )
    about = _about(body, points, name, body.landmark_names(points))
    with tempfile.TemporaryDirectory() as folder:
        code = cs.CodeGenerator(f"{path.stem}.c", {"with_header": True})
        code.add(function)
        code.generate(f"{folder}/")
        texts = {
            suffix: about + (Path(folder) / f"{path.stem}{suffix}").read_text()
            for suffix in (".c", ".h")
        }
    with replacing(path) as source, replacing(path.with_suffix(".h")) as header:
        source.write_text(texts[".c"])
        header.write_text(texts[".h"])


def _about(body: Body, points: str, name: str, labels: Sequence[str]) -> str:
    """The comment at the top of both files."""
    K, B, M = body.n_joints, body.n_betas, len(labels)
    lines = [
        f"The {points} of body {_plain(body.name)} at a pose, written by workbench with CasADi.",
        "",
        f"int {name}(const double** arg, double** res, long long* iw, double* w, int mem);",
        "",
        f"  arg[0]  pose, {K} x 3, rad: the rotation vector of each joint relative to its parent",
        f"  arg[1]  betas, {B}, standard deviations of shape",
        "  arg[2]  trans, 3, m",
        f"  res[0]  the points, {M} x 3, m; y points up, and the body faces +z",
        "",
        "Arrays are stored row after row. An argument that is a null pointer is zero. iw and w are",
        f"scratch memory of the lengths that {name}_work tells; mem is 0. It returns 0.",
        "",
        "Joints of the pose, in order:",
        *_wrapped(body.joint_names),
        "Points, in order:",
        *_wrapped(labels),
    ]
    return "/*\n" + "".join(f" * {line}".rstrip() + "\n" for line in lines) + " */\n"


def _plain(text: str) -> str:
    """Text that cannot end a comment."""
    return re.sub(r"[^\w .-]", "_", text)


def _wrapped(names: Sequence[str]) -> list[str]:
    text = ", ".join(map(_plain, names))
    return wrap(text, LINE_WIDTH, initial_indent="  ", subsequent_indent="  ")
