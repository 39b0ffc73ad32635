"""Programs in files: they give the digits of the function, anywhere, or a refusal in one sentence."""

import json
import os
import subprocess
import sys
import zipfile
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import stickslip as ss
from stickslip.systems import CoulombOscillator, Motion

# Compiled with other optimisations the last digits are others.
AS_HERE = {"JAX_DISABLE_MOST_OPTIMIZATIONS": str(jax.config.values["jax_disable_most_optimizations"])}


class Place(NamedTuple):
    x: Any
    y: Any


def product(place, scale):
    return {"both": place.x * place.y * scale, "parts": [place.x, (place.y, None)], "note": "constant"}


def run(mu_k, speed):
    block = CoulombOscillator(1.0, 1.0, 1.0, mu_k, speed)
    found = ss.simulate(block, 0.0, 30.0, Motion(x=0.0, v=speed), "stick", throw=False)
    return {"end": found.y1, "result": found.result}


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    path = tmp_path_factory.mktemp("programs") / "product.zip"
    example = Place(2.0, np.arange(3.0)), 2.0
    return ss.export(product, example, path, derivatives=True, units={"both": "J", "place.x": "m"})


def test_results_are_those_of_the_function_by_name(path):
    program, place = ss.load(path), Place(3.0, jnp.arange(3.0) + 0.1)
    expected = product(place, 0.7)
    for given in (place, {"y": place.y, "x": 3}):
        found = program(given, 0.7)
        assert found.keys() == {"both", "parts"}
        np.testing.assert_array_equal(found["both"], expected["both"])
        np.testing.assert_array_equal(found["parts"][1][0], place.y)
    assert "place.x [m]" in repr(program)
    assert program.header["outputs"]["both"]["unit"] == "J"
    slope = jax.grad(lambda scale: jnp.sum(program(place, scale)["both"]))(0.7)
    np.testing.assert_allclose(slope, np.sum(3.0 * np.asarray(place.y)), rtol=1e-15)


@pytest.mark.more
def test_a_motion_from_another_process_and_directory_has_the_same_digits(tmp_path):
    path = ss.export(run, (0.5, 0.2), tmp_path / "run.zip")
    (tmp_path / "elsewhere").mkdir()
    script = f"""
import stickslip as ss
program = ss.load({str(path)!r})
found = program(0.4, 0.3)
print(float(found["end"]["x"]).hex(), program.words["result"][found["result"]])
"""
    done = subprocess.run(
        [sys.executable, "-c", script], cwd=tmp_path / "elsewhere", capture_output=True, text=True,
        check=True, env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), **AS_HERE},
    )  # fmt: skip
    expected = jax.jit(run)(0.4, 0.3)["end"].x
    assert done.stdout.split() == [float(expected).hex(), "successful"]


def test_a_batch_of_any_length(tmp_path):
    program = ss.load(ss.export(product, (Place(1.0, 2.0), 3.0), tmp_path / "batch.zip", batch=True))
    for n in (1, 5):
        found = program(Place(np.arange(n) + 0.5, np.ones(n)), np.full(n, 2.0))
        np.testing.assert_array_equal(found["both"], 2.0 * np.arange(n) + 1.0)
    with pytest.raises(ValueError, match="batches of one length"):
        program(Place(np.ones(2), np.ones(2)), np.ones(3))


def test_arguments_of_other_names_shapes_and_types_are_refused(path):
    program = ss.load(path)
    with pytest.raises(TypeError, match=r"those of the file: place.x, place.y, scale"):
        program({"x": 1.0}, 2.0)
    with pytest.raises(ValueError, match=r"place.y = .*, of shape \(2,\): it must be of shape \(3\)"):
        program(Place(1.0, np.ones(2)), 2.0)
    with pytest.raises(TypeError, match=r"scale = .* it must be of type float64"):
        program(Place(1.0, np.ones(3)), 2.0j)
    with pytest.raises(TypeError, match="takes 2 arguments, not 1"):
        program(Place(1.0, np.ones(3)))


def test_functions_that_cannot_be_in_a_file_are_refused(tmp_path):
    def calls_the_host(x):
        return jax.pure_callback(np.sin, jax.ShapeDtypeStruct((), jnp.float64), x)

    def two_of_one_name(x):
        return {"a": {"b": x}, "a.b": x}

    for function, why in (
        (calls_the_host, "does not call the host"),
        (two_of_one_name, r"one result named 'a.b'"),
        (lambda x: {"note": "none"}, "whose result has numbers"),
    ):
        with pytest.raises(ValueError, match=why):
            ss.export(function, (1.0,), tmp_path / "none.zip")
    with pytest.raises(ValueError, match=r"units = 'z': it must be the name of .* x, y"):
        ss.export(lambda x: {"y": x}, (1.0,), tmp_path / "none.zip", units={"z": "m"})
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ({"jax": "0.1.2"}, r"was made with JAX 0\.1\.2, and this is JAX .*: export it again"),
        ({"format": "stickslip program 0"}, "has the format 'stickslip program 0'"),
        ({"platforms": ["tpu"]}, "was made for tpu, not for cpu"),
        ({"sha256": "0"}, "is damaged: its program is not the one"),
    ],
)
def test_files_of_other_versions_are_refused(path, tmp_path, change, why):
    other = tmp_path / "other.zip"
    with zipfile.ZipFile(path) as file, zipfile.ZipFile(other, "w") as new:
        new.writestr("header.json", json.dumps({**json.loads(file.read("header.json")), **change}))
        new.writestr("program", file.read("program"))
    with pytest.raises(ValueError, match=why):
        ss.load(other)


def test_numbers_that_name_results_are_names(tmp_path):
    def named(x, y):
        return {"far": {10**9: x["a.b"] + y}, "a": (x["a.b"], y), "a.b": y}

    program = ss.load(ss.export(named, ({"a.b": 1.0}, 2.0), tmp_path / "named.zip"))
    found = program({"a.b": 3.0}, 4.0)
    assert found == {"far": {"1000000000": 7.0}, "a": [3.0, 4.0], "a.b": 4.0}
    with pytest.raises(ValueError, match=r"arguments = .*names of their own"):
        ss.export(lambda x: x, ({"a.b": 1.0, "a": {"b": 2.0}},), tmp_path / "none.zip")


def test_what_is_no_file_is_refused(tmp_path):
    with pytest.raises(ValueError, match=r"path = .*: it must be a file of stickslip.export"):
        ss.load(tmp_path / "none.zip")


def test_a_flipped_byte_anywhere_is_seen(path, tmp_path):
    whole = path.read_bytes()
    for place in np.random.default_rng(0).integers(0, len(whole), 40):
        other = tmp_path / "other.zip"
        other.write_bytes(whole[:place] + bytes([whole[place] ^ 16]) + whole[place + 1 :])
        try:
            found = ss.load(other)
        except ValueError:
            continue
        # In what the archive says of itself, its time say: header and program are whole.
        assert found.header == ss.load(path).header
