"""Parameters replaced by name."""

import pytest

import corexy_jax as cx

MACHINE, _ = cx.scenario(1)


def test_a_parameter_is_replaced_and_the_others_stay():
    changed = cx.with_values(MACHINE, {"P1": 14.0, "mu_s": 0.3})
    assert (float(changed.P1), float(changed.mu_s)) == (14.0, 0.3)
    assert float(changed.P2) == float(MACHINE.P2)


@pytest.mark.parametrize("name", ["gravity", "parameter_units", "units"])
def test_what_is_not_a_parameter_is_refused_by_name(name):
    with pytest.raises(ValueError, match=rf"values\['{name}'\] = 1.0: it must be named after one of m"):
        cx.with_values(MACHINE, {name: 1.0})
