"""Derivatives of the functions of one or two numbers that steps call, where they are more than a product.

Each takes the operands, the value, and the rates of the operands, and returns the rate of the value. A rate that meets
an infinite derivative counts only where it is not zero. At a kink the derivative is that of the branch that the value
takes, which is one-sided.
"""

import math


def power_rate(base: float, exponent: float, value: float, base_rate: float, exponent_rate: float) -> float:
    """Rate of ``base ** exponent``; at a base of zero that of the exponents above one, which is zero or, for 1, one."""
    if base == 0.0:
        return base_rate if exponent == 1.0 else 0.0
    rate = 0.0
    if base_rate != 0.0:
        rate += exponent * value / base * base_rate
    if exponent_rate != 0.0 and value != 0.0:
        rate += value * math.log(abs(base)) * exponent_rate
    return rate


def root_rate(value: float, rate: float) -> float:
    """Rate of a square root."""
    if rate == 0.0:
        return 0.0
    return 0.5 * rate / value if value != 0.0 else math.copysign(math.inf, rate)


def size_rate(x: float, rate: float) -> float:
    """Rate of ``|x|``; at zero that of the direction in which x moves."""
    if x > 0.0:
        return rate
    return -rate if x < 0.0 else abs(rate)


def quotient(x: float, y: float) -> float:
    """x / y, infinite or not a number where y is zero."""
    if y == 0.0:
        return math.nan if x == 0.0 else math.copysign(math.inf, x)
    return x / y


def distance_rate(x: float, y: float, value: float, x_rate: float, y_rate: float) -> float:
    """Rate of ``hypot(x, y)``."""
    if value == 0.0:
        return math.sqrt(x_rate * x_rate + y_rate * y_rate)
    return x / value * x_rate + y / value * y_rate


def signed_rate(x: float, sign: float, rate: float) -> float:
    """Rate of ``copysign(x, sign)``."""
    same = math.copysign(1.0, x) == math.copysign(1.0, sign)
    return rate if same else -rate
