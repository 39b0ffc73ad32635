/* The bifurcation diagram of the block on a belt, by hand: what the machine can do.
 *
 * Tsit5 with fixed steps, lanes side by side in vector registers, a few registers of lanes interleaved
 * to hide latencies, one exponential and one division per evaluation, blocks of lanes shared out over
 * the cores. Where the acceleration of the block changes sign downwards the state before the step is
 * put aside; afterwards the crossings are located by taking that step again with other lengths.
 *
 * job.h, written by diagram.py, defines the parameters of the model and the tableau. WIDTH is the
 * number of lanes in a register, GROUPS the registers of one kind. WIDTH 1 is plain C: the equations
 * as printed, with the exponential functions of the library. With U_IN defined it is the full model
 * with the drive, whose rotor must turn forward all the time.
 *
 * Compiled without -ffast-math: the rounding in `exponential` needs the order of operations. */
#if defined(__AVX__)
#include <immintrin.h>
#endif
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "job.h"

#define INLINE static inline __attribute__((always_inline))
#define REFINEMENTS 6

#if WIDTH > 1
typedef double real __attribute__((vector_size(8 * WIDTH)));
typedef int64_t whole __attribute__((vector_size(8 * WIDTH)));
#define LANE(value, i) ((value)[i])
#else
typedef double real;
typedef int64_t whole;
#define LANE(value, i) (value)
#endif

#ifdef U_IN
#define WITH_DRIVE(...) __VA_ARGS__
#define BELT_VELOCITY(s) ((s).w * (R_BP / RHO))
#else
#define WITH_DRIVE(...)
#define BELT_VELOCITY(s) V_B
#endif

/* u, v: velocities; a, b: accelerations; w, i_w: speed of the rotor and current, c, d: their rates */
typedef struct { real x, y, u, v WITH_DRIVE(, w, i_w); } state;
typedef struct { real u, v, a, b WITH_DRIVE(, c, d); } slope;
typedef struct { long lane, step; double x, y, u, v WITH_DRIVE(, w, i_w); } crossing;

#if WIDTH > 1
INLINE whole bits(real a) { return (whole)a; }
INLINE real number(whole a) { return (real)a; }
INLINE real pick(whole yes, real a, real b) { return number((yes & bits(a)) | (~yes & bits(b))); }
INLINE int any(whole mask) {
#if defined(__AVX512DQ__) && WIDTH >= 8
    __m512i part[WIDTH / 8];
    int found = 0;
    memcpy(part, &mask, sizeof mask);
    for (int i = 0; i < WIDTH / 8; i++) found |= _mm512_movepi64_mask(part[i]);
#elif defined(__AVX__) && WIDTH >= 4
    __m256d part[WIDTH / 4];
    int found = 0;
    memcpy(part, &mask, sizeof mask);
    for (int i = 0; i < WIDTH / 4; i++) found |= _mm256_movemask_pd(part[i]);
#else
    int64_t found = 0;
    for (int i = 0; i < WIDTH; i++) found |= mask[i];
#endif
    return found != 0;
}

/* exp(z), z in [-700, 0]; relative error 1e-15. */
INLINE real exponential(real z) {
    const double integer = 6755399441055744.0; /* added to a number, it leaves its integer in the low bits */
    real shifted = z * 1.4426950408889634 + integer;
    real n = shifted - integer;
    real f = (z - n * 6.93147180369123816490e-01) - n * 1.90821492927058770002e-10;
    real f2 = f * f, f4 = f2 * f2;
    real low = (1.0 + f) + f2 * (0.5 + f * (1.0 / 6.0));
    real middle = (0.041666666666624164 + f * 0.008333333333330065)
        + f2 * (0.0013888888917196719 + f * 0.00019841269863040545);
    real high = (2.4801521322368692e-05 + f * 2.7557268480310024e-06)
        + f2 * (2.7620075879983367e-07 + f * 2.5100375832561234e-08);
    return number(bits(low + f4 * (middle + f4 * high)) + (bits(shifted) << 52));
}

/* mu(v), Eq. (12), by one exponential; the division is left to the caller. */
INLINE real friction(real v, real normal) {
    const whole sign = (whole){0} + INT64_MIN;
    real speed = number(bits(v) & ~sign);
    real e = exponential(speed * -ALPHA), e2 = e * e, one = e2 + 1.0;
    real over = (1.0 - e2) * (e * (2.0 * BETA) + one) * normal;
    real under = (speed * GAMMA + 1.0) * one * one;
    return number(bits(over / under) ^ (bits(v) & sign)) * MU_0;
}
#else
INLINE real pick(whole yes, real a, real b) { return yes ? a : b; }
INLINE int any(whole mask) { return mask != 0; }
INLINE real friction(real v, real normal) {
    return normal * MU_0 / (1 + GAMMA * fabs(v)) * (1 + BETA / cosh(ALPHA * v)) * tanh(ALPHA * v);
}
#endif

/* Eqs. (8) to (11), with the drive also (1) and (7). */
INLINE slope field(state s, real k3) {
    real stretched = k3 * (s.y + s.x * s.x * (0.5 / R));
    real angle = s.y * (1.0 / R);
    real lever = angle * (angle * (angle * (-1.0 / 6.0) - 0.5) + 1.0) + 1.0;
    real on_rim = s.v * C2 + stretched;
    real normal = lever * (0.75 * M_PENDULUM * G) + (M_BLOCK * G) - on_rim;
    real shared = (s.u + s.v) * C1 + (s.x + s.y) * K2;
    real dry = friction(s.u - BELT_VELOCITY(s), normal);
    real force = shared + s.x * K1 + stretched * (s.x * (1.0 / R)) + dry;
    real torque = shared + on_rim + lever * (0.75 * M_PENDULUM * G) + (Q / R);
    WITH_DRIVE(real drive = s.i_w * K_M + dry * (R_BP / (ETA * RHO)) - s.w * B_DC - T_K;)
    WITH_DRIVE(real volts = U_IN - s.w * K_E - s.i_w * R_W;)
    return (slope){s.u, s.v, force * (-1.0 / M_BLOCK), torque * (-R * R / J)
        WITH_DRIVE(, drive * (1.0 / J_DRIVE), volts * (1.0 / L_W))};
}

/* One step of length h from s, where the slope is k0. */
INLINE state step(state s, slope k0, real k3, real h) {
#define ALL(SUM) (state){SUM(x, u), SUM(y, v), SUM(u, a), SUM(v, b) WITH_DRIVE(, SUM(w, c), SUM(i_w, d))}
#define STAGE_1(at, c) s.at + (h * A_1_0) * k0.c
    slope k1 = field(ALL(STAGE_1), k3);
#define STAGE_2(at, c) s.at + (h * A_2_0) * k0.c + (h * A_2_1) * k1.c
    slope k2 = field(ALL(STAGE_2), k3);
#define STAGE_3(at, c) s.at + (h * A_3_0) * k0.c + (h * A_3_1) * k1.c + (h * A_3_2) * k2.c
    slope k_3 = field(ALL(STAGE_3), k3);
#define STAGE_4(at, c) \
    s.at + (h * A_4_0) * k0.c + (h * A_4_1) * k1.c + (h * A_4_2) * k2.c + (h * A_4_3) * k_3.c
    slope k4 = field(ALL(STAGE_4), k3);
#define STAGE_5(at, c) \
    s.at + (h * A_5_0) * k0.c + (h * A_5_1) * k1.c + (h * A_5_2) * k2.c + (h * A_5_3) * k_3.c \
        + (h * A_5_4) * k4.c
    slope k5 = field(ALL(STAGE_5), k3);
#define END(at, c) \
    s.at + (h * B_0) * k0.c + (h * B_1) * k1.c + (h * B_2) * k2.c + (h * B_3) * k_3.c \
        + (h * B_4) * k4.c + (h * B_5) * k5.c
    return ALL(END);
}

INLINE real filled(double value) { return (real){0} + value; }

INLINE long put_aside(crossing *found, long n, long lane, long number, whole crosses, state s) {
    for (int i = 0; i < WIDTH; i++)
        if (LANE(crosses, i))
            found[n++] = (crossing){lane + i, number, LANE(s.x, i), LANE(s.y, i), LANE(s.u, i), LANE(s.v, i)
                WITH_DRIVE(, LANE(s.w, i), LANE(s.i_w, i))};
    return n;
}

/* All steps of WIDTH * GROUPS lanes; crossings of the steps from `first` on are put aside. */
static long run(long lane, const double *k3s, double h, long steps, long first, crossing *found, double *end) {
    state s[GROUPS], before[GROUPS];
    real k3[GROUPS], last[GROUPS];
    long n = 0;
    for (int g = 0; g < GROUPS; g++) {
        memcpy(&k3[g], k3s + g * WIDTH, sizeof(real));
        s[g] = before[g] = (state){filled(START_X), filled(START_Y), filled(0), filled(0)
            WITH_DRIVE(, filled(0), filled(START_I_W))};
        last[g] = filled(-1);
    }
    for (long it = 0; it <= steps; it++) {
        slope k0[GROUPS];
        whole crosses[GROUPS], some = {0};
#pragma GCC unroll 8
        for (int g = 0; g < GROUPS; g++) {
            k0[g] = field(s[g], k3[g]);
            crosses[g] = (last[g] > 0.0) & (k0[g].a <= 0.0);
            some |= crosses[g];
        }
        if (__builtin_expect(any(some), 0) && it > first)
            for (int g = 0; g < GROUPS; g++)
                n = put_aside(found, n, lane + g * WIDTH, it - 1, crosses[g], before[g]);
        if (it == steps) break;
#pragma GCC unroll 8
        for (int g = 0; g < GROUPS; g++) {
            before[g] = s[g];
            last[g] = k0[g].a;
            s[g] = step(s[g], k0[g], k3[g], filled(h));
        }
    }
    for (int g = 0; g < GROUPS; g++) memcpy(end + g * WIDTH, &s[g].x, sizeof(real));
    return n;
}

/* Part of the step at which the acceleration is zero (Illinois), and x there. */
static void locate(state s, real k3, double h, real *part, real *x) {
    slope k0 = field(s, k3);
    state there = step(s, k0, k3, filled(h));
    real low = filled(0), high = filled(1), at_low = k0.a, at_high = field(there, k3).a;
    whole was_low = {0}, was_high = {0};
    for (int i = 0; i < REFINEMENTS; i++) {
        *part = (low * at_high - high * at_low) / (at_high - at_low);
        there = step(s, k0, k3, *part * h);
        *x = there.x;
        real value = field(there, k3).a;
        whole past = value <= 0.0, not_yet = value > 0.0;
        at_low = pick(past, pick(was_high, at_low * 0.5, at_low), value);
        at_high = pick(past, value, pick(was_low, at_high * 0.5, at_high));
        low = pick(past, low, *part);
        high = pick(past, *part, high);
        was_high = past;
        was_low = not_yet;
    }
}

/* Points x and times t, `room` per lane, of `lanes` lanes; how many there are in `count`. */
void diagram(long lanes, const double *k3, double h, long steps, long first, long room, int threads,
             double *x, double *t, int32_t *count, double *end) {
    const long size = WIDTH * GROUPS, blocks = (lanes + size - 1) / size;
#pragma omp parallel num_threads(threads)
    {
        crossing *found = malloc(sizeof(crossing) * (steps - first + 2) * size / 2);
#pragma omp for schedule(dynamic, 1)
        for (long block = 0; block < blocks; block++) {
            double k3s[WIDTH * GROUPS], ends[WIDTH * GROUPS];
            long lane = block * size, here = lanes - lane < size ? lanes - lane : size;
            for (long i = 0; i < size; i++) k3s[i] = k3[lane + (i < here ? i : here - 1)];
            long n = run(lane, k3s, h, steps, first, found, ends);
            memcpy(end + lane, ends, sizeof(double) * here);
            memset(count + lane, 0, sizeof(int32_t) * here);
            for (long j = 0; j < n; j += WIDTH) {
                state s = {filled(0), filled(0), filled(0), filled(0) WITH_DRIVE(, filled(0), filled(0))};
                real k = filled(0), part, at;
                for (int i = 0; i < WIDTH; i++) {
                    const crossing *c = found + (j + i < n ? j + i : n - 1);
                    LANE(s.x, i) = c->x, LANE(s.y, i) = c->y, LANE(s.u, i) = c->u, LANE(s.v, i) = c->v;
                    WITH_DRIVE(LANE(s.w, i) = c->w, LANE(s.i_w, i) = c->i_w;)
                    LANE(k, i) = k3s[c->lane - lane];
                }
                locate(s, k, h, &part, &at);
                for (int i = 0; i < WIDTH && j + i < n; i++) {
                    const crossing *c = found + j + i;
                    if (c->lane >= lanes || count[c->lane] >= room) continue;
                    long place = c->lane * room + count[c->lane]++;
                    x[place] = LANE(at, i);
                    t[place] = h * (c->step + LANE(part, i));
                }
            }
        }
        free(found);
    }
}
