"""The weights of the finer rig, 24 joints and 8 half limbs: what the synthetic teacher needs.

They are stored beside the bodies, so that pose blend shapes can be learned from the synthetic
teacher without the wheel.
"""

from dataclasses import replace

from scipy.sparse import csr_array

from workbench.bodies import SkinnedBody
from workbench.bodies.ablations import without_pose_blend_shapes
from workbench.errors import BadFile
from workbench.reading.arrays import check_numbers, read_expected, shipped, wholes
from workbench.synthetic.rig import N_FINE, at_most_four, coarse
from workbench.synthetic.skeleton import N_JOINTS, PARENTS
from workbench.synthetic.teacher import Teacher

FILE_NAME = "fine_weights.npz"
BODIES = ("default", "small")
SHARES = 2**15  # weights are stored as whole multiples of 1 / SHARES


def teacher_of(body: SkinnedBody) -> Teacher:
    """The synthetic teacher of an embedded body's mean person.

    Raises BadFile for a body whose fine weights are not shipped.
    """
    if body.name not in BODIES or body.parents != PARENTS or body.n_joints != N_JOINTS:
        raise BadFile(
            f"there is no teacher for body {body.name!r}; there is one for {' and '.join(BODIES)}, "
            "as load_body gives them"
        )
    parts, N = [f"{body.name}_{part}" for part in ("shares", "rows", "columns")], body.n_vertices
    with shipped(f"bodies/{FILE_NAME}", "file of fine weights") as archive:
        arrays = read_expected(archive, dict.fromkeys(parts, wholes("entries")))
        shares, rows, columns = (arrays[part] for part in parts)
        check_numbers(parts[1], rows, N)
        check_numbers(parts[2], columns, N_FINE)
    weights = csr_array((shares / SHARES, (rows, columns)), shape=(N, N_FINE))
    return Teacher(body.template, body.J_regressor @ body.template, weights)


def body_on_teachers_rig(body: SkinnedBody) -> SkinnedBody:
    """An embedded body with the teacher's weights, half limbs merged, and no pose blend shapes.

    A trained body's own weights depend on its blend shapes, and its poses are not the teacher's.
    Raises BadFile as `teacher_of` does.
    """
    weights = coarse(teacher_of(body).weights.toarray())
    assert body.mirror is not None  # embedded bodies are alike on both sides
    carried = replace(body, weights=at_most_four(weights, body.mirror))
    return without_pose_blend_shapes(carried)
