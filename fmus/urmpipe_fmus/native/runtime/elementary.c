/* SPDX-License-Identifier: MIT */
/* The elementary functions: the argument is brought near 0, and a Taylor series summed there. */
#include "elementary.h"

#include <math.h>

/* Constants in two or three parts: a first one with few digits, so that whole multiples of it are exact, and what
   it lacks. */
static const double TWO_OVER_PI = 0.6366197723675814;
static const double HALF_PI_1 = 1.5707963267341256, HALF_PI_2 = 6.077100506303966e-11,
                    HALF_PI_3 = 2.0222662487959506e-21;
static const double LN2_1 = 0.6931471803691238, LN2_2 = 1.9082149292705877e-10;
static const double ONE_OVER_LN2 = 1.4426950408889634, LN2 = 0.6931471805599453;
/* Constants to double precision, and what they lack. */
static const double PI = 3.141592653589793, PI_REST = 1.2246467991473532e-16;
static const double HALF_PI = 1.5707963267948966, HALF_PI_REST = 6.123233995736766e-17;

#define MOST_TURNS 1048576.0 /* quarter turns, of which whole multiples of HALF_PI_1 and HALF_PI_2 are exact */
#define LARGE 22.0           /* from here on exp(-2 x) is nothing beside 1 */
#define HUGE_ARGUMENT 1e9    /* from here on 1 is nothing beside x x */

/* c[0] + c[1] z + c[2] z^2 + ... by Horner's rule. */
static double series(double z, const double c[], int count) {
    double sum = c[count - 1];
    for (int k = count - 2; k >= 0; k--) sum = c[k] + z * sum;
    return sum;
}

#define COUNT(c) ((int)(sizeof c / sizeof c[0]))
#define SERIES(z, c) series(z, c, COUNT(c))

/* ---- angles ---- */

/* An angle less whole quarter turns: `turns` of them, and the rest |high| <= pi/4 in two parts. */
typedef struct {
    double high, low;
    int turns;
} Rest;

static Rest rest_of(double x) {
    Rest rest;
    double n = nearbyint(x * TWO_OVER_PI);
    double first = x - n * HALF_PI_1, second = n * HALF_PI_2;
    double high = first - second;
    double taken = first - high; /* second, but for what `high` was rounded by */
    double low = (first - (high + taken)) + (taken - second) - n * HALF_PI_3;
    rest.high = high + low;
    rest.low = (high - rest.high) + low;
    rest.turns = (int)n & 3;
    return rest;
}

static int is_in_range(double x) { return fabs(x * TWO_OVER_PI) < MOST_TURNS; }

/* Sine near 0: x - x^3/3! + x^5/5! - ...; the derivative 1 - x^2/2 takes the low part along. */
static double near_sin(Rest x) {
    static const double c[] = {-1.0 / 6.0,          1.0 / 120.0,          -1.0 / 5040.0,           1.0 / 362880.0,
                               -1.0 / 39916800.0, 1.0 / 6227020800.0, -1.0 / 1307674368000.0, 1.0 / 355687428096000.0};
    double z = x.high * x.high;
    return x.high + (x.high * z * SERIES(z, c) + x.low * (1.0 - 0.5 * z));
}

/* Cosine near 0: 1 - x^2/2 + x^4/4! - ...; the derivative -x takes the low part along. */
static double near_cos(Rest x) {
    static const double c[] = {1.0 / 24.0,        -1.0 / 720.0,        1.0 / 40320.0,          -1.0 / 3628800.0,
                               1.0 / 479001600.0, -1.0 / 87178291200.0, 1.0 / 20922789888000.0};
    double z = x.high * x.high, half = 0.5 * z;
    double first = 1.0 - half, lost = (1.0 - first) - half; /* what 1 - z/2 was rounded by */
    return first + (lost + (z * z * SERIES(z, c) - x.high * x.low));
}

double sin_of(double x) {
    if (x == 0.0) return x; /* with its sign */
    if (!is_in_range(x)) return sin(x);
    Rest rest = rest_of(x);
    double found = rest.turns & 1 ? near_cos(rest) : near_sin(rest);
    return rest.turns & 2 ? -found : found;
}

double cos_of(double x) {
    if (!is_in_range(x)) return cos(x);
    Rest rest = rest_of(x);
    double found = rest.turns & 1 ? near_sin(rest) : near_cos(rest);
    return rest.turns == 1 || rest.turns == 2 ? -found : found;
}

double tan_of(double x) {
    if (x == 0.0) return x; /* with its sign */
    if (!is_in_range(x)) return tan(x);
    Rest rest = rest_of(x);
    return rest.turns & 1 ? -near_cos(rest) / near_sin(rest) : near_sin(rest) / near_cos(rest);
}

/* Arc tangent of 0 <= x <= 1: that of the nearest eighth, and of the angle from there, t - t^3/3 + t^5/5 - ... */
static double near_atan(double x) {
    static const double eighths[] = {0.0,
                                     0.12435499454676144,
                                     0.24497866312686414,
                                     0.35877067027057225,
                                     0.4636476090008061,
                                     0.5585993153435624,
                                     0.6435011087932844,
                                     0.7188299996216245,
                                     0.7853981633974483};
    static const double c[] = {-1.0 / 3.0, 1.0 / 5.0, -1.0 / 7.0, 1.0 / 9.0, -1.0 / 11.0, 1.0 / 13.0};
    double k = nearbyint(8.0 * x);
    double t = (x - k / 8.0) / (1.0 + x * (k / 8.0));
    double z = t * t;
    return eighths[(int)k] + (t + t * z * SERIES(z, c));
}

double atan2_of(double y, double x) {
    double across = fabs(x), up = fabs(y), angle;
    if (isnan(x) || isnan(y)) return x + y;
    if (up == across) /* both may be 0, or infinite */
        angle = up == 0.0 ? 0.0 : 0.5 * HALF_PI;
    else if (up < across)
        angle = near_atan(up / across);
    else
        angle = HALF_PI - (near_atan(across / up) - HALF_PI_REST);
    if (signbit(x)) angle = PI - (angle - PI_REST);
    return copysign(angle, y);
}

double atan_of(double x) { return atan2_of(x, 1.0); }

double asin_of(double x) { return atan2_of(x, sqrt((1.0 - x) * (1.0 + x))); }

double acos_of(double x) { return atan2_of(sqrt((1.0 - x) * (1.0 + x)), x); }

/* ---- powers of e ---- */

/* x + more = n ln 2 + rest, where `more` is small; what is found is e^rest - 1. */
static double split_exp(double x, double more, int *n) {
    static const double c[] = {1.0 / 2.0,       1.0 / 6.0,        1.0 / 24.0,        1.0 / 120.0,
                               1.0 / 720.0,     1.0 / 5040.0,     1.0 / 40320.0,     1.0 / 362880.0,
                               1.0 / 3628800.0, 1.0 / 39916800.0, 1.0 / 479001600.0, 1.0 / 6227020800.0};
    double whole = nearbyint(x * ONE_OVER_LN2);
    double high = x - whole * LN2_1, low = whole * LN2_2 - more;
    double rest = high - low;
    double lost = (high - rest) - low;
    *n = (int)whole;
    return rest + (lost + rest * rest * SERIES(rest, c));
}

/* e^(x + more) */
static double exp_of_sum(double x, double more) {
    int n;
    if (isnan(x)) return x;
    if (x > 710.0) return INFINITY;
    if (x < -746.0) return 0.0;
    double less_one = split_exp(x, more, &n);
    return ldexp(1.0 + less_one, n);
}

double exp_of(double x) { return exp_of_sum(x, 0.0); }

double expm1_of(double x) {
    int n;
    if (x == 0.0) return x;
    if (isnan(x) || x > 40.0) return exp_of(x);
    if (x < -40.0) return -1.0;
    double less_one = split_exp(x, 0.0, &n);
    return ldexp(less_one, n) + (ldexp(1.0, n) - 1.0);
}

/* ln(1 + f) about 0 by s = f/(2 + f): 2 s + 2 s^3/3 + 2 s^5/5 + ... = f - s (f - 2 s^2/3 - 2 s^4/5 - ...). */
static const double LOG_SERIES[] = {2.0 / 3.0,  2.0 / 5.0,  2.0 / 7.0,  2.0 / 9.0,  2.0 / 11.0, 2.0 / 13.0,
                                    2.0 / 15.0, 2.0 / 17.0, 2.0 / 19.0, 2.0 / 21.0, 2.0 / 23.0};

static double near_log1p(double f) {
    double s = f / (2.0 + f), z = s * s;
    return f - s * (f - z * SERIES(z, LOG_SERIES));
}

/* x = (1 + f) 2^n with 1 + f about 1. */
static double split_log(double x, int *n) {
    double part = frexp(x, n);
    if (part >= 0.7071067811865476) return part - 1.0;
    --*n;
    return 2.0 * part - 1.0;
}

double log_of(double x) {
    int n;
    if (isnan(x) || x == INFINITY) return x;
    if (x <= 0.0) return x == 0.0 ? -INFINITY : NAN;
    double f = split_log(x, &n);
    return n * LN2_1 + (near_log1p(f) + n * LN2_2);
}

double log1p_of(double x) {
    double sum = 1.0 + x;
    if (fabs(x) < 0.29) return near_log1p(x);
    if (!(sum > 0.0) || sum > 1e16) return log_of(sum);
    return log_of(sum) + (x - (sum - 1.0)) / sum; /* with what the sum was rounded by */
}

/* Half of e^x where that may be all that can be written. */
static double half_exp(double x) {
    double root = exp_of(0.5 * x);
    return 0.5 * root * root;
}

double sinh_of(double x) {
    double size = fabs(x), less_one = expm1_of(size);
    if (isnan(x)) return x;
    return copysign(size < LARGE ? 0.5 * (less_one + less_one / (less_one + 1.0)) : half_exp(size), x);
}

double cosh_of(double x) {
    double size = fabs(x), power = exp_of(size);
    if (isnan(x)) return x;
    return size < LARGE ? 0.5 * power + 0.5 / power : half_exp(size);
}

double tanh_of(double x) {
    double size = fabs(x), less_one = expm1_of(2.0 * size);
    if (isnan(x)) return x;
    return copysign(size < LARGE ? less_one / (less_one + 2.0) : 1.0, x);
}

double asinh_of(double x) {
    double size = fabs(x), square = size * size;
    double found = size > HUGE_ARGUMENT ? log_of(size) + LN2 : log1p_of(size + square / (1.0 + sqrt(1.0 + square)));
    return copysign(found, x);
}

double acosh_of(double x) {
    double more = x - 1.0;
    if (x < 1.0) return NAN; /* the root below is of a product, which is above 0 again for x < -1 */
    return x > HUGE_ARGUMENT ? log_of(x) + LN2 : log1p_of(more + sqrt(more * (2.0 + more)));
}

double atanh_of(double x) {
    double size = fabs(x);
    return copysign(0.5 * log1p_of(2.0 * size / (1.0 - size)), x);
}

/* ---- any power ---- */

/* A number in two parts, the second beyond the last place of the first. */
typedef struct {
    double high, low;
} Pair;

/* a b to the last bit (Dekker): products of halves of the digits are exact. */
static Pair product(double a, double b) {
    double a_high = a * 134217729.0, b_high = b * 134217729.0; /* 2^27 + 1 */
    a_high -= a_high - a;
    b_high -= b_high - b;
    double a_low = a - a_high, b_low = b - b_high;
    Pair found = {a * b, 0.0};
    found.low = ((a_high * b_high - found.high) + a_high * b_low + a_low * b_high) + a_low * b_low;
    return found;
}

/* a + b + below, where a is 0 or larger than b, and b than `below`. */
static Pair sum_of(double a, double b, double below) {
    double sum = a + b, lost = (a - sum) + b;
    double low = lost + below;
    Pair found = {sum + low, 0.0};
    found.low = (sum - found.high) + low;
    return found;
}

/* 2/3 s^3 of a pair. */
static Pair two_thirds_of_cube(Pair s) {
    static const double two_thirds = 0.6666666666666666, rest = 3.700743415417188e-17;
    Pair square = product(s.high, s.high);
    Pair cube = product(s.high, square.high);
    Pair found = product(two_thirds, cube.high);
    cube.low += s.high * (square.low + 2.0 * s.high * s.low) + s.low * square.high;
    found.low += two_thirds * cube.low + rest * cube.high;
    return found;
}

/* ln(x) of a finite x > 0, to some more places than a double has: as log_of, the first two terms in pairs. */
static Pair log_pair(double x) {
    int n;
    double f = split_log(x, &n);
    double below = 2.0 + f, below_low = (2.0 - below) + f;
    Pair s = {f / below, 0.0};
    Pair whole = product(s.high, below);
    s.low = ((f - whole.high) - whole.low - s.high * below_low) / below;
    Pair third = two_thirds_of_cube(s);
    double z = s.high * s.high;
    double fifth = s.high * z * z * series(z, LOG_SERIES + 1, COUNT(LOG_SERIES) - 1);
    Pair first = sum_of(n * LN2_1, 2.0 * s.high, 0.0);
    return sum_of(first.high, third.high, third.low + (2.0 * s.low + (first.low + (fifth + n * LN2_2))));
}

double pow_of(double x, double y) {
    int is_special = !(fabs(x) < INFINITY) || x == 0.0 || x == 1.0 || !(fabs(y) < 1e100) || y == 0.0;
    if (is_special || (x < 0.0 && y != floor(y))) return pow(x, y); /* 0, 1, infinite or NaN: exact in any library */
    Pair exponent = log_pair(fabs(x)), scaled = product(y, exponent.high);
    double power = exp_of_sum(scaled.high, scaled.low + y * exponent.low);
    return x < 0.0 && fmod(y, 2.0) != 0.0 ? -power : power;
}

/* ---- others ---- */

double hypot_of(double x, double y) {
    double larger = greater(fabs(x), fabs(y)), smaller = lesser(fabs(x), fabs(y));
    int n;
    if (isinf(x) || isinf(y)) return INFINITY;
    if (isnan(larger) || smaller == 0.0) return larger;
    frexp(larger, &n); /* by a power of 2 near 1: no square is too large or too small */
    larger = ldexp(larger, -n);
    smaller = ldexp(smaller, -n);
    return ldexp(sqrt(larger * larger + smaller * smaller), n);
}

double sign_of(double x) { return x > 0.0 ? 1.0 : x < 0.0 ? -1.0 : x == 0.0 ? 0.0 : x; }

double lesser(double x, double y) { return x <= y || isnan(x) ? x : y; }

double greater(double x, double y) { return x >= y || isnan(x) ? x : y; }
