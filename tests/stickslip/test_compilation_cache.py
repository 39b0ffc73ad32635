"""A second process finds the programs of the first; what is damaged costs time and nothing else."""

import os
import subprocess
import sys
import time

import pytest

import stickslip as ss
from stickslip._compilation_cache import _shrink

PROGRAM = """
import os
import jax.monitoring
import jax.numpy as jnp
import stickslip as ss
from stickslip.systems import CoulombOscillator, Motion

ss.enable_compilation_cache(os.environ["STICKSLIP_CACHE"] + "-other")
jnp.ones(3) * 2.0  # JAX has opened a cache, and not the one that is wanted
read = []
jax.monitoring.register_event_listener(lambda event, **_: read.append(event))
folder = ss.enable_compilation_cache()
block = CoulombOscillator(1.0, 1.0, 1.0, 0.5, 0.2)
run = ss.simulate(block, 0.0, 30.0, Motion(x=0.0, v=0.2), "stick")
print(folder)
print(read.count("/jax/compilation_cache/cache_hits"))
print(float(run.y1.x))
"""


def process(cache):
    environment = {**os.environ, "STICKSLIP_CACHE": str(cache)}
    command = [sys.executable, "-W", "ignore", "-c", PROGRAM]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    folder, hits, x = done.stdout.split()
    return folder, int(hits), float(x)


@pytest.mark.more
def test_programs_are_read_and_damaged_ones_compiled_anew(tmp_path):
    folder, hits, x = process(tmp_path)
    assert folder.startswith(str(tmp_path))
    assert hits == 0
    assert x == pytest.approx(0.658436755, abs=1e-8)  # closed form, see the README

    entries = sorted(tmp_path.glob("compiled/*/*-cache"), key=lambda path: path.stat().st_size)
    assert entries
    assert process(tmp_path) == (folder, len(entries), x)

    largest = entries[-1].read_bytes()
    for entry in entries:
        entry.write_bytes(b"no program")
    assert process(tmp_path) == (folder, 0, x)
    entries[-1].write_bytes(largest[: len(largest) // 2])  # as a process leaves it that was killed
    assert process(tmp_path) == (folder, 0, x)


def test_what_was_not_used_for_longest_goes(tmp_path):
    folder = tmp_path / "jaxlib"
    folder.mkdir()
    for age, name in enumerate("abcd"):
        entry = folder / f"{name}-cache"
        entry.write_bytes(bytes(100))
        then = time.time() - 1000.0 * age
        os.utime(entry, (then, then))
    (folder / "other").write_bytes(bytes(1000))
    _shrink(tmp_path, 250.0)
    assert sorted(path.name for path in folder.iterdir()) == ["a-cache", "b-cache", "other"]


def test_bad_arguments_and_a_directory_that_cannot_be(tmp_path):
    with pytest.raises(TypeError, match="directory"):
        ss.enable_compilation_cache(3)
    with pytest.raises(ValueError, match="max_bytes"):
        ss.enable_compilation_cache(tmp_path, max_bytes=0.0)
    occupied = tmp_path / "file"
    occupied.write_text("")
    assert ss.enable_compilation_cache(occupied) is None
