/* LANES numbers in the type in which shape and pose directions are stored. WIDENED makes numbers to
compute with of them, in registers. */

typedef STORED stored
    __attribute__((vector_size(sizeof(STORED) * LANES), aligned(sizeof(STORED)), may_alias));

/* single precision to double: one instruction, in place of which gcc takes four for __builtin_convertvector */
#if LANES == 8
#include <immintrin.h>
#define DOUBLES(x) ((v)_mm512_cvtps_pd((__m256)(x)))
#elif LANES == 4
#include <immintrin.h>
#define DOUBLES(x) ((v)_mm256_cvtps_pd((__m128)(x)))
#else
#define DOUBLES(x) __builtin_convertvector(x, v)
#endif
