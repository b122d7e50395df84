"""Files are whole or not there, and what prevents them is said in words."""

from __future__ import annotations

import errno
import os
import subprocess
import sys
from pathlib import Path

import pytest

from shapeprog.errors import OutputError
from shapeprog.files import atomic_path, make_folder, write_bytes, write_text
from shapeprog.liang2022.loop import append_line


def fail_halfway(path, error):
    with atomic_path(path) as temporary:
        temporary.write_text("half")
        raise error


def test_a_file_is_written_whole(tmp_path):
    write_text(tmp_path / "a.txt", "höhe\n")
    assert (tmp_path / "a.txt").read_bytes() == "höhe\n".encode()
    write_bytes(tmp_path / "a.txt", b"new")
    assert (tmp_path / "a.txt").read_bytes() == b"new"
    assert [path.name for path in tmp_path.iterdir()] == ["a.txt"]


@pytest.mark.parametrize("error", [ValueError("mine"), KeyboardInterrupt()])
def test_a_failure_leaves_the_old_file_and_nothing_else(tmp_path, error):
    write_text(tmp_path / "a.txt", "old")
    with pytest.raises(type(error)):
        fail_halfway(tmp_path / "a.txt", error)
    assert (tmp_path / "a.txt").read_text() == "old"
    assert [path.name for path in tmp_path.iterdir()] == ["a.txt"]


@pytest.mark.parametrize(
    ("number", "cause"),
    [(errno.ENOSPC, "disk is full"), (errno.EACCES, "no permission"), (errno.EIO, "Input/output error")],
)
def test_trouble_with_the_disk_is_told_with_cause_and_cure(tmp_path, number, cause):
    with pytest.raises(OutputError, match=cause) as caught:
        fail_halfway(tmp_path / "a.txt", OSError(number, "Input/output error"))
    assert caught.value.hint
    assert not list(tmp_path.iterdir())


def test_the_temporary_name_keeps_the_suffix(tmp_path):
    with atomic_path(tmp_path / "a.tar.gz") as temporary:
        assert temporary.suffixes[-2:] == [".tar", ".gz"]
        assert temporary.parent == tmp_path
        temporary.touch()


def test_missing_folders_and_folders_in_the_way(tmp_path):
    with pytest.raises(OutputError, match="folder does not exist"):
        write_text(tmp_path / "no" / "a.txt", "x")
    with pytest.raises(OutputError, match="a folder of that name"):
        write_text(tmp_path, "x")
    write_text(tmp_path / "file", "x")
    with pytest.raises(OutputError, match=r"folder does not exist|file, not a folder"):
        write_text(tmp_path / "file" / "a.txt", "x")
    with pytest.raises(OutputError, match="name is too long"):
        write_text(tmp_path / ("n" * 300), "x")
    with pytest.raises(OutputError, match="a file of that name"):
        make_folder(tmp_path / "file")
    assert make_folder(tmp_path / "x" / "y").is_dir()


def test_what_is_written_is_on_the_disk_before_it_has_its_name(tmp_path, monkeypatch):
    calls = []

    def sync(file):
        calls.append(("sync", os.fstat(file).st_ino))

    def move(source, target, replace=os.replace):
        calls.append(("move", source.stat().st_ino))
        replace(source, target)

    monkeypatch.setattr(os, "fsync", sync)
    monkeypatch.setattr(os, "replace", move)
    write_text(tmp_path / "a.txt", "x")
    file, folder = (tmp_path / "a.txt").stat().st_ino, tmp_path.stat().st_ino
    assert calls == [("sync", file), ("move", file), ("sync", folder)]


def test_what_a_killed_writer_left_is_removed_when_the_folder_is_used_again(tmp_path):
    code = (
        "import os, pathlib, sys\nfrom shapeprog.files import atomic_path\n"
        "with atomic_path(pathlib.Path(sys.argv[1])) as path:\n    path.write_text('half')\n    os.kill(os.getpid(), 9)"
    )
    subprocess.run([sys.executable, "-c", code, tmp_path / "a.txt"], check=False)
    left = list(tmp_path.iterdir())
    assert [path.read_text() for path in left] == ["half"]
    with atomic_path(tmp_path / "b.txt") as temporary:
        temporary.write_text("of somebody who lives")
        make_folder(tmp_path)
        assert list(tmp_path.iterdir()) == [temporary]
    assert [path.name for path in tmp_path.iterdir()] == ["b.txt"]


def test_files_of_the_user_are_neither_removed_nor_links_replaced(tmp_path):
    (tmp_path / ".htaccess~").write_text("mine")
    (tmp_path / "real").mkdir()
    for link, target in (("a.txt", "real/a.txt"), ("new.txt", "real/new.txt")):
        (tmp_path / link).symlink_to(tmp_path / target)
    write_text(tmp_path / "real" / "a.txt", "old")
    for link in ("a.txt", "new.txt"):
        write_text(make_folder(tmp_path) / link, "new")
        assert (tmp_path / link).is_symlink()
        assert (tmp_path / "real" / link).read_text() == "new"
    assert (tmp_path / ".htaccess~").read_text() == "mine"


def test_lines_are_added_whole(tmp_path):
    for line in ("eins", "zwölf"):
        append_line(tmp_path / "a.txt", line)
    assert (tmp_path / "a.txt").read_bytes() == "eins\nzwölf\n".encode()


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no full device")
def test_a_disk_that_is_full_is_blamed_by_the_name_of_the_file():
    with pytest.raises(OutputError, match="cannot write /dev/full: the disk is full"):
        append_line("/dev/full", "x")
