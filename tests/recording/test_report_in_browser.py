"""The report as a browser shows it: no complaint, every picture there, nothing cut off."""

from __future__ import annotations

import html
import json
import re
import subprocess
from pathlib import Path
from typing import Any

import pytest
from required import needs_peer, peer
from synthetic_flight import SyntheticFlight, record

from aerodaas.recording.report.comparison import write_comparison
from aerodaas.recording.report.report import write_report

BROWSER = peer("AERODAAS_BROWSER")
PROBE = r"""
<script>
window.addEventListener("load", () => {
  const pictures = [...document.images];
  const cells = [...document.querySelectorAll("tbody th")];
  const names = cells.filter(one => !/\s/.test(one.textContent));
  const lines = cell => {
    const range = document.createRange();
    range.selectNodeContents(cell);
    return new Set([...range.getClientRects()].map(one => one.top)).size;
  };
  const found = {
    errors: window.complaints,
    pictures: pictures.length,
    missing: pictures.filter(one => !one.complete || one.naturalWidth === 0).length,
    tooWide: pictures.filter(one => one.getBoundingClientRect().right > innerWidth + 1).length,
    scrolls: document.documentElement.scrollWidth - innerWidth,
    width: innerWidth,
    page: getComputedStyle(document.body).backgroundColor,
    ink: getComputedStyle(document.body).color,
    brokenNames: names.filter(one => lines(one) > 1).map(one => one.textContent),
  };
  document.title = JSON.stringify(found);
});
</script>
"""
EARS = """
<script>
window.complaints = [];
window.addEventListener("error", event => window.complaints.push(String(event.message)), true);
</script>
"""


def look(page: Path, width: int, *, dark: bool = False) -> tuple[dict[str, Any], str]:
    """Load a page in a window of this width; returns what was found, and the browser's log."""
    probe = page.with_name("probe.html")
    text = page.read_text().replace("<head>", f"<head>{EARS}").replace("</body>", f"{PROBE}</body>")
    probe.write_text(text)
    command = [
        BROWSER, "--headless", "--no-sandbox", "--disable-gpu", "--enable-logging=stderr",
        f"--user-data-dir={page.parent / 'browser'}", f"--window-size={width},900", "--dump-dom",
        f"--blink-settings=preferredColorScheme={0 if dark else 1}", probe.as_uri(),
    ]  # fmt: skip
    done = subprocess.run(command, capture_output=True, text=True, timeout=240, check=True)
    title = re.search(r"<title>(.*?)</title>", done.stdout, re.DOTALL)
    assert title is not None
    found: dict[str, Any] = json.loads(html.unescape(title[1]))
    return found, done.stderr


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A flight with a few frames."""
    path = tmp_path_factory.mktemp("browser") / "flight.mcap"
    record(path, SyntheticFlight(frames=1, rate=10), drops=4)
    return path


@pytest.mark.slow
@needs_peer("AERODAAS_BROWSER")
@pytest.mark.parametrize("width", [1280, 500])
def test_pages_load_without_complaint(recorded: Path, tmp_path: Path, width: int) -> None:
    """Both pages, on a desktop and in the narrowest window that a headless browser opens."""
    report = write_report(recorded, tmp_path)
    comparison = write_comparison(recorded, recorded, tmp_path / "compare.html")
    for page, pictures in ((report.page, 4 + 6), (comparison, 2 * 4)):
        found, log = look(page, width)
        assert found["width"] == width
        assert found["errors"] == []
        assert "CONSOLE" not in log
        assert found["pictures"] >= pictures
        assert found["missing"] == 0
        assert found["tooWide"] == 0
        assert found["scrolls"] <= 0
        assert found["brokenNames"] == []
