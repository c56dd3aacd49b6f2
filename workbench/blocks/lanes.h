/* LANES numbers at a time, one for each of as many calls of the same function. */

#include <math.h>
#include <stddef.h>

#if defined(__AVX512F__)
#define LANES 8
#elif defined(__AVX__)
#define LANES 4
#else
#define LANES 2
#endif

typedef double v __attribute__((vector_size(8 * LANES)));
typedef long long bits __attribute__((vector_size(8 * LANES)));
typedef ptrdiff_t integer;

#define EXPORT __attribute__((visibility("default")))

static inline v all(double x)
{
    v found;
    for (int lane = 0; lane < LANES; ++lane) found[lane] = x;
    return found;
}

/* the truth is 1.0, as in CasADi */
#define TRUE_WHERE(condition) ((v)((bits)(condition) & (bits)all(1.0)))
#define IF(condition, x) ((v)((bits)((condition) != all(0.0)) & (bits)(x)))

#define ONE(name, x) static inline v each_##name(v a) \
    { for (int i = 0; i < LANES; ++i) { const double p = a[i]; a[i] = (x); } return a; }
#define TWO(name, x) static inline v each_##name(v a, v b) \
    { for (int i = 0; i < LANES; ++i) { const double p = a[i], q = b[i]; a[i] = (x); } return a; }

ONE(sqrt, sqrt(p)) ONE(sin, sin(p)) ONE(cos, cos(p)) ONE(tan, tan(p)) ONE(exp, exp(p))
ONE(log, log(p)) ONE(asin, asin(p)) ONE(acos, acos(p)) ONE(atan, atan(p)) ONE(fabs, fabs(p))
ONE(sinh, sinh(p)) ONE(cosh, cosh(p)) ONE(tanh, tanh(p)) ONE(floor, floor(p)) ONE(ceil, ceil(p))
ONE(log1p, log1p(p)) ONE(expm1, expm1(p)) ONE(erf, erf(p)) ONE(sign, p < 0 ? -1.0 : p > 0)
TWO(pow, pow(p, q)) TWO(atan2, atan2(p, q)) TWO(fmin, fmin(p, q)) TWO(fmax, fmax(p, q))
TWO(hypot, hypot(p, q)) TWO(copysign, copysign(p, q)) TWO(fmod, fmod(p, q))
