/* One number at a time: what the C of a CasADi function is made of, where `vectors.h` and `simd.h` take
several side by side. */

#include <math.h>
#include <stddef.h>
#include <string.h>

typedef double v;
typedef double anywhere;
typedef ptrdiff_t integer;

#define EXPORT __attribute__((visibility("default")))
#define ALWAYS_INLINE inline __attribute__((always_inline))
#define BROADCAST(x) (x)
#define TRUTH(condition) ((double)(condition)) /* as in CasADi */
#define IF(condition, x) ((condition) != 0.0 ? (x) : 0.0)
#define each_sqrt sqrt
#define each_sin sin
#define each_cos cos
