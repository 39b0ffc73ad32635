"""A damaged store is repaired, refused in one sentence, or as good as sound; it never lies.

The truth is NumPy's. What a damage does not touch, the user's own files among it, stays.
"""

import shutil

import numpy as np
import pytest

from stickslip.sweep import SweepMismatchError, SweepWriteError, open_dataset
from tests.stickslip.sweep._damage import kinds, other_lane, sweep, theses, truth

KINDS = kinds()
OUTCOMES = {}  # to be counted by whoever wants to know
# Those that put something of the user's, or a way out of the store, where the sweep's files are.
AROUND = [
    kind for kind in KINDS if any(w in kind for w in ("thesis", "another", "inside", "lost", "more"))
]
FILLED = {"x": np.isnan, "pair": np.isnan, "code": lambda a: a == -1}


@pytest.fixture(scope="module")
def stores(tmp_path_factory):
    """A sound store, and one of another sweep of the same shapes."""
    folder = tmp_path_factory.mktemp("sound")
    sweep(folder / "store")
    sweep(folder / "other", other_lane)
    return folder


def contents(path):
    """Every file but the diary, through links."""
    return {
        str(p.relative_to(path)): p.read_bytes()
        for p in path.rglob("*")
        if p.is_file() and p.name not in ("runs.jsonl", "lock")
    }


def is_one_sentence(error, argument):
    """Whether the error is the package's own, short, and begins with what was asked for."""
    text = error.strerror if isinstance(error, SweepWriteError) else str(error)
    own = type(error) in (ValueError, SweepMismatchError, SweepWriteError)
    begin = "could not " if isinstance(error, SweepWriteError) else f"{argument} = "
    return own and text.startswith(begin) and "\n" not in text and len(text) < 600


def assert_right(dataset):
    """The values of the sound store, or for blocks that it says are missing what stands for none."""
    assert set(dataset.variables) == set(truth())
    assert dataset.attrs["sweep_verified"] in ("yes", "by size and age")
    finished = dataset.attrs["sweep_state"] == "finished"
    missing = 0
    for name, want in truth().items():
        got = np.asarray(dataset[name])
        assert got.dtype == want.dtype
        right = got == want
        if name in FILLED and not finished:
            filled = FILLED[name](got)
            missing += int(filled.sum())
            right |= filled
        assert right.all(), name
    assert finished == (missing == 0)
    assert dataset.x.dims == ("k", "q")
    assert dataset.x.attrs == {"units": "m"}


def outcome(call, argument):
    """`None` if the call refused as it should, else the right dataset."""
    refusal = None
    try:
        dataset = call().load()
    except Exception as error:
        refusal = error
    if refusal is not None:
        assert is_one_sentence(refusal, argument), repr(refusal)
        return None
    assert_right(dataset)
    return dataset


def damaged(kind, stores, tmp_path):
    shutil.copytree(stores, tmp_path, dirs_exist_ok=True)
    KINDS[kind](tmp_path / "store", tmp_path / "other")
    return tmp_path / "store"


@pytest.mark.more
@pytest.mark.parametrize("kind", KINDS)
def test_it_is_repaired_refused_or_harmless(kind, stores, tmp_path):
    store = damaged(kind, stores, tmp_path)
    own, other, before = theses(tmp_path), contents(tmp_path / "other"), contents(store)
    read = outcome(lambda: open_dataset(store), "path")
    assert contents(store) == before
    resumed = outcome(lambda: sweep(store), "store")
    after = contents(store)
    assert theses(tmp_path) == own
    assert contents(tmp_path / "other") == other
    if resumed is None:
        OUTCOMES[kind] = "refused"
        # No block, no record and nothing of the user's is gone.
        assert {k: v for k, v in before.items() if k in after} == {k: after[k] for k in before}
        return
    assert resumed.attrs["sweep_state"] == "finished"
    OUTCOMES[kind] = "harmless" if after == before and read is not None else "repaired"
    again = outcome(lambda: open_dataset(store), "path")
    assert again is not None
    assert again.attrs["sweep_state"] == "finished"


@pytest.mark.more
@pytest.mark.parametrize("kind", AROUND)
def test_replacing_removes_the_sweep_and_nothing_else(kind, stores, tmp_path):
    store = damaged(kind, stores, tmp_path)
    own, other = theses(tmp_path), contents(tmp_path / "other")
    outcome(lambda: sweep(store, resume=False), "store")
    assert theses(tmp_path) == own
    assert contents(tmp_path / "other") == other


def test_there_are_enough_kinds():
    assert len(KINDS) >= 100
