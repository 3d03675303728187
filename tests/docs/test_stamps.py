"""docs/stamps.py finds the code that flew a table, in a repository made for this test."""

import subprocess
import sys

from helpers.pages import DOCS

from sim.study.trials import compute_release

sys.path.append(str(DOCS))
import stamps


def git(root, *arguments):
    identity = ["-c", "user.name=nobody", "-c", "user.email=nobody@example.org"]
    subprocess.run(["git", "-C", str(root), *identity, *arguments], check=True, capture_output=True)


def test_the_commit_of_each_release_is_found_with_what_changed_since(tmp_path, monkeypatch, capsys):
    root, docs, seen = tmp_path / "repository", tmp_path / "docs", []
    (root / "sim").mkdir(parents=True)
    docs.mkdir()
    git(root, "init", "-q")
    for text in ("a = 1\n", "a = 2\n", "a = 3\n"):
        (root / "sim" / "code.py").write_text(text)
        git(root, "add", "-A")
        git(root, "commit", "-q", "-m", text)
        seen.append(compute_release(root))
        (root / "README.md").write_text(text)  # not code: the release stays
        git(root, "add", "-A")
        git(root, "commit", "-q", "-m", "page")
    unknown = seen[0][:-8] + "00000000"
    (docs / "old.md").write_text(f"Flown by {seen[1]}.\n")
    (docs / "all.csv").write_text(f"version\n{seen[1]}\n{seen[2]}\n{unknown}\n")
    monkeypatch.setattr(stamps, "ROOT", root)
    monkeypatch.setattr(stamps, "__file__", str(docs / "stamps.py"))
    stamps.main()
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith(f"{seen[2]} is ") and lines[0].endswith("since then nothing changed")
    assert lines[2].startswith(f"{seen[1]} is ") and "1 file changed" in lines[2] and lines[3] == "    all.csv, old.md"
    assert lines[4:] == [f"{unknown} is not in this history", "    all.csv"]
