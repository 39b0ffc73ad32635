"""The planted faults of `make faults` can be planted: a patch that no longer applies shows nothing."""

import pytest

from tests.faults._table import faults, faulty
from tests.house._repository import ROOT

FEWEST = 60


@pytest.mark.parametrize("fault", faults(), ids=lambda fault: fault.name)
def test_a_fault_can_be_planted(fault):
    assert fault.file.startswith(("stickslip/", "corexy_jax/"))
    faulty(fault, (ROOT / fault.file).read_text(encoding="utf-8"))
    assert fault.tests
    assert all((ROOT / f"tests/{name}.py").is_file() for name in fault.tests)


def test_there_are_enough_of_them_with_names_of_their_own():
    names = [fault.name for fault in faults()]
    assert len(set(names)) == len(names) >= FEWEST
