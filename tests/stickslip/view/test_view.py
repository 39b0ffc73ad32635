"""`python -m stickslip view` without a browser: what it reads, draws, writes and refuses."""

import importlib.util
import re

import numpy as np
import pytest
import xarray as xr

from stickslip.__main__ import main
from tests.stickslip.view import _alone
from tests.stickslip.view._made_up import A, diagram_of, sections_of
from tests.stickslip.view._made_up_map import WORDS, V, X, map_of

pytest.importorskip("bokeh", reason="the viewer's extra is not installed")
from bokeh.document import Document
from bokeh.models import CustomJS

from stickslip.view import _file
from stickslip.view._diagram import Diagram
from stickslip.view._live import Live
from stickslip.view._map import Map, has_map
from stickslip.view._map_page import MapPage
from stickslip.view._module import import_functions
from stickslip.view.command import open_stored

MODULE, ALONE = "tests.stickslip.view._made_up", "tests.stickslip.view._alone"
MAPPED = "tests.stickslip.view._made_up_map"


def written(tmp_path, dataset=None):
    path = tmp_path / "made_up.nc"
    (diagram_of() if dataset is None else dataset).to_netcdf(path, engine="h5netcdf")
    return str(path)


def page(tmp_path, module=None):
    path = written(tmp_path)
    diagram = Diagram(open_stored(path), path)
    document = Document()
    return Live(diagram, module and import_functions(module, diagram.parameters), document), document


def work(document):
    """What the server does next."""
    for waiting in list(document.session_callbacks):
        document.remove_next_tick_callback(waiting)
        waiting.callback()


def test_the_diagram_has_all_points_and_a_click_shows_the_nearest_lane(tmp_path):
    live, document = page(tmp_path)
    truth = diagram_of().sel(seed=10)
    data = live.page.drawn.data
    assert len(data["y"]) == int(truth.x.notnull().sum()) == 28
    assert np.array_equal(np.unique(data["x"]), np.delete(A, 7))
    assert not data["bad"].any()
    live.choose(1.37)
    points = 14.0 * (-0.5) ** np.arange(5)
    np.testing.assert_allclose(live.page.return_points.data["x"], points[:-1], rtol=1e-15)
    np.testing.assert_allclose(live.page.return_points.data["y"], points[1:], rtol=1e-15)
    np.testing.assert_allclose(live.page.orbit_points.data["y"], points, rtol=1e-15)
    assert live.page.returns.title.text == "return map, a = 1.4 N: period 3, status ok"
    assert live.page.orbit.title.text.startswith("points in order, a = 1.4 N")
    assert live.page.marker.location == 1.4
    assert live.page.diagram.xaxis.axis_label == "load a [N]"
    live.choose(1.21)
    assert live.page.chosen.text == "a = 1.2 N: no period up to 16, status ok"
    live.choose(1.7)  # a lane without points
    assert len(live.page.return_points.data["x"]) == 0
    assert live.page.chosen.text == "a = 1.7 N: period unknown (too few points), status no crossing"
    assert document.title == "A made-up diagram"


def test_the_other_coordinate_is_chosen_and_a_region_dragged(tmp_path):
    live, _ = page(tmp_path)
    (select,) = live.page.selects
    assert [label for _, label in select.options] == ["10", "20"]
    select.value = "1"
    truth = diagram_of().sel(seed=20)
    data = live.page.drawn.data
    assert len(data["y"]) == int(truth.x.notnull().sum())
    np.testing.assert_allclose(np.unique(data["x"][data["bad"] == 1]), A[3:5])
    live.drag(1.45, 1.75)
    assert set(live.page.drawn.data["x"]) == set(A[5:8])
    assert live.page.back.visible
    live.back()
    assert not live.page.back.visible
    assert len(live.page.drawn.data["y"]) == len(data["y"])


def test_the_users_functions_are_asked_and_their_errors_shown(tmp_path, capsys):
    live, document = page(tmp_path, MODULE)
    work(document)
    live.page.selects[0].value = "1"
    live.choose(1.3)
    assert "computing" in live.page.message.text
    work(document)
    assert live.page.message.text == ""
    plane = live.page.plane_points.data
    np.testing.assert_allclose(np.hypot(plane["x"] - 20, plane["y"]), 1.3, rtol=1e-14)
    assert live.page.orbit.xaxis.axis_label == "time [s]"
    live.choose(1.9)
    work(document)
    assert "ArithmeticError: no orbit at a = 1.90 &lt;here&gt;" in live.page.message.text
    assert "ArithmeticError" in capsys.readouterr().err
    assert len(live.page.plane_points.data["x"]) == 0
    live.drag(1.2, 1.6)
    work(document)
    np.testing.assert_allclose(np.unique(live.page.drawn.data["x"]), np.linspace(1.2, 1.6, 5))
    assert live.page.back.visible
    work(document)
    live.back()
    assert set(live.page.drawn.data["x"]) == set(A)


def test_a_section_is_chosen_by_name_and_no_function_is_given_it(tmp_path):
    path = written(tmp_path, sections_of())
    diagram = Diagram(open_stored(path), path)
    document = Document()
    live = Live(diagram, import_functions(ALONE, diagram.parameters), document)
    work(document)
    (select,) = live.page.selects
    assert [label for _, label in select.options] == ["top", "low"]
    select.value = "1"
    live.choose(1.2)
    work(document)
    np.testing.assert_allclose(live.page.return_points.data["x"], 24.0 * (-0.5) ** np.arange(2))
    np.testing.assert_allclose(live.page.orbit_points.data["y"], 1.2 * np.linspace(0.0, 1.0, 11))
    select.value = "0"
    work(document)
    live.drag(1.2, 1.6)
    work(document)
    # Computed sections come in another order, and the chosen one is still drawn.
    top = sections_of(np.linspace(1.2, 1.6, 5)).x.sel(section="top").values
    np.testing.assert_array_equal(live.page.drawn.data["y"], top[np.isfinite(top)])


def test_a_click_on_a_map_shows_the_motion_from_there(tmp_path, capsys):
    path = written(tmp_path, map_of())
    dataset = open_stored(path)
    assert has_map(dataset)
    document = Document()
    shown = Map(dataset, path)
    page = MapPage(shown, import_functions(MAPPED, shown.parameters), document)
    truth = {(x, v): int(map_of().code.sel(x=x, v=v)) for x in X for v in V}
    names = {-1: "not settled", 0: "orbit 1", 1: "fixed point 1"}
    seen = page.cells.data
    assert len(seen["x"]) == X.size * V.size
    for x, v, word in zip(seen["x"], seen["y"], seen["word"], strict=True):
        assert word == names[truth[x, v]]
    page.choose(0.52, -0.6)
    work(document)
    assert page.chosen.text == "x = 0.5 m, v = -0.5 m/s: fixed point 1, time of entry [s] 4.5"
    assert (page.marker.data["x"], page.marker.data["y"]) == ([pytest.approx(0.5)], [-0.5])
    plane = page.motion.plane_points.data
    np.testing.assert_allclose(np.hypot(plane["x"], plane["y"]), np.hypot(0.5, 0.5), rtol=1e-14)
    assert (plane["x"][0], plane["y"][0]) == pytest.approx((0.5, -0.5))
    page.choose(-5.0, 5.0)  # beside the map: the nearest cell
    work(document)
    assert page.chosen.text.startswith("x = -0.9 m, v = 1.5 m/s: orbit 1")
    assert "ArithmeticError: no motion from v = 1.5 &lt;here&gt;" in page.message.text
    assert "ArithmeticError" in capsys.readouterr().err
    page.choose(-0.3, 0.0)  # two quick clicks: the first answer comes too late
    page.choose(0.9, 0.5)
    work(document)
    assert page.motion.plane_points.data["x"][0] == pytest.approx(0.9)


def test_a_map_without_a_module_says_what_each_cell_is():
    page = MapPage(Map(map_of().transpose(), "made up"), None, Document())
    page.choose(-0.5, 0.5)
    assert page.chosen.text.startswith("v = -0.5 m/s, x = 0.5 m: fixed point 1")


def test_cells_of_any_grid_meet_halfway():
    """Uneven, and stored backwards; a quantity that is named as a coordinate takes no place of it."""
    uneven = map_of().assign_coords(x=2.0 ** np.arange(X.size)).isel(x=slice(None, None, -1))
    shown = Map(uneven.assign(y=uneven.entry, left=uneven.entry), "made up")
    cells = MapPage(shown, None, Document()).cells.data
    for low, high, x, v, word in zip(
        *(cells[k] for k in ("left", "right", "x", "y", "word")), strict=True
    ):
        # Between 1, 2, 4, ... are 1.5, 3, 6, ...; the cells at both ends are as wide to both sides.
        assert (low, high) == (0.5 if x == 1.0 else 0.75 * x, 640.0 if x == 512.0 else 1.5 * x)
        assert word == shown.words[shown.number[shown.cell(x, v)]]
        assert word == WORDS[int(uneven.code.sel(x=x, v=v))].replace("_", " ")
    assert list(shown.beside) == ["entry", "y", "left"]


def test_a_map_that_is_not_finished_says_so():
    code = map_of().code
    code[2:4] = -4
    part = map_of().assign(code=code).assign_attrs(sweep_state="unfinished: 8 of 10 blocks")
    shown = Map(part, "made up")
    page = MapPage(shown, None, Document())
    page.choose(X[2], V[0])
    assert page.chosen.text.startswith("x = -0.5 m, v = -1.5 m/s: not computed")
    assert np.sum(page.cells.data["word"] == "not computed") == 2 * V.size


def test_a_large_map_is_thinned_and_each_of_its_cells_is_found():
    x, v = np.linspace(0.0, 1.0, 1501), np.linspace(-1.0, 1.0, 1001)
    code = (x[:, None] > np.abs(v)).astype(int)
    words = {"flag_meanings": "low high"}
    large = xr.Dataset({"code": (("x", "v"), code, words)}, {"x": x, "v": v})
    shown = Map(large, "made up")
    page = MapPage(shown, None, Document())
    assert 50_000 < len(page.cells.data["x"]) <= 200_000
    page.choose(0.5006, 0.5004)
    assert page.chosen.text == "x = 0.5006667, v = 0.5: high"


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        (lambda m: m.assign_coords(x=np.zeros(X.size)), "coordinate x has two finite values"),
        (lambda m: m.assign_coords(x=np.append(X[:-1], np.nan)), "coordinate x has two finite values"),
        (lambda m: m.isel(v=[0]), "coordinate v has two finite values"),
        (lambda m: m.assign(code=m.code.copy(data=7 + m.code.values)), "a word for each"),
        (lambda m: m.assign(code=m.code.assign_attrs(flag_values=[0, 1])), "as many flag_values"),
    ],
)
def test_a_map_that_cannot_be_drawn_is_refused(wrong, message):
    with pytest.raises(ValueError, match=message):
        Map(wrong(map_of()), "made up")


def test_a_file_keeps_one_orbit_for_all_sections(tmp_path):
    diagram = Diagram(sections_of(), "made up")
    _alone.ASKED.clear()
    found = _file.orbits_of(diagram, import_functions(ALONE, diagram.parameters))
    assert [(orbit["slice"], orbit["x"]) for orbit in found] == [(i, a) for i in range(2) for a in A]
    assert _alone.ASKED == list(A)


def test_one_file_without_a_server(tmp_path, capsys):
    target = tmp_path / "page.html"
    assert main(["view", written(tmp_path), "--with", MODULE, "--html", str(target)]) == 0
    text = target.read_text()
    assert len(text) < _file.LARGEST
    assert not re.findall(r"""<(?:script|link|img|iframe)[^>]*(?:src|href)\s*=\s*["']http""", text)
    diagram = Diagram(diagram_of(), "made up")
    found = _file.orbits_of(diagram, import_functions(MODULE, diagram.parameters))
    assert len(found) == 22
    assert [orbit["x"] for orbit in found if orbit["error"]] == pytest.approx([1.9, 2.0, 1.9, 2.0])
    capsys.readouterr()
    document = _file.document_of(diagram, found, _file.MOST_POINTS)
    (callback,) = document.select({"type": CustomJS})
    truth = diagram_of().x.values
    np.testing.assert_allclose(callback.args["y"], truth[np.isfinite(truth)], rtol=1e-7)
    assert np.array_equal(np.diff(callback.args["start"]), np.isfinite(truth).sum(axis=-1).ravel())


def test_lanes_are_left_out_evenly_where_all_do_not_fit():
    pack = _file.pack_points(Diagram(diagram_of(), "made up"), 30)
    truth = diagram_of().x.values[:, ::2]
    assert pack.stride == 2
    np.testing.assert_allclose(pack.y, truth[np.isfinite(truth)], rtol=1e-7)
    with pytest.raises(ValueError, match="two lanes of each of 2 choices"):
        _file.pack_points(Diagram(diagram_of(), "made up"), 3)


def test_a_store_of_a_sweep_is_read(tmp_path):
    from stickslip.sweep import Compute, Labels, Variable, run_sweep

    run_sweep(
        lambda a: {"x": np.arange(3.0) * a}, {"a": np.array([1.0, 2.0])}, store=tmp_path / "store",
        labels=Labels({"x": Variable(("point",))}), compute=Compute("portable", progress=False),
    )  # fmt: skip
    diagram = Diagram(open_stored(str(tmp_path / "store")), "store")
    lanes = diagram.lanes([])
    assert lanes.y.tolist() == [[0, 1, 2], [0, 2, 4]]
    assert diagram.in_words(lanes, 1) == "a = 2: period unknown (not stored), status not stored"


@pytest.mark.more
def test_a_store_of_several_sections_has_their_names(tmp_path):
    import stickslip as ss
    from stickslip.analysis import Maximum as Top
    from stickslip.analysis import Minimum, Recording, orbit_diagram
    from stickslip.sweep import Compute, open_dataset
    from tests.stickslip.analysis._arrays import Free

    orbit_diagram(
        Free(1.0), {"stiffness": np.array([1.0, 1.44, 2.25])}, {"x": 1.0, "v": 0.0},
        record=Recording(0.0, 15.0, {"top": Top("x"), "low": Minimum("x")}, "x", points=2, check=0),
        store=tmp_path / "store",
        integrator=ss.Integrator("rk4", ss.FixedStep(0.05)),
        compute=Compute("portable", progress=False),
    )  # fmt: skip
    read = open_dataset(tmp_path / "store")
    assert read.x.sel(section="low").shape == (3, 2)
    diagram = Diagram(open_stored(str(tmp_path / "store")), "store")
    assert diagram.others == {"section": ["top", "low"]}
    assert diagram.parameters == ["stiffness"]
    # From rest at 1 the first top comes after a period: all tops are at 1, all lows at -1.
    for number, place in enumerate((1.0, -1.0)):
        np.testing.assert_allclose(diagram.lanes([number]).y, np.full((3, 2), place), atol=1e-5)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["absent.nc"], "path = 'absent.nc': it must be a netCDF file or the store of a sweep"),
        (["text"], "unreadable"),
        (["folder"], "has no manifest.json"),
        (["flat"], "without a number over `point`; dimensions: a (11)"),
        (["words"], "with x over place and `point`, no parameter with numbers"),
        (["good", "--x", "b"], "x = 'b': it must be one of 'seed', 'a'"),
        (["good", "--observable", "y"], "observable = 'y': it must be one of 't', 'x'"),
        (["good", "--with", "no.such.module"], "with = 'no.such.module', not imported"),
        (["good", "--with", "math"], "with = 'math': it must be a module with a function"),
        (["good", "--with", "stickslip.view.command"], "must be a module with a function `orbit"),
        (["good", "--with", "tests.stickslip.view._wrong"], "_wrong.orbit"),
        (["good", "--port", "70000"], "port = 70000: it must be at most 65535"),
        (["good", "--html", "page.txt"], "html = 'page.txt': it must be the path of a file whose name"),
        (["good", "--html", "no/page.html"], "in a directory that is there"),
        (["map", "--html", "page.html"], "html = 'page.html': it must be absent for a map"),
        (["map", "--with", MODULE], "orbit(x=..., v=...)"),
        (["map", "--observable", "entry"], "observable = 'entry': it must be one of 'code'"),
    ],
)
def test_what_is_wrong_is_refused_by_name(options, message, tmp_path, capsys):
    made = {
        "good": diagram_of(),
        "flat": diagram_of().drop_vars(["t", "x"]).isel(seed=0),
        "map": map_of(),
        "words": xr.Dataset({"x": (("place", "point"), np.ones((2, 3)))}, {"place": ["here", "there"]}),
    }
    first, *rest = options
    if first in made:
        first = written(tmp_path, made[first])
    elif first == "folder":
        first = str(tmp_path)
    elif first == "text":
        (tmp_path / "text.nc").write_text("no data")
        first = str(tmp_path / "text.nc")
    assert main(["view", first, *rest]) == 2
    assert message in capsys.readouterr().err


def test_without_bokeh_one_sentence_says_what_to_install(tmp_path, capsys, monkeypatch):
    found = importlib.util.find_spec
    monkeypatch.setattr(
        importlib.util, "find_spec", lambda name, *rest: None if name == "bokeh" else found(name, *rest)
    )
    assert main(["view", written(tmp_path)]) == 2
    assert capsys.readouterr().err.strip().endswith("pip install 'bokeh>=3.7'")
