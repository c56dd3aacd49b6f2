/* Eight numbers at a time, one for each of eight vertices: gcc and clang map them to whatever
vector registers the processor has. */

#include <stddef.h>
#include <string.h>

typedef double v __attribute__((vector_size(64), may_alias));
typedef double anywhere __attribute__((vector_size(64), aligned(8), may_alias)); /* in memory */
typedef long long lanes __attribute__((vector_size(64)));

#define EXPORT __attribute__((visibility("default")))
#define BROADCAST(x) ((v){x, x, x, x, x, x, x, x})
#ifdef __clang__
#define SHUFFLE(a, b, ...) __builtin_shufflevector(a, b, __VA_ARGS__)
#else
#define SHUFFLE(a, b, ...) __builtin_shuffle(a, b, (lanes){__VA_ARGS__})
#endif
