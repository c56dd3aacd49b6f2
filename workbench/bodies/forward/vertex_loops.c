/* Loops over vertices around the kernels above.

vertices: ROWS x LANES numbers for every LANES vertices, the last ones filled up with zeros.
motion: numbers shared by all. N: how many vertices there are.
The many rows that a derivative is written to make the processor's own guess at what is read next
fail: memory is asked for ahead of use there.
*/

static inline void look_ahead(const double *vertices, integer first, integer rows)
{
    const double *next = vertices + LANES * (ROWS + first);
    for (integer i = 0; i < LANES * rows; i += 8) __builtin_prefetch(next + i);
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
static inline void posed(const anywhere *vertex, const double *motion, v *restrict rest,
                         v *restrict M, v *restrict found)
{
    v sum[3], M_sum[12] = {{0}};
    shaped(vertex, vertex + SHAPEDIRS, motion, sum);
    for (integer k = 1; k < JOINTS; ++k)
        bent(vertex + POSEDIRS + 27 * (k - 1), motion + FEATURES + 9 * (k - 1), sum);
    for (integer k = 0; k < JOINTS; ++k)
        blended(vertex + WEIGHTS + k, motion + MOTIONS + 12 * k, M_sum);
    memcpy(rest, sum, sizeof sum);
    memcpy(M, M_sum, sizeof M_sum);
    moved((const anywhere *)M, (const anywhere *)rest, found);
}

/* found (N, 3) */
EXPORT void points(integer N, const double *vertices, const double *motion, double *found)
{
    const v one[3] = {BROADCAST(1.0), BROADCAST(1.0), BROADCAST(1.0)};
    for (integer i = 0; i < N; i += LANES, vertices += LANES * ROWS) {
        v rest[3], M[12], here[3];
        posed((const anywhere *)vertices, motion, rest, M, here);
        spread(here, 1, at_most_all(N - i), one, &found, 3 * i);
    }
}

/* pose (3 K, 3 N), betas (B, 3 N), trans (3, 3 N): each absent, or the addresses of its rows, of
which some may be absent; scale (3 N) multiplies columns, or is absent; found (N, 3), or absent: the
points */
EXPORT void tangent(integer N, const double *vertices, const double *motion, const double *scale,
                    double *const *pose, double *const *betas, double *const *trans, double *found)
{
    static const v still[27]; /* the root bends nothing */
    const v one[3] = {BROADCAST(1.0), BROADCAST(1.0), BROADCAST(1.0)};
    for (integer i = 0; i < N; i += LANES, vertices += LANES * ROWS) {
        const integer count = at_most_all(N - i);
        const anywhere *vertex = (const anywhere *)vertices, *weights = vertex + WEIGHTS;
        v factor[3] = {BROADCAST(1.0), BROADCAST(1.0), BROADCAST(1.0)};
        v rest[3], M[12], here[3], slope[9];
        if (scale) memcpy(factor, scale + 3 * i, 3 * count * sizeof(double));
        posed(vertex, motion, rest, M, here);
        if (found) spread(here, 1, count, one, &found, 3 * i);
        if (pose) {
            v hanging[3 * JOINTS], arm[3 * JOINTS];
            for (integer k = 0; k < JOINTS; ++k)
                below(weights + k, motion + MOTIONS + 12 * k, (const anywhere *)rest, hanging + 3 * k);
            look_ahead(vertices, 0, POSEDIRS);
            arms((const anywhere *)hanging, weights, motion + CENTRES, arm);
            for (integer k = 0; k < JOINTS; ++k) {
                const integer bends = POSEDIRS + 27 * (k - 1);
                double *const *rows = pose + 3 * k;
                if (!rows[0] && !rows[1] && !rows[2]) continue; /* a joint that is held */
                if (k) look_ahead(vertices, bends, 27);
                by_joint(k ? vertex + bends : (const anywhere *)still, (const anywhere *)M,
                         (const anywhere *)arm + 3 * k, motion + OF_JOINTS + OF_JOINT * k, slope);
                spread(slope, 3, count, factor, rows, 3 * i);
            }
        }
        if (betas) {
            for (integer b = 0; b < BETAS; ++b) {
                if (!betas[b]) continue;
                by_beta(vertex + SHAPEDIRS + 3 * b, (const anywhere *)M, weights,
                        motion + OF_BETAS + 3 * JOINTS * b, slope);
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
EXPORT void adjoint(integer N, const double *vertices, const double *motion, const double *pull,
                    double *felt)
{
    v sum[MOTIONS + 12 * JOINTS] = {{0}};
    for (integer i = 0; i < N; i += LANES, vertices += LANES * ROWS) {
        const anywhere *vertex = (const anywhere *)vertices;
        v planar[3], rest[3], M[12], here[3], inside[3];
        double some[3 * LANES] = {0};
        memcpy(some, pull + 3 * i, 3 * at_most_all(N - i) * sizeof(double));
        for (int lane = 0; lane < LANES; ++lane)
            for (int d = 0; d < 3; ++d) planar[d][lane] = some[3 * lane + d];
        posed(vertex, motion, rest, M, here);
        on_rest((const anywhere *)M, (const anywhere *)planar, inside);
        on_betas(vertex + SHAPEDIRS, (const anywhere *)inside, sum);
        look_ahead(vertices, 0, POSEDIRS);
        for (integer k = 1; k < JOINTS; ++k) {
            look_ahead(vertices, POSEDIRS + 27 * (k - 1), 27);
            on_features(vertex + POSEDIRS + 27 * (k - 1), (const anywhere *)inside,
                        sum + FEATURES + 9 * (k - 1));
        }
        for (integer k = 0; k < JOINTS; ++k)
            on_motion(vertex + WEIGHTS + k, (const anywhere *)rest, (const anywhere *)planar,
                      sum + MOTIONS + 12 * k);
    }
    for (integer k = 0; k < MOTIONS + 12 * JOINTS; ++k) {
        felt[k] = 0;
        for (int lane = 0; lane < LANES; ++lane) felt[k] += sum[k][lane];
    }
}
