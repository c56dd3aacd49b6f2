/* Groups of vertices as they are stored, and the rows that their derivatives are written to.

A group is LANES vertices, the last ones filled up with zeros. `motion` is the column of numbers that all
of them share; `column_of` puts it together from betas, the motion of the joints and its slopes.
The many rows that a derivative is written to make the processor's own guess at what is read next
fail: memory is asked for ahead of use there, into the second cache, from which more can be on its way at
a time than into the first one. Where only points are written, that guess is right, and asking for memory
takes longer than it saves.
*/

#define AHEAD 8 /* joints that bend: so far ahead are their directions asked for */

typedef struct {
    integer N;              /* how many vertices there are */
    const double *vertices; /* ROWS x LANES numbers for every group */
    const STORED *shapes;   /* 3 BETAS x LANES for every group */
    const STORED *bends;    /* 27 x LANES for every group and every joint that bends it */
    const double *steps;    /* what a stored 1 of shapes and of bends is worth; columns are in these units */
    const integer *joints;  /* for every group three lists, each after its length: the joints that
                               carry it, bend it, and have joints that carry it at or below them */
    const integer *still;   /* joint, first vertex, number of vertices: stretches that a joint
                               neither turns nor bends */
    integer stretches;      /* how many of these there are */
} body_t;

typedef struct {
    integer carriers, benders, movers;
    const integer *carrier, *bender, *mover;
} lists_t;

static const integer parents[JOINTS] = PARENTS;

/* what is stored of one group of vertices */
typedef struct {
    const anywhere *vertex, *weights;
    const stored *shapes, *bends;
    lists_t lists;
} group_t;

/* the lists of a group; returns where those of the next one begin */
static inline const integer *read_lists(const integer *from, lists_t *lists)
{
    lists->carriers = *from++;
    lists->carrier = from;
    from += lists->carriers;
    lists->benders = *from++;
    lists->bender = from;
    from += lists->benders;
    lists->movers = *from++;
    lists->mover = from;
    return from + lists->movers;
}

static ALWAYS_INLINE void look_ahead(const void *next, integer bytes)
{
    _Pragma("GCC unroll 27") for (integer i = 0; i < bytes; i += 64) __builtin_prefetch((const char *)next + i, 0, 2);
}

/* the next group: every pointer is moved on by what the group before it takes */
static inline const integer *next_group(const body_t *body, integer i, const integer *joints, group_t *here)
{
    if (i == 0) {
        here->vertex = (const anywhere *)body->vertices;
        here->shapes = (const stored *)body->shapes;
        here->bends = (const stored *)body->bends;
    } else {
        here->vertex += ROWS;
        here->shapes += 3 * BETAS;
        here->bends += 27 * here->lists.benders;
    }
    here->weights = here->vertex + WEIGHTS;
    return read_lists(joints, &here->lists);
}

static inline integer at_most_all(integer left) { return left < LANES ? left : LANES; }

EXPORT integer lanes(void) { return LANES; }

#define COLUMN (OF_BETAS + 3 * JOINTS * BETAS)

/* the column in the units of what is stored; without slopes, the part before OF_JOINTS */
static void column_of(const body_t *body, const double *betas, const double *motion, const double *slopes,
                      double *restrict found)
{
    const double shape = body->steps[0], bend = body->steps[1];
    for (integer b = 0; b < BETAS; ++b) found[b] = shape * betas[b];
    for (integer i = 0; i < MOTIONS - FEATURES; ++i) found[FEATURES + i] = bend * motion[i];
    memcpy(found + MOTIONS, motion + MOTIONS - FEATURES, (OF_JOINTS - MOTIONS) * sizeof(double));
    if (!slopes) return;
    memcpy(found + OF_JOINTS, slopes, (COLUMN - OF_JOINTS) * sizeof(double));
    for (integer k = 0; k < JOINTS; ++k)
        for (integer i = 9; i < OF_JOINT; ++i) found[OF_JOINTS + OF_JOINT * k + i] *= bend;
}

/* (3, LANES) to (LANES, 3) */
static ALWAYS_INLINE void interleave(const v *restrict from, v *restrict to)
{
    const v x = from[0], y = from[1], z = from[2];
#if LANES == 8
    const v a = SHUFFLE(x, y, 0, 8, 0, 1, 9, 0, 2, 10);
    const v b = SHUFFLE(x, y, 0, 3, 11, 0, 4, 12, 0, 5);
    const v c = SHUFFLE(x, y, 13, 0, 6, 14, 0, 7, 15, 0);
    to[0] = SHUFFLE(a, z, 0, 1, 8, 3, 4, 9, 6, 7);
    to[1] = SHUFFLE(b, z, 10, 1, 2, 11, 4, 5, 12, 7);
    to[2] = SHUFFLE(c, z, 0, 13, 2, 3, 14, 5, 6, 15);
#elif LANES == 4
    const v a = SHUFFLE(x, y, 0, 4, 1, 5); /* x0 y0 x1 y1 */
    const v b = SHUFFLE(x, y, 2, 6, 3, 7); /* x2 y2 x3 y3 */
    to[0] = SHUFFLE(a, z, 0, 1, 4, 2);
    to[1] = SHUFFLE(SHUFFLE(a, z, 3, 5, 3, 5), b, 0, 1, 4, 5);
    to[2] = SHUFFLE(b, z, 6, 2, 3, 7);
#else
    to[0] = SHUFFLE(x, y, 0, 2);
    to[1] = SHUFFLE(z, x, 0, 3);
    to[2] = SHUFFLE(y, z, 1, 3);
#endif
}

/* one row: (3, LANES) to 3 count numbers, vertex by vertex, times factor (LANES, 3) */
static ALWAYS_INLINE void put(v x, v y, v z, integer count, const v *factor, double *to)
{
    const v from[3] = {x, y, z};
    v whole[3];
    interleave(from, whole);
    for (int i = 0; i < 3; ++i) whole[i] *= factor[i];
    if (count == LANES) {
        look_ahead(to + 2 * 3 * LANES, sizeof whole);
        for (int i = 0; i < 3; ++i) ((anywhere *)to)[i] = whole[i];
    } else {
        memcpy(to, whole, 3 * count * sizeof(double));
    }
}

/* (rows, 3, LANES) to rows of 3 count numbers, vertex by vertex, times factor (LANES, 3); row r is
written to places[r] + first, or left out where there is no such place */
static ALWAYS_INLINE void spread(const v *from, integer rows, integer count, const v *factor,
                          double *const *places, integer first)
{
    _Pragma("GCC unroll 3") for (integer row = 0; row < rows; ++row)
        if (places[row])
            put(from[3 * row], from[3 * row + 1], from[3 * row + 2], count, factor, places[row] + first);
}
