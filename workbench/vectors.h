/* LANES numbers at a time, as many as a vector register of the processor holds. Wider vectors than
that are taken apart through memory, at several times the cost. */

#include <stddef.h>
#include <string.h>

#if defined(__AVX512F__)
#define LANES 8
#define BROADCAST(x) ((v){x, x, x, x, x, x, x, x})
#elif defined(__AVX__)
#define LANES 4
#define BROADCAST(x) ((v){x, x, x, x})
#else
#define LANES 2
#define BROADCAST(x) ((v){x, x})
#endif

typedef double v __attribute__((vector_size(8 * LANES), may_alias));
typedef double anywhere __attribute__((vector_size(8 * LANES), aligned(8), may_alias)); /* in memory */
typedef long long places __attribute__((vector_size(8 * LANES)));

typedef ptrdiff_t integer;

#define EXPORT __attribute__((visibility("default")))
#define ALWAYS_INLINE inline __attribute__((always_inline))
#ifdef __clang__
#define SHUFFLE(a, b, ...) __builtin_shufflevector(a, b, __VA_ARGS__)
#else
#define SHUFFLE(a, b, ...) __builtin_shuffle(a, b, (places){__VA_ARGS__})
#endif
