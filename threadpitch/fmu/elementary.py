"""sin, cos, exp and log in ``+ - * / floor`` alone, so that they are bit-equal on every platform and in C.

The C libraries' own functions differ in the last bit between Linux and Windows. These are translated with the model
that uses them. A test holds their error against the correctly rounded value.
"""

from math import floor

LARGEST_ANGLE = 1e9
HALF_PI_INVERSE = 0.6366197723675814  # 2 / pi
# pi / 2 as the sum of two numbers of 30 bits and the rest: k * part is exact for |k| < 2^23 (Cody and Waite)
HALF_PI_1 = 1.570796325802803
HALF_PI_2 = 9.920935791635221e-10
HALF_PI_3 = 5.170182981794105e-19
LN2_INVERSE = 1.4426950408889634  # 1 / ln 2
# ln 2 as a number of 32 bits and the rest
LN2_1 = 0.6931471803691238
LN2_2 = 1.9082149292705877e-10
EXP_LARGEST = 709.0  # exp of it is still finite
LOG_SMALLEST = -745.0  # stands for the logarithm of zero and below
LARGEST = 1.7976931348623157e308
LOG_LARGEST = 709.782712893384  # stands for the logarithm of infinity
HALF_ROOT = 0.7071067811865476  # sqrt(1/2)


def sine_kernel(y: float) -> float:
    """sin y = y - y^3/3! + ... - y^15/15! + y^17/17!  for |y| <= pi/4; the next term is below 1e-19."""
    q = y * y
    s = q * (1.0 / 272.0)
    s = q * (1.0 / 210.0) * (1.0 - s)
    s = q * (1.0 / 156.0) * (1.0 - s)
    s = q * (1.0 / 110.0) * (1.0 - s)
    s = q * (1.0 / 72.0) * (1.0 - s)
    s = q * (1.0 / 42.0) * (1.0 - s)
    s = q * (1.0 / 20.0) * (1.0 - s)
    s = q * (1.0 / 6.0) * (1.0 - s)
    return y - y * s


def cosine_kernel(y: float) -> float:
    """cos y = 1 - y^2/2! + ... + y^16/16! - y^18/18!  for |y| <= pi/4; the next term is below 1e-20."""
    q = y * y
    s = q * (1.0 / 306.0)
    s = q * (1.0 / 240.0) * (1.0 - s)
    s = q * (1.0 / 182.0) * (1.0 - s)
    s = q * (1.0 / 132.0) * (1.0 - s)
    s = q * (1.0 / 90.0) * (1.0 - s)
    s = q * (1.0 / 56.0) * (1.0 - s)
    s = q * (1.0 / 30.0) * (1.0 - s)
    s = q * (1.0 / 12.0) * (1.0 - s)
    half = 0.5 * q
    rounded = 1.0 - half
    # (1 - rounded) - half is what rounding took from it
    return rounded + (((1.0 - rounded) - half) + half * s)


def sin(x: float) -> float:
    """sin x, x in radians; full accuracy for |x| < 1e7; 0 where |x| >= 1e9 or x is not a number."""
    if not abs(x) < LARGEST_ANGLE:
        return 0.0
    k = floor(x * HALF_PI_INVERSE + 0.5)
    y = ((x - k * HALF_PI_1) - k * HALF_PI_2) - k * HALF_PI_3
    quadrant = k - 4 * floor(0.25 * k)
    result = sine_kernel(y)
    if quadrant == 1:
        result = cosine_kernel(y)
    if quadrant == 2:
        result = -sine_kernel(y)
    if quadrant == 3:
        result = -cosine_kernel(y)
    return result


def cos(x: float) -> float:
    """cos x, x in radians; full accuracy for |x| < 1e7; 1 where |x| >= 1e9 or x is not a number."""
    if not abs(x) < LARGEST_ANGLE:
        return 1.0
    k = floor(x * HALF_PI_INVERSE + 0.5)
    y = ((x - k * HALF_PI_1) - k * HALF_PI_2) - k * HALF_PI_3
    quadrant = k - 4 * floor(0.25 * k)
    result = cosine_kernel(y)
    if quadrant == 1:
        result = -sine_kernel(y)
    if quadrant == 2:
        result = -cosine_kernel(y)
    if quadrant == 3:
        result = sine_kernel(y)
    return result


def exp(x: float) -> float:
    """e^x = 2^k e^r, r = x - k ln 2, e^r by its series to r^14; 0 for x < -745 or not a number, above 709 as 709."""
    if not x >= LOG_SMALLEST:
        return 0.0
    limited = x
    if x > EXP_LARGEST:
        limited = EXP_LARGEST
    k = floor(limited * LN2_INVERSE + 0.5)
    high = limited - k * LN2_1
    low = k * LN2_2
    r = high - low
    s = r / 14.0
    for i in range(10):
        s = r / (13.0 - i) * (1.0 + s)
    # the first terms last, so that the largest are rounded once: e^r - 1 = r + r^2/2 (1 + r/3 (1 + s))
    s = r * r * 0.5 * (1.0 + r / 3.0 * (1.0 + s))
    result = 1.0 + (high + (s - low))
    count = abs(k)
    factor = 2.0
    if k < 0:
        factor = 0.5
    while count > 0:
        result = result * factor
        count = count - 1
    return result


def log(x: float) -> float:
    """ln x = e ln 2 + 2 (s + s^3/3 + s^5/5 + ...), s = (m - 1)/(m + 1), x = m 2^e; -745 for x <= 0."""
    if x <= 0.0:
        return LOG_SMALLEST
    if x > LARGEST:
        return LOG_LARGEST
    m = x
    e = 0.0
    while m >= 2.0 * HALF_ROOT:
        m = m * 0.5
        e = e + 1.0
    while m < HALF_ROOT:
        m = m * 2.0
        e = e - 1.0
    f = m - 1.0
    s = f / (2.0 + f)
    q = s * s
    t = 0.0
    for i in range(12):
        t = q * (1.0 / (25.0 - 2.0 * i) + t)
    # ln(1 + f) = f - f^2/2 + s (f^2/2 + 2 t): small corrections to the exact f
    half = 0.5 * f * f
    return e * LN2_1 - ((half - (s * (half + 2.0 * t) + e * LN2_2)) - f)
