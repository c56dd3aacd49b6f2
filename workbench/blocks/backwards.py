"""Graphs whose Jacobians CasADi may take in either direction.

CasADi 3.8 takes a Jacobian of fewer rows than columns backwards, and then loses entries of
`matrix + scalar`: of the derivative by the scalar all but the first row come out zero. It does not
where the scalar is repeated to the size of the matrix first.
"""

import casadi as cs

LOSES = (cs.OP_ADD, cs.OP_SUB, cs.OP_FMOD, cs.OP_REMAINDER)


def scalars_repeated(expression: cs.MX) -> cs.MX:
    """An equal expression in which every scalar is repeated to a matrix before it is added to one.

    casadi.jacobian of the result by a symbol is right forwards and backwards. Functions that the
    expression calls without being inlined by CasADi are left as they are.
    """
    graph = cs.Function("graph", cs.symvar(expression), [expression])
    sums, repeated = [], []
    for k in range(graph.n_instructions()):
        if graph.instruction_id(k) in LOSES:
            found = graph.instruction_MX(k)
            a, b = found.dep(0), found.dep(1)
            if a.is_scalar() != b.is_scalar() and not (a if a.is_scalar() else b).is_constant():
                sums.append(found)
                repeated.append(_repeated(graph.instruction_id(k), a, b))
    if not sums:
        return expression
    # each sum gets a symbol, and the sums are put back one after the other, in their order
    symbols = [cs.MX.sym(f"sum {i}", found.sparsity()) for i, found in enumerate(sums)]
    *parts, last = cs.graph_substitute([*repeated, expression], sums, symbols)
    known: list[cs.MX] = []
    for part in parts:
        known.append(_put(part, symbols[: len(known)], known))
    return _put(last, symbols, known)


def _put(expression: cs.MX, symbols: list[cs.MX], known: list[cs.MX]) -> cs.MX:
    read = {symbol.__hash__() for symbol in cs.symvar(expression)}
    some = [i for i, symbol in enumerate(symbols) if symbol.__hash__() in read]
    if not some:
        return expression
    return cs.graph_substitute(expression, [symbols[i] for i in some], [known[i] for i in some])


def _repeated(operation: int, a: cs.MX, b: cs.MX) -> cs.MX:
    if a.is_scalar():
        a = cs.repmat(a, *b.shape)
    else:
        b = cs.repmat(b, *a.shape)
    named = {cs.OP_ADD: cs.plus, cs.OP_SUB: cs.minus, cs.OP_FMOD: cs.fmod}
    return named.get(operation, cs.remainder)(a, b)
