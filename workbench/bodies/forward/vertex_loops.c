/* Loops over vertices around the kernels above.

A group is LANES vertices, the last ones filled up with zeros. motion: numbers shared by all.
The many rows that a derivative is written to make the processor's own guess at what is read next
fail: memory is asked for ahead of use there.
*/

typedef struct {
    integer N;              /* how many vertices there are */
    const double *vertices; /* ROWS x LANES numbers for every group */
    const STORED *shapes;   /* 3 BETAS x LANES for every group */
    const STORED *bends;    /* 27 x LANES for every group and every joint that bends it */
    const double *steps;    /* what a stored 1 of shapes and of bends is worth; `motion` is in these units */
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

/* into the second cache: one group may fill the first one */
static inline void look_ahead(const void *next, integer bytes)
{
    for (integer i = 0; i < bytes; i += 64) __builtin_prefetch((const char *)next + i, 0, 2);
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

/* (3, LANES) to (LANES, 3) */
static inline void interleave(const v *restrict from, v *restrict to)
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

/* (rows, 3, LANES) to rows of 3 count numbers, vertex by vertex, times factor (LANES, 3); row r is
written to places[r] + first, or left out where there is no such place */
static inline void spread(const v *from, integer rows, integer count, const v *factor,
                          double *const *places, integer first)
{
    for (integer row = 0; row < rows; ++row, from += 3) {
        if (!places[row]) continue;
        double *to = places[row] + first;
        v whole[3];
        for (int i = 0; i < 3; ++i) __builtin_prefetch(to + 48 + LANES * i, 1);
        interleave(from, whole);
        for (int i = 0; i < 3; ++i) whole[i] *= factor[i];
        if (count == LANES) {
            for (int i = 0; i < 3; ++i) ((anywhere *)to)[i] = whole[i];
        } else {
            memcpy(to, whole, 3 * count * sizeof(double));
        }
    }
}

/* the rest vertex, the motion M (12) of it, and where that takes it */
static inline void posed(const group_t *of, const double *motion, v *restrict rest, v *restrict M,
                         v *restrict found)
{
    const lists_t *lists = &of->lists;
    v sum[3], M_sum[12] = {{0}};
    shaped(of->vertex, of->shapes, motion, sum);
    for (integer i = 0; i < lists->benders; ++i) /* in the order in which they are stored */
        _Pragma("GCC unroll 9") for (integer n = 0; n < 9; ++n)
            bent(of->bends + 27 * i + 3 * n, motion + FEATURES + 9 * (lists->bender[i] - 1) + n, sum);
    for (integer i = 0; i < lists->carriers; ++i) {
        const integer k = lists->carrier[i];
        blended(of->weights + k, motion + MOTIONS + 12 * k, M_sum);
    }
    memcpy(rest, sum, sizeof sum);
    memcpy(M, M_sum, sizeof M_sum);
    moved((const anywhere *)M, (const anywhere *)rest, found);
}

/* found (N, 3) */
EXPORT void points(const body_t *body, const double *motion, double *found)
{
    const v one[3] = {BROADCAST(1.0), BROADCAST(1.0), BROADCAST(1.0)};
    const integer *joints = body->joints;
    group_t of;
    for (integer i = 0; i < body->N; i += LANES) {
        v rest[3], M[12], here[3];
        joints = next_group(body, i, joints, &of);
        posed(&of, motion, rest, M, here);
        spread(here, 1, at_most_all(body->N - i), one, &found, 3 * i);
    }
}

/* the derivative of a group by the pose, to rows from column 3 i on */
static inline void by_pose(const group_t *of, const double *motion, const v *rest, const v *M,
                           integer count, const v *factor, double *const *pose, integer i)
{
    const lists_t *lists = &of->lists;
    v hanging[4 * JOINTS]; /* set only where something hangs */
    for (integer m = 0; m < lists->movers; ++m)
        memset(hanging + 4 * lists->mover[m], 0, 4 * sizeof(v));
    for (integer c = 0; c < lists->carriers; ++c) {
        const integer k = lists->carrier[c];
        below(of->weights + k, motion + MOTIONS + 12 * k, (const anywhere *)rest, hanging + 4 * k);
    }
    for (integer m = lists->movers - 1; m > 0; --m) { /* children come after their parents */
        const integer k = lists->mover[m];
        hung((const anywhere *)hanging + 4 * k, hanging + 4 * parents[k]);
    }
    for (integer m = 0, b = 0; m < lists->movers || b < lists->benders;) {
        v own[3], slope[9] = {{0}};
        const integer turns = m < lists->movers ? lists->mover[m] : JOINTS;
        const integer bulges = b < lists->benders ? lists->bender[b] : JOINTS;
        const integer k = turns < bulges ? turns : bulges;
        const double *of_joint = motion + OF_JOINTS + OF_JOINT * k;
        double *const *rows = pose + 3 * k;
        const stored *bend = of->bends + 27 * b;
        m += turns == k;
        b += bulges == k;
        if (!rows[0] && !rows[1] && !rows[2]) continue; /* a joint that is held */
        if (turns == k) {
            arm((const anywhere *)hanging + 4 * k, motion + CENTRES + 3 * k, own);
            turned((const anywhere *)own, of_joint, slope);
        }
        if (bulges == k) {
            look_ahead(bend + 27 * lists->benders, 27 * sizeof(stored));
            bulged(bend, (const anywhere *)M, of_joint, slope);
        }
        spread(slope, 3, count, factor, rows, 3 * i);
    }
}

/* pose (3 K, 3 N), betas (B, 3 N), trans (3, 3 N): each absent, or the addresses of its rows, of
which some may be absent; scale (3 N) multiplies columns, or is absent; found (N, 3), or absent: the
points */
EXPORT void tangent(const body_t *body, const double *motion, const double *scale,
                    double *const *pose, double *const *betas, double *const *trans, double *found)
{
    const v one[3] = {BROADCAST(1.0), BROADCAST(1.0), BROADCAST(1.0)};
    const integer *joints = body->joints;
    group_t of;
    if (pose)
        for (integer s = 0; s < body->stretches; ++s) {
            const integer *stretch = body->still + 3 * s;
            for (integer row = 3 * stretch[0]; row < 3 * stretch[0] + 3; ++row)
                if (pose[row])
                    memset(pose[row] + 3 * stretch[1], 0, 3 * stretch[2] * sizeof(double));
        }
    for (integer i = 0; i < body->N; i += LANES) {
        const integer count = at_most_all(body->N - i);
        v factor[3] = {BROADCAST(1.0), BROADCAST(1.0), BROADCAST(1.0)};
        v rest[3], M[12], here[3], slope[9];
        joints = next_group(body, i, joints, &of);
        if (scale) memcpy(factor, scale + 3 * i, 3 * count * sizeof(double));
        look_ahead(of.vertex + ROWS, ROWS * sizeof(v));
        look_ahead(of.shapes + 3 * BETAS, 3 * BETAS * sizeof(stored));
        posed(&of, motion, rest, M, here);
        if (found) spread(here, 1, count, one, &found, 3 * i);
        if (pose) by_pose(&of, motion, rest, M, count, factor, pose, i);
        if (betas) {
            for (int j = 0; j < 12; ++j) /* M is not needed any more but for stored shapes */
                M[j] *= BROADCAST(body->steps[0]);
            for (integer b = 0; b < BETAS; ++b) {
                if (!betas[b]) continue;
                by_beta(of.shapes + 3 * b, (const anywhere *)M, slope);
                for (integer c = 0; c < of.lists.carriers; ++c) {
                    const integer k = of.lists.carrier[c];
                    shifted(of.weights + k, motion + OF_BETAS + 3 * (JOINTS * b + k), slope);
                }
                spread(slope, 1, count, factor, betas + b, 3 * i);
            }
        }
        if (trans) {
            v unit[9] = {{0}};
            for (int d = 0; d < 3; ++d) unit[4 * d] = BROADCAST(1.0);
            spread(unit, 3, count, factor, trans, 3 * i);
        }
    }
}

/* felt (MOTIONS + 12 JOINTS): by betas, features and motions, the sum of pull (N, 3) times the points */
EXPORT void adjoint(const body_t *body, const double *motion, const double *pull, double *felt)
{
    v sum[MOTIONS + 12 * JOINTS] = {{0}};
    const integer *joints = body->joints;
    group_t of;
    for (integer i = 0; i < body->N; i += LANES) {
        v planar[3], rest[3], M[12], here[3], inside[3];
        double some[3 * LANES] = {0};
        joints = next_group(body, i, joints, &of);
        memcpy(some, pull + 3 * i, 3 * at_most_all(body->N - i) * sizeof(double));
        for (int lane = 0; lane < LANES; ++lane)
            for (int d = 0; d < 3; ++d) planar[d][lane] = some[3 * lane + d];
        look_ahead(of.vertex + ROWS, ROWS * sizeof(v));
        look_ahead(of.shapes + 3 * BETAS, 3 * BETAS * sizeof(stored));
        posed(&of, motion, rest, M, here);
        on_rest((const anywhere *)M, (const anywhere *)planar, inside);
        on_betas(of.shapes, (const anywhere *)inside, sum);
        for (integer b = 0; b < of.lists.benders; ++b)
            on_features(of.bends + 27 * b, (const anywhere *)inside,
                        sum + FEATURES + 9 * (of.lists.bender[b] - 1));
        for (integer c = 0; c < of.lists.carriers; ++c) {
            const integer k = of.lists.carrier[c];
            on_motion(of.weights + k, (const anywhere *)rest, (const anywhere *)planar,
                      sum + MOTIONS + 12 * k);
        }
    }
    for (integer k = 0; k < MOTIONS + 12 * JOINTS; ++k) {
        felt[k] = 0;
        for (int lane = 0; lane < LANES; ++lane) felt[k] += sum[k][lane];
    }
}
