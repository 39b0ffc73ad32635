"""The paper's fixed-step algorithm as plain loops for numba, all errata as printed."""

import numpy as np

# Order of a lane's numbers.
NAMES = (
    "m", "M", "J", "J_passive", "r", "R", "K_t", "K_e", "mu_s", "mu_k", "mu_1s_b", "mu_2s_b", "mu_1k_b",
    "mu_2k_b", "P1", "P2", "g", "r_f", "v01", "v02", "frequency",
)  # fmt: skip
ENDS = ("x", "y", "vx", "vy", "omega_1", "omega_2", "motor_1", "motor_2", "belt_1", "belt_2")


def kernel(threads: int):
    """Compiled function `(machines [lane, 21], end [lane, 10], steps, dt)` that fills `end`."""
    import numba  # pyright: ignore[reportMissingImports]

    numba.set_num_threads(threads)

    @numba.njit(inline="always")
    def dead(load, bound):
        return 0.0 if abs(load) < bound else load - bound * np.sign(load)

    @numba.njit(inline="always")
    def rows(q, mu, sx, sy, su, sw, s1, s2, roll_1, roll_2):
        """Eqs. (39), (40), (48), (49), (57), (58), (66), (67): b_x and b_y."""
        m, M, r, P1, P2, g, r_f = q[0], q[1], q[4], q[14], q[15], q[16], q[17]
        one, two = -mu * 2.0 * P1 * r_f * s1 * roll_1, -mu * 2.0 * P2 * r_f * s2 * roll_2
        pulley_1, pulley_2 = 2.0**0.5 * mu * P1 * r_f, 2.0**0.5 * mu * P2 * r_f
        outer = (pulley_1 + pulley_2) * sx
        inner_1, inner_2 = -2.0 * pulley_1 * su, -2.0 * pulley_2 * sw
        b_x = one + two + inner_1 + inner_2 - outer + outer - mu * m * g * sx * r
        b_y = one - two + inner_1 - inner_2 - mu * (M + m) * g * sy * r
        return b_x, b_y

    @numba.njit(inline="always")
    def turning(q, torque, belt, omega, P, rolls, with_belt):
        """Acceleration of a motor pulley and the torque of the ground on it."""
        static, kinetic = q[8] * 2.0 * P * q[17], -q[9] * 2.0 * P * q[17] * np.sign(omega)
        if rolls:
            alpha = with_belt
        elif omega == 0.0:
            alpha = dead(torque + belt * q[4], static) / q[2]
        else:
            alpha = (kinetic + torque + belt * q[4]) / q[2]
        ground = kinetic
        if omega == 0.0:
            ground = -static * np.sign(alpha)
            if alpha == 0.0:
                ground = -min(max(torque, -static), static)
        return alpha, ground

    @numba.njit(inline="always")
    def motion(q, vx, vy, w1, w2, slip_1, slip_2, t1, t2, f1, f2):
        m, M, J, Jp, r = q[0], q[1], q[2], q[3], q[4]
        roll_1, roll_2 = 0.0 if slip_1 else 1.0, 0.0 if slip_2 else 1.0
        s = np.sign(vx), np.sign(vy), np.sign(vx + vy), np.sign(vx - vy), np.sign(w1), np.sign(w2)
        b_x, b_y = rows(q, q[9], s[0], s[1], s[2], s[3], s[4], s[5], roll_1, roll_2)
        a1, a2 = f1 * r if slip_1 else t1, f2 * r if slip_2 else t2
        load_x, load_y = b_x + a1 + a2, b_y + a1 - a2
        u0 = 1.0 if vx + vy == 0.0 else 0.0
        d0 = 1.0 if vx - vy == 0.0 else 0.0
        p0, n0 = (1.0 if w1 == 0.0 else 0.0) * roll_1, (1.0 if w2 == 0.0 else 0.0) * roll_2
        if vx == 0.0:
            bound = rows(q, q[8], 1.0, 0.0, u0, d0, p0, n0, 1.0, 1.0)
            load_x = dead(load_x, abs(bound[0]))
        if vy == 0.0:
            bound = rows(q, q[8], 0.0, 1.0, u0, -d0, p0, -n0, 1.0, 1.0)
            load_y = dead(load_y, abs(bound[1]))
        motors, coupling = (roll_1 + roll_2) * J / r, (roll_1 - roll_2) * J / r
        m_x = m * r + 8.0 * Jp / r + motors
        m_y = (M + m) * r + 4.0 * Jp / r + motors
        determinant = m_x * m_y - coupling * coupling
        ax = (m_y * load_x - coupling * load_y) / determinant
        ay = (m_x * load_y - coupling * load_x) / determinant
        alpha_1, ground_1 = turning(q, t1, f1, w1, q[14], not slip_1, (ax + ay) / r)
        alpha_2, ground_2 = turning(q, t2, f2, w2, q[15], not slip_2, (ax - ay) / r)
        return ax, ay, alpha_1, alpha_2, ground_1, ground_2

    @numba.njit(parallel=True)
    def run(machines, end, steps, dt):
        for lane in numba.prange(machines.shape[0]):
            q = machines[lane]
            J, r, P1, P2 = q[2], q[4], q[14], q[15]
            x = y = vx = vy = w1 = w2 = work_1 = work_2 = lost_1 = lost_2 = 0.0
            slip_1 = slip_2 = False
            for k in range(steps):
                angle = 2.0 * np.pi * q[20] * (k * dt)
                t1 = q[6] * ((q[18] * np.sin(angle) - q[7] * w1) / q[5])
                t2 = q[6] * ((q[19] * np.cos(angle) - q[7] * w2) / q[5])
                turn_1, turn_2 = (vx + vy) / r, (vx - vy) / r
                f1 = -2.0 * q[12] * P1 * np.sign(w1 - turn_1)
                f2 = -2.0 * q[13] * P2 * np.sign(w2 - turn_2)
                g1, g2 = f1 if slip_1 else 0.0, f2 if slip_2 else 0.0
                ideal = motion(q, vx, vy, w1, w2, slip_1, slip_2, t1, t2, g1, g2)
                needed_1 = abs(J * ideal[2] / r - J * ((ideal[4] + t1) / r)) / (2.0 * P1)
                needed_2 = abs(J * ideal[3] / r - J * ((ideal[5] + t2) / r)) / (2.0 * P2)
                slip_1, slip_2 = slip_1 or needed_1 > q[10], slip_2 or needed_2 > q[11]
                g1, g2 = f1 if slip_1 else 0.0, f2 if slip_2 else 0.0
                a = motion(q, vx, vy, w1, w2, slip_1, slip_2, t1, t2, g1, g2)
                work_1, work_2 = work_1 + dt * t1 * w1, work_2 + dt * t2 * w2
                lost_1 += dt * g1 * r * (w1 + turn_1)
                lost_2 += dt * g2 * r * (w2 + turn_2)
                x, y = x + dt * vx, y + dt * vy
                vx, vy = vx + dt * a[0], vy + dt * a[1]
                w1, w2 = w1 + dt * a[2], w2 + dt * a[3]
                turn_1, turn_2 = (vx + vy) / r, (vx - vy) / r
                slip_1, slip_2 = slip_1 and w1 != turn_1, slip_2 and w2 != turn_2
                if not slip_1:
                    w1 = turn_1
                if not slip_2:
                    w2 = turn_2
            end[lane, 0], end[lane, 1], end[lane, 2], end[lane, 3] = x, y, vx, vy
            end[lane, 4], end[lane, 5], end[lane, 6], end[lane, 7] = w1, w2, work_1, work_2
            end[lane, 8], end[lane, 9] = lost_1, lost_2

    return run
