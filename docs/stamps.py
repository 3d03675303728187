"""Code that flew the tables of the pages, and how much of it has changed since: `python docs/stamps.py`.

A table names the release that flew it, `0.1.0+` and a digest of the code (`sim.study.trials.compute_release`). This
looks for these releases in the history of the repository, newest commits first, which takes minutes for old ones.
"""

from __future__ import annotations

import re
import subprocess
import tarfile
from collections.abc import Iterable, Iterator
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory

from sim.installation import ROOT
from sim.study.trials import compute_release

RELEASE = re.compile(r"\b\d+\.\d+\.\d+\+[0-9a-f]{8}\b")
CODE = ["assets", "planning", "sim", "tracking"]


def list_stamps(docs: Path) -> dict[str, list[str]]:
    """Files of the documentation by the releases that they name."""
    stamps: dict[str, list[str]] = {}
    for file in sorted([*docs.rglob("*.md"), *docs.rglob("*.csv")]):
        for release in sorted(set(RELEASE.findall(file.read_text("utf-8")))):
            stamps.setdefault(release, []).append(file.relative_to(docs).as_posix())
    return stamps


def find_commits(root: Path, releases: Iterable[str]) -> Iterator[tuple[str, str]]:
    """Releases that are in the history of a repository, each with the newest commit that has it."""
    left = set(releases)
    commits = _call_git(root, "log", "--format=%h", "--", *CODE).decode().split()
    for commit in commits:
        if not left:
            return
        with TemporaryDirectory() as folder:
            there = _call_git(root, "ls-tree", "--name-only", commit, *CODE).decode().split()
            with tarfile.open(fileobj=BytesIO(_call_git(root, "archive", commit, *there))) as archive:
                archive.extractall(folder, filter="data")
            release = compute_release(Path(folder))
        if release in left:
            left.remove(release)
            yield release, commit


def count_changes(root: Path, commit: str) -> str:
    """What has changed in the code since a commit, in git's words; empty if nothing has."""
    return _call_git(root, "diff", "--shortstat", commit, "--", *CODE).decode().strip()


def _call_git(root: Path, *arguments: str) -> bytes:
    return subprocess.run(["git", "-C", str(root), *arguments], check=True, capture_output=True).stdout


def main() -> None:
    """Print a line for each release, and the files that name it."""
    stamps = list_stamps(Path(__file__).parent)
    for release, commit in find_commits(ROOT, stamps):
        print(f"{release} is {commit}; since then {count_changes(ROOT, commit) or 'nothing changed'}")
        print(f"    {', '.join(stamps.pop(release))}", flush=True)
    for release, files in stamps.items():
        print(f"{release} is not in this history\n    {', '.join(files)}")


if __name__ == "__main__":
    main()
