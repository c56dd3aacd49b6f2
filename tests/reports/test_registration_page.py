"""The page of a registered scan, and the folder of many that training reads."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.registration.clouds import cloud, person
from workbench import load_body
from workbench.bodies import SkinnedBody
from workbench.geometry.meshes import read_mesh
from workbench.registration import (
    FailedScan,
    FitStage,
    Reading,
    Recipe,
    RegisteredScan,
    ScanJob,
    register,
)
from workbench.reports import write_registration
from workbench.reports.many import RegistrationFolder
from workbench.training.first_guess import read_start
from workbench.training.folder import Row, open_folder

pytestmark = pytest.mark.thorough

RECIPE = Recipe((FitStage(200, 0.02, 0.1, 2, 10),), ())


@pytest.fixture(scope="module")
def body() -> SkinnedBody:
    return load_body("small")


@pytest.fixture(scope="module")
def found(body: SkinnedBody, tmp_path_factory: pytest.TempPathFactory) -> RegisteredScan:
    path = tmp_path_factory.mktemp("scans") / "scan <1>.xyz"
    path.write_text("a file that the key is made from")
    registration = register(body, cloud(body, person(body, 0.0)), recipe=RECIPE)
    return RegisteredScan(ScanJob("one", path), registration, None, ("y is taken to be up",))


def test_registration_folder_holds_page_and_arrays(
    body: SkinnedBody, found: RegisteredScan, tmp_path: Path
) -> None:
    page = write_registration(found, tmp_path / "run", body="small", key="k")
    text = page.read_text()
    assert "small on scan &lt;1&gt;.xyz" in text
    assert "Y is taken to be up." in text
    assert "://" not in text.replace("http://www.w3.org", "")  # nothing is fetched
    with np.load(tmp_path / "run" / "registration.npz") as stored:
        np.testing.assert_array_equal(stored["vertices"], found.registration.vertices)
        np.testing.assert_array_equal(stored["confidence"], found.registration.seen)
        again = body.vertices(stored["pose"], stored["betas"], stored["trans"])
        np.testing.assert_allclose(again, found.registration.model, atol=1e-12)
    mesh = read_mesh(tmp_path / "run" / "registration.ply")
    np.testing.assert_array_equal(mesh.vertices, found.registration.vertices)
    np.testing.assert_array_equal(mesh.faces, body.faces)
    told = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert told["median_m"] == found.registration.median
    assert told["key"] == "k"


ROW = Row("one/registration.npz", "anna", "female", "poses")


def folder_in(place: Path, body: SkinnedBody, recipe: Recipe = RECIPE) -> RegistrationFolder:
    return RegistrationFolder(place, body, "small", recipe, Reading(), "scans", {"one": ROW})


def test_registration_folder_is_read_by_training(
    body: SkinnedBody, found: RegisteredScan, tmp_path: Path
) -> None:
    folder = folder_in(tmp_path / "run", body)
    entry = folder.keep(found, folder.key(found.job))
    failed = FailedScan(ScanJob("two", Path("two.ply")), "it is <empty>")
    page = folder.finish([entry], [failed])
    read = open_folder(tmp_path / "run", body.n_vertices, body.faces)
    assert read.rows == (ROW,)
    vertices, confidence = read.read_row(ROW)
    np.testing.assert_array_equal(vertices, found.registration.vertices)
    np.testing.assert_array_equal(confidence, found.registration.seen)
    start = read_start(str(tmp_path / "run" / "start.npz"))
    np.testing.assert_array_equal(start.template, body.template)
    text = page.read_text()
    assert 'href="one/index.html"' in text
    assert "two.ply: it is &lt;empty&gt;" in text


def test_a_scan_is_kept_until_something_changes(
    body: SkinnedBody, found: RegisteredScan, tmp_path: Path
) -> None:
    folder = folder_in(tmp_path / "run", body)
    key = folder.key(found.job)
    assert folder.kept(found.job, key) is None
    folder.keep(found, key)
    again = folder_in(tmp_path / "run", body)
    assert again.key(found.job) == key
    kept = again.kept(found.job, key)
    assert kept is not None
    assert kept.facts["scan"] == "one"
    other = folder_in(tmp_path / "run", body, replace(RECIPE, boundary=0.01))
    assert other.key(found.job) != key
    assert replace(again, reading=Reading(unit="mm")).key(found.job) != key
    found.job.path.write_text("another scan")
    assert again.key(found.job) != key
    (tmp_path / "run" / "one" / "registration.npz").unlink()
    assert again.kept(found.job, key) is None
