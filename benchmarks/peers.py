"""Others who can do it: PyTorch with smplx, JAX, and finite differences in NumPy.

All get the same body in double precision, and return the residual with the Jacobian.
"""

from collections.abc import Callable, Iterator
from dataclasses import fields
from importlib.util import find_spec
from typing import Any

import numpy as np
import scipy.linalg

from benchmarks import plain
from benchmarks.bodies_made_up import SIGMA, Case
from benchmarks.candidates import Candidate
from workbench.arrays import Array

JAX, TORCH, DIFFERENCES = "JAX", "torch (smplx.lbs)", "NumPy, differences"


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
    """plain.vertices traced and compiled; the arrays are arguments, on the device already."""
    import jax

    jax.config.update("jax_enable_x64", True)
    import jax.numpy as jnp
    from jax.scipy.linalg import cho_factor, cho_solve

    parents, observed = case.body.parents, jnp.asarray(case.fixed)
    arrays = tuple(jnp.asarray(array) for array in _listed(case))

    def residual(x: Any, arrays: Any, observed: Any) -> Any:
        return (plain.vertices(jnp, arrays, parents, x).reshape(-1) - observed) / SIGMA

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
    """plain.vertices in NumPy, and one more evaluation for each unknown."""
    arrays, parents, observed = tuple(_listed(case)), case.body.parents, case.fixed

    def forward(x: Array) -> Array:
        found: Array = (plain.vertices(np, arrays, parents, x).ravel() - observed) / SIGMA
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


def _listed(case: Case) -> list[Array]:
    arrays = plain.Arrays.of(case.body)
    return [getattr(arrays, field.name) for field in fields(arrays)]
