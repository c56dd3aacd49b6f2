"""A triangle body from the entries of its file.

    bs_style        "triangles", which says the kind of body; that of SMPL's files is "lbs"
    v_template      (N, 3) m
    f               (F, 3)
    shapedirs       (F, 3, 3, B)
    posedirs        (F, 3, 3, 3 J)
    near            (F, J)
    weights         (F, K), sparse: weights/data, weights/indices, weights/indptr, weights/shape
    J_regressor     (K, N), likewise

and kintree_table, joint_names, name, card and landmarks as in the files of skinned bodies. Other
arrays of numbers or texts are the body's `extras`.
"""

from typing import NoReturn

from workbench.bodies.files.entries import Contents, Entries
from workbench.bodies.files.extras import OF_TRIANGLES, TRIANGLES, sorted_out
from workbench.bodies.files.smpl_layout import landmarks_from, own_card, parents_from
from workbench.bodies.readonly import locked
from workbench.bodies.triangles.body import TriangleBody
from workbench.bodies.validation import check_shapes
from workbench.errors import BadFile, some

STYLE = "triangles"


def is_triangle_body(raw: Contents) -> bool:
    """Whether the entries say that they are those of a triangle body."""
    return Entries(raw, "").text("bs_style", "") == STYLE


def triangle_body_from(raw: Contents, name: str, where: str) -> TriangleBody:
    """The body whose entries are `raw`; `where` is the file, for messages.

    Raises BadFile for entries that are missing or are not what their key says, BadBody if they do
    not fit together.
    """
    entries = Entries(raw, where)
    have = {key.partition("/")[0] for key in raw}
    if missing := [key for key in OF_TRIANGLES if key not in have]:
        raise BadFile(
            f"{where} has no {', '.join(missing)}; it has {some(sorted(have))}. The file of a "
            f"triangle body has {', '.join(OF_TRIANGLES)}"
        )
    parents = parents_from(entries)
    _check_shapes(entries)
    extras, left_out = sorted_out(raw, TRIANGLES)
    return TriangleBody(
        template=locked(entries.reals("v_template")),
        faces=entries.wholes("f"),
        shapedirs=locked(entries.reals("shapedirs")),
        posedirs=locked(entries.reals("posedirs")),
        near=entries.wholes("near"),
        weights=entries.matrix("weights"),
        J_regressor=entries.matrix("J_regressor"),
        parents=parents,
        joint_names=entries.texts("joint_names"),
        landmarks=landmarks_from(entries),
        name=entries.name("name", name),
        card=own_card(entries, left_out),
        extras=extras,
    )


def _check_shapes(entries: Entries) -> None:
    """Raise BadFile for shapes that do not fit together, before anything becomes float64."""

    def refuse(reason: str) -> NoReturn:
        raise BadFile(f"{entries.where}: {reason}")

    F = (*entries.array("f").shape, 0)[0]
    J = (*entries.array("near").shape, 0, 0)[1]
    expected: dict[str, tuple[int | str, ...]] = {
        "v_template": ("N", 3),
        "f": ("F", 3),
        "near": (F, "J"),
        "shapedirs": (F, 3, 3, "B"),
        "posedirs": (F, 3, 3, 3 * J),
    }
    check_shapes(refuse, {key: (entries.array(key), sizes) for key, sizes in expected.items()})
