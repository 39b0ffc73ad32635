"""The page in headless Chromium: no complaint, nothing fetched, and a click changes the orbit."""

import asyncio

import numpy as np
import pytest

from stickslip.__main__ import main
from stickslip.view._diagram import Diagram
from stickslip.view._live import Live
from stickslip.view._map import Map
from stickslip.view._map_page import MapPage
from stickslip.view._module import import_functions
from stickslip.view._server import start_server
from tests.stickslip.view import _chromium
from tests.stickslip.view._made_up import A, diagram_of, sections_of
from tests.stickslip.view._made_up_map import map_of

pytest.importorskip("bokeh", reason="the viewer's extra is not installed")
pytestmark = pytest.mark.skipif(_chromium.PROGRAM is None, reason="no Chromium on this machine")

MODEL = "Bokeh.documents[0].get_model_by_name('{}')"
READY = (
    "window.Bokeh !== undefined && Bokeh.documents.length > 0 && "
    + MODEL.format("drawn")
    + (" !== null && " + MODEL.format("drawn") + ".data.x.length > 0")
)
CELL = """(() => {{
  for (const view of Bokeh.index.roots) {{
    const found = [...view.owner.query((v) => v.model.type === 'Figure')][0]
    const box = found.el.getBoundingClientRect(), frame = found.frame
    return [box.x + frame.x_scale.compute({x}), box.y + frame.y_scale.compute({y})]
  }}
}})()"""
# The place of a parameter in the window, by the scales of the page itself.
PLACE = """(() => {{
  for (const view of Bokeh.index.roots) {{
    const found = [...view.owner.query((v) => v.model.type === 'Figure')][0]
    const box = found.el.getBoundingClientRect(), frame = found.frame
    return [box.x + frame.x_scale.compute({x}), box.y + frame.bbox.y_center]
  }}
}})()"""


async def column(page, name, key="y"):
    """A column of a source as numbers."""
    values = await page.evaluate(f"Array.from({MODEL.format(name)}.data.{key})")
    return np.array(values, float)


async def place(page, x):
    return await page.evaluate(PLACE.format(x=x))


async def look(url):
    async with _chromium.open_page(url) as page:
        await page.until(READY)
        before = await column(page, "orbit")
        await page.click(await place(page, A[4]))
        await page.until(f"{MODEL.format('marker')}.location === {A[4]}")
        after = await column(page, "orbit")
        returns = await column(page, "returns", "x"), await column(page, "returns")
        text = await page.evaluate(f"{MODEL.format('chosen')}.text")
        await page.evaluate(f"{MODEL.format('seed')}.value = '1'")
        bad = await column(page, "drawn", "bad")
        return before, after, returns, text, bad, page.complaints, page.requests


def test_a_click_shows_another_orbit(tmp_path):
    path, target = tmp_path / "made_up.nc", tmp_path / "page.html"
    diagram_of().to_netcdf(path, engine="h5netcdf")
    assert main(["view", str(path), "--html", str(target)]) == 0
    before, after, returns, text, bad, complaints, requests = asyncio.run(look(target.as_uri()))
    assert complaints == []
    assert [url for url in requests if not url.startswith(("file:", "data:"))] == []
    truth = diagram_of().x.values
    np.testing.assert_allclose(before, truth[0, 5, :1], rtol=1e-7)
    np.testing.assert_allclose(after, truth[0, 4, :5], rtol=1e-7)
    np.testing.assert_allclose(returns, [truth[0, 4, :4], truth[0, 4, 1:5]], rtol=1e-7)
    assert text == "a = 1.4 N: period 3, status ok"
    assert bad.size == np.isfinite(truth[1]).sum()
    assert bad.sum() == np.isfinite(truth[1, 3:5]).sum()


async def switch(url):
    """Points and words of each section, after one click."""
    async with _chromium.open_page(url) as page:
        await page.until(READY)
        await page.click(await place(page, A[4]))
        await page.until(f"{MODEL.format('marker')}.location === {A[4]}")
        found = [(await column(page, "orbit"), await column(page, "drawn"))]
        await page.evaluate(f"{MODEL.format('section')}.value = '1'")
        found.append((await column(page, "orbit"), await column(page, "drawn")))
        named = await page.evaluate(f"{MODEL.format('section')}.options.map((o) => o[1])")
        return found, named, page.complaints


def test_sections_are_chosen_on_the_page(tmp_path):
    path, target = tmp_path / "sections.nc", tmp_path / "page.html"
    sections_of().to_netcdf(path, engine="h5netcdf")
    assert main(["view", str(path), "--html", str(target)]) == 0
    found, named, complaints = asyncio.run(switch(target.as_uri()))
    assert complaints == []
    assert named == ["top", "low"]
    truth = sections_of().x.values
    for (orbit, drawn), points in zip(found, truth.swapaxes(0, 1), strict=True):
        np.testing.assert_allclose(orbit, points[4][np.isfinite(points[4])], rtol=1e-7)
        np.testing.assert_allclose(drawn, points[np.isfinite(points)], rtol=1e-7)


async def ask(diagram):
    """What the server's page shows after a click, an orbit that fails, a dragged region, and back."""
    functions = import_functions("tests.stickslip.view._made_up", diagram.parameters)
    server = start_server(lambda document: Live(diagram, functions, document), 0)
    try:
        async with _chromium.open_page(f"http://localhost:{server.port}/") as page:
            await page.until(READY)
            await page.click(await place(page, A[4]))
            await page.until(f"{MODEL.format('marker')}.location === {A[4]}")
            await page.until(f"{MODEL.format('plane')}.data.x.length > 0")
            circle = await column(page, "plane", "x"), await column(page, "plane")
            await page.click(await place(page, A[9]))
            await page.until(f"{MODEL.format('message')}.text.includes('Error')")
            error = await page.evaluate(f"{MODEL.format('message')}.text")
            await page.drag(await place(page, 1.2), await place(page, 1.6))
            await page.until(f"{MODEL.format('back')}.visible")
            region = np.unique(await column(page, "drawn", "x"))
            return circle, error, region, page.complaints
    finally:
        server.stop()
        server.unlisten()


def test_the_server_asks_the_users_functions(capsys):
    circle, error, region, complaints = asyncio.run(ask(Diagram(diagram_of(), "made up")))
    assert complaints == []
    np.testing.assert_allclose(np.hypot(circle[0] - 10, circle[1]), 1.4, rtol=1e-14)
    assert "ArithmeticError: no orbit at a = 1.90 &lt;here&gt;" in error
    # As exact as a pointer is: a pixel is 0.001.
    np.testing.assert_allclose(region, np.linspace(1.2, 1.6, 5), atol=2e-3)
    assert "ArithmeticError" in capsys.readouterr().err


async def walk(shown):
    """What the server's page of a map shows after a click, and the colours of its legend."""
    functions = import_functions("tests.stickslip.view._made_up_map", shown.parameters)
    server = start_server(lambda document: MapPage(shown, functions, document), 0)
    try:
        async with _chromium.open_page(f"http://localhost:{server.port}/") as page:
            await page.until(READY.replace("drawn", "cells"))
            await page.click(await page.evaluate(CELL.format(x=-0.68, y=0.6)))
            await page.until(f"{MODEL.format('plane')}.data.x.length > 0")
            circle = await column(page, "plane", "x"), await column(page, "plane")
            text = await page.evaluate(f"{MODEL.format('chosen')}.text")
            return circle, text, page.complaints
    finally:
        server.stop()
        server.unlisten()


def test_a_click_on_a_map_is_answered_from_its_cell():
    circle, text, complaints = asyncio.run(walk(Map(map_of(), "made up")))
    assert complaints == []
    assert text.startswith("x = -0.7 m, v = 0.5 m/s: orbit 1")
    np.testing.assert_allclose([circle[0][0], circle[1][0]], [-0.7, 0.5], rtol=1e-14)
