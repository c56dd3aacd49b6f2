"""Every example runs, and what it claims holds."""

import itertools
import sys
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import workbench as wb
from tests.tiers import few
from workbench.experiments import find

FOLDER = Path(__file__).parents[1] / "examples"
EXAMPLES = sorted(path.stem for path in FOLDER.glob("[0-9]*.py"))
MINUTES = ("15_how_well_a_person_is_known", "17_posterior_of_scape")  # which are not run here
QUICK = (
    "01_polynomial",
    "02_known_correspondences",
    "03_what_joints_cannot_see",
    "05_one_camera",
    "07_many_solvers",
    "11_parts_of_a_pose",
    "36_a_file_of_your_own",
)
Claim = Callable[[Any], None]
CLAIMS: dict[str, list[Claim]] = {}


def claims_of(name: str) -> Callable[[Claim], Claim]:
    def register(claim: Claim) -> Claim:
        CLAIMS.setdefault(name, []).append(claim)
        return claim

    return register


@pytest.mark.parametrize("name", few((n for n in EXAMPLES if n not in MINUTES), keep=QUICK))
def test_example_runs_and_its_claims_hold(name: str) -> None:
    example = import_module(f"examples.{name}")
    try:
        for claim in CLAIMS.get(name, ()):
            claim(example)
    finally:
        del sys.modules[f"examples.{name}"]  # and the memory that it holds


@claims_of("01_polynomial")
def the_cubic_is_found_within_its_spread(example: Any) -> None:
    off = np.abs(example.solution.values["w"] - example.truth) / example.spread
    assert example.solution.converged
    assert off.max() < 4


@claims_of("02_known_correspondences")
def the_body_is_found_within_the_noise(example: Any) -> None:
    assert example.solution.converged
    assert example.error.mean() < 0.0007  # 85 parameters average 1,107 noisy coordinates


@claims_of("03_what_joints_cannot_see")
def joints_leave_thirty_two_directions_unseen(example: Any) -> None:
    assert example.diagnosis.rank == 40
    assert len(example.diagnosis.null_directions) == 32
    assert len(example.twists) == 17
    assert example.joints_moved < 1e-6  # m: second order in a turn of 1 mrad
    assert example.skin_moved > 1e-5


@claims_of("37_soft_tissue")
def soft_tissue_follows_a_motion(example: Any) -> None:
    assert example.same
    assert example.explained > 0.7
    once = [far for (_, times), far in sorted(example.farthest.items()) if times == 1]
    assert once == sorted(once), "the heavier, the farther"


@claims_of("38_soft_tissue_as_unknowns")
def tissue_is_found_with_pose_and_shape(example: Any) -> None:
    assert max(example.errors["with"].values()) < 1e-6
    assert example.errors["without"]["pose"] > 0.03, "rad: joints bend for what tissue does"
    for name, deviation in example.deviations.items():
        assert 0.5 < example.rms[name] / deviation < 1.5


@claims_of("05_one_camera")
def one_camera_sees_across_and_not_along(example: Any) -> None:
    one, two = example.errors["one camera"].mean(axis=0), example.errors["two cameras"].mean(axis=0)
    assert one[2] > 4 * one[0]
    assert two.max() < 10  # mm
    assert example.sigmas["one camera"][2] > 5 * example.sigmas["two cameras"][2]


@claims_of("29_the_gauge_of_bundle_adjustment")
def bundle_adjustment_is_invariant_to_similarities(example: Any) -> None:
    kinds = [direction.kind for direction in example.diagnosis.null_directions]
    assert sorted(kinds) == ["rotation"] * 3 + ["scale"] + ["translation"] * 3
    first = example.remedies[0]
    assert (first.acts, first.cured) == (2, True)
    assert first.what.startswith("hold camera ")
    assert example.solution.converged


@claims_of("12_a_video")
def a_sequence_shares_a_shape_and_fills_gaps(example: Any) -> None:
    assert example.together.converged
    alone, together = example.errors["frame by frame"], example.errors["as a sequence"]
    seen = np.delete(np.arange(example.FRAMES), example.hidden)
    assert together[seen].mean() < 0.6 * alone[seen].mean()
    assert together[example.hidden].mean() < 20 < 100 < alone[example.hidden].mean()  # mm


@claims_of("36_a_file_of_your_own")
def a_file_of_ones_own_is_taken_by_the_commands(example: Any) -> None:
    setup = find(str(FOLDER / "36_a_file_of_your_own.py")).setup()
    found = dict(setup.start) | wb.solve(setup.problem, setup.start).values
    places = example.body.joints(**{n: found[n] for n in ("pose", "betas", "trans")})
    assert np.abs(places[example.ankles, 1] - 0.08).max() < 0.005
    assert abs(places[example.number["right_wrist"], 2] - 0.45) < 0.005
    assert wb.diagnose(setup.problem.without(*setup.priors), found).rank == 3


@claims_of("06_outliers")
def robust_kernels_leave_outliers_alone(example: Any) -> None:
    squares, huber, geman = (example.errors[name].mean() for name in example.KERNELS)
    assert squares > 100  # mm
    assert squares > 5 * huber > 10 * geman
    np.testing.assert_allclose(abs(example.strongest), 1 / np.sqrt(3), atol=0.02)
    assert example.rho["Geman-McClure"].max() < 1


@claims_of("08_posterior")
def the_posterior_leans_and_laplace_does_not(example: Any) -> None:
    assert example.posterior.usable
    a, k, c = example.lean
    assert a > 1.2
    assert k > 1
    assert c < 0.8
    inside = (example.by_draws[:, 0] < example.truth) & (example.truth < example.by_draws[:, 1])
    assert inside.all()


@claims_of("11_parts_of_a_pose")
def parts_of_a_pose_are_free_by_name_and_made_of_anything(example: Any) -> None:
    held = example.placed.values["pose"][1:]
    np.testing.assert_array_equal(held, example.body.start()["pose"][1:])
    assert example.staged.cost < 1e-6 < example.placed.cost
    assert any(name.startswith("a turn of rest[") for name in example.unseen)
    assert example.found.converged
    assert np.abs(example.found.values["coefficients"]).max() < 1e-6


@claims_of("14_three_body_models")
def three_body_models_are_fitted_to_the_same_points(example: Any) -> None:
    assert all(fit.solution.converged for some in example.fits.values() for fit in some)
    assert example.lower["SCAPE"] == example.lower["BlendSCAPE"] == 12
    held_out = {n: np.array([f.held_out.mean() for f in some]) for n, some in example.fits.items()}
    means = [off.mean() for off in held_out.values()]
    errors = [off.std() / np.sqrt(len(off)) for off in held_out.values()]
    assert max(means) - min(means) < min(errors)
    assert 10 < example.apart["SCAPE"].mean() < example.apart["BlendSCAPE"].mean() < 30  # mm


@claims_of("16_nine_numbers_or_three")
def nine_numbers_cost_more_except_for_one_small_turn(example: Any) -> None:
    medians = {key: np.median(counts) for key, counts in example.iterations.items()}
    for solver in ("ipopt", "sqp"):
        small, large = (
            [medians[case, form, solver] for form in ("nine", "three")]
            for case in ("1 rotation by 30", "4 rotations by 90")
        )
        assert small[0] < small[1]
        assert large[0] > large[1]
    for (case, form, solver), some in example.runs.items():
        assert all(one.violation < (1e-6 if form == "nine" else 1e-14) for one in some)
        assert example.at_best[case, form, solver] >= 18


@claims_of("18_a_body_on_a_scan")
def free_vertices_come_nearer_to_a_scanned_person_than_the_model(example: Any) -> None:
    assert not example.warnings
    assert max(example.model) < 15  # mm
    seen, hidden = np.array(example.free) / np.array(example.model)
    assert seen < 0.8
    assert hidden < 1


@claims_of("32_a_skeleton_from_meshes")
def an_arm_gets_the_skeleton_that_moved_it(example: Any) -> None:
    assert example.body.n_joints == 5
    assert max(example.found.rms, example.held_out) < 1e-8  # m
    assert example.gaps.min(axis=1).max() < 1e-6
    assert example.edges == {frozenset(pair) for pair in itertools.pairwise(example.NAMES)}
    (slides,) = (note for note in example.found.notes if "one axis" in note)
    assert "along (0.00, 0.00, 1.00)" in slides


@claims_of("30_what_to_measure_next")
def a_second_camera_and_ten_markers_are_chosen(example: Any) -> None:
    assert example.second.gain > 10
    assert example.second.best != example.overall.best
    assert all(len(set(found.chosen)) == 10 for found in (example.ten, example.for_stature))
    assert example.for_stature.after.sd < 0.01 < 0.05 < example.for_stature.before.sd  # m


@claims_of("31_a_scanned_hand")
def a_scan_says_more_of_a_hand_than_its_skeleton(example: Any) -> None:
    assert example.ranks == {"16 joints": 23, "21 points": 38}
    means = {name: off.mean() for name, off in example.errors.items()}  # mm
    assert means["scan"] < means["21 points"] < 3
    assert means["scan and 21 points"] < 1.2
    median = np.median(
        example.away(example.surfaces["scan"], example.hand.faces, example.held_out.points)
    )
    assert median < 0.5


@claims_of("20_ablated_smpl")
def every_ablation_is_seen_and_no_fit_makes_up_for_it(example: Any) -> None:
    assert example.away["no blend weights"].max() > 50  # mm
    assert 1 < example.away["no pose blend shapes"].mean() < 5
    assert example.away["no shape blend shapes"].mean() > 30
    assert all(left > 1 for left in example.residuals_left.values())


@claims_of("22_linear_blending_fails")
def linear_blending_fails_as_the_laws_say(example: Any) -> None:
    assert example.off_the_law < 1e-12
    assert example.off_the_integral < 1e-3
    linear, dual, smpl = (example.wrist[name][-1] for name in example.ways)
    assert linear < smpl < 1
    np.testing.assert_allclose(dual, 1, atol=1e-12)


@claims_of("23_predicting_blend_shapes")
def only_rotation_elements_come_back_after_one_turn(example: Any) -> None:
    grown = example.once_round
    assert abs(grown["LBS + rotation elements (SMPL)"]) < 1e-9  # mm
    assert grown["LBS + theta"] > 1
    assert grown["LBS + quaternions"] > 1
    best, *_, worst = sorted(example.errors, key=example.errors.__getitem__)
    assert (best, worst) == ("LBS + rotation elements (SMPL)", "linear blending (LBS)")


@claims_of("24_shape_directions")
def shape_directions_explain_and_joints_go_with_them(example: Any) -> None:
    assert (np.diff(example.left, axis=0) <= 1e-15).all()
    assert example.left[-1].mean() < 0.2 * example.left[0].mean()
    assert example.moved.max() > 0.1  # m
    assert example.wrong.max() > 0.03
    assert sum(count for count, _ in example.PUBLISHED.values()) == 6_014_970
