"""The pages in a Chromium at three widths, on light and dark paper; FMU_PAGES names their folder, CHROMIUM the browser.

Pictures of them stay in the folder, for a look.
"""

import csv
import os
import shutil
from pathlib import Path

import pytest
from playwright.sync_api import sync_playwright

FOLDER = Path(os.environ["FMU_PAGES"])
PAGES = sorted(FOLDER.rglob("*.html"))
TICKS = "panel => [...panel.querySelectorAll('text')].map(text => text.textContent).slice(0, -1)"


@pytest.fixture(scope="module")
def browser():
    path = os.environ.get("CHROMIUM") or shutil.which("chromium") or shutil.which("google-chrome")
    assert path, "this test needs a Chromium: set CHROMIUM to its path"
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=["--no-sandbox", "--disable-gpu"])
        yield browser
        browser.close()


def opened(browser, path, width, scheme="light"):
    page = browser.new_page(viewport={"width": width, "height": 900}, color_scheme=scheme)
    page.on("pageerror", lambda error: pytest.fail(str(error)))
    page.on("console", lambda message: pytest.fail(message.text))
    page.on("request", lambda request: request.url.startswith("file:") or pytest.fail(request.url))
    page.goto(path.as_uri())
    page.wait_for_timeout(500)
    return page


@pytest.mark.parametrize("path", PAGES, ids=lambda path: path.stem)
@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [360, 800, 1400])
def test_nothing_is_wider_than_the_page(browser, path, width, scheme):
    page = opened(browser, path, width, scheme)
    assert page.evaluate("document.documentElement.scrollWidth") == width
    paper = page.evaluate("getComputedStyle(document.documentElement).backgroundColor")
    assert (paper == "rgb(255, 255, 255)") == (scheme == "light")
    drawn = page.eval_on_selector_all(".figure .curve", "all => all.map(curve => curve.getAttribute('d').length)")
    assert len(drawn) > 3 or not page.locator(".figure").count()
    assert all(drawn)
    page.screenshot(path=path.with_name(f"{path.stem}-{width}-{scheme}.png"))
    page.close()


def test_wide_tables_show_that_they_scroll(browser):
    """A shade at the edge, and the arrow keys scroll."""
    page = opened(browser, FOLDER / "compare" / "compare.html", 360)
    wide = [box for box in page.locator(".scroll").all() if box.evaluate("box => box.scrollWidth > box.clientWidth")]
    assert len(wide) > 1
    for box in wide:
        attachments = box.evaluate("box => getComputedStyle(box).backgroundAttachment")
        assert attachments == "local, local, scroll, scroll"
        assert box.get_attribute("role") == "region"
        assert box.get_attribute("aria-label")
        box.focus()
        page.keyboard.press("ArrowRight")
        page.wait_for_function("box => box.scrollLeft > 0", arg=box.element_handle())
    page.close()


def test_the_map_has_values_at_the_cursor(browser):
    """Between points of the grid, out of reach, with the arrow keys, and on the map of another voltage."""
    page = opened(browser, FOLDER / "map" / "map.html", 1000)
    cells = page.locator(".readings tr")
    value = lambda name: cells.filter(has_text=name).first.locator("td").first.text_content()
    assert not page.locator(".readings").is_visible()
    assert page.locator("figure.map:visible").count() == 1
    box = page.locator("figure.map:visible svg").bounding_box()
    scale = box["width"] / 900
    page.mouse.move(box["x"] + 400 * scale, box["y"] + 150 * scale)
    efficiency = float(value("efficiency"))
    mechanical = float(value("p_mech"))
    losses = sum(float(value(name)) for name in ["p_cu", "p_iron", "p_cond", "p_sw", "p_friction"])
    assert 94 < efficiency < 97
    assert mechanical / (mechanical + losses) * 100 == pytest.approx(efficiency, abs=0.05)
    page.mouse.move(box["x"] + 700 * scale, box["y"] + 60 * scale)
    assert value("efficiency") == "out of reach"
    page.locator("figure.map:visible svg").focus()
    before = value("speed")
    page.keyboard.press("ArrowRight")
    assert value("speed") != before
    page.select_option("#sheet", "0")
    assert page.locator("figure.map:visible").get_attribute("data-sheet") == "0"
    page.close()


@pytest.fixture
def run(browser):
    page = opened(browser, FOLDER / "run.html", 900)
    yield page
    page.close()


def ticks(run, panel=0):
    return [text for text in run.locator(".panel").nth(panel).evaluate(TICKS)]


def test_a_drag_zooms_all_panels_and_a_double_click_shows_all(run):
    before, last = ticks(run), ticks(run, 4)
    box = run.locator(".plot").first.bounding_box()
    middle = box["y"] + 80
    run.mouse.move(box["x"] + 300, middle)
    run.mouse.down()
    run.mouse.move(box["x"] + 400, middle, steps=4)
    assert run.locator(".chosen").first.get_attribute("width") == "100"
    run.mouse.up()
    assert ticks(run) != before
    assert ticks(run)[-5:] == ticks(run, 4)[-5:]
    assert run.locator("text=Show all").last.is_enabled()
    run.mouse.dblclick(box["x"] + 300, middle)
    assert (ticks(run), ticks(run, 4)) == (before, last)


def test_a_name_hides_its_curve(run):
    button, curve = run.locator(".legend button").first, run.locator(".curve").first
    for pressed in ("false", "true"):
        button.click()
        assert button.get_attribute("aria-pressed") == pressed
        assert bool(curve.get_attribute("d")) == (pressed == "true")


def test_the_keyboard_reads_values_and_zooms(run):
    before = ticks(run)
    run.locator(".plot").first.focus()
    for _ in range(20):
        run.keyboard.press("ArrowRight")
    at = float(run.locator(".bar output").inner_text().split()[2])
    name, value = run.locator(".legend button").first.evaluate("b => [b.childNodes[1].textContent, b.lastChild.textContent]")
    with (FOLDER / "run.csv").open() as file:
        rows = list(csv.DictReader(file))
    nearest = min(rows, key=lambda row: abs(float(row["time"]) - at))
    assert float(value.replace("\u2212", "-")) == pytest.approx(float(nearest[name]) * 9.5492966, rel=1e-4, abs=1e-6)
    run.keyboard.press("+")
    assert ticks(run) != before
    run.keyboard.press("Escape")
    assert ticks(run) == before
