"""Check the site as built: every link, and every page in a real browser as wide as a phone.

Run it as ``python docs/check_site.py``, after docs/build.sh. It needs nothing but Python; the part
with the browser needs ``chromium``, and is left out, and said to be, where there is none.
"""

import functools
import html
import http.server
import re
import shutil
import subprocess
import sys
import tempfile
import threading
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

SITE = Path(__file__).parent / "_build" / "html"
PHONE = 390  # Width of a phone, CSS pixels.
LOADED = "script", "img", "link", "iframe", "source"  # What a browser loads to show a page.


class Page(HTMLParser):
    """The links of a page, what it loads, and the names of its parts."""

    def __init__(self, path):
        super().__init__()
        self.links, self.loads, self.names = [], [], set()
        self.feed(path.read_text())

    def handle_starttag(self, tag, attributes):
        """Take note of what a tag refers to."""
        given = dict(attributes)
        self.names |= {given[key] for key in ("id", "name") if given.get(key)}
        target = given.get("src") or given.get("href")
        is_preload = tag == "link" and given.get("rel") in ("next", "prev", "search", "index")
        if target:
            (self.loads if tag in LOADED and not is_preload else self.links).append(target)


def check_links(pages):
    """Return what leads nowhere, and what a page loads from a network."""
    wrong = []
    for path, page in pages.items():
        here = path.relative_to(SITE)
        wrong += [
            f"{here} loads {x}" for x in page.loads if urlsplit(x).scheme in ("http", "https")
        ]
        for target in page.links + page.loads:
            parts = urlsplit(target)
            if parts.scheme or parts.netloc:
                continue
            there = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            if there.is_dir():
                there /= "index.html"
            if not there.exists():
                wrong.append(f"{here} links to {target}, which is not there")
            elif there in pages and unquote(parts.fragment) not in pages[there].names | {"", "#"}:
                wrong.append(f"{here} links to {target}, a part that {there.name} has not")
    return wrong


SCRIPT = """
<!doctype html><meta charset="utf-8"><title>check</title><pre id="found"></pre>
<iframe id="page" style="width:%(width)dpx;height:844px;border:0"></iframe><script>
const found = [], frame = document.getElementById("page"), pages = %(pages)s;
function load(page) {
  return new Promise(done => { frame.onload = done; frame.src = page; });
}
async function check() {
  for (const page of pages) {
    await load("/" + page);
    await new Promise(done => setTimeout(done, 30));
    const body = frame.contentDocument;
    for (const image of body.images) {
      image.loading = "eager";
      if (!image.complete) await image.decode().catch(() => {});
      if (!image.naturalWidth) found.push(page + ": no picture " + image.src);
    }
    const wide = body.documentElement.scrollWidth;
    if (wide > %(width)d + 1) found.push(page + ": is " + wide + " wide");
    if (!body.querySelector("h1")) found.push(page + ": has no heading");
  }
  found.push("checked " + pages.length);
  document.getElementById("found").textContent = found.join("\\n");
  document.title = "done";
}
check();
</script>
"""


class Server(http.server.SimpleHTTPRequestHandler):
    """The site, a page that walks through it, and a list of what was asked for in vain."""

    missing, walk = [], b""

    def do_GET(self):
        """Answer with a file, or with the page that walks through them."""
        if self.path == "/--walk--.html":
            self.send_response(200)
            self.send_header("Content-Type", "text/html")
            self.end_headers()
            self.wfile.write(self.walk)
        else:
            super().do_GET()

    def send_error(self, code, *reason):
        """Take note of what is not there."""
        self.missing.append(self.path)
        super().send_error(code, *reason)

    def log_message(self, *_):
        """Say nothing of each request."""


def check_in_browser(browser, names):
    """Return what is wrong with pages in a browser: pictures, widths, errors of its console."""
    Server.walk = (SCRIPT % {"width": PHONE, "pages": names}).encode()
    server = http.server.ThreadingHTTPServer(
        ("127.0.0.1", 0), functools.partial(Server, directory=str(SITE))
    )
    threading.Thread(target=server.serve_forever, daemon=True).start()
    with tempfile.TemporaryDirectory() as profile:
        command = [browser, "--headless=new", "--no-sandbox", "--disable-gpu", "--dump-dom"]
        command += [f"--user-data-dir={profile}", "--enable-logging=stderr", "--log-level=0"]
        command += ["--window-size=500,900", "--virtual-time-budget=3000000"]
        address = f"http://127.0.0.1:{server.server_port}/--walk--.html"
        run = subprocess.run([*command, address], capture_output=True, text=True, timeout=600)
    server.shutdown()
    said = re.search(r'<pre id="found">(.*?)</pre>', run.stdout, re.DOTALL)
    found = html.unescape(said[1]).splitlines() if said else []
    if f"checked {len(names)}" not in found:
        found.append(f"the browser did not come to the end: {run.stdout[:200]}{run.stderr[-500:]}")
    console = re.findall(r"(?:ERROR|WARNING|INFO):CONSOLE.*", run.stderr)
    found += [line for line in console if line.startswith("ERROR") or "Uncaught" in line]
    found += [f"asked for in vain: {path}" for path in Server.missing if "favicon" not in path]
    return [line for line in found if line != f"checked {len(names)}"]


if __name__ == "__main__":
    SITE = SITE.resolve()
    paths = (path for path in sorted(SITE.rglob("*.html")) if "_static" not in path.parts)
    pages = {path: Page(path) for path in paths}
    if not pages:
        sys.exit("there is no site: bash docs/build.sh")
    wrong = check_links(pages)
    print(f"{len(pages)} pages, {sum(len(p.links) + len(p.loads) for p in pages.values())} links")
    names = [str(path.relative_to(SITE)) for path in pages]
    browser = shutil.which("chromium") or shutil.which("chromium-browser")
    if browser:
        wrong += check_in_browser(browser, names)
        print(f"all seen in {browser}, {PHONE} pixels wide")
    else:
        print("there is no chromium here: NOT seen in a browser")
    if wrong:
        sys.exit("\n".join(wrong))
