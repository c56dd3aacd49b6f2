/* LANES calls of the same function at a time. */

#if defined(LONG_CODE) && defined(__GNUC__) && !defined(__clang__)
#pragma GCC optimize("O1") /* the compiler's time grows faster than the code */
#endif

#include <math.h>
typedef long long bits __attribute__((vector_size(8 * LANES)));

#define PART __attribute__((noinline))

/* the truth is 1.0, as in CasADi */
#define TRUTH(condition) ((v)((bits)(condition) & (bits)BROADCAST(1.0)))
#define CHOICE(condition, x, y) ((v)(((bits)(condition) & (bits)(x)) | (~(bits)(condition) & (bits)(y))))
#define IF(condition, x) ((v)((bits)((condition) != BROADCAST(0.0)) & (bits)(x)))

#if LANES == 8
#define OF_ROWS(j) {row[0][j], row[1][j], row[2][j], row[3][j], row[4][j], row[5][j], row[6][j], row[7][j]}
#elif LANES == 4
#define OF_ROWS(j) {row[0][j], row[1][j], row[2][j], row[3][j]}
#else
#define OF_ROWS(j) {row[0][j], row[1][j]}
#endif

/* rows of n numbers, from `first` on, to (n, LANES) and back; the last row fills up what is left */
#define GATHER(to, from, n) { \
    const double *row[LANES]; \
    for (int l = 0; l < LANES; ++l) row[l] = from + (n) * (first + l < M ? first + l : M - 1); \
    for (integer j = 0; j < (n); ++j) to[j] = (v)OF_ROWS(j); }
#define SCATTER(from, to, n) for (int l = 0; l < LANES && first + l < M; ++l) \
    for (integer j = 0; j < (n); ++j) to[(n) * (first + l) + j] = from[j][l];

#define ONE_NUMBER(name, x) static PART v each_##name(v a) \
    { for (int i = 0; i < LANES; ++i) { const double p = a[i]; a[i] = (x); } return a; }
#define TWO_NUMBERS(name, x) static PART v each_##name(v a, v b) \
    { for (int i = 0; i < LANES; ++i) { const double p = a[i], q = b[i]; a[i] = (x); } return a; }

/* sines and cosines of all lanes: x = r + quarter pi / 2 with |r| <= pi / 4, and Taylor's series of r.
pi / 2 is written as three numbers, of which the first two have 33 digits, so that products with
quarter are exact. What is larger, or no number, goes to the library. */
#define SMALL 1e5
#define MAGIC 6755399441055744.0 /* 1.5 * 2^52: adding it rounds to a whole number in the last digits */
#define TURNED(name, shift) static PART v each_##name(v a) \
{ \
    int small = 1; \
    for (int i = 0; i < LANES; ++i) small &= fabs(a[i]) < SMALL; \
    if (!small) { for (int i = 0; i < LANES; ++i) a[i] = name(a[i]); return a; } \
    const v rounded = a * 0x1.45f306dc9c883p-1 + MAGIC, quarter = rounded - MAGIC; \
    const bits n = (bits)rounded + (shift); \
    v r = a - quarter * 0x1.921fb544p+0; \
    r = r - quarter * 0x1.0b4611a6p-34; \
    r = r - quarter * 0x1.3198a2e037073p-69; \
    const v q = r * r; \
    v s = 1.0 / 355687428096000.0 + 0.0 * q, c = 1.0 / 20922789888000.0 + 0.0 * q; \
    s = s * q - 1.0 / 1307674368000.0; \
    c = c * q - 1.0 / 87178291200.0; \
    s = s * q + 1.0 / 6227020800.0; \
    c = c * q + 1.0 / 479001600.0; \
    s = s * q - 1.0 / 39916800.0; \
    c = c * q - 1.0 / 3628800.0; \
    s = s * q + 1.0 / 362880.0; \
    c = c * q + 1.0 / 40320.0; \
    s = s * q - 1.0 / 5040.0; \
    c = c * q - 1.0 / 720.0; \
    s = s * q + 1.0 / 120.0; \
    c = c * q + 1.0 / 24.0; \
    s = s * q - 1.0 / 6.0; \
    s = r + r * q * s; \
    c = 1.0 - 0.5 * q + q * q * c; \
    const bits odd = -(n & 1), minus = -((n >> 1) & 1); \
    const bits found = ((bits)c & odd) | ((bits)s & ~odd); \
    return (v)(found ^ (minus & (bits)BROADCAST(-0.0))); \
}
TURNED(sin, 0) TURNED(cos, 1)

/* y = A u in groups of at most TOGETHER rows, which read the same columns and whose sums stay in
registers; rows[] says where they go */
#define EACH1(f) f(0)
#define EACH2(f) EACH1(f) f(1)
#define EACH3(f) EACH2(f) f(2)
#define EACH4(f) EACH3(f) f(3)
#define EACH5(f) EACH4(f) f(4)
#define EACH6(f) EACH5(f) f(5)
#define EACH7(f) EACH6(f) f(6)
#define EACH8(f) EACH7(f) f(7)
#define NOTHING_YET(i) v s##i = BROADCAST(0.0);
#define ONE_MORE(i) s##i += x * element[i];
#define KEEP(i) y[rows[i]] = s##i;
#define GROUP_OF(n) case n: { \
    EACH##n(NOTHING_YET) \
    for (integer k = *columns_of; k > 0; --k, element += n) { const v x = u[*columns++]; EACH##n(ONE_MORE) } \
    EACH##n(KEEP) \
    break; }
static PART void product(integer groups, const short *rows_of, const short *columns_of, const short *rows,
                         const short *columns, const double *element, const v *u, v *y)
{
    for (; groups > 0; --groups, rows += *rows_of++, ++columns_of)
        switch (*rows_of) {
            GROUP_OF(1) GROUP_OF(2) GROUP_OF(3) GROUP_OF(4) GROUP_OF(5) GROUP_OF(6) GROUP_OF(7) GROUP_OF(8)
        }
}

#if defined(__GNUC__) && !defined(__clang__)
__attribute__((optimize("O3", "no-math-errno"))) /* one instruction for all lanes */
#endif
ONE_NUMBER(sqrt, sqrt(p))
ONE_NUMBER(tan, tan(p))
ONE_NUMBER(exp, exp(p)) ONE_NUMBER(log, log(p)) ONE_NUMBER(asin, asin(p))
ONE_NUMBER(acos, acos(p)) ONE_NUMBER(atan, atan(p)) ONE_NUMBER(fabs, fabs(p))
ONE_NUMBER(sinh, sinh(p)) ONE_NUMBER(cosh, cosh(p)) ONE_NUMBER(tanh, tanh(p))
ONE_NUMBER(floor, floor(p)) ONE_NUMBER(ceil, ceil(p)) ONE_NUMBER(log1p, log1p(p))
ONE_NUMBER(expm1, expm1(p)) ONE_NUMBER(erf, erf(p)) ONE_NUMBER(sign, p < 0 ? -1.0 : p > 0)
TWO_NUMBERS(pow, pow(p, q)) TWO_NUMBERS(atan2, atan2(p, q))
TWO_NUMBERS(hypot, hypot(p, q))
TWO_NUMBERS(copysign, copysign(p, q)) TWO_NUMBERS(fmod, fmod(p, q))
