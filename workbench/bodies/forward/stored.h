/* LANES numbers in the type in which shape and pose directions are stored. WIDENED makes numbers to
compute with of them, in registers. */

typedef STORED stored
    __attribute__((vector_size(sizeof(STORED) * LANES), aligned(sizeof(STORED)), may_alias));
