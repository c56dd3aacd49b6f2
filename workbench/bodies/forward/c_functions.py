"""One vertex and one joint of a linearly blended body in symbols, and the C that is made of them.

Loops over vertices and joints are in `mesh.c` and `joint.c`; the formulas are those of `mesh` and
`motion`. Inputs are columns of numbers whose order is known here and in C only:

    vertex     template (3,) and weights (K,) of one vertex
    shapedirs  (B, 3) of one vertex
    posedirs   (9, 3) of one vertex and one joint; most are zero, and left out
    motion     what the kinematics say at one pose and shape, the same for all vertices: betas,
               then the numbers of a `JointMotion` and of its `MotionDerivatives`

Matrices are columns of numbers, row by row; a motion [R t] (3, 4) is 12 of them.
"""

from __future__ import annotations

from collections.abc import Mapping

import casadi as cs

from workbench.blocks.simd import C_OF, statements
from workbench.bodies.forward.kinematics import bound_motion, followed
from workbench.compiling import source_beside, vectors
from workbench.geometry.rotation import rodrigues

SUMS_AND_PRODUCTS = {op: C_OF[op] for op in (cs.OP_ADD, cs.OP_SUB, cs.OP_MUL, cs.OP_NEG)}
STORED = ("shapedirs", "posedirs")  # what is read in the type in which it is stored
HERE = "/* the functions of c_functions.py */\n"  # the line of the loops that they replace


def mesh_source(parents: tuple[int, ...], B: int, single: bool = False) -> str:
    """The C of surfaces of bodies with B betas on this tree.

    `single` says whether shape and pose directions are stored in single precision.
    """
    added, alone = vertex_functions(B)
    functions = [_in_c(function, "+=") for function in added.values()]
    functions += [_in_c(function, "=") for function in alone.values()]
    sizes = {"STORED": "float" if single else "double"}
    sizes["WIDENED(x)"] = "DOUBLES(x)" if single else "(x)"
    return _source("mesh.c", parents, B, vectors(), sizes, functions)


def joint_source(parents: tuple[int, ...], B: int) -> str:
    """The C of the kinematics of bodies with B betas on this tree."""
    functions = [_in_c(function, "=", C_OF) for function in joint_functions().values()]
    return _source("joint.c", parents, B, "", {}, functions)


def _source(
    file: str,
    parents: tuple[int, ...],
    B: int,
    head: str,
    sizes: Mapping[str, object],
    functions: list[str],
) -> str:
    tree = "{" + ", ".join(map(str, parents)) + "}"
    constants = {"PARENTS": tree, "JOINTS": len(parents), "BETAS": B, **sizes}
    defines = [f"#define {name} {value}" for name, value in constants.items()]
    loops = source_beside(__package__, file).replace(HERE, "\n".join(functions))
    return "\n".join([head, *defines, loops])


def _in_c(function: cs.Function, put: str, c_of: Mapping[int, str] = SUMS_AND_PRODUCTS) -> str:
    """A function as C for several vertices; the input called `motion` is the same for all."""
    names = [function.name_in(i) for i in range(function.n_in())]
    stored = tuple(f"i{i}[" for i, name in enumerate(names) if name in STORED)

    def read(operand: str) -> str:
        return f"WIDENED({operand})" if operand.startswith(stored) else operand

    lines = [
        f"{to} {put} {text.format(*map(read, of))};"
        if to.startswith("o")
        else f"const v {to} = {text.format(*map(read, of))};"
        for to, of, text in statements(function, [name == "motion" for name in names], c_of)
    ]
    kinds = {"motion": "double"} | dict.fromkeys(STORED, "stored")
    typed = [f"const {kinds.get(n, 'anywhere')} *restrict i{i}" for i, n in enumerate(names)]
    head = f"static ALWAYS_INLINE void {function.name()}({', '.join(typed)}, v *restrict o0)"
    return "\n".join([head, "{", *lines, "}", ""])


def vertex_functions(B: int) -> tuple[dict[str, cs.Function], dict[str, cs.Function]]:
    """Functions of columns by name, for a body with B betas: those whose values are summed, others.

    They are small, for one joint or one beta each, so that what they need stays in registers, and
    that joints which leave a vertex alone cost nothing. M = sum_j w_j G_j, (3, 4). Joint k carries
    y_k = w_k G_k [v; 1] and the share w_k; its subtree, (4,), is the sum of both over the joints at
    and below it, and its arm the subtree seen from the joint. `turned` and `turned_d_posed` are
    d(point)/d(pose_k) together, `by_beta` and `shifted` d(point)/d(beta_b). `vjp_of_...` are
    gradients of g . what is named. Values of the first ones are summed over joints, features or
    lanes.
    """
    T, S, betas = cs.SX.sym("T", 3), cs.SX.sym("S", 3, B), cs.SX.sym("betas", B)
    P, P_n, f, f_n = cs.SX.sym("P", 3, 9), cs.SX.sym("P_n", 3), cs.SX.sym("f", 9), cs.SX.sym("f_n")
    w, joint, subtree = cs.SX.sym("w"), cs.SX.sym("joint", 3), cs.SX.sym("subtree", 4)
    v, g, G, M = cs.SX.sym("v", 3), cs.SX.sym("g", 3), cs.SX.sym("G", 12), cs.SX.sym("M", 12)
    S_b, arm, shift = cs.SX.sym("S_b", 3), cs.SX.sym("arm", 3), cs.SX.sym("shift", 3)
    axes, df_n, d_posed = cs.SX.sym("axes", 3, 3), cs.SX.sym("df_n", 3), cs.SX.sym("d_posed", 3, 3)

    def moved_by(G: cs.SX) -> cs.SX:
        R, t = _motion(G)
        return R @ v + t

    def gradient(of: cs.SX, by: cs.SX) -> cs.SX:
        return cs.gradient(cs.dot(g, of), by)

    moved, carried = moved_by(M), w * moved_by(G)
    turned = cs.horzcat(*[cs.cross(axis, arm) for axis in cs.horzsplit(axes)])
    added = (
        _function("posed", P_n * f_n, posedirs=P_n, motion=f_n),
        _function("d_posed", P_n @ df_n.T, posedirs=P_n, motion=df_n),
        _function("blended", w * G, weight=w, motion=G),
        _function("add_to_parent", subtree, subtree=subtree),
        _function("turned", turned, arm=arm, motion=axes),
        _function("shifted", w * shift, weight=w, motion=shift),
        _function("vjp_of_features", gradient(P @ f, f), posedirs=P, g=g),
        _function("vjp_of_G", gradient(carried, G), weight=w, v=v, g=g),
        _function("vjp_of_betas", gradient(S @ betas, betas), shapedirs=S, g=g),
    )
    alone = (
        _function("shaped", T + S @ betas, template=T, shapedirs=S, motion=betas),
        _function("moved", moved, M=M, v=v),
        _function("carried", cs.vertcat(carried, w), weight=w, motion=G, v=v),
        _function("arm", subtree[:3] - subtree[3] * joint, subtree=subtree, motion=joint),
        _function("turned_d_posed", _motion(M)[0] @ d_posed, M=M, d_posed=d_posed),
        _function("by_beta", _motion(M)[0] @ S_b, shapedirs=S_b, M=M),
        _function("vjp_of_rest", gradient(moved, v), M=M, g=g),
    )
    by_name = [{function.name(): function for function in some} for some in (added, alone)]
    return by_name[0], by_name[1]


def joint_functions() -> dict[str, cs.Function]:
    """Functions of columns by name, of joint k.

    `unbind` is the transpose of a joint's rotation in the world in the bind pose, `above` the
    motion of the parent, `d_local` R_k and its derivative by each of the three numbers (36,), and
    `axes` are those about which the world turns by pose_k: R_up^-1 w is that of dR R'.
    """
    pose, place, d_local = cs.SX.sym("pose", 3), cs.SX.sym("place", 3), cs.SX.sym("d_local", 36)
    R, unbind, above, G = (
        cs.SX.sym(n, m) for n, m in (("R", 9), ("u", 9), ("above", 12), ("G", 12))
    )
    turn = rodrigues(pose)
    columns = cs.horzsplit(cs.jacobian(cs.vec(turn), pose))
    turns = [turn, *(cs.reshape(column, 3, 3) for column in columns)]
    local, *changes = (_square(part) for part in cs.vertsplit(d_local, 9))
    above_k = _motion(G)[0] @ _square(unbind).T
    axes = []
    for D in changes:
        skew = D @ local.T
        axes.append(above_k @ cs.vertcat(skew[2, 1], skew[0, 2], skew[1, 0]))
    world = cs.horzcat(*followed(_motion(above), _square(R), place))
    bound = bound_motion(_motion(G), _square(unbind), place)
    functions = (
        _function("local", _rows(turn), pose=pose),
        _function("d_local", cs.vertcat(*map(_rows, turns)), pose=pose),
        _function("placed", _square(unbind) @ place, unbind=unbind, place=place),
        _function("follow", _rows(world), above=above, R=R, place=place),
        _function("bound", _rows(bound), world=G, unbind=unbind, place=place),
        _function("axes", cs.vertcat(*axes), above=G, unbind=unbind, d_local=d_local),
    )
    return {function.name(): function for function in functions}


def _function(name: str, output: cs.SX, **inputs: cs.SX) -> cs.Function:
    """A function from columns of numbers to one, with the names of its inputs."""
    columns = [cs.vec(column) for column in inputs.values()]
    return cs.Function(name, columns, [cs.densify(cs.vec(output))], [*inputs], ["out"])


def _rows(matrix: cs.SX) -> cs.SX:
    return cs.vec(matrix.T)


def _square(column: cs.SX) -> cs.SX:
    return cs.reshape(column, 3, 3).T


def _motion(column: cs.SX) -> tuple[cs.SX, cs.SX]:
    """The rotation (3, 3) and the place (3, 1) of a motion."""
    matrix = cs.reshape(column, 4, 3).T
    return matrix[:, :3], matrix[:, 3]
