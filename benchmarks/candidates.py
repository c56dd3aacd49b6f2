"""Who computes a residual, its Jacobian and a Gauss-Newton step, and whether they agree.

The workbench, with and without its compiled kernels; JAX, PyTorch with smplx, and finite
differences in NumPy; and the least that the hardware allows. All get the same body in double
precision, and return the residual with the Jacobian.
"""

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from importlib.util import find_spec
from typing import Any, TypeVar

import numpy as np
import scipy.linalg
from scipy.linalg.blas import dsyrk

import workbench as wb
from benchmarks.problems import SIGMA, Case, arrays_of, case_of, plain_vertices
from workbench.arrays import Array
from workbench.bodies.forward.compiled import CompiledMesh, joint_library, mesh_library
from workbench.problem import storage

NUMPY, COMPILED = "workbench", "workbench, compiled"
JAX, TORCH, DIFFERENCES, FLOOR = "JAX", "torch (smplx.lbs)", "NumPy, differences", "floor"
SWITCH = "WORKBENCH_COMPILE"
T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class Candidate:
    """Three functions of the flat unknowns x (n,); what they return, `numpy.asarray` can read.

    The tolerances say how far from the workbench they may be: metres, and metres per unit.
    """

    name: str
    forward: Callable[[Array], Any]  # x -> r (m,)
    jacobian: Callable[[Array], tuple[Any, Any]]  # x -> r, J (m, n)
    step: Callable[[Array], Any]  # x -> p (n,), the least |J p + r|
    value_tolerance: float = 1e-10
    jacobian_tolerance: float = 1e-8
    remark: str = ""


class Disagreement(Exception):
    """A candidate computes something else than the workbench."""


def check(candidate: Candidate, case: Case, x: Array) -> dict[str, float]:
    """How far the candidate is from the workbench: m, m per unit, and relative for the step.

    Raises Disagreement beyond the candidate's tolerances.
    """
    ours = case.problem.linearize_at(x, case.fixed)
    r, (also_r, J) = candidate.forward(x), candidate.jacobian(x)
    step, our_step = np.asarray(candidate.step(x)), ours.step()
    away = {
        "value": SIGMA * max(_apart(r, ours.residual), _apart(also_r, ours.residual)),
        "jacobian": SIGMA * _apart(J, ours.jacobian),
        "step": _apart(step, our_step) / float(np.abs(our_step).max()),
    }
    allowed = {
        "value": candidate.value_tolerance,
        "jacobian": candidate.jacobian_tolerance,
        "step": 1e3 * candidate.jacobian_tolerance,  # the condition of J comes in
    }
    for what, distance in away.items():
        if not distance <= allowed[what]:
            raise Disagreement(
                f"{candidate.name} on {case.name}: its {what} is {distance:.1e} from the "
                f"workbench's, and {allowed[what]:.0e} is allowed"
            )
    return away


def _apart(a: Any, b: Any) -> float:
    return float(np.abs(np.asarray(a) - np.asarray(b)).max())


# The workbench


@contextmanager
def compiling(allowed: bool) -> Iterator[None]:
    """Allow the compiled kernel, or not, while a problem is built and first used."""
    before = os.environ.get(SWITCH)
    os.environ[SWITCH] = "1" if allowed else "0"
    _forget()  # what is remembered for the whole process
    try:
        yield
    finally:
        _forget()
        os.environ.pop(SWITCH)
        if before is not None:
            os.environ[SWITCH] = before


def _forget() -> None:
    mesh_library.cache_clear()
    joint_library.cache_clear()
    storage.compiled_gram.cache_clear()


def ways(body: wb.SkinnedBody) -> dict[str, bool]:
    """How the workbench can compute a body here, and whether it may compile for that."""
    found = {NUMPY: False}
    with compiling(True):
        if isinstance(replace(body).numeric.mesh(), CompiledMesh):
            found[COMPILED] = True
    return found


def cases(name: str, body: wb.SkinnedBody) -> dict[str, Case]:
    """The problem of each way that the workbench can compute here, built and used once."""
    made = {}
    for way, allowed in ways(body).items():
        with compiling(allowed):
            case = case_of(name, body)
            case.problem.prepare()
            for x in case.people(2, seed=1):
                case.problem.linearize_at(x, case.fixed).step()
        made[way] = case
    return made


def as_built(way: str, run: Callable[..., T]) -> Callable[..., T]:
    """A function that gets no compiled linear algebra either, if `way` compiles nothing."""

    def plainly(*arguments: Any) -> T:
        before = storage.compiled_gram
        vars(storage)["compiled_gram"] = _nothing
        try:
            return run(*arguments)
        finally:
            vars(storage)["compiled_gram"] = before

    return plainly if way == NUMPY else run


def _nothing() -> None:
    """What `storage.compiled_gram` is without a compiler."""


def ours(name: str, case: Case) -> Candidate:
    """Through Problem.residual, Problem.linearize_at and Linearization.step."""
    problem, fixed = case.problem, case.fixed

    def jacobian(x: Array) -> tuple[Array, Array]:
        here = problem.linearize_at(x, fixed)
        return here.residual, np.asarray(here.jacobian)

    forward: Callable[[Array], Array] = lambda x: problem.residual(x, fixed)  # noqa: E731
    step = as_built(name, lambda x: problem.linearize_at(x, fixed).step())
    return Candidate(name, forward, jacobian, step)


# Peers


def installed(case: Case) -> Iterator[Candidate]:
    """The peers that are here, of those that there are; a line about each that is not."""
    needs: dict[Callable[[Case], Candidate], tuple[str, ...]] = {
        in_jax: ("jax",),
        in_torch: ("torch", "smplx"),
        by_differences: (),
    }
    for make, packages in needs.items():
        missing = [package for package in packages if find_spec(package) is None]
        if missing:
            print(f"skipped {make.__name__}: {' and '.join(missing)} not installed")
        else:
            yield make(case)


def in_jax(case: Case) -> Candidate:
    """plain_vertices, traced and compiled; the arrays are arguments, on the device already."""
    import jax

    jax.config.update("jax_enable_x64", True)
    import jax.numpy as jnp
    from jax.scipy.linalg import cho_factor, cho_solve

    parents, observed = case.body.parents, jnp.asarray(case.fixed)
    arrays = tuple(jnp.asarray(array) for array in arrays_of(case.body))

    def residual(x: Any, arrays: Any, observed: Any) -> Any:
        return (plain_vertices(jnp, arrays, parents, x).reshape(-1) - observed) / SIGMA

    def with_itself(*arguments: Any) -> Any:
        r = residual(*arguments)
        return r, r

    def linearize(*arguments: Any) -> Any:
        J, r = jax.jacfwd(with_itself, has_aux=True)(*arguments)
        return r, J

    def step(*arguments: Any) -> Any:
        r, J = linearize(*arguments)
        return -cho_solve(cho_factor(J.T @ J), J.T @ r)

    def ready(function: Callable[..., Any]) -> Callable[[Array], Any]:
        compiled = jax.jit(function)
        return lambda x: jax.block_until_ready(compiled(x, arrays, observed))

    return Candidate(JAX, ready(residual), ready(linearize), ready(step))


def in_torch(case: Case) -> Candidate:
    """smplx's own function, as its body models call it."""
    import torch
    from smplx.lbs import lbs

    torch.set_num_threads(1)
    body = case.body
    N, K, B = body.n_vertices, body.n_joints, body.n_betas
    template, shapedirs, weights, observed, regressor = map(
        torch.from_numpy,
        (body.template, body.shapedirs, body.weights, case.fixed, body.J_regressor.toarray()),
    )
    posedirs = torch.from_numpy(np.ascontiguousarray(body.posedirs.reshape(3 * N, -1).T))
    parents = torch.tensor(body.parents)

    def residual(x: Any) -> Any:
        pose, betas, trans = x[: 3 * K], x[3 * K : 3 * K + B], x[3 * K + B :]
        shape, turn = betas[None], pose[None]
        v, _ = lbs(shape, turn, template, shapedirs, posedirs, regressor, parents, weights)
        return ((v[0] + trans).reshape(-1) - observed) / SIGMA

    def with_itself(x: Any) -> Any:
        r = residual(x)
        return r, r

    derive = torch.func.jacfwd(with_itself, has_aux=True)

    def linearize(x: Array) -> tuple[Any, Any]:
        with torch.no_grad():
            J, r = derive(torch.from_numpy(x))
            return r, J

    def step(x: Array) -> Any:
        r, J = linearize(x)
        L = torch.linalg.cholesky(J.T @ J)
        return -torch.cholesky_solve((J.T @ r)[:, None], L)[:, 0]

    def forward(x: Array) -> Any:
        with torch.no_grad():
            return residual(torch.from_numpy(x))

    remark = "smplx adds 1e-8 to every angle, which is why it may be further away"
    return Candidate(TORCH, forward, linearize, step, 1e-7, 1e-6, remark)


def by_differences(case: Case) -> Candidate:
    """plain_vertices in NumPy, and one more evaluation for each unknown."""
    arrays, parents, observed = arrays_of(case.body), case.body.parents, case.fixed

    def forward(x: Array) -> Array:
        found: Array = (plain_vertices(np, arrays, parents, x).ravel() - observed) / SIGMA
        return found

    def jacobian(x: Array) -> tuple[Array, Array]:
        r, h = forward(x), 1e-8
        columns = np.empty((len(x), len(r)))
        for i, column in enumerate(columns):
            moved = x.copy()
            moved[i] += h
            np.subtract(forward(moved), r, out=column)
            column /= h
        return r, columns.T

    def step(x: Array) -> Array:
        r, J = jacobian(x)
        return -np.asarray(scipy.linalg.cho_solve(scipy.linalg.cho_factor(J.T @ J), J.T @ r))

    remark = "two-point differences: half the digits are lost"
    return Candidate(DIFFERENCES, forward, jacobian, step, 1e-10, 1e-5, remark)


# What the hardware allows


def floor(case: Case) -> Candidate:
    """Nothing useful, but what everybody has to do at least; never checked.

    Forward: every pose direction is read once (gemv 3 N x 9 (K - 1)). Jacobian: and J (3 N x n) is
    written once. Step: and J'J is formed once (syrk).
    """
    m, n = 3 * case.body.n_vertices, case.problem.free.size
    posedirs = np.ascontiguousarray(case.body.posedirs.reshape(m, -1))
    features = np.ones(posedirs.shape[1])
    J = np.zeros((n, m)).T  # stored column by column, as dsyrk likes it

    def read(x: Array) -> Array:
        return posedirs @ features

    def write(x: Array) -> tuple[Array, Array]:
        r = read(x)
        J.fill(x[0])
        return r, J

    def form(x: Array) -> Array:
        write(x)
        return np.asarray(dsyrk(1.0, J, trans=1))

    return Candidate(FLOOR, read, write, form)
