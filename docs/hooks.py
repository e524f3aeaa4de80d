"""What the site's pages have beyond their Markdown: examples, and links out of the folder docs.

The pages are read in the repository, too, where a link to ../src/epinet leads to the source; on the
site, which has no source, such a link becomes the path's name, and a picture beside docs is copied.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parent.parent
EXAMPLES = '--8<-- "examples.md"'
LINK = re.compile(r"(!?)\[([^\]]*)\]\(((?:\.\./)+)((?!docs/)[\w./-]+)\)")


def on_page_markdown(markdown: str, page: Any, config: Any, files: Any) -> str:
    """The page with the examples in it, and without links that leave the site."""
    if EXAMPLES in markdown:
        markdown = markdown.replace(EXAMPLES, "\n".join(map(_shown, _scripts())))
    depth = page.file.src_uri.count("/")

    def mended(link: re.Match[str]) -> str:
        picture, text, up, path = link.groups()
        if up.count("../") <= depth:
            return link[0]
        if picture:
            return f"![{text}]({'../' * depth}{path})"
        return text if text.startswith("`") else f"{text} (`{path}`)"

    return LINK.sub(mended, markdown)


def on_files(files: Any, config: Any) -> Any:
    """The site's files, and the pictures of the results."""
    from mkdocs.structure.files import File

    for picture in sorted((ROOT / "benchmarks" / "results").glob("*.png")):
        uri = picture.relative_to(ROOT).as_posix()
        files.append(File.generated(config, uri, abs_src_path=str(picture)))
    return files


def _scripts() -> list[Path]:
    return sorted((ROOT / "examples").glob("[0-9]*.py"))


def _shown(script: Path) -> str:
    return f"## `{script.name}`\n\n```python\n{script.read_text()}```\n"
