"""Opens reports in headless Chromium and looks whether everything is drawn, can be worked by keyboard, and comes from the page alone.

    report.py FOLDER...

Each folder has a report.html; screenshots of it (light, dark, on paper, narrow, without programs) are put beside it.
"""

import shutil
import sys
from pathlib import Path

from playwright.sync_api import Page, sync_playwright

LARGEST = 8_000_000
# Distinct colours of a chart that has axes, letters and a curve, and of a view with a shaded body.
CHART, VIEW = 8, 40

COLOURS = """canvas => {
    const copy = document.createElement('canvas');
    copy.width = canvas.width; copy.height = canvas.height;
    const pen = copy.getContext('2d');
    pen.drawImage(canvas, 0, 0);
    const data = new Uint32Array(pen.getImageData(0, 0, copy.width, copy.height).data.buffer);
    let sum = 0;
    for (let k = 0; k < data.length; k += 1) sum = (sum * 31 + data[k]) >>> 0;
    return [new Set(data).size, sum];
}"""

checks = 0


def check(holds: bool, what: str) -> None:
    global checks
    checks += 1
    if not holds:
        sys.exit(f"report: {what}")


def ready(page: Page, url: str) -> None:
    page.goto(url)
    page.wait_for_function("document.documentElement.dataset.ready === 'true'", timeout=20_000)


def charts(page: Page, name: str) -> None:
    figures = page.locator("figure[data-chart]")
    check(figures.count() > 0, f"{name}: has no chart")
    for figure in figures.all():
        canvas = figure.locator("canvas")
        check(canvas.count() == 1, f"{name}: chart {figure.get_attribute('data-chart')} is not drawn")
        colours, _ = canvas.evaluate(COLOURS)
        check(colours >= CHART, f"{name}: chart {figure.get_attribute('data-chart')} is blank ({colours} colours)")


def space(page: Page, name: str) -> None:
    views = page.locator("figure.space .viewer")
    check(views.count() > 0, f"{name}: shows nothing in space")
    canvas = views.first.locator("canvas")
    colours, before = canvas.evaluate(COLOURS)
    check(colours >= VIEW, f"{name}: the view in space is blank ({colours} colours)")
    canvas.focus()
    page.keyboard.press("ArrowLeft")
    _, turned = canvas.evaluate(COLOURS)
    check(turned != before, f"{name}: arrow keys do not turn the view")
    page.keyboard.press("Home")
    check(canvas.evaluate(COLOURS)[1] == before, f"{name}: Home does not bring the view back")
    slider = views.first.locator("input[type=range]")
    if slider.count():
        slider.focus()
        page.keyboard.press("Home")
        first, told = canvas.evaluate(COLOURS)[1], views.first.locator("output").inner_text()
        page.keyboard.press("ArrowRight")
        check(slider.input_value() == "1", f"{name}: the arrow key does not move the slider")
        check(views.first.locator("output").inner_text() != told, f"{name}: the slider does not tell its time")
        check(canvas.evaluate(COLOURS)[1] != first, f"{name}: the slider does not move the body")


def words(page: Page, name: str) -> None:
    """Everything that is seen has a text that stands for it."""
    for what, of in [("img", "alt"), ("svg[role=img]", "aria-label"), ("canvas[role=img]", "aria-label"), (".live[role=img]", "aria-label")]:
        for e in page.locator(what).all():
            check(len(e.get_attribute(of) or "") > 10, f"{name}: {what} without {of}")
    for e in page.locator("input, select, button").all():
        label = e.get_attribute("aria-label") or e.evaluate("e => e.innerText || (e.closest('label') || {}).innerText || ''")
        check(len(label.strip()) > 1, f"{name}: a control without a name: {e.evaluate('e => e.outerHTML')}")


def look(browser, folder: Path) -> None:
    name = folder.name
    path = folder / "report.html"
    check(path.stat().st_size < LARGEST, f"{name}: {path.stat().st_size} bytes; at most {LARGEST} are allowed")
    faults: list[str] = []
    for theme in ["light", "dark"]:
        context = browser.new_context(color_scheme=theme, viewport={"width": 1100, "height": 900})
        page = context.new_page()
        page.on("console", lambda m: faults.append(f"{m.type}: {m.text}") if m.type in ("error", "warning") else None)
        page.on("pageerror", lambda e: faults.append(f"exception: {e}"))
        # Everything is in the page: whatever else it asks for is a fault.
        page.on("request", lambda r: faults.append(f"asks for {r.url}") if not r.url.startswith(("data:", "blob:")) and r.url != path.as_uri() else None)
        ready(page, path.as_uri())
        check(page.locator("main > *").first.get_attribute("class").startswith("verdict"), f"{name}: the verdict does not come first")
        charts(page, name)
        space(page, name)
        words(page, name)
        for details in page.locator("details").all():
            details.locator("summary").click()
        page.wait_for_timeout(300)
        if page.locator("details.explorer").count():
            curves = page.locator("details.explorer canvas")
            check(curves.count() >= 2, f"{name}: the explorer of curves is empty")
        page.screenshot(path=folder / f"{theme}.png", full_page=True)
        if theme == "light":
            page.locator("#theme").click()
            check(page.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(22, 24, 27)", f"{name}: the button does not make it dark")
            page.emulate_media(media="print")
            page.wait_for_timeout(200)
            check(page.locator("figure.chart .static svg").first.is_visible(), f"{name}: paper shows no chart")
            check(not page.locator(".viewer").first.is_visible(), f"{name}: paper shows controls")
            page.screenshot(path=folder / "print.png", full_page=True)
            page.pdf(path=folder / "print.pdf")
            page.emulate_media(media="screen")
            page.set_viewport_size({"width": 420, "height": 800})
            page.wait_for_timeout(400)
            wide = page.evaluate("document.documentElement.scrollWidth")
            check(wide <= 421, f"{name}: is {wide} pixels wide on a screen of 420")
            page.screenshot(path=folder / "narrow.png", full_page=True)
        context.close()
    check(not faults, f"{name}: " + "; ".join(dict.fromkeys(faults)))
    context = browser.new_context(java_script_enabled=False, viewport={"width": 1100, "height": 900})
    page = context.new_page()
    page.goto(path.as_uri())
    check(page.locator("figure.chart .static svg").first.is_visible(), f"{name}: no chart without programs")
    check(page.locator("figure.space .static img").first.is_visible(), f"{name}: no picture in space without programs")
    page.screenshot(path=folder / "plain.png", full_page=True)
    context.close()


def special(folders: dict[str, Path]) -> None:
    """What each kind of report must have."""
    page = lambda name: (folders[name] / "report.html").read_text()
    check('data-chart="track-' in page("markers"), "markers: no measured against simulated curve")
    check('data-chart="residual-0"' in page("static"), "static: no residual of the one frame")
    check("kPa" in page("depth") and "Camera overlay" in page("depth"), "depth: no value in kPa, or no overlay")
    check("Residual map" in page("why"), "why: no residual map")


def main() -> None:
    folders = {Path(p).name: Path(p).resolve() for p in sys.argv[1:]}
    binary = shutil.which("chromium")
    check(binary is not None, "there is no chromium")
    with sync_playwright() as p:
        # A software renderer: there need be no graphics processor. As root Chromium wants no sandbox.
        options = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"]
        browser = p.chromium.launch(executable_path=binary, args=options)
        for folder in folders.values():
            look(browser, folder)
        browser.close()
    special(folders)
    print(f"reports: {checks} passed, 0 failed")


if __name__ == "__main__":
    main()
