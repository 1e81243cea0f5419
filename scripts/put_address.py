# SPDX-License-Identifier: Apache-2.0
"""Writes the project's address into what an index of packages shows, before a package is built.

python scripts/put_address.py ADDRESS REF [FOLDER]

ADDRESS is that of the repository, as https://HOST/OWNER/NAME, and REF a tag. The repository itself
knows no address: a copy of it lives at another one, and the publishing workflow is told which.
`pyproject.toml` gets `[project.urls]`. Links and pictures of `README.md` that lead to files become
addresses, because an index has no files.
"""

import re
import sys
from pathlib import Path

URLS = """[project.urls]
Homepage = "{address}"
Documentation = "{address}/tree/{ref}/docs"
Source = "{address}"
Issues = "{address}/issues"
Changelog = "{address}/blob/{ref}/CHANGELOG.md"

"""
BEFORE = "[project.optional-dependencies]\n"  # where the table goes
LINK = re.compile(r"(!?)\[([^\]]*)\]\((?!https?://|#)([^)\s]+)\)")


def put_address(address: str, ref: str, folder: Path) -> None:
    """Changes `pyproject.toml` and `README.md` of a folder.

    Raises:
        SystemExit: the address is none, or a file is not as it should be.
    """
    address = address.rstrip("/")
    if not re.fullmatch(r"https://[^/\s\"]+/[^/\s\"]+/[^/\s\"]+", address):
        raise SystemExit(f"{address}: no address like https://HOST/OWNER/NAME")
    if not re.fullmatch(r"[\w.+-]+", ref):
        raise SystemExit(f"{ref}: no tag")
    project, readme = folder / "pyproject.toml", folder / "README.md"
    text = project.read_text(encoding="utf-8")
    if text.count(BEFORE) != 1 or "[project.urls]" in text:
        raise SystemExit(f"{project}: has an address already, or no place for one")

    def whole(found: re.Match[str]) -> str:
        picture, folder_of_files = bool(found[1]), (folder / found[3]).is_dir()
        kind = "raw" if picture else "tree" if folder_of_files else "blob"
        return f"{found[1]}[{found[2]}]({address}/{kind}/{ref}/{found[3]})"

    table = URLS.format(address=address, ref=ref)
    project.write_text(text.replace(BEFORE, table + BEFORE), encoding="utf-8")
    readme.write_text(LINK.sub(whole, readme.read_text(encoding="utf-8")), encoding="utf-8")


if __name__ == "__main__":
    if len(sys.argv) not in (3, 4):
        raise SystemExit(__doc__)
    put_address(sys.argv[1], sys.argv[2], Path(sys.argv[3] if len(sys.argv) == 4 else "."))
