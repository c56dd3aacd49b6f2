"""How many minutes each exercise takes, as its author guesses; nobody has been measured yet.

`workbench lecture mark` says what students of a class needed. The minutes of exercises with numbers
of each student's own stand in `variants.py`.
"""

ESTIMATED: dict[int, dict[str, int]] = {
    1: {"polynomial": 5, "linear_fit": 15, "shortening": 10, "parameter_count": 10, "is_linear": 20, "predict": 30},
    2: {"hat": 5, "rodrigues": 20, "angle_between": 15, "shorter": 15, "nearest_rotation": 15, "mean_rotation": 15, "third": 30},
    3: {"inverse": 5, "turned_body": 10, "world_rotations": 10, "posed_joints": 15, "binding": 20, "reach": 35},
    4: {"blend": 15, "radius_left": 15, "volume_lost": 20, "blended_turn": 15, "blend_quaternions": 20, "weights": 30, "first_weights": 25},
    5: {"shares": 10, "exact": 15, "features": 10, "learn": 15, "directions": 20, "regressor": 30, "mixed": 20},
    6: {"residual": 15, "jacobian": 20, "gradient": 5, "numeric_jacobian": 15, "gauss_newton_step": 10, "left_out": 20, "fit": 30},
    7: {"damped_step": 15, "gain": 15, "cauchy_point": 15, "dogleg_step": 25, "damping_for": 25, "fit": 40},
    8: {"rank": 10, "null_space": 10, "depends": 15, "rank_of_tree": 20, "sigmas": 25, "markers": 40},
    9: {"project": 10, "depth": 5, "keypoint_residual": 10, "triangulate": 20, "place": 20, "fit": 30},
    10: {"whitened": 10, "rho": 5, "influence": 10, "shrunk": 10, "max_mixture": 20, "line": 30},
    11: {"target": 5, "effort_until": 10, "ratios": 15, "profile": 15, "wilson": 15, "turned_round": 20},
    12: {"log_posterior": 15, "deviations": 15, "interval": 10, "next_point": 10, "stretch": 15, "draw": 40},
    13: {"taught_by": 5, "unevenness": 10, "ridge": 15, "shape_space": 20, "weights_of": 25, "rest_shape": 30},
    14: {"frame": 10, "deformation": 10, "edge_matrix": 15, "stitch": 15, "blend_volume": 20, "explained": 15},
    15: {"closest_on_triangle": 25, "icp_step": 15, "distance_gradient": 20, "robust_weight": 20, "coupling_residual": 10, "align": 45},
    16: {"torso_depth": 10, "keypoint_cost": 10, "bending_cost": 20, "mixture_costs": 20, "sphere_slope": 10, "fitted_joints": 45},
    17: {"smooth_residual": 10, "worth": 15, "worth_of_errors": 20, "arrow_solve": 30, "carried": 20, "filled": 25},
    18: {"pose_of": 5, "components_needed": 10, "mirrored": 15, "whole_pose": 10, "seen_turns": 30},
    19: {"wobble": 20, "one_step": 15, "free_run": 10, "stabilized": 30, "felt": 20, "joint_between": 30},
}  # fmt: skip
