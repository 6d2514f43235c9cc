"""The pages that run FMUs, in a Chromium; FMU_PAGES names their folder, CHROMIUM the browser.

Pictures of them stay in the folder, for a look.
"""

import json
import os
import re
import shutil
import time
from pathlib import Path

import pytest
from playwright.sync_api import sync_playwright

FOLDER = Path(os.environ["FMU_PAGES"])
DRIVE = FOLDER / "PmsmDrive.html"
# Every column of the recording, as the bits of its numbers.
BITS = """names => Array.from({ length: rec.n }, (_, k) => names.map(name => {
  const view = new DataView(new ArrayBuffer(8));
  view.setFloat64(0, rec.columns.get(name)[k]);
  return view.getBigUint64(0).toString(16).padStart(16, "0");
}))"""
HASH = """async () => {
  const parts = [...rec.columns.values()].map(column => new Uint8Array(column.slice(0, rec.n).buffer));
  const digest = await new Blob(parts).arrayBuffer().then(bytes => {
    let hash = 0xcbf29ce484222325n;
    for (const byte of new Uint8Array(bytes)) hash = ((hash ^ BigInt(byte)) * 0x100000001b3n) & 0xffffffffffffffffn;
    return hash.toString(16);
  });
  return `${rec.n} ${digest}`;
}"""


@pytest.fixture(scope="module")
def browser():
    path = os.environ.get("CHROMIUM") or shutil.which("chromium") or shutil.which("google-chrome")
    assert path, "this test needs a Chromium: set CHROMIUM to its path"
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=["--no-sandbox", "--disable-gpu"])
        yield browser
        browser.close()


def opened(browser, path, width=1400, scheme="light", hash=""):
    page = browser.new_page(viewport={"width": width, "height": 900}, color_scheme=scheme)
    page.on("pageerror", lambda error: pytest.fail(str(error)))
    page.on("console", lambda message: pytest.fail(message.text))
    allowed = ("file:", "blob:")
    page.on("request", lambda request: request.url.startswith(allowed) or pytest.fail(request.url))
    page.goto(path.as_uri() + hash)
    page.wait_for_selector("#run:enabled", timeout=10000)
    return page


def finished(page, timeout=60000):
    page.wait_for_function("() => !running && !wanted && rec.n > 1", timeout=timeout)


def preset(page, title, rate="0"):
    """Chooses a preset, at full speed to its end."""
    page.get_by_role("button", name=title).click()
    page.wait_for_function("() => rec.n >= 1")
    page.evaluate("choose(0)")
    page.evaluate("again()")
    finished(page)
    assert page.evaluate("[rec.time[0], rec.n - 1]") == [0, page.evaluate("k")], "rows of another run"


def test_the_bits_are_those_of_a_native_run(browser):
    expected = json.loads((FOLDER / "expected.json").read_text())
    begun = time.time()
    page = opened(browser, DRIVE)
    print(f"Run is enabled after {time.time() - begun:.2f} s")
    assert time.time() - begun < 3
    run = expected["run"]
    page.evaluate("run => { plan = { ...start(), set: new Map(run.set), events: run.events, stop: run.stop }; choose(0); begin(true); }", run)
    finished(page)
    got = page.evaluate(BITS, expected["names"])
    assert len(got) == len(expected["rows"]) == 1001
    for k, (row, wanted) in enumerate(zip(got, expected["rows"])):
        wrong = [name for name, a, b in zip(expected["names"], row, wanted) if a != b]
        assert not wrong, f"row {k}: {wrong}"
    page.click("#save")
    page.wait_for_function("() => saved !== null")
    state = page.evaluate("Array.from(saved.state, byte => byte.toString(16).padStart(2, '0')).join('')")
    assert state == expected["state"], "the state as bytes"
    print(page.text_content("#speed"))
    assert page.evaluate("speed") > 5
    page.close()


def test_states_changes_and_addresses_repeat_a_run(browser):
    page = opened(browser, DRIVE)
    page.get_by_role("button", name="Load step at standstill").click()
    page.wait_for_function("() => k > 50")
    page.evaluate("pause()")
    page.wait_for_function("() => !running")
    # A live change by hand, then to the end.
    box = page.locator("#v" + str(page.evaluate("byName.get('speed_ref').reference")))
    box.fill("100")
    box.press("Enter")
    page.wait_for_function("() => plan.events.some(event => event[1] === 'speed_ref')")
    page.click("#save")
    page.wait_for_function("() => saved !== null")
    page.evaluate("choose(0)")
    page.click("#run")
    finished(page)
    whole = page.evaluate(HASH)
    page.click("#back")
    page.wait_for_function("() => k === saved.k")
    page.click("#run")
    finished(page)
    assert page.evaluate(HASH) == whole, "the saved state"
    page.click("#again")
    page.wait_for_function("() => rec.n > 2")
    finished(page)
    assert page.evaluate(HASH) == whole, "the run again"
    address = page.evaluate("address()")
    second = opened(browser, DRIVE, hash=address)
    second.wait_for_function("() => rec.n > 1")
    finished(second)
    assert second.evaluate(HASH) == whole, address
    second.close()
    page.close()


def test_what_an_address_has_wrong_is_told(browser):
    page = opened(browser, DRIVE, hash="#set=speeed:1,plant.motor.R_s:1e999&do=5:tau_load:1,x:y:z&rate=fast&moon=full&stop=0.05")
    page.wait_for_function("() => document.getElementById('message').textContent.includes('Not used')")
    said = page.text_content("#message")
    for part in ["speeed:1", "plant.motor.R_s:1e999", "x:y:z", "rate=fast", "moon"]:
        assert part in said, said
    finished(page)
    assert page.evaluate("plan.events.length") == 1
    page.close()


def test_a_slider_at_standstill(browser):
    """What a stranger does: run, then move the load."""
    page = opened(browser, DRIVE, width=390)
    page.get_by_role("button", name="Load step at standstill").click()
    page.evaluate("choose(0)")
    page.wait_for_function("() => k > 0")
    finished(page)
    first = page.evaluate("Math.abs(rec.columns.get('angle error')[rec.n - 1]) * 180 / Math.PI")
    assert 35 < first < 36.4
    slider = page.locator("input[type=range][aria-label=tau_load]")
    slider.focus()
    page.keyboard.press("ArrowLeft")
    # Beyond its end the run goes on.
    page.wait_for_function("() => plan.stop === null && k > 1400")
    page.evaluate("pause()")
    page.wait_for_function("() => !running")
    assert page.evaluate("plan.events.length") == 2
    assert page.evaluate("document.documentElement.scrollWidth") == 390
    page.close()


def test_refusals_leave_the_run(browser):
    page = opened(browser, DRIVE)
    page.get_by_role("button", name="Load step at 1000 rpm").click()
    page.wait_for_function("() => k > 20")
    page.evaluate("pause()")
    page.wait_for_function("() => !running")
    box = page.locator("#v" + str(page.evaluate("byName.get('plant.motor.R_s').reference")))
    box.fill("-1")
    box.press("Enter")
    assert "plant.motor.R_s: above 0 Ohm" in page.text_content("#message")
    assert box.get_attribute("aria-invalid") == "true"
    # Injection cannot work with a machine that is not salient: the model says so at the start of a run.
    page.select_option("#v" + str(page.evaluate("byName.get('controller.estimator').reference")), label="SquareWaveInjection")
    page.wait_for_function("() => document.getElementById('message').className === 'wrong'")
    assert "L_q" in page.text_content("#message")
    page.click("#reset")
    page.wait_for_function("() => ready && rec.n === 1")
    page.click("#run")
    page.wait_for_function("() => k > 10")
    page.close()


def test_a_page_without_a_line_of_its_author(browser):
    page = opened(browser, FOLDER / "RcCircuit.html")
    page.evaluate("choose(0)")
    page.click("#run")
    finished(page)
    assert page.locator("#plots canvas").count() == 2
    page.locator("#v" + str(page.evaluate("byName.get('u').reference"))).fill("8")
    page.keyboard.press("Enter")
    page.wait_for_function("() => k > 60")
    page.evaluate("pause()")
    page.wait_for_function("() => !running")
    assert page.evaluate("rec.columns.get('u_c')[rec.n - 1]") > 5
    with page.expect_download() as download:
        page.click("#csv")
    text = Path(download.value.path()).read_text().splitlines()
    assert text[0] == "time [s],u [V],u_c [V],i [A]"
    assert len(text) == page.evaluate("rec.n") + 1
    page.close()


@pytest.mark.parametrize("what, told", [("panic in a step", r"panic.*model\.rs:\d+"), ("panic in initialize", "thirteen"), ("fault", "left the finite numbers"), ("abort", "model's code ended|unreachable|panic")])
def test_a_model_that_fails(browser, what, told):
    page = opened(browser, FOLDER / "Probe.html")
    page.evaluate("choose(0)")
    set_ = {"panic in a step": ("mode", 4), "panic in initialize": ("n", 13), "fault": ("mode", 2), "abort": ("n", 1234567)}[what]
    page.evaluate("([name, value]) => { plan.set.set(name, value); begin(true); }", list(set_))
    page.wait_for_function("() => document.getElementById('message').className === 'wrong'")
    said = page.text_content("#message")
    print(what, "->", said)
    assert re.search(told, said), said
    page.click("#reset")
    page.wait_for_function("() => ready && rec.n === 1")
    page.evaluate("choose(0)")
    page.click("#run")
    finished(page)
    assert page.evaluate("rec.n") == 11
    page.close()


def test_a_model_that_hangs(browser):
    page = opened(browser, FOLDER / "RcCircuit.html")
    page.workers[0].evaluate("void (DOES.hang = () => { for (;;); })")
    page.evaluate("send({ does: 'hang' })")
    page.wait_for_function("() => document.getElementById('message').textContent.startsWith('The model does not answer')", timeout=5000)
    page.click("#reset")
    page.wait_for_function("() => ready && rec.n === 1")
    page.evaluate("choose(0)")
    page.click("#run")
    finished(page)
    page.close()


def test_many_runs_in_one_tab(browser):
    page = opened(browser, FOLDER / "RcCircuit.html")
    script = """async n => {
      for (let i = 0; i < n; i++) {
        await new Promise(done => { const told = SAYS.rows; SAYS.rows = message => { told(message); SAYS.rows = told; done(); }; begin(false); });
      }
      return new Promise(done => { const told = SAYS.state; SAYS.state = message => { SAYS.state = told; done(message.state.length); }; send({ does: "save" }); });
    }"""
    worker = page.workers[0]
    page.evaluate(script, 10)
    before = worker.evaluate("fmu.api.memory.buffer.byteLength")
    page.evaluate(script, 2000)
    after = worker.evaluate("fmu.api.memory.buffer.byteLength")
    print(before, after)
    assert after == before
    page.close()


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [360, 800, 1400])
@pytest.mark.parametrize("name", ["PmsmDrive", "RcCircuit"])
def test_nothing_is_wider_than_the_page(browser, name, width, scheme):
    page = opened(browser, FOLDER / f"{name}.html", width, scheme)
    if name == "PmsmDrive":
        preset(page, "Load step at standstill")
    else:
        page.evaluate("choose(0)")
        page.click("#run")
        finished(page)
    page.wait_for_timeout(300)
    assert page.evaluate("document.documentElement.scrollWidth") == width
    page.screenshot(path=FOLDER / f"{name}-{width}-{scheme}.png", full_page=width < 1000)
    page.close()


def test_keys_alone(browser):
    """Tab reaches run, presets, a slider and a plot; arrows move the cursor."""
    page = opened(browser, DRIVE)
    page.keyboard.press("Tab")
    assert page.evaluate("document.activeElement.textContent") == "Start from any angle"
    page.keyboard.press("Enter")
    page.wait_for_function("() => k > 5")
    seen = set()
    for _ in range(60):
        page.keyboard.press("Tab")
        seen.add(page.evaluate("document.activeElement.tagName + (document.activeElement.type || '')"))
    assert {"BUTTONbutton", "INPUTrange", "INPUTnumber", "CANVAS"} <= seen, seen
    page.locator("#plots canvas").first.focus()
    page.keyboard.press("ArrowLeft")
    assert page.evaluate("view.at !== null")
    page.close()
