"""Pages measured in a real browser: what is laid out where, at several widths, folds closed and open, and for print."""

from __future__ import annotations

import html
import json
import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

_MEASURE = """
const visible = (e) => e.checkVisibility({checkVisibilityCSS: true});
function texts(doc) {
  const found = [], walker = doc.createTreeWalker(doc.body, NodeFilter.SHOW_TEXT);
  for (let n = walker.nextNode(); n; n = walker.nextNode()) {
    const e = n.parentElement;
    if (!n.data.trim() || !visible(e) || e.closest("script,style,.skip,.sr,.hidden")) continue;
    found.push([n, e]);
  }
  return found;
}
function clipped(doc, width) {
  const out = [];
  for (const [n, e] of texts(doc)) {
    const range = doc.createRange(); range.selectNodeContents(n);
    for (const rect of range.getClientRects()) {
      let r = rect, bad = "";
      if (r.width < 1 || r.height < 1) continue;
      for (let up = e; up && up !== doc.body; up = up.parentElement) {
        const style = getComputedStyle(up);
        if (style.display === "inline" || style.display === "contents") continue;
        const b = up.getBoundingClientRect();
        // what a reader can scroll to is not cut off: the box that scrolls is what has to lie within the others
        const wide = /auto|scroll/.test(style.overflowX) && up.scrollWidth > up.clientWidth;
        const tall = /auto|scroll/.test(style.overflowY) && up.scrollHeight > up.clientHeight;
        if (wide || tall) { r = b; continue; }
        if (r.left < b.left - 1 || r.right > b.right + 1 || r.top < b.top - 2.5 || r.bottom > b.bottom + 2.5) {
          bad = `${n.data.trim().slice(0, 40)} outside ${up.tagName}.${up.className}`; break; }
      }
      if (!bad && (r.left < -1 || r.right > width + 1)) bad = n.data.trim().slice(0, 40) + " outside the window";
      if (bad) { out.push(bad); break; }
    }
  }
  return out;
}
const part = (v) => v <= .03928 ? v / 12.92 : ((v + .055) / 1.055) ** 2.4;
const lum = (c) => .2126 * part(c[0] / 255) + .7152 * part(c[1] / 255) + .0722 * part(c[2] / 255);
const rgb = (text) => text.match(/[\\d.]+/g).map(Number);
function contrast(doc) {
  let worst = [99, ""];
  for (const [n, e] of texts(doc)) {
    const fore = rgb(getComputedStyle(e).color).slice(0, 3);
    let back = [255, 255, 255];
    for (let up = e; up; up = up.parentElement) {
      const c = rgb(getComputedStyle(up).backgroundColor);
      if (c.length === 3 || c[3] > 0) { back = c.slice(0, 3); break; }
    }
    const a = lum(fore), b = lum(back), ratio = (Math.max(a, b) + .05) / (Math.min(a, b) + .05);
    if (ratio < worst[0]) worst = [ratio, n.data.trim().slice(0, 40)];
  }
  return worst;
}
const words = (t) => t.split(/\\s+/).filter((w) => /\\w/.test(w)).length;
function told(doc) {
  const first = doc.querySelector(".first"), sign = doc.getElementById("signature");
  const out = {own: 0, all: 0, ownText: "", bottom: 0, heads: []};
  for (const [n, e] of texts(doc)) {
    out.all += words(n.data);
    if (first && first.contains(e) && !(sign && sign.contains(e)) && !e.closest(".said")) {
      out.own += words(n.data); out.ownText += " " + n.data; }
  }
  for (const s of doc.querySelectorAll(".five>section"))
    out.bottom = Math.max(out.bottom, s.getBoundingClientRect().bottom);
  out.sheet = first ? first.getBoundingClientRect().bottom : 0;
  out.heads = [...doc.querySelectorAll(".five h2")].map((h) => h.textContent);
  return out;
}
function report(names) {
  const out = {};
  for (const name of names) {
    const doc = document.getElementById("f" + name).contentDocument, root = doc.documentElement;
    out[name] = {closed: clipped(doc, root.clientWidth), ...told(doc), contrast: contrast(doc)};
    out[name].scroll = root.scrollWidth - root.clientWidth;
    doc.querySelectorAll("details").forEach((d) => d.open = true);
    out[name].open = clipped(doc, root.clientWidth);
    out[name].openContrast = contrast(doc);
    out[name].openScroll = root.scrollWidth - root.clientWidth;
  }
  document.body.innerHTML = "<pre id=result></pre>";
  document.getElementById("result").textContent = JSON.stringify(out);
}
"""


def browser() -> str:
    return next(found for name in ("chromium", "chromium-browser", "google-chrome") if (found := shutil.which(name)))


def _printed(page: str) -> str:
    """The page with the rules for paper, as a page of its own."""
    style = re.search("<style>(.*?)</style>", page, re.DOTALL)
    assert style is not None
    css = re.sub(r"@media screen and \([^)]*\)", "@media not all", style.group(1)).replace("@media print", "@media all")
    return page.replace(style.group(1), css.replace("@media(prefers-color-scheme:dark)", "@media not all"))


def dark(page: str) -> str:
    """The page as a reader sees it whose system is dark."""
    return page.replace("prefers-color-scheme:dark", "min-width:1px")


def frames_of(page: str, widths: tuple[int, ...] = (320, 420, 1400)) -> dict[str, tuple[str, int]]:
    """The page at several widths, and as it is printed: 695 pixels are a sheet of A4 without its margins."""
    return {str(width): (page, width) for width in widths} | {"print": (_printed(page), 695)}


def measure(frames: dict[str, tuple[str, int]], folder: Path) -> dict[str, Any]:
    """For each page at its width, folds closed and open: what is clipped, contrast, words. One start of the browser."""
    whole = "<style>*{content-visibility:visible!important}</style></head>"  # no guessed heights of what is far below
    bare = {
        name: (re.sub(r'<meta http-equiv="Content-Security-Policy"[^>]*>', "", page).replace("</head>", whole), width)
        for name, (page, width) in frames.items()
    }
    body = "".join(
        f'<iframe id="f{name}" style="border:0;width:{width}px;height:1000px" srcdoc="{html.escape(text)}"></iframe>'
        for name, (text, width) in bare.items()
    )
    script = f"{_MEASURE}\nonload = () => setTimeout(() => report({json.dumps(list(frames))}), 200);"
    path = folder / "measured.html"
    path.write_text(f"<!doctype html><meta charset=utf-8><body>{body}<script>{script}</script>", "utf-8", "replace")
    command = [browser(), "--headless", "--no-sandbox", "--disable-gpu", f"--user-data-dir={folder / 'profile'}"]
    command += ["--window-size=1500,1000", "--virtual-time-budget=2000", "--dump-dom", path.as_uri()]
    done = subprocess.run(command, capture_output=True, text=True, timeout=180, check=True)
    shown = re.search(r'<pre id="result">(.*?)</pre>', done.stdout, re.DOTALL)
    assert shown is not None, done.stdout[-500:]
    found: dict[str, Any] = json.loads(html.unescape(shown.group(1)))
    return found
