"""The report in headless Chromium, as wide as a desktop and a phone: no request, no error, no overflow."""

import json
import shutil

import pytest

pytestmark = [pytest.mark.long, pytest.mark.browser]

WIDTHS = (1280, 390)


@pytest.fixture(scope="module")
def browser():
    from selenium import webdriver
    from selenium.webdriver.chrome.service import Service

    options = webdriver.ChromeOptions()
    options.binary_location = shutil.which("chromium")
    for flag in (
        "--headless=new",
        "--no-sandbox",
        "--disable-gpu",
        "--disable-dev-shm-usage",
        "--window-size=1280,900",
    ):
        options.add_argument(flag)
    options.set_capability("goog:loggingPrefs", {"performance": "ALL", "browser": "ALL"})
    driver = webdriver.Chrome(options=options, service=Service(shutil.which("chromedriver")))
    yield driver
    driver.quit()


@pytest.mark.parametrize("width", WIDTHS)
def test_report_opens(browser, finished, width):
    # A window has a smallest width; the device metrics do not.
    metrics = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": width < 500}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)
    page = (finished[0] / "report.html").as_uri()
    browser.get(page)

    assert browser.execute_script("return innerWidth") == width
    assert browser.execute_script("return document.scrollingElement.scrollWidth") <= width
    wide = browser.execute_script(
        "const out = e => e.getBoundingClientRect().right > innerWidth && !e.closest('.scroll, pre, .track');"
        "return [...document.querySelectorAll('main *')].filter(out).map(e => e.outerHTML.slice(0, 80))"
    )
    assert wide == []

    browser.execute_script("document.querySelectorAll('details').forEach(d => d.open = true)")
    assert browser.execute_script("return document.scrollingElement.scrollWidth") <= width

    requests = [
        message["params"]["request"]["url"]
        for entry in browser.get_log("performance")
        if (message := json.loads(entry["message"])["message"])["method"] == "Network.requestWillBeSent"
    ]
    assert [url for url in requests if url != page and not url.startswith("data:")] == []
    assert browser.get_log("browser") == []
    assert "checks hold" in browser.title


def test_a_link_to_a_check_opens_it(browser, finished):
    page = (finished[0] / "report.html").as_uri()
    browser.get(page)
    browser.execute_script("document.querySelector('.point').click()")
    assert browser.execute_script("return document.querySelector('details.check:target').open") is True
