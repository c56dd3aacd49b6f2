"""Scans against surfaces: contacts that are chosen anew, and the same contacts held."""

from collections.abc import Callable

import casadi as cs
import numpy as np
import pytest

import workbench as wb
from tests.differences import assert_jacobian
from tests.tiers import THOROUGH, few
from workbench import Block, Problem, Residual, residuals
from workbench.errors import BadMesh, BadResidual, NotNumbers, NotSupported
from workbench.problem import storage
from workbench.residuals import geman_mcclure, of_norms, quadratic, scaled
from workbench.residuals.contacts import Form, distance, loose, offset
from workbench.residuals.scans import Shadow

FORMS: dict[str, Form] = {
    "distance": distance,
    "offset": offset,
    "loose": loose(0.3),
}
EACH_FORM = pytest.mark.parametrize(
    "form", few([pytest.param(form, id=name) for name, form in FORMS.items()], 2)
)
TETRAHEDRON = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=float)
FACES = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])  # normals point outwards
CORNERS = Block("corners", (4, 3), "m")
OUTSIDE = np.array([[0.2, 0.3, -0.1], [-0.2, 0.3, 0.3], [0.6, 0.5, 0.4], [0.5, -0.1, -0.1]])
DISTANCES = np.array([0.1, 0.2, 0.5 / np.sqrt(3), 0.1 * np.sqrt(2)])  # faces, and an edge


def body_and_scan(seed: int = 0) -> tuple[wb.SkinnedBody, np.ndarray, dict[str, np.ndarray]]:
    """A small body, points near the surface of one person, and values a little off."""
    rng, body = np.random.default_rng(seed), wb.load_body("small")
    truth = {
        "pose": rng.normal(scale=0.1, size=(24, 3)),
        "betas": rng.normal(size=10),
        "trans": np.array([0.1, 0.9, 0.2]),
    }
    face, share = rng.integers(len(body.faces), size=60), rng.dirichlet([1, 1, 1], 60)
    surface = body.vertices(*truth.values())
    scan = np.einsum("mk,mkc->mc", share, surface[body.faces[face]])
    scan += rng.normal(scale=0.02, size=scan.shape)
    off = {name: value + 0.01 * rng.normal(size=value.shape) for name, value in truth.items()}
    return body, scan, off


def of_body(body: wb.SkinnedBody, scan: np.ndarray, **options: object) -> Residual:
    points = body.points(*(block.symbol for block in body.blocks()))
    return residuals.scan_to_model(points, body.faces, scan, sigma=0.01, **options)


def test_distances_of_a_solid_are_known() -> None:
    for form, expected in (
        (distance, DISTANCES),
        (loose(0.25), 0.25 * DISTANCES),
    ):
        r = residuals.scan_to_model(CORNERS.symbol, FACES, OUTSIDE, sigma=0.1, form=form)
        here = Problem([r], "corners").linearize({"corners": TETRAHEDRON}).residual
        np.testing.assert_allclose(here, expected / 0.1, rtol=1e-12)
    within = np.array([[0.1, 0.2, 0.3]])  # behind the surface: signed, and not loosened
    for form in (distance, loose(0.25)):
        r = residuals.scan_to_model(CORNERS.symbol, FACES, within, sigma=1.0, form=form)
        here = Problem([r], "corners").linearize({"corners": TETRAHEDRON}).residual
        np.testing.assert_allclose(here, [-0.1], rtol=1e-12)


def test_offset_points_to_the_scan() -> None:
    r = residuals.scan_to_model(CORNERS.symbol, FACES, OUTSIDE, sigma=1.0, form=offset)
    here = Problem([r], "corners").linearize({"corners": TETRAHEDRON}).residual.reshape(-1, 3)
    np.testing.assert_allclose(np.linalg.norm(here, axis=1), DISTANCES, rtol=1e-12)
    np.testing.assert_allclose(here[0], [0, 0, -0.1], atol=1e-15)


@pytest.mark.parametrize(
    "form",
    [distance, offset, pytest.param(loose(0.3), marks=THOROUGH)],
    ids=["distance", "offset", "loose"],
)
@pytest.mark.parametrize(
    "robust", [pytest.param(False, marks=THOROUGH), True], ids=["quadratic", "robust"]
)
def test_gradient_matches_differences_with_contacts_chosen_anew(form: Form, robust: bool) -> None:
    """Contacts are chosen anew in each of the costs whose differences are taken."""
    body, scan, values = body_and_scan()
    kernel = scaled(geman_mcclure, 3.0) if robust else quadratic
    if form.numbers > 1:
        kernel = of_norms(kernel) if robust else kernel
    problem = Problem([of_body(body, scan, form=form, kernel=kernel)], ("pose", "betas", "trans"))
    x, fixed = problem.split(values)
    _, gradient = problem.cost_and_gradient(x, fixed)
    rng = np.random.default_rng(5)
    for _ in range(5):
        d = rng.normal(size=x.size)
        d /= np.linalg.norm(d)
        h = 1e-4  # contacts slide and may switch; Richardson's extrapolation of two differences
        costs = [problem.cost_and_gradient(x + k * h * d, fixed)[0] for k in (-1, -0.5, 0.5, 1)]
        coarse, fine = (costs[3] - costs[0]) / (2 * h), (costs[2] - costs[1]) / h
        slope = (4 * fine - coarse) / 3
        assert abs(gradient @ d - slope) < 1e-8 * max(1.0, np.linalg.norm(gradient))


@EACH_FORM
def test_held_contacts_agree_to_first_order_and_have_a_graph(form: Form) -> None:
    body, scan, values = body_and_scan(2)
    moving = Problem([of_body(body, scan, form=form)], ("betas", "trans"))
    held = moving.frozen(values)
    assert held.has_graph
    assert not moving.has_graph
    with pytest.raises(NotSupported, match="no graph"):
        _ = moving.hessian
    assert held.frozen(values) is held
    assert held.free.names == moving.free.names
    x, fixed = moving.split(values)
    one, other = moving.linearize_at(x, fixed), held.linearize_at(x, fixed)
    np.testing.assert_allclose(other.residual, one.residual, atol=1e-12)
    np.testing.assert_allclose(other.dense, one.dense, atol=1e-10)
    assert_jacobian(held, x, fixed, 1e-8)
    graph = np.asarray(held.derivative(x, fixed)[1])
    np.testing.assert_allclose(graph, one.dense, atol=1e-9)


@pytest.mark.parametrize("dense_from", [0, 10**9], ids=["sparse", "dense"])
def test_free_vertices_have_a_sparse_jacobian(
    monkeypatch: pytest.MonkeyPatch, dense_from: int
) -> None:
    monkeypatch.setattr(storage, "DENSE_FROM", dense_from)
    body, scan, values = body_and_scan(4)
    surface = body.vertices(*values.values())
    free = Block("vertices", surface.shape, "m")
    data = residuals.scan_to_model(free.symbol, body.faces, scan, sigma=0.01)
    stay = residuals.vertices(free.symbol, surface, sigma=0.05)
    problem = Problem([data, stay], "vertices", blocks=[free])
    places = []
    for seed in range(3):
        moved = surface + np.random.default_rng(seed).normal(scale=0.01, size=surface.shape)
        x, fixed = problem.split({"vertices": moved})
        here = problem.linearize_at(x, fixed)
        assert here.estimated == (dense_from == 0)
        J = here.dense
        assert np.count_nonzero(J[: len(scan)], axis=1).max() <= 9
        places.append(J[: len(scan)] != 0)
        d = np.random.default_rng(seed).normal(size=x.size)
        h = 1e-6
        ahead, behind = (problem.residual(x + k * h * d, fixed) for k in (1, -1))
        np.testing.assert_allclose(here.along(d), (ahead - behind) / (2 * h), atol=1e-5)
        np.testing.assert_allclose(J[len(scan) :], np.eye(x.size) / 0.05)
    assert (places[0] != places[1]).any()
    assert problem.pattern.shape == problem.linearize({"vertices": surface}).shape
    assert all(problem.pattern.toarray()[: len(scan)][each].all() for each in places)


def test_only_free_entries_of_a_surface_have_columns() -> None:
    r = residuals.scan_to_model(CORNERS.symbol, FACES, OUTSIDE, sigma=0.1)
    whole = Problem([r], "corners").linearize({"corners": TETRAHEDRON}).dense
    part = Problem([r], ("corners[1:3]",)).linearize({"corners": TETRAHEDRON}).dense
    np.testing.assert_allclose(part, whole[:, 3:9])


def test_points_beyond_the_gate_have_no_gradient() -> None:
    scan = np.vstack([OUTSIDE, [[9.0, 9.0, 9.0]]])
    for form in FORMS.values():
        r = residuals.scan_to_model(CORNERS.symbol, FACES, scan, sigma=1.0, within=0.5, form=form)
        here = Problem([r], "corners").linearize({"corners": TETRAHEDRON})
        rows = slice(4 * form.numbers, 5 * form.numbers)
        assert np.linalg.norm(here.residual[rows]) == 0.5
        assert not here.dense[rows].any()


def test_normals_choose_the_side_of_a_thin_sheet() -> None:
    """Two parallel sheets that face away from each other: the point belongs to the far one."""
    sheet = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 0.2], [1, 0, 0.2], [0, 1, 0.2]])
    faces, place = np.array([[0, 2, 1], [3, 4, 5]]), Block("sheet", (6, 3), "m")  # down, and up
    scan, up = [[0.2, 0.2, 0.05]], [[0.0, 0.0, 1.0]]
    distances = {}
    for name, options in (("near", {}), ("oriented", {"normals": up, "within": 1.0})):
        r = residuals.scan_to_model(place.symbol, faces, scan, sigma=1.0, **options)
        distances[name] = Problem([r], "sheet").linearize({"sheet": sheet}).residual
    np.testing.assert_allclose(distances["near"], [-0.05], rtol=1e-12)
    np.testing.assert_allclose(distances["oriented"], [-0.15], rtol=1e-12)


def test_scan_weights_stand_outside_of_the_kernel() -> None:
    weights, kernel = np.array([0.0, 1.0, 2.0, 4.0]), scaled(geman_mcclure, 2.0)
    r = residuals.scan_to_model(
        CORNERS.symbol, FACES, OUTSIDE, sigma=0.1, kernel=kernel, weights=weights
    )
    s = (DISTANCES / 0.1) ** 2
    expected = 0.5 * np.sum(weights * s / (1 + s / 4))
    here = Problem([r], "corners").linearize({"corners": TETRAHEDRON}).cost
    assert here == pytest.approx(expected, rel=1e-12)


def complain(run: Callable[[], object], *words: str) -> None:
    with pytest.raises((BadResidual, BadMesh, NotNumbers)) as error:
        run()
    for word in words:
        assert word in str(error.value)


def test_bad_scan_arguments_are_refused() -> None:
    def scanned(scan: object = OUTSIDE, faces: object = FACES, **options: object) -> Residual:
        return residuals.scan_to_model(CORNERS.symbol, faces, scan, sigma=0.1, **options)

    complain(lambda: scanned(OUTSIDE[:, :2]), "(M, 3)", "(4, 2)")
    complain(lambda: scanned(np.full((2, 3), np.nan)), "NaN")
    complain(lambda: scanned("a scan"), "scan")
    complain(lambda: scanned(faces=[[0, 1, 4]]), "0 to 3", "faces")
    complain(lambda: scanned(normals=OUTSIDE), "within")
    complain(lambda: scanned(normals=0 * OUTSIDE, within=1.0), "length zero")
    complain(lambda: scanned(within=-1.0), "above zero")
    complain(lambda: scanned(weights=[1.0, 2.0]), "4 of them", "(2,)")
    complain(lambda: scaled(of_norms(geman_mcclure), 2.0), "of_norms(scaled")


WALL = np.stack(np.meshgrid(*[np.linspace(-0.5, 0.5, 101)] * 2), axis=-1).reshape(-1, 2)
SCAN = np.column_stack([WALL, np.zeros(len(WALL))])  # a wall of 1 m, every centimetre a point
CAMERA = np.array([0.0, 0.0, 2.0])
PLACED = Block("placed", (6, 3), "m")


def metres_off(places: list[list[float]], **margins: float) -> np.ndarray:
    """How far places are from the shadow of the wall, in m."""
    given = np.array(places)
    block = Block("placed", given.shape, "m")
    residual = residuals.free_space(block.symbol, SCAN, CAMERA, sigma=0.1, **margins)
    return 0.1 * Problem([residual], "placed").linearize({"placed": given}).residual


def test_free_space_behind_the_scan_is_zero() -> None:
    assert not metres_off([[0, 0, -0.001], [0.3, -0.4, -3], [0.7, 0, -1]]).any()  # shadows widen


def test_free_space_in_front_is_the_depth() -> None:
    distances = metres_off([[0, 0, 0.02], [0, 0, 0.5], [0.2, 0.1, 1.0]])
    depth = np.linalg.norm([0.4, 0.2, 2]) - np.linalg.norm([0.2, 0.1, 1])
    np.testing.assert_allclose(distances, [0, 0.47, depth - 0.03], atol=5e-3)


def test_free_space_beside_is_the_distance_to_rays() -> None:
    across = 0.5 / np.hypot(0.5, 2) * np.array([1, 0, 0.25])  # of the ray along the wall's edge
    there = np.array([0.5, 0, 0]) + 0.1 * across / np.linalg.norm(across)
    ray = np.array([0.5, 0, -2]) / np.hypot(0.5, 2)
    square = np.array([2.0, 0, 0.5]) / np.hypot(0.5, 2)
    np.testing.assert_allclose(
        metres_off([list(CAMERA + 2.5 * ray + 0.1 * square), list(there)]), [0.07, 0.07], atol=6e-3
    )


@pytest.mark.thorough
def test_thin_scans_have_wide_rays() -> None:
    some = np.random.default_rng(0).permutation(len(SCAN))[:200]  # 7 cm apart
    wide = Shadow.of(SCAN[some], CAMERA)
    assert 0.1 < wide.beside < 0.2
    inside = np.column_stack([0.8 * WALL, np.full(len(WALL), -0.1)])
    assert np.mean(wide.distances(inside).numbers > 0) < 0.001
    assert Shadow.of(SCAN, CAMERA).beside == Shadow.of(SCAN[:3], CAMERA).beside == 0.03


def test_free_space_ignores_what_is_out_of_view() -> None:
    places = [[0.7, 0, 0.2], [0, 0, 0.5], [0, 3, 1.0]]
    assert metres_off(places).min() > 0.1
    np.testing.assert_array_equal(metres_off(places, within=0.05) > 0, [False, True, False])


def test_free_space_jacobian_matches_differences() -> None:
    rng = np.random.default_rng(0)
    residual = residuals.free_space(PLACED.symbol, SCAN, CAMERA, sigma=0.1)
    problem = Problem([residual], "placed")
    for _ in range(3):
        x = (rng.uniform(-1, 1, (6, 3)) * [1, 1, 0.5] + [0, 0, 0.5]).ravel()
        assert np.count_nonzero(problem.residual(x, np.zeros(0))) >= 4
        assert_jacobian(problem, x, np.zeros(0), 1e-7)


def test_bad_free_space_arguments_are_refused() -> None:
    for margins in ({"beside": 0.0}, {"within": -1.0}):
        with pytest.raises(BadResidual, match="margins above 0 m"):
            residuals.free_space(PLACED.symbol, SCAN, CAMERA, sigma=0.1, **margins)
    with pytest.raises(BadResidual, match="at the camera"):
        residuals.free_space(PLACED.symbol, np.vstack([SCAN, CAMERA]), CAMERA, sigma=0.1)
    with pytest.raises(BadResidual, match="camera's place"):
        residuals.free_space(PLACED.symbol, SCAN, [0.0, np.nan, 1.0], sigma=0.1)


@pytest.mark.parametrize("form", few([distance, offset], 1))
def test_sequences_of_scans_are_their_frames(form: Form) -> None:
    body, scan, values = body_and_scan()
    frames = [
        Problem([of_body(body, scan + shift, form=form)], ("pose", "betas", "trans"))
        for shift in (0.0, 0.02)
    ]
    video = wb.sequence(frames, shared="betas")
    each = {"pose": 0.1, "trans": 0.05}
    whole = {
        name: np.stack([value, value + each[name]]) if name in each else value
        for name, value in values.items()
    }
    own = [{n: v[t] if n in each else v for n, v in whole.items()} for t in range(2)]
    apart = [frame.linearize(at) for frame, at in zip(frames, own, strict=True)]
    together = video.linearize(whole)
    np.testing.assert_allclose(together.residual, np.concatenate([one.residual for one in apart]))
    at = video.free.slices["betas"]
    by_betas = [J.dense[:, f.free.slices["betas"]] for J, f in zip(apart, frames, strict=True)]
    np.testing.assert_allclose(together.dense[:, at], np.concatenate(by_betas), atol=1e-9)
    held = video.frozen(whole)
    assert held.has_graph
    x, fixed = held.split(whole)
    by_graph, J = held.derivative(x, fixed)
    np.testing.assert_allclose(np.asarray(by_graph).ravel(), together.residual, atol=1e-9)
    np.testing.assert_allclose(np.asarray(cs.densify(J)), together.dense, atol=1e-8)
    np.testing.assert_allclose(held.linearize(whole).dense, together.dense, atol=1e-9)
    x = x + 1e-3 * np.random.default_rng(0).standard_normal(x.shape)
    assert held.costs(x, fixed)(x[None])[0] == pytest.approx(held.cost_and_gradient(x, fixed)[0])
