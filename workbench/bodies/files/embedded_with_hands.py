"""Reading the bodies with hands, which are sewn together from embedded bodies and hands."""

from importlib.resources import as_file, files

from workbench.bodies.files.embedded import REPAIR, embedded, embedded_hand
from workbench.bodies.sewn_hands import with_hands
from workbench.bodies.sewn_mesh import Sewing
from workbench.bodies.skinned import SkinnedBody
from workbench.errors import BadFile
from workbench.reading.arrays import opened, read_expected, reals, texts, wholes

EXPECTED = {"bodies": texts("G"), "vertices": wholes("H"), "held": reals("G", 16, 3)}
SEWN = {"full-hands": "full", "full-hands-female": "full-female", "full-hands-male": "full-male"}


def embedded_with_hands(name: str) -> SkinnedBody:
    """One of the bodies in `SEWN`, sewn together when it is asked for.

    Its own file says only where the hand is on the body, and how the body holds its fingers.
    Raises BadFile if a file is missing or is not one, BadBody if they do not fit together.
    """
    body = embedded(SEWN[name])
    return with_hands(body, embedded_hand(), sewing_of(body.name), name)


def sewing_of(body: str) -> Sewing:
    """Where the hand is on one of the bodies that `SEWN` names. Raises BadFile."""
    with (
        as_file(files("workbench") / "data" / "bodies" / "full-hands.npz") as packed,
        opened(packed, "file of a hand's place", REPAIR) as archive,
    ):
        arrays = read_expected(archive, EXPECTED)
    names = [str(name) for name in arrays["bodies"]]
    if body not in names:
        raise BadFile(f"full-hands.npz does not say how {body!r} holds its fingers; {REPAIR}")
    return Sewing(arrays["vertices"], arrays["held"][names.index(body)])
