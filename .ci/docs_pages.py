"""Brings the pages beside docs/ into the site, and turns the links between them and docs/ to where they then are."""

import re
from pathlib import Path

from properdocs.config.defaults import ProperDocsConfig
from properdocs.structure.files import File, Files
from properdocs.structure.pages import Page

ROOT = Path(__file__).parents[1]
PAGES = ("README.md", "ARCHITECTURE.md", "SECURITY.md", "CHANGELOG.md")
UP_AND_OUT = re.compile(rf"\]\(\.\./((?:\.\./)*(?:{'|'.join(map(re.escape, PAGES))})[)#])")


def on_files(files: Files, config: ProperDocsConfig) -> Files:
    """Add the pages."""
    for name in PAGES:
        files.append(File.generated(config, name, content=(ROOT / name).read_text()))
    return files


def on_page_markdown(markdown: str, page: Page, config: ProperDocsConfig, files: Files) -> str:
    """Turn the links."""
    if page.file.src_uri in PAGES:
        return markdown.replace("](docs/", "](")
    return UP_AND_OUT.sub(r"](\1", markdown)
