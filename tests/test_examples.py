"""Every example runs and asserts what it claims."""

import itertools
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

import workbench as wb
from workbench.experiments import find

EXAMPLES = sorted(p.stem for p in (Path(__file__).parents[1] / "examples").glob("[0-9]*.py"))


LONG = ("15_how_well_a_person_is_known", "17_posterior_of_scape")  # held by tests below, as long


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=pytest.mark.thorough) if n in LONG else n for n in EXAMPLES]
)
def test_it_runs(name: str) -> None:
    import_module(f"examples.{name}")


def test_the_cubic_is_found_within_its_spread() -> None:
    example = import_module("examples.01_polynomial")
    off = np.abs(example.solution.values["w"] - example.truth) / example.spread
    assert example.solution.converged
    assert off.max() < 4


def test_the_body_is_found_within_the_noise() -> None:
    example = import_module("examples.02_known_correspondences")
    assert example.solution.converged
    assert example.error.mean() < 0.0007  # 85 parameters average 1,107 noisy coordinates


def test_joints_leave_thirty_two_directions_unseen() -> None:
    example = import_module("examples.03_what_joints_cannot_see")
    assert example.diagnosis.rank == 40
    assert len(example.diagnosis.null_directions) == 32
    assert len(example.twists) == 17
    assert example.joints_moved < 1e-6  # m: second order in a turn of 1 mrad
    assert example.skin_moved > 1e-5


def test_soft_tissue_follows_a_motion() -> None:
    example = import_module("examples.37_soft_tissue")
    assert example.same
    assert example.explained > 0.7
    once = [far for (_, times), far in sorted(example.farthest.items()) if times == 1]
    thrice = [far for (_, times), far in sorted(example.farthest.items()) if times == 3]
    np.testing.assert_allclose(thrice, 3 * np.array(once), rtol=1e-9)
    assert once == sorted(once), "the heavier, the farther"


def test_one_camera_sees_across_and_not_along() -> None:
    example = import_module("examples.05_one_camera")
    one, two = example.errors["one camera"].mean(axis=0), example.errors["two cameras"].mean(axis=0)
    assert one[2] > 4 * one[0]
    assert two.max() < 10  # mm
    assert example.sigmas["one camera"][2] > 5 * example.sigmas["two cameras"][2]


def test_bundle_adjustment_is_invariant_to_similarities() -> None:
    example = import_module("examples.29_the_gauge_of_bundle_adjustment")
    kinds = [direction.kind for direction in example.diagnosis.null_directions]
    assert sorted(kinds) == ["rotation"] * 3 + ["scale"] + ["translation"] * 3
    first = example.remedies[0]
    assert (first.acts, first.numbers, first.cured) == (2, 7, True)
    assert first.what.startswith("hold camera ")
    assert any("the distance of points[" in remedy.what for remedy in example.remedies)
    assert example.solution.converged


def test_a_sequence_shares_a_shape_and_fills_gaps() -> None:
    example = import_module("examples.12_a_video")
    assert example.together.converged
    assert example.together.trace[-1].linear_algebra == "band cholesky"
    alone, together = example.errors["frame by frame"], example.errors["as a sequence"]
    seen = np.delete(np.arange(example.FRAMES), example.hidden)
    assert together[seen].mean() < 0.6 * alone[seen].mean()
    assert alone[example.hidden].mean() > 100  # mm
    assert together[example.hidden].mean() < 20
    spread = {name: np.sqrt(np.mean(off**2)) for name, off in example.shapes.items()}
    assert spread["as a sequence"] < spread["frame by frame"] / 3


def test_a_file_of_ones_own_is_taken_by_the_commands() -> None:
    setup = find(str(Path(__file__).parents[1] / "examples" / "36_a_file_of_your_own.py")).setup()
    example = import_module("examples.36_a_file_of_your_own")
    found = dict(setup.start) | wb.solve(setup.problem, setup.start).values
    places = example.body.joints(**{n: found[n] for n in ("pose", "betas", "trans")})
    assert np.abs(places[example.ankles, 1] - 0.08).max() < 0.005
    assert abs(places[example.number["right_wrist"], 2] - 0.45) < 0.005
    assert wb.diagnose(setup.problem.without(*setup.priors), found).rank == 3


def test_each_term_of_training_closes_directions() -> None:
    example = import_module("examples.13_training_term_by_term")
    assert example.data.shape == (4320, 2700)
    assert example.open_with == {"E_D": 31, "E_D + E_T": 16, "E_D + E_T + E_P": 12}
    kinds = {direction.kind for direction in example.data.null_directions}
    assert kinds == {"shift", "gauge"}  # every one of them has a name


def test_robust_kernels_leave_outliers_alone() -> None:
    example = import_module("examples.06_outliers")
    squares, huber, geman = (example.errors[name].mean() for name in example.KERNELS)
    assert squares > 100  # mm
    assert squares > 5 * huber > 10 * geman
    np.testing.assert_allclose(abs(example.strongest), 1 / np.sqrt(3), atol=0.02)
    assert example.rho["Geman-McClure"].max() < 1


def test_every_solver_ends_in_the_same_place() -> None:
    example = import_module("examples.07_many_solvers")
    for name, end in example.ends.items():
        np.testing.assert_allclose(end, [1, 1], atol=1e-5, err_msg=name)
    assert example.calls["gauss-newton"] < example.calls["steepest-descent"] / 3


def test_the_posterior_leans_and_laplace_does_not() -> None:
    example = import_module("examples.08_posterior")
    assert example.posterior.usable
    a, k, c = example.lean
    assert a > 1.2
    assert k > 1
    assert c < 0.8
    inside = (example.by_draws[:, 0] < example.truth) & (example.truth < example.by_draws[:, 1])
    assert inside.all()


def test_training_is_fitting_with_the_template_free() -> None:
    example = import_module("examples.09_training_in_a_sentence")
    assert example.solution.converged
    assert example.before > 0.009  # m
    assert example.after < 0.001
    assert example.unseen == len(example.noticed) == 3
    assert max(example.noticed.values()) < 1e-9


def test_a_cloud_without_names_is_fitted_round_by_round() -> None:
    example = import_module("examples.10_depth_map")
    assert example.errors[-1] < example.errors[0] / 4
    assert example.gaps[-1] < 10  # mm, between points that are as far apart
    assert example.front.mean() < 30


def test_parts_of_a_pose_are_free_by_name_and_made_of_anything() -> None:
    example = import_module("examples.11_parts_of_a_pose")
    labels = [example.root.free.label(i) for i in range(6)]
    assert labels == [*(f"trans[{a}]" for a in "xyz"), *(f"pose[pelvis, {a}]" for a in "xyz")]
    held = example.placed.values["pose"][1:]
    np.testing.assert_array_equal(held, example.body.start()["pose"][1:])
    assert example.staged.cost < 1e-6 < example.placed.cost
    assert example.diagnosis.rank < example.looked_at.free.size
    assert any(name.startswith("a turn of rest[") for name in example.unseen)
    assert example.found.converged
    assert np.abs(example.found.values["coefficients"]).max() < 1e-6
    start = {name: value.T for name, value in example.body.start().items()}
    r, J = example.function(start["pose"], start["betas"], start["trans"])
    here = example.whole.freeing("pose").linearize(example.body.start())
    np.testing.assert_allclose(np.asarray(r).ravel(), here.residual, atol=1e-10)
    np.testing.assert_allclose(np.asarray(J), here.jacobian, atol=1e-9)


def test_three_body_models_are_fitted_to_the_same_points() -> None:
    example = import_module("examples.14_three_body_models")
    assert len(example.FRAMES) == 12
    for frame in example.FRAMES:
        places, seen, held = example.keypoints(frame)
        known = np.flatnonzero(np.isfinite(places[:, 0]))
        np.testing.assert_array_equal(np.sort([*seen, *held]), known)
        assert len(held) == len(known) // 4
    assert not example.models["SCAPE"].posedirs.any()
    assert not example.models["BlendSCAPE"].posedirs.any()
    assert all(fit.solution.converged for some in example.fits.values() for fit in some)
    assert example.lower["SCAPE"] == example.lower["BlendSCAPE"] == 12
    held_out = {n: np.array([f.held_out.mean() for f in some]) for n, some in example.fits.items()}
    means = [off.mean() for off in held_out.values()]
    errors = [off.std() / np.sqrt(len(off)) for off in held_out.values()]
    assert max(means) - min(means) < min(errors)
    assert example.observed["SMPL"].mean() < 20 < example.observed["SCAPE"].mean()
    assert 10 < example.apart["SCAPE"].mean() < example.apart["BlendSCAPE"].mean() < 30  # mm


@pytest.mark.thorough
def test_a_second_camera_narrows_what_is_known_of_a_person() -> None:
    example = import_module("examples.15_how_well_a_person_is_known")
    for posterior in example.posteriors.values():
        assert posterior.usable
        assert posterior.size == posterior.problem.free.size == 3 + 3 + 24 + 10
        assert posterior.mixing.scales.max() < 1.01
    assert example.share > 0.9
    assert 1 < example.shift < 10  # mm
    one, two = example.sds["one camera"], example.sds["two cameras"]
    assert (two < one).all()
    distance, height, elbow, _ = two / one
    assert distance < 0.2
    assert height < 0.4
    assert elbow > 0.5
    assert example.together > 0.9
    assert np.corrcoef(example.numbers["one camera"].T)[0, 3] > 0.9
    for name in example.sds:
        low, high = example.intervals[name].T
        middle = example.numbers[name].mean(axis=0)
        assert (low < middle).all()
        assert (middle < high).all()
        assert (abs(example.reference - middle) < 2 * example.sds[name]).all()


@pytest.mark.thorough
def test_joints_tell_pose_and_shape_of_scape() -> None:
    example = import_module("examples.17_posterior_of_scape")
    posterior = example.posterior
    assert posterior.usable
    assert posterior.size == posterior.problem.free.size == 28
    assert posterior.mixing.scales.max() < 1.01
    assert 11 < example.distance < 57  # 99.8 % of chi^2 of 28 degrees of freedom
    assert (example.narrower > 2).all()
    height, volume, *_ = example.numbers.std(axis=0)
    assert 0.005 < height < 0.02
    assert 4 < volume < 7
    E, _, W, _ = posterior.draws.shape
    evaluations = E * W * (posterior.mixing.discarded + posterior.mixing.steps)
    assert 1.8e6 < evaluations < 2e6
    assert "chain of nearly two million evaluations" in " ".join(example.__doc__.split())


def test_nine_numbers_cost_more_except_for_one_small_turn() -> None:
    example = import_module("examples.16_nine_numbers_or_three")
    assert example.SEEDS == 20
    medians = {key: np.median(counts) for key, counts in example.iterations.items()}
    for case in example.CASES:
        for solver in ("ipopt", "sqp"):
            nine, three = medians[case, "nine", solver], medians[case, "three", solver]
            if (case, solver) == ("1 rotation by 90", "sqp"):
                assert nine == three
            else:
                assert nine < three if case == "1 rotation by 30" else nine > three
        assert sum(example.sooner[case]) == example.SEEDS
    assert example.sooner["1 rotation by 30"][0] == 0
    assert example.sooner["4 rotations by 90"] == [20, 0, 0]
    unknowns = {key: some[0].unknowns for key, some in example.runs.items()}
    assert unknowns["4 rotations by 90", "nine", "sqp"] == 36
    assert unknowns["4 rotations by 90", "three", "sqp"] == 12
    for (case, form, solver), some in example.runs.items():
        for one in some:
            assert one.violation < (1e-6 if form == "nine" else 1e-14)
            assert one.solution.converged or (case, form, solver) == (
                "4 rotations by 90",
                "nine",
                "ipopt",
            )
        assert example.at_best[case, form, solver] >= 18
        if form == "three":
            assert example.at_best[case, form, solver] == example.SEEDS


def test_free_vertices_come_nearer_to_a_scanned_person_than_the_model() -> None:
    example = import_module("examples.18_a_body_on_a_scan")
    assert not example.warnings
    assert max(example.model) < 15  # mm
    seen, hidden = np.array(example.free) / np.array(example.model)
    assert seen < 0.8
    assert hidden < 1


def test_scans_registered_together_come_nearer_to_the_truth() -> None:
    example = import_module("examples.28_scans_together")
    assert example.costs == sorted(example.costs, reverse=True)
    for apart, together in zip(example.found["apart"], example.found["together"], strict=True):
        assert together < 0.97 * apart


def test_a_motion_comes_back_from_its_files(capsys: pytest.CaptureFixture[str]) -> None:
    example = import_module("examples.33_motions_and_their_files")
    capsys.readouterr()
    found, fast, body = example.found, example.fast, example.body
    assert found.bones is not None
    assert fast.seconds == pytest.approx(2.0)
    turned = fast.joints(body)[-1]
    left = turned[body.joint_names.index("left_hip")] - turned[body.joint_names.index("right_hip")]
    assert left[0] < 0 < np.linalg.norm(left)  # half a turn: left is where right was
    assert np.abs(found.joints()[:, example.order] - fast.joints(body)).max() < 1e-6


def test_an_arm_gets_the_skeleton_that_moved_it(capsys: pytest.CaptureFixture[str]) -> None:
    example = import_module("examples.32_a_skeleton_from_meshes")
    capsys.readouterr()
    assert example.body.n_joints == 5
    assert max(example.found.rms, example.held_out) < 1e-8  # m
    assert example.gaps.min(axis=1).max() < 1e-6
    assert example.edges == {frozenset(pair) for pair in itertools.pairwise(example.NAMES)}
    (slides,) = (note for note in example.found.notes if "one axis" in note)
    assert "along (0.00, 0.00, 1.00)" in slides


def test_a_second_camera_and_ten_markers_are_chosen() -> None:
    example = import_module("examples.30_what_to_measure_next")
    second, overall = example.second, example.overall
    assert len(second.ranking) == 36
    assert 0.1 < second.before.sd < 0.3  # m
    assert second.gain > 10
    assert second.ranking[-1].sd > 2 * second.after.sd
    assert second.best != overall.best
    for found in (example.ten, example.for_stature):
        assert len(set(found.chosen)) == 10
        assert "no single exchange improves the choice" in found.search
    assert example.for_stature.after.sd < 0.01 < 0.05 < example.for_stature.before.sd  # m
    assert 0 < len(example.shared) < 10


def test_a_scan_says_more_of_a_hand_than_its_skeleton() -> None:
    example = import_module("examples.31_a_scanned_hand")
    assert example.ranks == {"16 joints": 23, "21 points": 38}
    means = {name: off.mean() for name, off in example.errors.items()}  # mm
    assert means["scan"] < means["21 points"] < 3
    assert means["scan and 21 points"] < 1.2
    median = np.median(
        example.away(example.surfaces["scan"], example.hand.faces, example.held_out.points)
    )
    assert median < 0.5


def test_a_hand_is_found_from_joints_and_finger_tips() -> None:
    example = import_module("examples.34_a_hand")
    assert all(solution.converged for solution in example.solutions)
    assert np.median(example.medians) < 2  # mm, with 2 mm of noise
    assert example.apart < 1e-12  # m
