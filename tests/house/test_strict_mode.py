"""The strictness itself: a fault of each kind must fail here, or it would pass everywhere."""

import os
import re
import subprocess
import sys
import warnings
from pathlib import Path

import jax
import jax.numpy as jnp
import pytest

import stickslip as ss
from tests.house._repository import ROOT


def test_arrays_are_float64():
    assert jnp.zeros(()).dtype == jnp.float64


def test_two_devices_on_any_cpu():
    assert len(jax.devices("cpu")) == 2


def test_rank_promotion_raises():
    with pytest.raises(ValueError, match="rank_promotion"):
        jnp.ones((2, 3)) + jnp.ones(3)


def test_dtype_promotion_raises():
    with pytest.raises(jax.dtypes.TypePromotionError):
        jnp.ones(2) + jnp.ones(2, dtype=jnp.int32)


@pytest.mark.usefixtures("standard_dtype_promotion")
def test_dtype_promotion_can_be_lent():
    assert (jnp.ones(2) + jnp.ones(2, dtype=jnp.int32)).dtype == jnp.float64


def test_warnings_are_errors():
    with pytest.raises(UserWarning, match="planted"):
        warnings.warn("planted", stacklevel=1)


def test_annotations_are_checked_at_call_time(tmp_path):
    """The options of `make test-all`, on a package with a wrong but broadcastable shape."""
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    (typed,) = re.findall(r"^TYPED := (.*)$", makefile, re.MULTILINE)
    package = tmp_path / "stickslip"
    package.mkdir()
    (package / "__init__.py").write_text(
        "from jaxtyping import Array, Float\n"
        "def double(x: Float[Array, '3']) -> Float[Array, '3']:\n"
        "    return 2 * x\n"
    )
    (tmp_path / "test_planted.py").write_text(
        "import jax.numpy as jnp, stickslip\ndef test_planted():\n    stickslip.double(jnp.ones(1))\n"
    )
    options = [typed, "-c", ROOT / "pyproject.toml", "--rootdir", tmp_path]
    options += ["-p", "no:cacheprovider", "-o", f"pythonpath={tmp_path}"]
    done = subprocess.run(
        [sys.executable, "-m", "pytest", *options, "test_planted.py"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert "TypeCheckError" in done.stdout, done.stdout + done.stderr


def test_programs_are_kept_in_the_checkout_where_git_does_not_look(pytestconfig):
    """Those of this process and of the processes that it starts."""
    if getattr(pytestconfig, "cache", None) is None:
        pytest.skip("run with `-p no:cacheprovider`, which keeps nothing")
    kept, before = Path(os.environ["STICKSLIP_CACHE"]), jax.config.jax_compilation_cache_dir
    ss.enable_compilation_cache()  # the quick suite has it off, unless a test before this one has it on
    try:
        assert Path(jax.config.jax_compilation_cache_dir).is_relative_to(kept)
    finally:
        jax.config.update("jax_compilation_cache_dir", before)
    assert kept.is_relative_to(ROOT / pytestconfig.getini("cache_dir"))
    assert ".pytest_cache/" in (ROOT / ".gitignore").read_text(encoding="utf-8").splitlines()


def test_unknown_markers_are_refused(pytestconfig):
    assert pytestconfig.getoption("strict_markers")
