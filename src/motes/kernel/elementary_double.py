"""Elementary functions on float64 scalars, as polynomials that a loop can run in SIMD registers.

Every operation is float64 or int64; nothing is called that is not inlined, nothing branches, and
the order of operations is part of the accuracy, so that these compile with `jit.EXACT`. Reduction
of the argument follows Cody and Waite (Software Manual for the Elementary Functions, 1980); the
coefficients are minimax polynomials of our own, found by Remez exchange. The sign of a zero has no
meaning here: -0 counts as 0.
"""

from __future__ import annotations

from typing import Any

import numpy as np

Real = np.float64


def _reals(*values: float) -> tuple[np.float64, ...]:
    return tuple(Real(value) for value in values)


ZERO, HALF, ONE, TWO = _reals(0, 0.5, 1, 2)
INFINITY, NAN = _reals(np.inf, np.nan)
ROUND = Real(1.5 * 2.0**52)
"""Adding it rounds to an integer, which is then found in the low bits of the sum."""
ROUND_BITS = ROUND.view(np.int64)
SPLIT = np.int64(-(2**27))
"""Mask that keeps 26 bits of a significand, so that products of two such numbers are exact."""

LOG2_E = Real(1.4426950408889634)
LN2 = Real(0.6931471805599453)
LN2_HIGH, LN2_LOW = _reals(0.6931471805592082, 7.371002565167799e-13)
TWO_OVER_LN2, TWO_OVER_LN2_HIGH, TWO_OVER_LN2_LOW = _reals(
    2.8853900817779268, 2.885390043258667, 3.851925982253235e-08
)
TWO_OVER_PI = Real(0.6366197723675814)
QUARTER_TURN = _reals(1.5707963267341256, 6.077100506303966e-11, 2.0222662487959506e-21)
"""Pi/2 in three parts; up to 2^20 times each of the first two is exact."""
PI, HALF_PI, QUARTER_PI = _reals(np.pi, np.pi / 2, np.pi / 4)
TAN_EIGHTH_PI = Real(0.41421356237309503)

TINY = Real(2.0**-1022)
LINEAR = Real(2.0**-60)
"""Below it 1 - exp(-z) is z."""
SUBNORMAL_SCALE = Real(2.0**52)
SQRT_HALF_BITS = Real(0.7071067811865476).view(np.int64)
EXPONENT_OF_ONE = ONE.view(np.int64)

EXP = _reals(
    0.500000000000000555,
    0.16666666666666686,
    0.0416666666665736246,
    0.00833333333331459738,
    0.00138888889323792869,
    0.000198412699030058591,
    2.48015044451114977e-05,
    2.75572279814663652e-06,
    2.76263269284859518e-07,
    2.51144639360117976e-08,
)
LOG = _reals(
    0.666666666666666609,
    0.400000000000062871,
    0.285714285690729613,
    0.222222226487502311,
    0.181817755085624251,
    0.153870976492150532,
    0.132499620557327998,
    0.132527546620719139,
)
SIN = _reals(
    -0.166666666666666319,
    0.00833333333332237019,
    -0.00019841269829771296,
    2.75573136786974882e-06,
    -2.50507559647094845e-08,
    1.58966666220179625e-10,
)
COS = _reals(
    0.0416666666666665992,
    -0.0013888888888874065,
    2.48015872894435178e-05,
    -2.75573143406614627e-07,
    2.08757216231181511e-09,
    -1.13595592647797531e-11,
)
ATAN = _reals(
    -0.333333333333333275,
    0.199999999999976668,
    -0.142857142853877969,
    0.111111110881675789,
    -0.090909081442332989,
    0.0769228275318337137,
    -0.0666622668959343229,
    0.0587702123056388374,
    -0.0521840120021447481,
    0.0450353786410674082,
    -0.0334742115589919384,
    0.015194921201365976,
)


def small_exp(r: Any) -> Any:
    """exp(r) - 1 for |r| <= ln(2) / 2."""
    r2 = r * r  # Estrin's scheme: half as many operations wait for one another as in Horner's.
    r4 = r2 * r2
    p = (EXP[4] + r * EXP[5]) + r2 * (EXP[6] + r * EXP[7]) + r4 * (EXP[8] + r * EXP[9])
    p = (EXP[0] + r * EXP[1]) + r2 * (EXP[2] + r * EXP[3]) + r4 * p
    return r + r2 * p


def reduced_exp(x: Any) -> tuple[Any, Any]:
    """The q and k of exp(x) = (1 + q) 2^k, for -746 <= x <= 710."""
    rounded = x * LOG2_E + ROUND
    n = rounded - ROUND
    q = small_exp((x - n * LN2_HIGH) - n * LN2_LOW)
    return q, np.float64(rounded).view(np.int64) - ROUND_BITS


def scaled(x: Any, k: Any) -> Any:
    """x 2^k in two factors, so that overflow and gradual underflow come out right."""
    half = np.int64(k >> np.int64(1))
    rest = np.int64(k - half)
    first = np.int64(np.int64(half + np.int64(1023)) << np.int64(52)).view(np.float64)
    second = np.int64(np.int64(rest + np.int64(1023)) << np.int64(52)).view(np.float64)
    return x * first * second


def exp(x: Any) -> Any:
    """Exponential. Error below 1.5 ULP; underflows to 0, overflows to infinity."""
    x = Real(710) if x > Real(710) else x
    x = Real(-746) if x < Real(-746) else x
    q, k = reduced_exp(x)
    return scaled(ONE + q, k)


def one_minus_exp(z: Any) -> Any:
    """1 - exp(-z) for z >= 0, without cancellation near 0."""
    z = Real(708) if z > Real(708) else z  # Where the difference from 1 is long gone.
    rounded = z * -LOG2_E + ROUND
    n = rounded - ROUND
    q = small_exp(-z - n * LN2)  # The error of LN2 fades with exp(-z).
    k = np.float64(rounded).view(np.int64) - ROUND_BITS
    scale = np.int64(np.int64(k + np.int64(1023)) << np.int64(52)).view(np.float64)
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
    shift = Real(-52) if subnormal else ZERO
    offset = np.int64(np.float64(scaled_up).view(np.int64) - SQRT_HALF_BITS)
    k = np.int64(offset >> np.int64(52))
    bits = np.int64((offset & np.int64(0xFFFFFFFFFFFFF)) + SQRT_HALF_BITS)
    return Real(k) + shift, np.int64(bits).view(np.float64) - ONE


def log_series(z: Any) -> Any:
    """(2 atanh(s) / s - 2) / z with z = s^2."""
    p = LOG[4] + z * (LOG[5] + z * (LOG[6] + z * LOG[7]))
    return LOG[0] + z * (LOG[1] + z * (LOG[2] + z * (LOG[3] + z * p)))


def log(x: Any) -> Any:
    """Natural logarithm. Error below 1 ULP; -infinity at 0, NaN below."""
    k, f = exponent_and_rest(x)
    s = f / (TWO + f)
    z = s * s
    tail = z * log_series(z)
    half_square = HALF * f * f
    y = k * LN2_HIGH - ((half_square - (s * (half_square + tail) + k * LN2_LOW)) - f)
    y = y if x > ZERO else NAN
    y = -INFINITY if x == ZERO else y
    return INFINITY if x == INFINITY else y


def high_part(x: Any) -> Any:
    """The leading 26 bits of a number."""
    return np.int64(np.float64(x).view(np.int64) & SPLIT).view(np.float64)


def log2_in_two(x: Any) -> tuple[Any, Any]:
    """log2(x) as the sum of two numbers, to 2^-60 of itself, for finite x > 0."""
    k, f = exponent_and_rest(x)
    d = TWO + f
    s = f / d
    s_high = high_part(s)
    d_high = high_part(d)
    d_low = f - (d_high - TWO)
    s_low = ((f - s_high * d_high) - s_high * d_low) / d
    z = s * s
    tail = s * z * log_series(z) * LOG2_E
    large = s_high * TWO_OVER_LN2_HIGH
    small = s_high * TWO_OVER_LN2_LOW + (s_low * TWO_OVER_LN2 + tail)
    high = k + large
    return high, (large - (high - k)) + small


def pow(x: Any, y: Any) -> Any:
    """x to the power y, by the rules of IEEE 754. Error below 4 ULP.

    A negative x needs an integer y, else the result is NaN.
    """
    base = abs(x)
    limit = Real(2.0**65)
    exponent = limit if y > limit else y
    exponent = -limit if exponent < -limit else exponent
    log_high, log_low = log2_in_two(base)
    first, log_first = high_part(exponent), high_part(log_high)
    high = first * log_first
    low = (exponent - first) * log_high + first * (log_high - log_first) + exponent * log_low
    total = high + low
    rounded = total + ROUND
    q = small_exp(((high - (rounded - ROUND)) + low) * LN2)
    k = np.int64(np.float64(rounded).view(np.int64) - ROUND_BITS)
    result = scaled(ONE + q, k)
    result = INFINITY if total > Real(1025) else result
    result = ZERO if total < Real(-1080) else result
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
    r = ONE if r > ONE else r
    r = -ONE if r < -ONE else r
    z = r * r
    p = SIN[2] + z * (SIN[3] + z * (SIN[4] + z * SIN[5]))
    sine = r + r * z * (SIN[0] + z * (SIN[1] + z * p))
    p = COS[2] + z * (COS[3] + z * (COS[4] + z * COS[5]))
    cosine = (ONE - HALF * z) + z * z * (COS[0] + z * (COS[1] + z * p))
    return sine, cosine, np.int64(np.float64(rounded).view(np.int64) - ROUND_BITS)


def sin(x: Any) -> Any:
    """Sine. Error below 2.5 ULP for |x| <= 1 000 000; beyond, it fades, within [-1, 1]."""
    sine, cosine, k = reduced_angle(x)
    y = cosine if k & np.int64(1) else sine
    return -y if k & np.int64(2) else y


def cos(x: Any) -> Any:
    """Cosine. Error below 2.5 ULP for |x| <= 1 000 000; beyond, it fades, within [-1, 1]."""
    sine, cosine, k = reduced_angle(x)
    y = sine if k & np.int64(1) else cosine
    return -y if (k + np.int64(1)) & np.int64(2) else y


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
    p = ATAN[8] + z * (ATAN[9] + z * (ATAN[10] + z * ATAN[11]))
    p = ATAN[4] + z * (ATAN[5] + z * (ATAN[6] + z * (ATAN[7] + z * p)))
    p = ATAN[0] + z * (ATAN[1] + z * (ATAN[2] + z * (ATAN[3] + z * p)))
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
    """A number, such as an integer, as float64."""
    return np.float64(x)
