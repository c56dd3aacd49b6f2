"""Which part of a body each vertex belongs to, for errors that are told part by part."""

from workbench.bodies.body import Body
from workbench.bodies.parts import BONES

HANDS = tuple(f"{side}_{part}" for side in ("left", "right") for part in ("hand", "fingers"))


def vertex_parts(body: Body) -> tuple[str, ...]:
    """The name (N,) of each vertex's part: that of the joint which moves it most.

    A joint without a part, such as one of a finger, belongs to that of its parent; what lies below
    a wrist is fingers. Bodies without SMPL's joints, such as a hand, have a part for each joint.
    """
    names: list[str] = []
    for k, joint in enumerate(body.joint_names):
        parent = body.joint_names[body.parents[k]] if k else ""
        below = names[body.parents[k]] if k else ""
        if joint in BONES:
            names.append(BONES[joint])
        elif parent in ("left_wrist", "right_wrist"):
            names.append(parent.replace("wrist", "fingers"))
        else:
            names.append(below if below in BONES.values() else joint)
    return tuple(names[k] for k in body.vertex_weights.argmax(axis=1))
