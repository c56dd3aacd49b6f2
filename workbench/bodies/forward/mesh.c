/* Points of a surface, their derivative and its transpose: loops over groups of vertices around the functions of
one vertex.

A group is LANES vertices, the last ones filled up with zeros. `motion` is the column of numbers that all
of them share; `column_of` puts it together from betas, the motion of the joints and its derivatives.
The many rows that a derivative is written to make the processor's own guess at what is read next
fail: memory is asked for ahead of use there, into the second cache, from which more can be on its way at
a time than into the first one. Where only points are written, that guess is right, and asking for memory
takes longer than it saves.
*/

#define AHEAD 8 /* joints: so far ahead are their directions asked for */
#define ROWS (3 + JOINTS) /* of a vertex: its template and weights */

/* where the parts of `motion` begin, after betas */
#define FEATURES BETAS
#define MOTIONS (FEATURES + 9 * (JOINTS - 1))
#define CENTRES (MOTIONS + 12 * JOINTS)
#define AXES (CENTRES + 3 * JOINTS)
#define D_FEATURES (AXES + 9 * JOINTS)
#define D_SHIFT (D_FEATURES + 27 * JOINTS)
#define COLUMN (D_SHIFT + 3 * BETAS * JOINTS)

/* LANES numbers in the type in which shape and pose directions are stored, of which WIDENED makes numbers to compute
with */
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

/* the functions of c_functions.py */

typedef struct {
    integer N;              /* how many vertices there are */
    const double *vertices; /* ROWS x LANES numbers for every group */
    const STORED *shapes;   /* 3 BETAS x LANES for every group */
    const STORED *posedirs; /* 27 x LANES for every group and every joint that corrects it */
    const double *steps;    /* what a stored 1 of shapes and of posedirs is worth; columns are in these units */
    const integer *joints;  /* for every group three lists, each after its length: the joints with a weight on it,
                               with posedirs for it, and with a weight on it at or below them */
} body_t;

typedef struct {
    integer weighted, corrected, moving; /* how many joints */
    const integer *weighs, *corrects, *moves;
} lists_t;

static const integer parents[JOINTS] = PARENTS;

/* what is stored of one group of vertices */
typedef struct {
    const anywhere *vertex, *weights;
    const stored *shapes, *posedirs;
    lists_t lists;
} group_t;

/* the lists of a group; returns where those of the next one begin */
static inline const integer *read_lists(const integer *from, lists_t *lists)
{
    lists->weighted = *from++;
    lists->weighs = from;
    from += lists->weighted;
    lists->corrected = *from++;
    lists->corrects = from;
    from += lists->corrected;
    lists->moving = *from++;
    lists->moves = from;
    return from + lists->moving;
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
        here->posedirs = (const stored *)body->posedirs;
    } else {
        here->vertex += ROWS;
        here->shapes += 3 * BETAS;
        here->posedirs += 27 * here->lists.corrected;
    }
    here->weights = here->vertex + 3;
    return read_lists(joints, &here->lists);
}

static inline integer at_most_all(integer left) { return left < LANES ? left : LANES; }

EXPORT integer lanes(void) { return LANES; }

/* the column in the units of what is stored; without derivatives, the part before AXES */
static void column_of(const body_t *body, const double *betas, const double *motion, const double *derivatives,
                      double *restrict found)
{
    const double shape = body->steps[0], pose = body->steps[1];
    for (integer b = 0; b < BETAS; ++b) found[b] = shape * betas[b];
    for (integer i = 0; i < MOTIONS - FEATURES; ++i) found[FEATURES + i] = pose * motion[i];
    memcpy(found + MOTIONS, motion + MOTIONS - FEATURES, (AXES - MOTIONS) * sizeof(double));
    if (!derivatives) return;
    memcpy(found + AXES, derivatives, (COLUMN - AXES) * sizeof(double));
    for (integer i = D_FEATURES; i < D_SHIFT; ++i) found[i] *= pose;
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

/* the motion M (12) of a group */
static ALWAYS_INLINE void motion_of(const group_t *of, const double *motion, v *restrict M)
{
    v sum[12] = {{0}};
    for (integer i = 0; i < of->lists.weighted; ++i) {
        const integer k = of->lists.weighs[i];
        blended(of->weights + k, motion + MOTIONS + 12 * k, sum);
    }
    memcpy(M, sum, sizeof sum);
}

/* the rest vertex; and with `by_posedirs` (9 for each joint that corrects it), how the pose of these joints moves it
through their pose blend shapes, turned by M. The sums are in the same order with these and without, so that their
bits are the same */
static ALWAYS_INLINE void at_rest(const group_t *of, const double *motion, const v *restrict M,
                                  v *restrict by_posedirs, v *restrict rest)
{
    const lists_t *lists = &of->lists;
    v sum[3];
    shaped(of->vertex, of->shapes, motion, sum);
    for (integer i = 0; i < lists->corrected; ++i) { /* in the order in which they are stored */
        const integer k = lists->corrects[i];
        const double *feature = motion + FEATURES + 9 * (k - 1);
        const double *d_feature = motion + D_FEATURES + 27 * k;
        const stored *posedir = of->posedirs + 27 * i;
        v own[9] = {{0}};
        if (by_posedirs) look_ahead(posedir + 27 * AHEAD, 27 * sizeof(stored));
        _Pragma("GCC unroll 9") for (integer n = 0; n < 9; ++n) {
            posed(posedir + 3 * n, feature + n, sum);
            if (by_posedirs) d_posed(posedir + 3 * n, d_feature + 3 * n, own);
        }
        if (by_posedirs) turned_d_posed((const anywhere *)M, (const anywhere *)own, by_posedirs + 9 * i);
    }
    memcpy(rest, sum, sizeof sum);
}

/* found (N, 3) */
EXPORT void points(const body_t *body, const double *betas, const double *moving, double *found)
{
    const v one[3] = {BROADCAST(1.0), BROADCAST(1.0), BROADCAST(1.0)};
    const integer *joints = body->joints;
    double motion[AXES];
    group_t of;
    column_of(body, betas, moving, NULL, motion);
    for (integer i = 0; i < body->N; i += LANES) {
        v rest[3], M[12], here[3];
        joints = next_group(body, i, joints, &of);
        motion_of(&of, motion, M);
        at_rest(&of, motion, M, NULL, rest);
        moved((const anywhere *)M, (const anywhere *)rest, here);
        put(here[0], here[1], here[2], at_most_all(body->N - i), one, found + 3 * i);
    }
}

/* the derivative of a group by the pose, to rows from column 3 i on */
static ALWAYS_INLINE void by_pose(const group_t *of, const double *motion, const v *rest,
                           const v *by_posedirs,                           integer count, const v *factor, double *const *pose, integer i)
{
    const lists_t *lists = &of->lists;
    v subtree[4 * JOINTS]; /* set only where a joint moves the group */
    for (integer m = 0; m < lists->moving; ++m)
        memset(subtree + 4 * lists->moves[m], 0, 4 * sizeof(v));
    for (integer c = 0; c < lists->weighted; ++c) {
        const integer k = lists->weighs[c];
        carried(of->weights + k, motion + MOTIONS + 12 * k, (const anywhere *)rest, subtree + 4 * k);
    }
    for (integer m = lists->moving - 1; m > 0; --m) { /* children come after their parents */
        const integer k = lists->moves[m];
        add_to_parent((const anywhere *)subtree + 4 * k, subtree + 4 * parents[k]);
    }
    for (integer m = 0, b = 0; m < lists->moving || b < lists->corrected;) {
        v own[3], found[9] = {{0}};
        const integer moves = m < lists->moving ? lists->moves[m] : JOINTS;
        const integer corrects = b < lists->corrected ? lists->corrects[b] : JOINTS;
        const integer k = moves < corrects ? moves : corrects;
        double *const *rows = pose + 3 * k;
        const v *by_posedir = by_posedirs + 9 * b;
        m += moves == k;
        b += corrects == k;
        if (!rows[0] && !rows[1] && !rows[2]) continue; /* a joint that is held */
        if (corrects == k) memcpy(found, by_posedir, sizeof found);
        if (moves == k) {
            arm((const anywhere *)subtree + 4 * k, motion + CENTRES + 3 * k, own);
            turned((const anywhere *)own, motion + AXES + 9 * k, found);
        }
        spread(found, 3, count, factor, rows, 3 * i);
    }
}

/* what the derivative is written to: see `write_jacobian` */
typedef struct {
    const double *scale;
    double *const *pose, *const *betas, *const *trans;
    double *points;
} wanted_t;

/* the derivatives and points of a group of `count` vertices, of which i is the first one */
static ALWAYS_INLINE void of_group(const body_t *body, const group_t *of, integer i, integer count,
                                   const double *motion, const wanted_t *into)
{
    const v zero = BROADCAST(0.0), unit = BROADCAST(1.0), one[3] = {unit, unit, unit};
    v factor[3] = {unit, unit, unit};
    v rest[3], M[12], here[3], by_posedirs[9 * JOINTS];
    if (into->scale) memcpy(factor, into->scale + 3 * i, 3 * count * sizeof(double));
    look_ahead(of->vertex + ROWS, ROWS * sizeof(v));
    look_ahead(of->shapes + 3 * BETAS, 3 * BETAS * sizeof(stored));
    motion_of(of, motion, M);
    if (into->pose)
        at_rest(of, motion, M, by_posedirs, rest);
    else
        at_rest(of, motion, M, NULL, rest);
    if (into->points) {
        moved((const anywhere *)M, (const anywhere *)rest, here);
        put(here[0], here[1], here[2], count, one, into->points + 3 * i);
    }
    if (into->pose) by_pose(of, motion, rest, by_posedirs, count, factor, into->pose, i);
    if (into->betas) {
        for (int j = 0; j < 12; ++j) /* M is not needed any more but for stored shapes */
            M[j] *= BROADCAST(body->steps[0]);
        for (integer b = 0; b < BETAS; ++b) {
            v found[3];
            if (!into->betas[b]) continue;
            by_beta(of->shapes + 3 * b, (const anywhere *)M, found);
            for (integer c = 0; c < of->lists.weighted; ++c) {
                const integer k = of->lists.weighs[c];
                shifted(of->weights + k, motion + D_SHIFT + 3 * (JOINTS * b + k), found);
            }
            put(found[0], found[1], found[2], count, factor, into->betas[b] + 3 * i);
        }
    }
    if (into->trans) {
        double *const *rows = into->trans;
        if (rows[0]) put(unit, zero, zero, count, factor, rows[0] + 3 * i);
        if (rows[1]) put(zero, unit, zero, count, factor, rows[1] + 3 * i);
        if (rows[2]) put(zero, zero, unit, count, factor, rows[2] + 3 * i);
    }
}

/* the last group, apart, so that the code for all others need not know of fewer vertices */
static __attribute__((noinline)) void of_last(const body_t *body, const group_t *of, integer i,
                                              const double *motion, const wanted_t *into)
{
    of_group(body, of, i, body->N - i, motion, into);
}

/* pose (3 K, 3 N), betas (B, 3 N), trans (3, 3 N): each absent, or the addresses of its rows, of
which some may be absent; scale (3 N) multiplies columns, or is absent; found (N, 3), or absent: the
points. Where a joint leaves vertices alone, nothing is written */
EXPORT void write_jacobian(const body_t *body, const double *person, const double *moving, const double *derivatives,
                           const double *scale, double *const *pose, double *const *betas, double *const *trans,
                           double *found)
{
    const wanted_t into = {scale, pose, betas, trans, found};
    const integer *joints = body->joints;
    double motion[COLUMN];
    group_t of;
    integer i = 0;
    column_of(body, person, moving, derivatives, motion);
    for (; i + LANES <= body->N; i += LANES) {
        joints = next_group(body, i, joints, &of);
        of_group(body, &of, i, LANES, motion, &into);
    }
    if (i == body->N) return;
    next_group(body, i, joints, &of);
    of_last(body, &of, i, motion, &into);
}

/* found (CENTRES): the gradient of cotangent (N, 3) . points by betas, features and motions */
EXPORT void vjp(const body_t *body, const double *betas, const double *moving, const double *cotangent,
                double *found)
{
    v sum[CENTRES] = {{0}};
    const integer *joints = body->joints;
    double motion[AXES];
    group_t of;
    column_of(body, betas, moving, NULL, motion);
    for (integer i = 0; i < body->N; i += LANES) {
        v g[3], rest[3], M[12], on_rest[3];
        double some[3 * LANES] = {0};
        joints = next_group(body, i, joints, &of);
        memcpy(some, cotangent + 3 * i, 3 * at_most_all(body->N - i) * sizeof(double));
        for (int lane = 0; lane < LANES; ++lane)
            for (int d = 0; d < 3; ++d) g[d][lane] = some[3 * lane + d];
        look_ahead(of.vertex + ROWS, ROWS * sizeof(v));
        look_ahead(of.shapes + 3 * BETAS, 3 * BETAS * sizeof(stored));
        motion_of(&of, motion, M);
        at_rest(&of, motion, M, NULL, rest);
        vjp_of_rest((const anywhere *)M, (const anywhere *)g, on_rest);
        vjp_of_betas(of.shapes, (const anywhere *)on_rest, sum);
        for (integer b = 0; b < of.lists.corrected; ++b)
            vjp_of_features(of.posedirs + 27 * b, (const anywhere *)on_rest,
                            sum + FEATURES + 9 * (of.lists.corrects[b] - 1));
        for (integer c = 0; c < of.lists.weighted; ++c) {
            const integer k = of.lists.weighs[c];
            vjp_of_G(of.weights + k, (const anywhere *)rest, (const anywhere *)g, sum + MOTIONS + 12 * k);
        }
    }
    for (integer k = 0; k < CENTRES; ++k) {
        found[k] = 0;
        for (int lane = 0; lane < LANES; ++lane) found[k] += sum[k][lane];
    }
}
