"""Bodies fitted to markers: what is found again, what is refused, and what files may hold."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

import workbench as wb
from workbench.arrays import Array
from workbench.blocks import Values
from workbench.cli.fit import Worn, fit_markers
from workbench.errors import BadArgument, BadFile, UnknownName
from workbench.experiments.moving_people import dressed_person, true_measures
from workbench.fitting import (
    BadObservation,
    MarkerSet,
    default_markers,
    marker_fit,
    marker_solver,
    mosh,
    read_marker_set,
    read_markers,
    spread_frames,
)
from workbench.fitting.marker_sets import known_labels, known_markers, matched
from workbench.fitting.markers import marker_errors, offset_prior, surface_frames
from workbench.geometry.guesses import UP_TO_Y
from workbench.geometry.solids import vertex_normals
from workbench.motions import read_motion
from workbench.priors.poses import draw_poses, shipped_gaussian
from workbench.solvers import TrustRegion

BODY = wb.load_body("small")
WORN = default_markers(BODY)


def person(seed: int, frames: int, noise: float = 0.001) -> tuple[Values, Array]:
    rng = np.random.default_rng(seed)
    poses = draw_poses(shipped_gaussian(), frames, rng)
    return dressed_person(BODY, WORN, poses, rng, noise, 0.05, 0.005)


def test_default_markers_are_on_the_named_side() -> None:
    for name in ("small", "default"):
        body = wb.load_body(name)
        worn = default_markers(body)
        assert len(worn.names) == len({*worn.vertices.tolist()}) == 41
        side = {label[0]: 1 for label in worn.names}
        assert side.keys() >= {"L", "R"}
        for label, x in zip(worn.names, body.template[worn.vertices, 0], strict=True):
            if label[1:] in [other[1:] for other in worn.names if other[0] != label[0]]:
                assert x > 0 if label[0] == "L" else x < 0, label
        normals = vertex_normals(body.template, body.faces)[worn.vertices]
        np.testing.assert_allclose(worn.nominal, 0.0095 * normals)


@pytest.mark.thorough
def test_shape_offsets_and_poses_are_recovered() -> None:
    """With hardly any noise and many frames, everything comes back that markers can see."""
    truth, observed = person(1, 6, noise=1e-4)
    setup = marker_fit(observed, BODY, WORN, sigma=1e-4)
    solution = marker_solver().solve(setup.problem, setup.start)
    values = setup.start | solution.values
    before, after = true_measures(BODY, setup.start, truth), true_measures(BODY, values, truth)
    assert [m.value for m in after] < [m.value / 4 for m in before]
    assert after[0].value < 3
    errors = marker_errors(WORN.on(BODY), observed, values)
    assert np.isnan(errors).sum() == np.isnan(observed).any(axis=2).sum()
    assert 1e3 * np.sqrt(np.nanmean(errors**2)) < 1
    assert [prior in setup.problem.rows for prior in setup.priors] == [True, True, True]
    assert any("distance to marker" in m.name for m in setup.measures(values))


def test_offset_prior_is_wide_along_the_surface() -> None:
    dressed = WORN.on(BODY)
    term = offset_prior(dressed, WORN, 0.005, across=0.001)
    problem = wb.Problem([term], ("offsets",))
    frames = surface_frames(dressed, WORN)
    np.testing.assert_allclose(frames @ frames.swapaxes(1, 2), [np.eye(3)] * 41, atol=1e-12)
    normals = vertex_normals(BODY.template, BODY.faces)[WORN.vertices]
    for direction, sigma in ((normals, 0.001), (frames[:, 0], 0.005), (frames[:, 1], 0.005)):
        off = WORN.nominal + 0.002 * direction
        r = problem.residual(off.ravel(), np.zeros(0))
        assert r @ r == pytest.approx(41 * (0.002 / sigma) ** 2)
    assert term.label(5).endswith(f"[{WORN.names[1]}, across]")
    for wrong in (0.0, np.nan):
        with pytest.raises(BadArgument, match="across of markers"):
            offset_prior(dressed, WORN, 0.005, across=wrong)
    bare = (dressed.faces != WORN.vertices[3]).all(axis=1)
    with pytest.raises(BadArgument, match=f"{WORN.names[3]!r} is on a vertex that no face has"):
        offset_prior(replace(dressed, faces=dressed.faces[bare]), WORN, 0.005, across=0.001)


def test_mosh_poses_every_frame() -> None:
    truth, observed = person(2, 6)
    observed[3, 2:] = np.nan  # a frame that shows two markers
    said: list[str] = []
    found = mosh(observed, BODY, WORN, frames=3, sigma=0.001, progress=said.append)
    assert np.isnan(found.pose).all(axis=(1, 2)).tolist() == [t == 3 for t in range(6)]
    assert np.isnan(found.errors[3]).all()
    assert len(found.frames) == 3
    assert 3 not in found.frames
    assert "3 of 6 frames" in said[0]
    assert "frame 5 of 5" in said[-1]
    joints = BODY.joints(found.pose, found.betas, found.trans)
    true = BODY.joints(truth["pose"], truth["betas"], truth["trans"])
    assert np.nanmedian(np.linalg.norm(joints - true, axis=2)) < 0.012


def test_marker_start_is_invariant_to_facing() -> None:
    _, observed = person(3, 2)
    turned = observed @ np.array([[0, 0, -1], [0, 1, 0], [1, 0, 0]])
    plain, other = (marker_fit(m, BODY, WORN).start["pose"][:, 1:] for m in (observed, turned))
    np.testing.assert_allclose(other, plain, atol=1e-3)


def test_spread_frames_skips_alike_frames() -> None:
    _, observed = person(4, 6, noise=1e-6)
    observed = np.nan_to_num(observed, nan=0.5)
    again = np.concatenate([np.repeat(observed[:1], 20, axis=0), observed[1:]])
    assert spread_frames(again, 6).tolist() == [0, 20, 21, 22, 23, 24]
    assert spread_frames(again[:3], 12).tolist() == [0, 1, 2]


def test_bad_markers_are_refused() -> None:
    _, observed = person(6, 3)
    few, none = observed.copy(), np.full((3, 41, 3), np.nan)
    few[1, 3:] = np.nan
    for fit, markers, error, said in [
        (marker_fit, observed[:, :5], BadArgument, r"shape \(T, 41, 3\)"),
        (mosh, observed[0], BadArgument, r"shape \(T, 41, 3\)"),
        (marker_fit, few, BadObservation, r"frame 1 shows [0-3] of 41 markers"),
        (mosh, none, BadObservation, "no frame shows 4 markers"),
    ]:
        with pytest.raises(error, match=said):
            fit(markers, BODY, WORN)


def test_bad_marker_sets_are_refused(tmp_path: Path) -> None:
    for vertices, said in [
        ({"a": 3, "c": 4, "b": 3}, "the markers 'a' and 'b' are on the same vertex 3"),
        ({"a": 369}, "has the vertices 0 to 368"),
        ({}, "one marker or more"),
    ]:
        with pytest.raises(BadArgument, match=said):
            MarkerSet.of(BODY, vertices)
    with pytest.raises(UnknownName, match="no marker is called 'knee'"):
        WORN.only(["knee"])
    path = tmp_path / "set.json"
    path.write_text(json.dumps({"nose": 7, "chin": 9}))
    assert read_marker_set(path, BODY).names == ("nose", "chin")
    for wrong in ('{"nose": -1}', '{"nose": 1.5}', "[1]", '{"nose": 999}', "{", "{}"):
        path.write_text(wrong)
        with pytest.raises(BadFile, match=r"set\.json"):
            read_marker_set(path, BODY)


def test_marker_labels_are_matched_by_name() -> None:
    worn, places, notes = matched(["subject:LFHD", "C7", "*12"], WORN)
    assert worn.names == ("LFHD", "C7")
    assert places == (0, 1)
    assert "*12" in notes[0]
    with pytest.raises(BadArgument, match=r"none of the labels.*--labels MAP\.csv"):
        matched(["*1"], WORN)


@pytest.mark.parametrize("change", [str.lower, "s01_{}".format, "Anna B:{}".format])
def test_labels_of_any_case_and_prefix_are_understood(change: Callable[[str], str]) -> None:
    worn, places, notes = matched(["x", *map(change, WORN.names)], WORN)
    assert worn.names == WORN.names
    assert places == tuple(range(1, 42))
    assert notes[0] == "not fitted are x, which the marker set does not have"
    assert notes[1].startswith(f"41 of 41 labels are understood: {change('C7')} as C7")


@pytest.mark.parametrize(
    ("labels", "meant"),
    [
        ("LASI RPSI SACR LKNE LKNM RTIB LANK LHEE RTOE RBAK LFRA", "Plug-in Gait"),
        ("L.ASIS V.Sacral R.Knee R.Knee.Medial L.Ankle R.Heel L.Toe R.Shoulder", "Helen Hayes"),
        ("LIAS R_IPS L_FLE RFME L_FAX RTTC LFAL R_TAM LFCC R_FM1 L_FM2 RFM5 CV7", "CAST"),
        ("ARIEL LFSH RBSH LIEL ROWR LIHAND ROHAND MFWT MBWT LKNI RHEL LMT1 RMT5", "Vicon 53"),
        (
            "HeadTop BackTop WaistLFront RShoulderTop LWristIn RKneeOut LToeIn",
            "OptiTrack",
        ),
    ],
)
def test_labels_of_usual_marker_sets_are_understood(labels: str, meant: str) -> None:
    given = labels.split()
    everywhere = known_markers(BODY)
    for prefix in ("", "Subject:"):
        worn, places, notes = matched([prefix + label for label in given], everywhere)
        assert places == tuple(range(len(given))), meant
        assert not any("not fitted" in note for note in notes)
        x = BODY.template[worn.vertices, 0]
        sides = [label.upper().removeprefix("WAIST")[0] for label in given]
        assert (x[[side == "L" for side in sides]] > 0).all()
        assert (x[[side == "R" for side in sides]] < 0).all()


def test_of_several_subjects_the_one_with_most_markers_is_taken() -> None:
    labels = ["a_LHEE", "b_LHEE", "b_C7", "b_CV7", "B_RHEE", "*3", "T10"]
    worn, places, notes = matched(labels, WORN)
    assert worn.names == ("LHEE", "C7", "RHEE", "T10")
    assert places == (1, 2, 4, 6)
    said = "not fitted are a_LHEE, b_CV7, *3, which the marker set does not have"
    assert notes[0] == f"{said}, or that are not of 'B_'"


def test_known_labels_are_of_known_markers() -> None:
    names = known_markers(BODY).names
    assert len({*names}) == 72
    assert {*known_labels().values()} <= {*names}
    assert all(name == label for label, name in known_labels().items() if label in names)
    assert not {"LKNEE", "RANKLE", "LSHOULDER", "RELBOW"} & {*known_labels()}  # joints of others


def written(path: Path, **arrays: object) -> Path:
    np.savez(path, **arrays)  # type: ignore[arg-type]
    return path


@pytest.mark.parametrize(("scale", "z_up"), [(1.0, False), (1000.0, True)])
def test_marker_files_guess_unit_and_axis(tmp_path: Path, scale: float, z_up: bool) -> None:
    standing = np.repeat(BODY.template[WORN.vertices][None], 3, axis=0)
    standing = standing * [0.3, 1, 1] + [0.2, 1.0, 0.1]  # arms down
    given = standing @ UP_TO_Y["z" if z_up else "y"]
    given[1, 4], given[2, 5] = np.nan, 0.0
    path = written(tmp_path / "m.npz", markers=scale * given, labels=np.array(WORN.names), fps=60.0)
    found = read_markers(path)
    assert found.fps == 60.0
    assert found.labels == WORN.names
    assert np.isnan(found.markers).all(axis=2).sum() == 2
    known = np.isfinite(found.markers)
    np.testing.assert_allclose(found.markers[known], standing[known], atol=1e-9)
    said = " ".join(found.notes)
    assert f"taken to be {'m' if scale == 1 else 'mm'}," in said
    assert f"{'z' if z_up else 'y'} is taken to be up" in said
    assert "1.6 % of the places" in said
    with pytest.raises(UnknownName, match="no unit is called 'inch'"):
        read_markers(path, unit="inch")
    with pytest.raises(UnknownName, match="no axis is called 'w'"):
        read_markers(path, up="w")


def test_damaged_marker_files_are_refused(tmp_path: Path) -> None:
    for arrays, why in [
        ({"labels": ["a", "b"]}, "markers missing"),
        ({"markers": np.zeros((2, 2, 3))}, "labels missing"),
        ({"markers": np.zeros((2, 3, 3)), "labels": ["a", "b"]}, "labels has shape"),
        ({"markers": np.zeros((2, 2, 3)), "labels": ["a", "b"]}, "no marker was seen"),
        ({"markers": np.ones((2, 2, 3)), "labels": ["a", "a"]}, "more than once"),
        ({"markers": np.full((2, 2, 3), np.inf), "labels": ["a", "b"]}, "which is no place"),
        ({"markers": 1e9 * np.eye(3)[None], "labels": ["a", "b", "c"]}, "size of a body"),
        ({"markers": np.ones((2, 2, 3)), "labels": ["a", "b"], "fps": 0.0}, "fps is 0"),
    ]:
        with pytest.raises(BadFile, match=rf"m\.npz .*{why}"):
            read_markers(written(tmp_path / "m.npz", **arrays))


@pytest.mark.thorough
def test_command_writes_the_motion_of_every_frame(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    _, observed = person(7, 14)
    labels = np.array([*WORN.names, "*41"])
    more = np.concatenate([1000 * observed, np.ones((14, 1, 3))], axis=1)
    path = written(tmp_path / "take.npz", markers=more, labels=labels)
    known = Worn(height=0.012, across=1e-4)
    fit_markers(Console(), path, BODY, known, 30.0, None, TrustRegion(), tmp_path / "runs")
    said = " ".join(capsys.readouterr().out.split())
    assert "not fitted are *41" in said
    assert "the unit is taken to be mm" in said
    assert "the worst is" in said
    assert (tmp_path / "runs" / "take" / "index.html").exists()
    with np.load(tmp_path / "runs" / "take" / "motion.npz") as found:
        shapes = {name: found[name].shape for name in found}
        assert found["fps"] == 30.0
        assert found["labels"].tolist() == list(WORN.names)
        out = WORN.nominal / np.linalg.norm(WORN.nominal, axis=1, keepdims=True)
        heights = np.sum(found["offsets"] * out, axis=1)
        np.testing.assert_allclose(heights, 0.012, atol=1e-3)  # 9.5 mm, had it not been given
    of_frames = {"poses": (14, 24, 3), "trans": (14, 3), "errors": (14, 41), "frames": (12,)}
    of_all = {"betas": (BODY.n_betas,), "offsets": (41, 3), "labels": (41,), "joint_names": (24,)}
    assert shapes == of_frames | of_all | {"fps": (), "up_axis": ()}
    motion = read_motion(tmp_path / "runs" / "take" / "motion.npz")
    assert (len(motion), motion.fps, motion.joint_names) == (14, 30.0, BODY.joint_names)
