"""An axis with dry friction under a sampled PID controller, in closed form: plain Python.

Between two instants the acceleration is constant: parabolas, a stop is the root of a line, and a block
at rest stays there while the force on it is at most the static one.
"""

import math
from dataclasses import dataclass


@dataclass
class Loop:
    period: float = 0.01
    kp: float = 50.0
    ki: float = 50.0
    kd: float = 10.0
    static: float = 1.5
    kinetic: float = 1.0
    quantum: float = 0.0
    delay: int = 0
    latency: float = 0.0
    target: float = 0.0

    def run(self, samples: int, x: float, v: float = 0.0):
        """Position, speed, sum of the errors times the period, and number of stops; behind the last
        period, before the sample there."""
        force, total, stops, outputs = 0.0, 0.0, 0, []

        def move(time):
            nonlocal x, v, stops
            while time > 0.0:
                if v == 0.0 and abs(force) <= self.static:
                    return
                sense = math.copysign(1.0, v if v != 0.0 else force)
                a = force - sense * self.kinetic
                until = -v / a if v * a < 0.0 else math.inf
                step = min(until, time)
                x += v * step + 0.5 * a * step * step
                v, time = (0.0, time - step) if until <= time else (v + a * step, 0.0)
                stops += until == step

        for k in range(samples):
            read = math.floor(x / self.quantum + 0.5) * self.quantum if self.quantum else x
            error = self.target - read
            total += self.period * error
            outputs.append(self.kp * error + self.ki * total - self.kd * v)
            move(self.latency)
            force = outputs[k - self.delay] if k >= self.delay else 0.0
            move(self.period - self.latency)
        return x, v, total, stops
