"""Run by the system's Python, which has Siconos: Moreau time stepping of a forced dry-friction block.

Prints one JSON list of rows [t, x, v]. Arguments: step, end, forcing amplitude, forcing frequency,
friction force, x0, v0. The forcing is carried as two more states (cosine and minus sine).
"""

import json
import sys

import numpy as np
import siconos.kernel as sk

h, end, a, w, f, x0, v0 = map(float, sys.argv[1:])
field = np.array([[0, 1, 0, 0], [-1, 0, a, 0], [0, 0, 0, w], [0, 0, -w, 0]], float)
block = sk.FirstOrderLinearTIDS([x0, v0, 1.0, 0.0], field)
contact = sk.FirstOrderLinearTIR(
    np.array([[0.0, 1.0, 0.0, 0.0]]), np.array([[0.0], [1.0], [0.0], [0.0]])
)
interaction = sk.Interaction(sk.RelayNSL(1, -f, f), contact)
model = sk.NonSmoothDynamicalSystem(0.0, end)
model.insertDynamicalSystem(block)
model.link(interaction, block)
solver = sk.Relay()
solver.numericsSolverOptions().dparam[0] = 1e-14
run = sk.TimeStepping(model, sk.TimeDiscretisation(0.0, h), sk.EulerMoreauOSI(1.0), solver)
rows = []
while run.hasNextEvent():
    run.computeOneStep()
    rows.append([run.nextTime(), *block.x()[:2]])
    run.nextStep()
print(json.dumps(rows))
