"""Distinct real roots of a polynomial with exact coefficients: a Sturm chain, never rounded."""

import itertools
from collections.abc import Sequence
from fractions import Fraction

__all__ = ["roots_between", "value"]


def roots_between(coefficients: Sequence[Fraction], high: Fraction | None) -> int:
    """Number of distinct roots in (0, high], or beyond 0, of a polynomial, highest power first."""
    first = list(itertools.dropwhile(lambda c: c == 0, coefficients))
    while first and first[-1] == 0:  # roots at 0 are none
        first.pop()
    n = len(first) - 1
    if n < 1:
        return 0
    chain = [first, [c * (n - k) for k, c in enumerate(first[:-1])]]
    while len(chain[-1]) > 1:
        _, rest = _divided(chain[-2], chain[-1])
        if not rest:  # roots that are multiple: the same ones, each once
            return roots_between(_divided(first, chain[-1])[0], high)
        chain.append([-c for c in rest])
    at_zero = [p[-1] for p in chain]
    at_high = [p[0] if high is None else value(p, high) for p in chain]
    return _changes(at_zero) - _changes(at_high)


def _divided(p: list[Fraction], q: list[Fraction]) -> tuple[list[Fraction], list[Fraction]]:
    """Quotient and remainder."""
    rest, quotient = list(p), []
    while len(rest) >= len(q):
        factor = rest[0] / q[0]
        quotient.append(factor)
        for k, c in enumerate(q):
            rest[k] -= factor * c
        rest.pop(0)
    return quotient, list(itertools.dropwhile(lambda c: c == 0, rest))


def value(p: Sequence[Fraction], x: Fraction) -> Fraction:
    total = Fraction(0)
    for c in p:
        total = total * x + c
    return total


def _changes(values: Sequence[Fraction]) -> int:
    signs = [v > 0 for v in values if v != 0]
    return sum(a != b for a, b in itertools.pairwise(signs))
