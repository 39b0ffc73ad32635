"""Every identification command scores further records of its format; the measured ones are needed."""

import os
import pathlib

import pytest

from experiments import _data, _output
from experiments.double_pendulum import _record as arm
from experiments.double_pendulum import identify as of_arm
from experiments.pendulum import _record as swing
from experiments.pendulum import identify as of_swing
from experiments.rock import _record as rock
from experiments.rock import identify as of_rock

COPIED = {  # a copy of the record is the further one: command, group, name, changes
    "rock": (of_rock, "rsf_velocity_steps", rock.NAME, ["starts=1"]),
    "pendulum": (of_swing, "multiarm_pendulum", swing.NAME, []),
}


def _numbers(line: str) -> list[float]:
    return [
        float(w.rstrip(",")) for w in line.split() if w[:1].isdigit() and w.rstrip(",")[-1].isdigit()
    ]


def _folder() -> pathlib.Path:
    if _data.VARIABLE not in os.environ:
        pytest.skip(f"{_data.VARIABLE} is not set")
    return pathlib.Path(os.environ[_data.VARIABLE])


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:The fit converged")  # by viscous friction alone it cannot be good
@pytest.mark.parametrize("kind", COPIED)
def test_a_further_record(kind, tmp_path, capsys):
    command, group, name, changes = COPIED[kind]
    whole = _data.find(_folder(), group, name, "").read_bytes()
    further = f"further{pathlib.Path(name).suffix}"
    for copy in (name, further):
        (tmp_path / copy).write_bytes(whole)
    changes = [*changes, f"scored={further}"]
    _output.run(command.EXPERIMENT, tmp_path, quick=True, data=tmp_path, changes=changes)
    lines = capsys.readouterr().out.splitlines()
    told = [line for line in lines if line.startswith(f"{further}, ")]
    assert len(told) == 2
    assert any(line.startswith("fitted from a state that is ") for line in lines)
    for line in told:
        errors = _numbers(line.partition("error")[2])
        if kind == "rock":  # fitted to it or taken over from its copy: the same
            assert errors[0] == pytest.approx(errors[1], rel=1e-2)
            assert errors[0] < 1e-3
        else:  # the segment that was fitted, and others that were not [mrad]
            assert errors[0] < 40.0


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:The fit converged")  # no law explains all of the record
def test_further_trajectories(tmp_path, capsys):
    changes = ["records=3", "scored=5,2"]
    _output.run(of_arm.EXPERIMENT, tmp_path, quick=True, data=_folder(), changes=changes)
    told = capsys.readouterr().out
    assert "Trajectory 2 after 3 s, simulation: " in told
    assert "\nfitted from rest: at the first angles" in told
    assert "trajectory 5 [rad]" in told


def test_what_is_not_a_list_of_records():
    assert _data.listed("scored", " a.mat, b.mat,") == ("a.mat", "b.mat")
    assert _data.numbered("records", "2,3") == (2, 3)
    for text, allowed in (("2,2", None), ("x", None), ("4", range(1, 4))):
        with pytest.raises(ValueError, match=f"--set records={text}: it must"):
            _data.numbered("records", text, allowed)
    assert arm.NAME.format(2).endswith("02.csv")
