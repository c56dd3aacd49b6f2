"""Which solvers an experiment compares, by their names in `SOLVERS`."""

SECOND_ORDER = ("trust-region", "gauss-newton", "levenberg-marquardt", "ipopt")
LARGE = (*SECOND_ORDER, "nlopt-lbfgs")  # also of problems whose exact Hessian takes long
GRADED = (*SECOND_ORDER, "ipopt-exact", "nlopt-lbfgs")
MANY = (*GRADED, "nlopt-tnewton", "nlopt-slsqp")
BOUNDED = ("ipopt", "ipopt-exact", "nlopt-lbfgs", "nlopt-slsqp")
