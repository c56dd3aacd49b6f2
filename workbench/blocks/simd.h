/* LANES calls of the same function at a time. */

#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC optimize("O1") /* straight code: more costs the compiler time and gains nothing */
#endif

#include <math.h>
typedef long long bits __attribute__((vector_size(8 * LANES)));

#define PART __attribute__((noinline))

/* the truth is 1.0, as in CasADi */
#define TRUTH(condition) ((v)((bits)(condition) & (bits)BROADCAST(1.0)))
#define IF(condition, x) ((v)((bits)((condition) != BROADCAST(0.0)) & (bits)(x)))

/* rows of n numbers, from `first` on, to (n, LANES) and back; the last row fills up what is left */
#define GATHER(to, from, n) for (int l = 0; l < LANES; ++l) { \
    const double *row = from + (n) * (first + l < M ? first + l : M - 1); \
    for (integer j = 0; j < (n); ++j) to[j][l] = row[j]; }
#define SCATTER(from, to, n) for (int l = 0; l < LANES && first + l < M; ++l) \
    for (integer j = 0; j < (n); ++j) to[(n) * (first + l) + j] = from[j][l];

#define ONE_NUMBER(name, x) static PART v each_##name(v a) \
    { for (int i = 0; i < LANES; ++i) { const double p = a[i]; a[i] = (x); } return a; }
#define TWO_NUMBERS(name, x) static PART v each_##name(v a, v b) \
    { for (int i = 0; i < LANES; ++i) { const double p = a[i], q = b[i]; a[i] = (x); } return a; }

ONE_NUMBER(sqrt, sqrt(p)) ONE_NUMBER(sin, sin(p)) ONE_NUMBER(cos, cos(p)) ONE_NUMBER(tan, tan(p))
ONE_NUMBER(exp, exp(p)) ONE_NUMBER(log, log(p)) ONE_NUMBER(asin, asin(p))
ONE_NUMBER(acos, acos(p)) ONE_NUMBER(atan, atan(p)) ONE_NUMBER(fabs, fabs(p))
ONE_NUMBER(sinh, sinh(p)) ONE_NUMBER(cosh, cosh(p)) ONE_NUMBER(tanh, tanh(p))
ONE_NUMBER(floor, floor(p)) ONE_NUMBER(ceil, ceil(p)) ONE_NUMBER(log1p, log1p(p))
ONE_NUMBER(expm1, expm1(p)) ONE_NUMBER(erf, erf(p)) ONE_NUMBER(sign, p < 0 ? -1.0 : p > 0)
TWO_NUMBERS(pow, pow(p, q)) TWO_NUMBERS(atan2, atan2(p, q)) TWO_NUMBERS(fmin, fmin(p, q))
TWO_NUMBERS(fmax, fmax(p, q)) TWO_NUMBERS(hypot, hypot(p, q))
TWO_NUMBERS(copysign, copysign(p, q)) TWO_NUMBERS(fmod, fmod(p, q))
