/* Stick-slip motions by a loop written for them: eight lanes a register, Runge-Kutta steps of a fixed
 * length, each event by the Illinois rule on a step that is repeated until its guard is zero.
 *
 * job.h, written by stick_slip.py, defines STEP: from x, u, h and `slips` (1 or 0) the state x1, u1 after
 * a step of the method, its stages written out.
 */
#include <stdint.h>

#define WIDTH 8
#define SOLVED 1e-13

typedef double real __attribute__((vector_size(8 * WIDTH)));
typedef int64_t whole __attribute__((vector_size(8 * WIDTH)));

#include "job.h"

#define INLINE static inline __attribute__((always_inline))

INLINE real pick(whole yes, real a, real b) {
    return (real)((yes & (whole)a) | (~yes & (whole)b));
}

INLINE int any(whole mask) {
    int64_t found = 0;
    for (int i = 0; i < WIDTH; i++) found |= mask[i];
    return found != 0;
}

static void block(const double *speeds, double length, double end, double *out) {
    const real zero = {0.0}, one = zero + 1.0, half = zero + 0.5, H = zero + length;
    real t = zero, x = zero, u, v, h = H, low = zero, high = zero, at_low = zero, at_high = zero;
    whole sliding = {0}, open = {0}, side = {0};
    __builtin_memcpy(&v, speeds, sizeof v);
    u = v;
    while (any(t < end)) {
        real left = end - t, slips = pick(sliding, one, zero), x1, u1;
        h = pick(h > left, left, h);
        STEP
        real g = pick(sliding, v - u1, one - x1);
        whole solved = (g <= SOLVED) & (g >= -SOLVED) & (h < left);
        whole fires = solved & (open | (g < 0.0)), plain = ~fires & ~open & (g >= 0.0);
        whole goes = fires | plain;
        if (any(~goes)) {
            /* The bracket of a lane: its guard is positive at `low` and not at `high`. */
            whole opens = ~goes & ~open, up = ~goes & open & (g > 0.0), down = ~goes & open & (g <= 0.0);
            real g0 = pick(sliding, v - u, one - x);
            at_low = pick(opens, g0, pick(up, g, pick(down & (side > 0), at_low * half, at_low)));
            at_high = pick(opens | down, g, pick(up & (side < 0), at_high * half, at_high));
            low = pick(opens, zero, pick(up, h, low));
            high = pick(opens | down, h, high);
            side = (opens & 0) | (~opens & ((down & 1) | (up & -1) | (goes & side)));
        }
        open = open & ~fires;
        open = open | ~goes;
        t = pick(goes, t + h, t);
        x = pick(goes, x1, x);
        u = pick(fires, v, pick(plain, u1, u));
        sliding = sliding ^ fires;
        h = pick(goes, H, (low * at_high - high * at_low) / (at_high - at_low));
    }
    __builtin_memcpy(out, &x, sizeof x);
}

void stick_slip(long lanes, const double *speeds, double h, double end, int threads, double *out) {
#pragma omp parallel for num_threads(threads) schedule(static)
    for (long i = 0; i < lanes; i += WIDTH) block(speeds + i, h, end, out + i);
}
