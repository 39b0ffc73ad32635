"""The page in headless Chromium: no complaint, nothing fetched, and a click changes the orbit."""

import asyncio

import numpy as np
import pytest

from stickslip.__main__ import main
from tests.stickslip.view import _chromium
from tests.stickslip.view._made_up import A, diagram_of

pytest.importorskip("bokeh", reason="the viewer's extra is not installed")
pytestmark = pytest.mark.skipif(_chromium.PROGRAM is None, reason="no Chromium on this machine")

MODEL = "Bokeh.documents[0].get_model_by_name('{}')"
READY = (
    "window.Bokeh !== undefined && Bokeh.documents.length > 0 && "
    + MODEL.format("drawn")
    + (" !== null && " + MODEL.format("drawn") + ".data.x.length > 0")
)
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


async def clicked(page, x):
    at = await page.evaluate(PLACE.format(x=x))
    await page.click(*at)


async def look(url):
    async with _chromium.open_page(url) as page:
        await page.until(READY)
        before = await column(page, "orbit")
        await clicked(page, A[4])
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
