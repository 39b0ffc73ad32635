"""Maps of the CoreXY mechanism against time stepping that shares nothing with the package."""

import matplotlib.pyplot as plt
import numpy as np
import pytest

from experiments._experiment import Context, load
from tests.corexy_jax._moreau import SCENARIOS, Reference


def test_all_are_there():
    names = {name for name in load() if name.startswith("corexy-") or name == "identify-corexy"}
    figures = {f"corexy-fig{n:02d}" for n in range(4, 13)}
    maps = {f"corexy-map-{name}" for name in ("tension", "friction", "frequency")}
    assert names == figures | maps | {
        "corexy-dead-zone",
        "corexy-feedforward",
        "corexy-input-design",
        "corexy-plan",
        "corexy-print",
        "identify-corexy",
    }


@pytest.mark.slow
def test_corner_of_the_map_is_scenario_1(tmp_path):
    """Belts with mu_1s = 5 and mu_2s = 0.2 move as those of scenario 1: motor 1 needs at most 1.58."""
    experiment = load()["corexy-map-friction"]
    data = experiment.compute({**experiment.parameters, "points": 2}, Context(tmp_path))
    plt.close(experiment.draw(data))
    corner = data.isel(mu_1s_b=1, mu_2s_b=0)
    h = 1e-3
    _, _, v, sense = Reference(SCENARIOS[1], h).run(6.0, 1)
    slips = sense[1:, 6:] != 0
    relative = 0.05 * v[1:, 2:] - np.stack([v[1:, 0] + v[1:, 1], v[1:, 0] - v[1:, 1]], axis=1)
    distance = h * np.sum(np.abs(relative) * slips, axis=0)
    assert float(corner.slip_1) == 0.0
    assert distance[0] < 1e-9
    assert float(corner.slip_2) == pytest.approx(distance[1], rel=2e-3)
    number = 1 + slips[:, 0] + 2 * slips[:, 1]
    for k in (1, 2, 3, 4):
        assert float(corner[f"dmn_{k}"]) == pytest.approx(np.mean(number == k), abs=2e-3)
    rests = np.all(sense[1:, :2] == 0, axis=1)
    assert float(corner.moving) == pytest.approx(1 - np.mean(rests), abs=5e-3)
    assert {data[name].attrs["units"] for name in ("slip_1", "moving")} == {"m", "1"}
    # The other corners: belts that always hold, and belts that hold on one side only.
    assert float(data.dmn_1[1, 1]) > 0.99
    assert float(data.slip_1[0, 1]) > 10 > float(data.slip_2[0, 1])
