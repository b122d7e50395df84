"""Files are whole or not there, and what prevents them is said in words."""

from __future__ import annotations

import errno

import pytest

from shapeprog.errors import OutputError
from shapeprog.files import atomic_path, make_folder, write_bytes, write_text


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
