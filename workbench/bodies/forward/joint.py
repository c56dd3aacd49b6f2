"""One joint of a kinematic tree in symbols: what compiled kinematics are made from.

The formulas are those of `kinematics` and `motion`, which write them for whole bodies. Matrices are
columns of numbers, row by row; a motion [R t] (3, 4) is 12 of them. Loops over the tree are in
`joint_loops.c`, with what is a difference or a copy of these numbers: the features of a pose, and
how betas shift motions. Both ways are compared before the library is used.
"""

from __future__ import annotations

import casadi as cs

from workbench.bodies.forward.kinematics import bound_motion, followed, local_slopes, turning_axes
from workbench.bodies.forward.vertex import function_of_columns, matrix_of_rows
from workbench.geometry.rotation import rodrigues


def joint_functions() -> dict[str, cs.Function]:
    """Functions of columns by name.

    `above` is the motion of the parent in the world, `unbind` the transpose of the joint's rotation
    in the bind pose.

        local        (pose_k) -> R_k, (9,)
        local_slopes (pose_k) -> R_k and its derivative by each of the three numbers, (36,)
        placed       (unbind of the parent, from the parent to k at rest) -> in its frame, (3,) m
        follow       (above, R_k, place in the parent's frame) -> the motion in the world, (12,)
        bound        (motion in the world, unbind, joint at rest) -> G_k, (12,)
        axes         (above, R_k and its slopes) -> the axes about which pose_k turns, (9,)
    """
    pose, R, unbind = cs.SX.sym("pose", 3), cs.SX.sym("R", 9), cs.SX.sym("unbind", 9)
    above, world, place = cs.SX.sym("above", 12), cs.SX.sym("world", 12), cs.SX.sym("place", 3)
    sloped = cs.SX.sym("sloped", 36)
    turn = rodrigues(pose)
    ((by_x, by_y, by_z),) = local_slopes(pose, turn)
    R_up, t_up = _motion(above)
    R_k, t_k = _motion(world)
    own, *slopes = (_square(part) for part in cs.vertsplit(sloped, 9))
    axes = turning_axes([slopes], own, [R_up])
    turns = turn, by_x, by_y, by_z
    made = (
        function_of_columns("local", _rows(turn), pose=pose),
        function_of_columns("local_slopes", cs.vertcat(*map(_rows, turns)), pose=pose),
        function_of_columns("placed", _square(unbind) @ place, unbind=unbind, place=place),
        function_of_columns(
            "follow",
            _rows(cs.horzcat(*followed((R_up, t_up), _square(R), place))),
            above=above,
            R=R,
            place=place,
        ),
        function_of_columns(
            "bound",
            _rows(bound_motion((R_k, t_k), _square(unbind), place)),
            world=world,
            unbind=unbind,
            place=place,
        ),
        function_of_columns("axes", cs.vertcat(*axes), above=above, sloped=sloped),
    )
    return {function.name(): function for function in made}


def _rows(matrix: cs.SX) -> cs.SX:
    """A matrix as a column of its numbers, row by row."""
    return cs.vec(matrix.T)


def _square(column: cs.SX) -> cs.SX:
    return matrix_of_rows(column, 3, 3)


def _motion(column: cs.SX) -> tuple[cs.SX, cs.SX]:
    """The rotation (3, 3) and the place (3, 1) of a motion."""
    matrix = matrix_of_rows(column, 3, 4)
    return matrix[:, :3], matrix[:, 3]
