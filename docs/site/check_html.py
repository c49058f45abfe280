"""Looks over the finished site: links inside it lead somewhere, nothing comes from a network, every page has a title.

    python3 docs/site/check_html.py build/site/html
"""
import re
import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit


class Page(HTMLParser):
    def __init__(self, text):
        super().__init__()
        self.links, self.loads, self.ids, self.title = [], [], set(), False
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        a = dict(attributes)
        self.ids.update(v for k, v in a.items() if k in ("id", "name") and v)
        if tag == "title":
            self.title = True
        if tag == "a" and a.get("href"):
            self.links.append(a["href"])
        if tag in ("script", "img", "source", "iframe", "video") and (a.get("src") or a.get("srcset")):
            self.loads.append(a.get("src") or a["srcset"])
        if tag == "link" and a.get("rel") in ("stylesheet", "icon", "preload"):
            self.loads.append(a.get("href", ""))


def main():
    root = Path(sys.argv[1]).resolve()
    pages = {f: Page(f.read_text(errors="replace")) for f in sorted(root.rglob("*.html"))}
    wrong, links = [], 0
    for file, page in pages.items():
        name = file.relative_to(root)
        if not page.title:
            wrong.append(f"{name}: no title")
        for uri in page.loads + page.links:
            parts = urlsplit(uri)
            if parts.scheme == "data" or parts.scheme in ("http", "https", "mailto") and uri in page.links:
                continue
            if parts.scheme or parts.netloc:
                wrong.append(f"{name}: loads {uri} from a network")
                continue
            links += 1
            target = (file.parent / unquote(parts.path)).resolve() if parts.path else file
            if target.is_dir():
                target /= "index.html"
            if not target.exists():
                wrong.append(f"{name}: {uri} leads nowhere")
            elif parts.fragment and target in pages and unquote(parts.fragment) not in pages[target].ids:
                wrong.append(f"{name}: {uri}: there is no such place on the page")
        for m in re.finditer(r"url\(['\"]?(https?:[^)]*)", file.read_text(errors="replace")):
            wrong.append(f"{name}: loads {m[1]} from a network")
    for line in wrong[:40]:
        print(line)
    size = sum(f.stat().st_size for f in root.rglob("*") if f.is_file())
    print(f"{len(pages)} pages, {links} links, {len(wrong)} wrong, {size / 1e6:.1f} MB")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
