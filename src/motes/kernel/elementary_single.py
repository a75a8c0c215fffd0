"""Elementary functions on float32 scalars, as polynomials that a loop can run in SIMD registers.

Every operation is float32 or int32; nothing is called that is not inlined, nothing branches, and
the order of operations is part of the accuracy, so that these compile with `jit.EXACT`. Reduction
of the argument follows Cody and Waite (Software Manual for the Elementary Functions, 1980); the
coefficients are minimax polynomials of our own, found by Remez exchange. The sign of a zero has no
meaning here: -0 counts as 0.
"""

from __future__ import annotations

from typing import Any

import numpy as np

Real = np.float32


def _reals(*values: float) -> tuple[np.float32, ...]:
    return tuple(Real(value) for value in values)


ZERO, HALF, ONE, TWO = _reals(0, 0.5, 1, 2)
INFINITY, NAN = _reals(np.inf, np.nan)
ROUND = Real(1.5 * 2.0**23)
"""Adding it rounds to an integer, which is then found in the low bits of the sum."""
ROUND_BITS = ROUND.view(np.int32)
SPLIT = np.int32(-(2**12))
"""Mask that keeps 12 bits of a significand, so that products of two such numbers are exact."""

LOG2_E = Real(1.4426950408889634)
LN2 = Real(0.6931471805599453)
LN2_HIGH, LN2_LOW = _reals(0.693115234375, 3.1946184945309415e-05)
TWO_OVER_LN2, TWO_OVER_LN2_HIGH, TWO_OVER_LN2_LOW = _reals(
    2.8853900817779268, 2.884765625, 0.0006244567779268147
)
TWO_OVER_PI = Real(0.6366197723675814)
QUARTER_TURN = _reals(
    1.5703125, 0.0004837512969970703, 7.549533620476723e-08, 2.563344151594519e-12
)
"""Pi/2 in four parts; up to 6500 times each of the first three is exact."""
PI, HALF_PI, QUARTER_PI = _reals(np.pi, np.pi / 2, np.pi / 4)
TAN_EIGHTH_PI = Real(0.41421356237309503)

TINY = Real(2.0**-126)
LINEAR = Real(2.0**-30)
"""Below it 1 - exp(-z) is z."""
SUBNORMAL_SCALE = Real(2.0**23)
SQRT_HALF_BITS = Real(0.7071067811865476).view(np.int32)
EXPONENT_OF_ONE = ONE.view(np.int32)

EXP = _reals(0.5, 0.16666543, 0.04166628, 0.0083665837, 0.0013946424)
LOG = _reals(0.66666776, 0.39977497, 0.29873073)
SIN = _reals(-0.16666667, 0.008333329, -0.0001983933, 2.7182746e-06)
COS = _reals(0.041666646, -0.0013887364, 2.443809e-05)
ATAN = _reals(-0.33333316, 0.19998484, -0.14243738, 0.10595141, -0.060811598)


def small_exp(r: Any) -> Any:
    """exp(r) - 1 for |r| <= ln(2) / 2."""
    r2 = r * r  # Estrin's scheme: half as many operations wait for one another as in Horner's.
    p = (EXP[0] + r * EXP[1]) + r2 * ((EXP[2] + r * EXP[3]) + r2 * EXP[4])
    return r + r2 * p


def reduced_exp(x: Any) -> tuple[Any, Any]:
    """The q and k of exp(x) = (1 + q) 2^k, for -104 <= x <= 89."""
    rounded = x * LOG2_E + ROUND
    n = rounded - ROUND
    q = small_exp((x - n * LN2_HIGH) - n * LN2_LOW)
    return q, np.int32(np.float32(rounded).view(np.int32) - ROUND_BITS)


def scaled(x: Any, k: Any) -> Any:
    """x 2^k in two factors, so that overflow and gradual underflow come out right."""
    half = np.int32(k >> np.int32(1))
    rest = np.int32(k - half)
    first = np.int32(np.int32(half + np.int32(127)) << np.int32(23)).view(np.float32)
    second = np.int32(np.int32(rest + np.int32(127)) << np.int32(23)).view(np.float32)
    return x * first * second


def exp(x: Any) -> Any:
    """Exponential. Error below 1.5 ULP; underflows to 0, overflows to infinity."""
    x = Real(89) if x > Real(89) else x
    x = Real(-104) if x < Real(-104) else x
    q, k = reduced_exp(x)
    return scaled(ONE + q, k)


def one_minus_exp(z: Any) -> Any:
    """1 - exp(-z) for z >= 0, without cancellation near 0."""
    z = Real(87) if z > Real(87) else z  # Where the difference from 1 is long gone.
    rounded = z * -LOG2_E + ROUND
    n = rounded - ROUND
    q = small_exp(-z - n * LN2)  # The error of LN2 fades with exp(-z).
    k = np.int32(np.float32(rounded).view(np.int32) - ROUND_BITS)
    scale = np.int32(np.int32(k + np.int32(127)) << np.int32(23)).view(np.float32)
    return (ONE - scale) - scale * q


def damped_time(rate: Any, h: Any) -> Any:
    """Integral of exp(-rate s) over s from 0 to h, rate h >= 0: (1 - exp(-rate h)) / rate.

    Error below 3 ULP.
    """
    z = rate * h
    linear = abs(z) < LINEAR
    inverse = ONE / (ONE if linear else rate)  # Beside the exponential, not after it.
    return h if linear else one_minus_exp(z) * inverse


def phi1(z: Any) -> Any:
    """(1 - exp(-z)) / z, 1 at 0, for 0 <= z <= infinity. Error below 3 ULP."""
    return damped_time(z, ONE)


def tanh(x: Any) -> Any:
    """Hyperbolic tangent. Error below 3 ULP."""
    numerator = one_minus_exp(TWO * abs(x))
    y = numerator / (TWO - numerator)
    return -y if x < ZERO else y


def exponent_and_rest(x: Any) -> tuple[Any, Any]:
    """The k and f of x = (1 + f) 2^k with 1 + f in [sqrt(1/2), sqrt(2)), for finite x > 0."""
    subnormal = x < TINY
    scaled_up = x * SUBNORMAL_SCALE if subnormal else x
    shift = Real(-23) if subnormal else ZERO
    offset = np.int32(np.float32(scaled_up).view(np.int32) - SQRT_HALF_BITS)
    k = np.int32(offset >> np.int32(23))
    bits = np.int32((offset & np.int32(0x7FFFFF)) + SQRT_HALF_BITS)
    return Real(k) + shift, np.int32(bits).view(np.float32) - ONE


def log(x: Any) -> Any:
    """Natural logarithm. Error below 1 ULP; -infinity at 0, NaN below."""
    k, f = exponent_and_rest(x)
    s = f / (TWO + f)
    z = s * s
    tail = z * (LOG[0] + z * (LOG[1] + z * LOG[2]))
    half_square = HALF * f * f
    y = k * LN2_HIGH - ((half_square - (s * (half_square + tail) + k * LN2_LOW)) - f)
    y = y if x > ZERO else NAN
    y = -INFINITY if x == ZERO else y
    return INFINITY if x == INFINITY else y


def high_part(x: Any) -> Any:
    """The leading 12 bits of a number."""
    return np.int32(np.float32(x).view(np.int32) & SPLIT).view(np.float32)


def log2_in_two(x: Any) -> tuple[Any, Any]:
    """log2(x) as the sum of two numbers, to 2^-31 of itself, for finite x > 0."""
    k, f = exponent_and_rest(x)
    d = TWO + f
    s = f / d
    s_high = high_part(s)
    d_high = high_part(d)
    d_low = f - (d_high - TWO)
    s_low = ((f - s_high * d_high) - s_high * d_low) / d
    z = s * s
    tail = s * z * (LOG[0] + z * (LOG[1] + z * LOG[2])) * LOG2_E
    large = s_high * TWO_OVER_LN2_HIGH
    small = s_high * TWO_OVER_LN2_LOW + (s_low * TWO_OVER_LN2 + tail)
    high = k + large
    return high, (large - (high - k)) + small


def pow(x: Any, y: Any) -> Any:
    """x to the power y, by the rules of IEEE 754. Error below 2 ULP.

    A negative x needs an integer y, else the result is NaN.
    """
    base = abs(x)
    limit = Real(2.0**33)
    exponent = limit if y > limit else y
    exponent = -limit if exponent < -limit else exponent
    log_high, log_low = log2_in_two(base)
    first, log_first = high_part(exponent), high_part(log_high)
    high = first * log_first
    low = (exponent - first) * log_high + first * (log_high - log_first) + exponent * log_low
    total = high + low
    rounded = total + ROUND
    q = small_exp(((high - (rounded - ROUND)) + low) * LN2)
    k = np.int32(np.float32(rounded).view(np.int32) - ROUND_BITS)
    result = scaled(ONE + q, k)
    result = INFINITY if total > Real(129) else result
    result = ZERO if total < Real(-152) else result
    at_zero = INFINITY if y < ZERO else ZERO
    at_infinity = ZERO if y < ZERO else INFINITY
    result = at_zero if base == ZERO else result
    result = at_infinity if base == INFINITY else result
    whole = np.floor(y) == y
    odd = whole and np.floor(y * HALF) != y * HALF
    result = -result if odd and x < ZERO else result
    result = NAN if x < ZERO and base < INFINITY and not whole else result
    result = result if x == x and y == y else NAN
    return ONE if y == ZERO or x == ONE else result


def reduced_angle(x: Any) -> tuple[Any, Any, Any]:
    """Sine and cosine of x - k pi/2, and k."""
    rounded = x * TWO_OVER_PI + ROUND
    n = rounded - ROUND
    r = ((x - n * QUARTER_TURN[0]) - n * QUARTER_TURN[1]) - n * QUARTER_TURN[2]
    r = r - n * QUARTER_TURN[3]
    r = ONE if r > ONE else r
    r = -ONE if r < -ONE else r
    z = r * r
    sine = r + r * z * (SIN[0] + z * (SIN[1] + z * (SIN[2] + z * SIN[3])))
    cosine = (ONE - HALF * z) + z * z * (COS[0] + z * (COS[1] + z * COS[2]))
    return sine, cosine, np.int32(np.float32(rounded).view(np.int32) - ROUND_BITS)


def sin(x: Any) -> Any:
    """Sine. Error below 2.5 ULP for |x| <= 10 000; beyond, it fades, within [-1, 1]."""
    sine, cosine, k = reduced_angle(x)
    y = cosine if k & np.int32(1) else sine
    return -y if k & np.int32(2) else y


def cos(x: Any) -> Any:
    """Cosine. Error below 2.5 ULP for |x| <= 10 000; beyond, it fades, within [-1, 1]."""
    sine, cosine, k = reduced_angle(x)
    y = sine if k & np.int32(1) else cosine
    return -y if (k + np.int32(1)) & np.int32(2) else y


def atan2(y: Any, x: Any) -> Any:
    """Angle of the point (x, y) from the x axis, in [-pi, pi]. Error below 3 ULP; 0 at (0, 0)."""
    a, b = abs(x), abs(y)
    low, high = (b, a) if b <= a else (a, b)
    steep = low > TAN_EIGHTH_PI * high or low == INFINITY
    numerator = low - high if steep else low
    denominator = low + high if steep else high
    ratio = numerator / denominator
    ratio = ZERO if high == ZERO or low == INFINITY else ratio
    z = ratio * ratio
    p = ATAN[0] + z * (ATAN[1] + z * (ATAN[2] + z * (ATAN[3] + z * ATAN[4])))
    angle = ratio + ratio * z * p
    angle = QUARTER_PI + angle if steep else angle
    angle = angle if b <= a else HALF_PI - angle
    angle = PI - angle if x < ZERO else angle
    angle = -angle if y < ZERO else angle
    return angle if a == a and b == b else NAN


def sqrt(x: Any) -> Any:
    """Square root, correctly rounded."""
    return np.sqrt(x)


def floor(x: Any) -> Any:
    """Largest integer not above x, exact."""
    return np.floor(x)


def real(x: Any) -> Any:
    """A number, such as an integer, as float32."""
    return np.float32(x)
