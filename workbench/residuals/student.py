"""Student's t with several degrees of freedom: like a Gaussian, with tails that are not as light.

x ~ t(nu, mu, S) in d dimensions has the log density, up to a constant,

    -1/2 (nu + d) log(1 + m^2 / nu),   m^2 = (x - mu)' S^-1 (x - mu).

It is a Gaussian of covariance S / w whose precision w is unknown, and drawn anew for each x from a
Gamma distribution of the mean 1 and the shape nu / 2: what is unusual in one of its numbers is
expected to be so in the others (Lange, Little and Taylor, Robust statistical modeling using the t
distribution, 1989). For nu -> infinity it is the Gaussian of covariance S.

Observations often determine only r directions of x, and the prior has to fill in the others. If all
d numbers are estimated together, the likeliest precision w counts all d of them as evidence that x
is usual, although d - r of them are near their expected values only because no observation moves
them. The precision is then far too large, and x is drawn to the mean. If the directions that are
not observed are integrated out instead, the r others again have a t distribution. Its squared
distance is the least m^2 that these r directions leave possible, and its density is the one above
with r in place of d; `counted` is this r. With the unobserved directions at their likeliest places,
the cost is exactly minus the log density of the r directions. As a function of all d numbers it
belongs to no density: if nu + r <= d, its integral is infinite, and nothing can be sampled unless
at least d - nu - r directions are determined otherwise.

Where m^2 is large, J'J is larger than the Hessian. With u = m^2 / nu, it is larger by the factor
(1 + u) log(1 + u) / u across the way to the mean; along this way the Hessian is negative for u > 1.
Laplace's standard deviations of what hardly anything but this term determines are then too small.
"""

import casadi as cs
import numpy as np
from numpy.typing import ArrayLike

from workbench.errors import BadResidual
from workbench.residuals.arguments import named
from workbench.residuals.gaussian import gaussian
from workbench.residuals.residual import Residual

SMALL = 1e-5  # of m^2 / nu: below, the logarithm is its series


def student_t(
    expression: cs.MX,
    *,
    dof: float,
    mean: ArrayLike = 0.0,
    scale: ArrayLike = 1.0,
    counted: float | None = None,
    name: str | None = None,
) -> Residual:
    """g(m^2) L^-1 (x - mean), with S = L L' and m^2 g(m^2)^2 = (nu + d) log(1 + m^2 / nu).

    Half the sum of its d squares is the log density at the mean less the log density at x. x is a
    block's symbol or an expression of d numbers, and `dof` is nu. `scale` is the matrix S, which is
    not the covariance: the covariance is nu / (nu - 2) S if nu > 2, and infinite otherwise. `mean`
    and `scale` have the shapes that the mean and the covariance of `gaussian` may have, and raise
    the same errors. `counted` says how many of the numbers of x the observations determine; it
    takes the place of d in the formula, and is d if not given. With fewer than d, the residual is
    no longer the log density of x: use it to find likeliest points, and not to draw samples.
    Raises BadResidual for degrees of freedom that are not above 0, and a `counted` that is not
    above 0 and at most d.
    """
    name = name or named("student_t", expression)
    nu = dof
    if not isinstance(nu, (int, float, np.number)) or not 0 < nu < np.inf:
        raise BadResidual(
            f"residual {name!r} needs a number of degrees of freedom above 0, not {nu!r}; with "
            "infinitely many it is gaussian(...)"
        )
    z = gaussian(expression, mean=mean, covariance=scale, name=name).whitened
    d = int(z.shape[0])
    r = d if counted is None else counted
    if not isinstance(r, (int, float, np.number)) or not 0 < r <= d:
        raise BadResidual(
            f"residual {name!r} is about {d} numbers, of which {r!r} cannot be counted; give a "
            f"number above 0 and at most {d}"
        )
    u = cs.dot(z, z) / nu
    small = u < SMALL
    safe = cs.if_else(small, 1, u)  # guarded: both branches are evaluated
    shrunk = cs.if_else(small, 1 - u / 2 + u**2 / 3, cs.log1p(safe) / safe)
    return Residual(name, cs.sqrt((nu + r) / nu * shrunk) * z, 1.0)
