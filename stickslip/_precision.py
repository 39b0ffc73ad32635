"""The float64 policy: events are located to rounding, which single precision cannot hold."""

import os

import jax

_FALSE = frozenset({"0", "false", "f", "no", "n", "off"})


def require_float64() -> None:
    """Switch JAX to 64-bit types, or raise where the environment forbids it.

    JAX turns 64-bit inputs into 32-bit ones unless told otherwise, so importing `stickslip` throws
    the switch. A user who set `JAX_ENABLE_X64` to false asked for something else, and overruling
    that silently would surprise as much as losing half the digits.
    """
    setting = os.environ.get("JAX_ENABLE_X64", "")
    if setting.strip().lower() in _FALSE:
        raise RuntimeError(
            f"stickslip computes in 64-bit floating point, but the environment sets "
            f"JAX_ENABLE_X64={setting}. Unset JAX_ENABLE_X64 or set it to 1, "
            f"then import stickslip again."
        )
    jax.config.update("jax_enable_x64", True)


# On import, so that the package can list this module first and hold nothing but imports.
require_float64()
