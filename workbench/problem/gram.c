/* The products of the columns of a matrix with many rows, with one another.

Rows are taken in blocks that stay near the processor. Columns that are zero in a block, as those of
joints that leave all of its vertices alone, are left out of it. The other ones stand side by side in
`packed`, and tiles of TALL x WIDE products are summed in registers, LANES rows at a time. `vectors.h`
comes first.
*/

#define BLOCK 128 /* rows, a multiple of LANES */
#define STEPS (BLOCK / LANES)
#if LANES == 8
#define TALL 4 /* TALL x WIDE sums, and one operand of each row and column, in 32 registers */
#define WIDE 6
#else
#define TALL 3 /* in 16 registers */
#define WIDE 3
#endif
#define UNROLLED _Pragma("GCC unroll 8")
/* keeps a number in a register that a compiler would otherwise read again for each of its uses */
#if defined(__x86_64__)
#define KEPT(x) __asm__("" : "+v"(x))
#elif defined(__aarch64__)
#define KEPT(x) __asm__("" : "+w"(x))
#else
#define KEPT(x)
#endif

/* the numbers of `room` that `gram` needs for n columns */
EXPORT integer room_for(integer n) { return (n + 1) * (n + 1) * LANES + (n + TALL + WIDE) * BLOCK; }

/* a column's rows of one block, filled up with zeros; whether any of them is not zero */
static inline int pack(const double *from, integer rows, v *restrict to)
{
    places seen = {0};
    long long any = 0;
    if (rows < BLOCK) memset(to, 0, BLOCK * sizeof(double));
    memcpy(to, from, rows * sizeof(double));
    for (integer s = 0; s < STEPS; ++s) seen |= (places)to[s] + (places)to[s]; /* without the signs of zeros */
    for (int lane = 0; lane < LANES; ++lane) any |= seen[lane];
    return any != 0;
}

/* the products of TALL packed columns with WIDE others, added to `sums` at their places */
static inline void tile(const v *restrict a, const v *restrict b, const integer *row, const integer *column,
                        integer width, v *restrict sums)
{
    v own[TALL][WIDE];
    UNROLLED for (int i = 0; i < TALL; ++i)
        UNROLLED for (int j = 0; j < WIDE; ++j) own[i][j] = sums[row[i] * width + column[j]];
    for (integer s = 0; s < STEPS; ++s) {
        v of_row[TALL];
        UNROLLED for (int i = 0; i < TALL; ++i) of_row[i] = a[i * STEPS + s];
        UNROLLED for (int j = 0; j < WIDE; ++j) {
            v x = b[j * STEPS + s];
            KEPT(x);
            UNROLLED for (int i = 0; i < TALL; ++i) own[i][j] += of_row[i] * x;
        }
    }
    UNROLLED for (int i = 0; i < TALL; ++i)
        UNROLLED for (int j = 0; j < WIDE; ++j) sums[row[i] * width + column[j]] = own[i][j];
}

/* found (n, n): the products of n columns of m rows, which begin at the addresses `columns`; the last one,
the residual, is never left out, so that what is not finite in others shows beside its zeros. room: see
room_for, at an address that is a multiple of 64 */
EXPORT void gram(integer m, integer n, const double *const *columns, double *room, double *found)
{
    const integer width = n + 1; /* what is beyond the last column is added up there */
    v *sums = (v *)room, *packed = sums + width * width;
    integer place[n + TALL + WIDE];
    memset(sums, 0, width * width * sizeof(v));
    for (integer first = 0; first < m; first += BLOCK) {
        const integer rows = m - first < BLOCK ? m - first : BLOCK;
        integer k = 0, asked = 0;
        for (integer j = 0; j < n; ++j) {
            place[k] = j;
            k += pack(columns[j] + first, rows, packed + k * STEPS) || j == n - 1;
        }
        for (integer j = k; j < k + TALL + WIDE; ++j) place[j] = n;
        memset(packed + k * STEPS, 0, (TALL + WIDE) * BLOCK * sizeof(double));
        for (integer i = 0; i < k; i += TALL) {
            for (; asked < n && asked * k < n * (i + TALL); ++asked) /* memory is asked for ahead of use */
                for (integer s = 0; s < STEPS; ++s)
                    __builtin_prefetch(columns[asked] + first + 2 * BLOCK + LANES * s, 0, 2);
            for (integer j = i; j < k; j += WIDE)
                tile(packed + i * STEPS, packed + j * STEPS, place + i, place + j, width, sums);
        }
    }
    for (integer i = 0; i < n; ++i)
        for (integer j = i; j < n; ++j) {
            double sum = 0;
            for (int lane = 0; lane < LANES; ++lane) sum += sums[i * width + j][lane];
            found[i * n + j] = found[j * n + i] = sum;
        }
}
