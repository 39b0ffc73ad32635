"""How motions start is a choice, by one of three kinds, that every identification of a record names."""

import inspect
import sys

import pytest

from experiments._experiment import load
from experiments._starts import Start, starts_told


def test_words(capsys):
    told = starts_told(fitted=Start("rest"), left_out=Start("given", "by its first samples"))
    assert told == "fitted from rest\nleft out from a state that is given: by its first samples"
    assert capsys.readouterr().out == told + "\n"
    with pytest.raises(ValueError, match="kind is 'moving'; it must be one of rest, given, fitted"):
        Start("moving")


def test_every_identification_of_a_record_names_its_starts():
    every = [one for name, one in load().items() if name.startswith("identify-")]
    found = [one for one in every if one.brought or one.measured]
    assert len(found) >= 5
    for experiment in found:
        of_record = experiment.measured or experiment
        module = sys.modules[of_record.compute.__module__]
        assert "starts_told(" in inspect.getsource(module), experiment.name
