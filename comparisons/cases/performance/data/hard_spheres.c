/* Hard spheres from collision to collision, in plain C: the reference of the case event_speed.
 *
 *     cc -O2 -ffp-contract=off -o hard_spheres hard_spheres.c -lm
 *     hard_spheres START END     -> events collisions crossings stale seconds mean_height
 *
 * The algorithm of gpudem.event_driven without periodic sides, saw-teeth, friction and guard: one event a particle,
 * cells, a clock of its own for each, a tournament tree, lazy invalidation; the same arithmetic in the same order.
 * Part of gpudem, MIT licence. START is written by comparisons/event_speed.py.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#define FAR 1e300
#define NOBODY (-1)
#define WALL (-2)

typedef double vec[3];

static int n, leaves, cells[3], reach[3], wall[6], shut[6];
static vec lo, edge, gravity;
static double wall_at[6], wall_speed[6], wall_e[6], e;
static vec *x, *v;
static double *clock_of, *radius, *mass, *hit_time, *cross_time, *time_of;
static int *head, *next, *previous, (*cell)[3], *collisions, *partner, *partner_collisions, *cross_side, *winner;
static long pairs, hits, crossings, stale;
static double work, dissipated, overlap, virial;

static double fall_time(double h, double w, double a)
{
    if (h <= 0 && w < 0)
        return 0;
    if (a < 0) {
        double s = sqrt(fmax(w * w - 2 * a * h, 0));
        return w >= 0 ? (w + s) / -a : 2 * h / (s - w);
    }
    if (w >= 0)
        return FAR;
    double q = w * w - 2 * a * h;
    return q < 0 ? FAR : 2 * h / (sqrt(q) - w);
}

static double dot(const double *a, const double *b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

static double meeting_time(const double *r, const double *u, double d)
{
    double b = dot(r, u);
    if (b >= 0)
        return FAR;
    double c = dot(r, r) - d * d;
    if (c <= 0)
        return 0;
    double q = b * b - dot(u, u) * c;
    return q <= 0 ? FAR : c / (sqrt(q) - b);
}

static int place(const int *c) { return (c[2] * cells[1] + c[1]) * cells[0] + c[0]; }

static void put(int i)
{
    int k = place(cell[i]), first = head[k];
    next[i] = first;
    previous[i] = -1;
    if (first >= 0)
        previous[first] = i;
    head[k] = i;
}

static void take(int i)
{
    if (previous[i] >= 0)
        next[previous[i]] = next[i];
    else
        head[place(cell[i])] = next[i];
    if (next[i] >= 0)
        previous[next[i]] = previous[i];
}

static void bring(int i, double t)
{
    double dt = t - clock_of[i];
    for (int k = 0; k < 3; k++) {
        x[i][k] += dt * (v[i][k] + 0.5 * dt * gravity[k]);
        v[i][k] += dt * gravity[k];
    }
    clock_of[i] = t;
}

/* Earliest meeting of i, whose clock is t, in cells first..end around its own, if before best. */
static double scan(int i, double t, const int *first, const int *end, double best, int *who)
{
    int c[3];
    *who = NOBODY;
    for (int dz = first[2]; dz <= end[2]; dz++) {
        if ((c[2] = cell[i][2] + dz) < 0 || c[2] >= cells[2])
            continue;
        for (int dy = first[1]; dy <= end[1]; dy++) {
            if ((c[1] = cell[i][1] + dy) < 0 || c[1] >= cells[1])
                continue;
            for (int dx = first[0]; dx <= end[0]; dx++) {
                if ((c[0] = cell[i][0] + dx) < 0 || c[0] >= cells[0])
                    continue;
                for (int j = head[place(c)]; j >= 0; j = next[j]) {
                    double dt = t - clock_of[j], half = 0.5 * dt;
                    vec r, u;
                    for (int k = 0; k < 3; k++) {
                        r[k] = x[i][k] - (x[j][k] + dt * (v[j][k] + half * gravity[k]));
                        u[k] = v[i][k] - (v[j][k] + dt * gravity[k]);
                    }
                    double after = t + meeting_time(r, u, radius[i] + radius[j]);
                    if (after < best && j != i) {
                        best = after;
                        *who = j;
                    }
                }
            }
        }
    }
    return best;
}

static void predict_crossing(int i, double t)
{
    double best = FAR;
    int side = 0;
    for (int k = 0; k < 3; k++) {
        if (!reach[k])
            continue;
        if (cell[i][k] > 0 || !shut[2 * k]) {
            double after = t + fall_time(x[i][k] - (lo[k] + cell[i][k] * edge[k]), v[i][k], gravity[k]);
            if (after < best) {
                best = after;
                side = 2 * k;
            }
        }
        if (cell[i][k] < cells[k] - 1 || !shut[2 * k + 1]) {
            double high = lo[k] + (cell[i][k] + 1) * edge[k];
            double after = t + fall_time(high - x[i][k], -v[i][k], -gravity[k]);
            if (after < best) {
                best = after;
                side = 2 * k + 1;
            }
        }
    }
    cross_time[i] = best;
    cross_side[i] = side;
    time_of[i] = fmin(best, hit_time[i]);
}

static void play(int i)
{
    int node = (leaves + i) >> 1, a = i & -2, won = time_of[a + 1] < time_of[a] ? a + 1 : a;
    int old = winner[node];
    winner[node] = won;
    while (node > 1 && (won != old || won == i)) {
        node >>= 1;
        int p = winner[2 * node], q = winner[2 * node + 1];
        won = time_of[q] < time_of[p] ? q : p;
        old = winner[node];
        winner[node] = won;
    }
}

static void predict(int i, double t)
{
    int first[3] = {-reach[0], -reach[1], -reach[2]}, who;
    double best = scan(i, t, first, reach, FAR, &who);
    for (int k = 0; k < 3; k++) {
        for (int side = 2 * k; side < 2 * k + 2; side++) {
            if (!wall[side])
                continue;
            double sign = 1 - 2 * (side % 2);
            double h = (side % 2 ? wall_at[side] - x[i][k] : x[i][k] - wall_at[side]) - radius[i];
            double after = t + fall_time(h, sign * v[i][k], sign * gravity[k]);
            if (after < best) {
                best = after;
                who = WALL - side;
            }
        }
    }
    hit_time[i] = best;
    partner[i] = who;
    if (who >= 0)
        partner_collisions[i] = collisions[who];
    predict_crossing(i, t);
}

static void cross(int i, double t)
{
    int k = cross_side[i] / 2, step = 2 * (cross_side[i] % 2) - 1, who;
    bring(i, t);
    if (cell[i][k] + step < 0 || cell[i][k] + step >= cells[k]) {
        fprintf(stderr, "particle %d left the domain at t = %.9g\n", i + 1, t);
        exit(1);
    }
    take(i);
    cell[i][k] += step;
    put(i);
    int first[3] = {-reach[0], -reach[1], -reach[2]}, end[3] = {reach[0], reach[1], reach[2]};
    first[k] = end[k] = step;
    double best = scan(i, t, first, end, hit_time[i], &who);
    if (who >= 0) {
        hit_time[i] = best;
        partner[i] = who;
        partner_collisions[i] = collisions[who];
    }
    predict_crossing(i, t);
    play(i);
    crossings++;
}

static void hit_wall(int i, int side, double t)
{
    int k = side / 2;
    double sign = 1 - 2 * (side % 2), u = wall_speed[side], q = wall_e[side];
    bring(i, t);
    double w = sign * v[i][k], dw = (1 + q) * (u - w);
    v[i][k] += sign * dw;
    work += mass[i] * dw * u;
    dissipated += 0.5 * mass[i] * (1 - q * q) * (w - u) * (w - u);
    collisions[i]++;
    hits++;
    predict(i, t);
    play(i);
}

static void hit_pair(int i, int j, double t)
{
    vec r, u;
    bring(i, t);
    bring(j, t);
    for (int k = 0; k < 3; k++)
        r[k] = x[i][k] - x[j][k];
    double distance = sqrt(dot(r, r)), d = radius[i] + radius[j];
    for (int k = 0; k < 3; k++) {
        r[k] /= distance;
        u[k] = v[i][k] - v[j][k];
    }
    double w = dot(r, u), reduced = mass[i] * mass[j] / (mass[i] + mass[j]);
    double impulse = fmax(-(1 + e) * reduced * w, 0);
    for (int k = 0; k < 3; k++) {
        v[i][k] += impulse / mass[i] * r[k];
        v[j][k] -= impulse / mass[j] * r[k];
    }
    if (w < 0)
        dissipated += 0.5 * reduced * (1 - e * e) * w * w;
    virial += impulse * d;
    overlap = fmax(overlap, (d - distance) / d);
    collisions[i]++;
    collisions[j]++;
    pairs++;
    predict(i, t);
    predict(j, t);
    play(i);
    play(j);
}

static void *room(size_t count, size_t size)
{
    void *p = calloc(count, size);
    if (!p) {
        fprintf(stderr, "out of memory\n");
        exit(1);
    }
    return p;
}

static double number(FILE *file)
{
    double a;
    if (fscanf(file, "%lf", &a) != 1) {
        fprintf(stderr, "START: a number is missing\n");
        exit(1);
    }
    return a;
}

static void start(const char *path)
{
    FILE *file = fopen(path, "r");
    if (!file) {
        perror(path);
        exit(1);
    }
    n = (int)number(file);
    for (leaves = 2; leaves < n;)
        leaves *= 2;
    for (int k = 0; k < 3; k++) {
        cells[k] = (int)number(file);
        reach[k] = (int)number(file);
        lo[k] = number(file);
        edge[k] = number(file);
        gravity[k] = number(file);
    }
    for (int k = 0; k < 6; k++) {
        wall[k] = (int)number(file);
        shut[k] = (int)number(file);
        wall_at[k] = number(file);
        wall_speed[k] = number(file);
        wall_e[k] = number(file);
    }
    e = number(file);
    x = room(n, sizeof *x), v = room(n, sizeof *v), cell = room(n, sizeof *cell);
    radius = room(n, sizeof(double)), mass = room(n, sizeof(double)), clock_of = room(n, sizeof(double));
    hit_time = room(n, sizeof(double)), cross_time = room(n, sizeof(double));
    time_of = room(leaves, sizeof(double)), winner = room(leaves, sizeof(int));
    next = room(n, sizeof(int)), previous = room(n, sizeof(int)), collisions = room(n, sizeof(int));
    partner = room(n, sizeof(int)), partner_collisions = room(n, sizeof(int)), cross_side = room(n, sizeof(int));
    size_t boxes = (size_t)cells[0] * cells[1] * cells[2];
    head = room(boxes, sizeof(int));
    for (size_t k = 0; k < boxes; k++)
        head[k] = -1;
    for (int i = 0; i < leaves; i++)
        time_of[i] = FAR;
    for (int i = 0; i < n; i++) {
        for (int k = 0; k < 3; k++)
            x[i][k] = number(file);
        for (int k = 0; k < 3; k++)
            v[i][k] = number(file);
        radius[i] = number(file);
        mass[i] = number(file);
        for (int k = 0; k < 3; k++)
            cell[i][k] = (int)fmin(fmax(floor((x[i][k] - lo[k]) / edge[k]), 0), cells[k] - 1);
        put(i);
    }
    fclose(file);
    for (int i = 0; i < n; i++)
        predict(i, 0);
    for (int node = leaves - 1; node > 0; node--) {
        int leaf = 2 * node >= leaves, a = leaf ? 2 * node - leaves : winner[2 * node];
        int b = leaf ? a + 1 : winner[2 * node + 1];
        winner[node] = time_of[b] < time_of[a] ? b : a;
    }
}

int main(int count, char **words)
{
    if (count != 3) {
        fprintf(stderr, "usage: hard_spheres START END\n");
        return 2;
    }
    double end = atof(words[2]), height = 0;
    start(words[1]);
    struct timespec a, b;
    clock_gettime(CLOCK_MONOTONIC, &a);
    for (;;) {
        int i = winner[1];
        double t = time_of[i];
        if (t > end)
            break;
        if (cross_time[i] < hit_time[i])
            cross(i, t);
        else if (partner[i] < 0)
            hit_wall(i, WALL - partner[i], t);
        else if (collisions[partner[i]] != partner_collisions[i]) {
            stale++;
            bring(i, t);
            predict(i, t);
            play(i);
        } else
            hit_pair(i, partner[i], t);
    }
    clock_gettime(CLOCK_MONOTONIC, &b);
    for (int i = 0; i < n; i++) {
        bring(i, end);
        height += x[i][2];
    }
    printf("%ld %ld %ld %ld %.9f %.17g\n", pairs + hits + crossings + stale, pairs + hits, crossings, stale,
           (double)(b.tv_sec - a.tv_sec) + 1e-9 * (double)(b.tv_nsec - a.tv_nsec), height / n);
    return 0;
}
