"""What each algorithm of NLopt 2.10 needs and supports, by its manual or by measurement.

LD_LBFGS_NOCEDAL is left out, because it is a name without an implementation. A global algorithm
searches the box between the bounds until its evaluations are used up.
"""

from collections.abc import Mapping

from workbench.solvers.abilities import Abilities, Boxes, Derivative

COST, GRADIENT = Derivative.COST, Derivative.GRADIENT
UNKNOWN, TAKEN, NEEDED = Boxes.UNKNOWN, Boxes.TAKEN, Boxes.NEEDED


def _everywhere(
    source: str, *, derivative: Derivative = COST, stochastic: bool = False, note: str = ""
) -> Abilities:
    """The abilities of an algorithm that searches the whole box between the bounds."""
    return Abilities(
        derivative, NEEDED, is_global=True, stochastic=stochastic, source=source, note=note
    )


_DIRECT = "Jones, Perttunen and Stuckman 1993"
_DIRECT_L = "Gablonsky and Kelley 2001"
_MLSL = "Rinnooy Kan and Timmer 1987"
_LOCAL = "its local searches are made by the algorithm of the option `local`"
_TNEWTON = "Dembo and Steihaug 1982; Luksan"

ALGORITHMS: Mapping[str, Abilities] = {
    "LD_LBFGS": Abilities(GRADIENT, TAKEN, source="Nocedal 1980; Luksan"),
    "LD_VAR1": Abilities(GRADIENT, TAKEN, source="Vlcek and Luksan 2006", note="rank 1"),
    "LD_VAR2": Abilities(GRADIENT, TAKEN, source="Vlcek and Luksan 2006", note="rank 2"),
    "LD_TNEWTON": Abilities(GRADIENT, TAKEN, source=_TNEWTON),
    "LD_TNEWTON_RESTART": Abilities(GRADIENT, TAKEN, source=_TNEWTON),
    "LD_TNEWTON_PRECOND": Abilities(GRADIENT, TAKEN, source=_TNEWTON),
    "LD_TNEWTON_PRECOND_RESTART": Abilities(GRADIENT, TAKEN, source=_TNEWTON),
    "LD_SLSQP": Abilities(
        GRADIENT,
        TAKEN,
        equations=True,
        inequalities=True,
        source="Kraft 1994",
        note="O(n^3) per iteration",
    ),
    "LD_MMA": Abilities(GRADIENT, TAKEN, inequalities=True, source="Svanberg 2002"),
    "LD_CCSAQ": Abilities(GRADIENT, TAKEN, inequalities=True, source="Svanberg 2002"),
    "LN_BOBYQA": Abilities(COST, TAKEN, source="Powell 2009", note="to about 30 unknowns"),
    "LN_NEWUOA": Abilities(COST, UNKNOWN, source="Powell 2004", note="two unknowns at least"),
    "LN_NEWUOA_BOUND": Abilities(COST, TAKEN, source="Powell 2004", note="two unknowns at least"),
    "LN_COBYLA": Abilities(
        COST,
        TAKEN,
        equations=True,
        inequalities=True,
        source="Powell 1994",
        note="NaN would make it run for ever; it is never shown one",
    ),
    "LN_PRAXIS": Abilities(COST, TAKEN, stochastic=True, source="Brent 1972"),
    "LN_NELDERMEAD": Abilities(COST, TAKEN, source="Nelder and Mead 1965"),
    "LN_SBPLX": Abilities(COST, TAKEN, source="Rowan 1990"),
    "G_MLSL": _everywhere(_MLSL, derivative=GRADIENT, stochastic=True, note=_LOCAL),
    "G_MLSL_LDS": _everywhere(
        _MLSL + "; Kucherenko and Sytsko 2005", derivative=GRADIENT, note=_LOCAL
    ),
    "GD_STOGO": _everywhere("Madsen and Zertchaninov 1998", derivative=GRADIENT),
    "GD_STOGO_RAND": _everywhere(
        "Madsen and Zertchaninov 1998", derivative=GRADIENT, stochastic=True
    ),
    "GN_DIRECT": _everywhere(_DIRECT),
    "GN_DIRECT_NOSCAL": _everywhere(_DIRECT),
    "GN_DIRECT_L": _everywhere(_DIRECT_L),
    "GN_DIRECT_L_NOSCAL": _everywhere(_DIRECT_L),
    "GN_DIRECT_L_RAND": _everywhere(_DIRECT_L, stochastic=True),
    "GN_DIRECT_L_RAND_NOSCAL": _everywhere(_DIRECT_L, stochastic=True),
    "GN_ORIG_DIRECT": _everywhere(_DIRECT),
    "GN_ORIG_DIRECT_L": _everywhere(_DIRECT_L),
    "GN_CRS2_LM": _everywhere("Kaelo and Ali 2006", stochastic=True),
    "GN_ISRES": Abilities(
        COST,
        NEEDED,
        equations=True,
        inequalities=True,
        is_global=True,
        stochastic=True,
        source="Runarsson and Yao 2005",
    ),
    "GN_ESCH": _everywhere("da Silva Santos 2010", stochastic=True),
    "GN_AGS": _everywhere("Sergeyev and Markin 1995", note="to about 10 unknowns"),
}
