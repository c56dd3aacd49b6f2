"""Reading the bodies with hands, which are sewn together from embedded bodies and hands."""

from importlib.resources import as_file, files

from workbench.bodies.files.embedded import REPAIR, embedded, embedded_hand
from workbench.bodies.sewn_hands import with_hands
from workbench.bodies.sewn_mesh import Sewing
from workbench.bodies.skinned import SkinnedBody
from workbench.reading.archive import opened
from workbench.reading.expected import check_numbers, read_expected, reals, texts, wholes

EXPECTED = {"bodies": texts("G"), "vertices": wholes("H"), "held": reals("G", 16, 3)}
SEWN = {"full-hands": "full", "full-hands-female": "full-female", "full-hands-male": "full-male"}


def embedded_with_hands(name: str) -> SkinnedBody:
    """One of the bodies in `SEWN`, sewn together when it is asked for.

    Its own file says only where the hand is on the body, and how the body holds its fingers.
    Raises BadFile if a file is missing or is not one, BadBody if they do not fit together.
    """
    body, hand = embedded(SEWN[name]), embedded_hand()
    with (
        as_file(files("workbench") / "data" / "bodies" / "full-hands.npz") as packed,
        opened(packed, "file of a hand's place", REPAIR) as archive,
    ):
        arrays = read_expected(archive, EXPECTED)
    check_numbers("vertices", arrays["vertices"], body.n_vertices)
    held = arrays["held"][arrays["bodies"].tolist().index(body.name)]
    return with_hands(body, hand, Sewing(arrays["vertices"], held), name)
