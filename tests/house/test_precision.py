"""The float64 policy, each case in an interpreter of its own: the switch is global to a process."""

import pytest

from tests.house._repository import PACKAGES, run_python


@pytest.mark.more
@pytest.mark.parametrize("package", PACKAGES)
def test_importing_switches_to_float64(package):
    done = run_python(f"import jax.numpy as jnp, {package}; print(jnp.zeros(()).dtype)")
    assert done.stdout.strip() == "float64", done.stderr


@pytest.mark.more
def test_a_switch_already_thrown_is_kept():
    done = run_python(
        "import stickslip, jax.numpy as jnp; print(jnp.zeros(()).dtype)", JAX_ENABLE_X64="true"
    )
    assert done.stdout.strip() == "float64", done.stderr


@pytest.mark.more
@pytest.mark.parametrize(
    ("package", "setting"), [("stickslip", "0"), ("stickslip", "False"), ("corexy_jax", "off")]
)
def test_single_precision_by_environment_is_refused(package, setting):
    done = run_python(f"import {package}", JAX_ENABLE_X64=setting)
    assert done.returncode != 0
    message = done.stderr.strip().splitlines()[-1]
    assert message.startswith("RuntimeError: stickslip computes in 64-bit floating point")
    assert f"JAX_ENABLE_X64={setting}" in message
    assert "Unset JAX_ENABLE_X64 or set it to 1" in message
