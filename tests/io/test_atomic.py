from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from epinet.errors import InputError
from epinet.io.atomic import atomic_folder, atomic_path, remove_leftovers, scratch_folder


def test_a_file_appears_whole_with_its_folder(tmp_path: Path) -> None:
    target = tmp_path / "new" / "a.txt"
    with atomic_path(target) as temporary:
        assert temporary.parent == target.parent
        assert temporary.suffix == ".txt"
        temporary.write_text("x")
        assert not target.exists()
    assert target.read_text() == "x"
    assert list(target.parent.iterdir()) == [target]


def test_a_failure_keeps_the_old_file(tmp_path: Path) -> None:
    target = tmp_path / "a.txt"
    target.write_text("old")
    with pytest.raises(KeyError), atomic_path(target) as temporary:
        temporary.write_text("half")
        raise KeyError
    assert target.read_text() == "old"
    assert list(tmp_path.iterdir()) == [target]


def test_a_folder_replaces_the_old_one_as_a_whole(tmp_path: Path) -> None:
    target = tmp_path / "result"
    target.mkdir()
    (target / "stale").touch()
    with atomic_folder(target) as temporary:
        (temporary / "fresh").touch()
        assert (target / "stale").exists()
    assert [file.name for file in target.iterdir()] == ["fresh"]
    assert list(tmp_path.iterdir()) == [target]


def test_a_failure_keeps_the_old_folder(tmp_path: Path) -> None:
    target = tmp_path / "result"
    target.mkdir()
    (target / "old").touch()
    with pytest.raises(KeyError), atomic_folder(target) as temporary:
        (temporary / "half").touch()
        raise KeyError
    assert [file.name for file in target.iterdir()] == ["old"]
    assert list(tmp_path.iterdir()) == [target]


@pytest.mark.parametrize("atomic", [atomic_path, atomic_folder])
def test_a_path_below_a_file_is_refused_by_name(tmp_path: Path, atomic: object) -> None:
    (tmp_path / "file").touch()
    with (
        pytest.raises(InputError, match=r"below: cannot be written .* permissions"),
        atomic(tmp_path / "file" / "below"),  # type: ignore[operator]
    ):
        pass


def test_no_space_is_refused_by_name(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"a\.txt: cannot be written \(No space left"):  # noqa: SIM117
        with atomic_path(tmp_path / "a.txt"):
            raise OSError(28, "No space left on device")
    assert not list(tmp_path.iterdir())


def test_a_folder_does_not_replace_a_file_nor_a_file_a_folder(tmp_path: Path) -> None:
    file, folder = tmp_path / "file", tmp_path / "folder"
    file.touch()
    folder.mkdir()
    with pytest.raises(InputError), atomic_folder(file):
        pass
    with pytest.raises(InputError), atomic_path(folder) as temporary:
        temporary.touch()
    assert sorted(tmp_path.iterdir()) == [file, folder]


KILLED = """
import os, sys
from pathlib import Path
from epinet.io.atomic import atomic_folder, atomic_path, scratch_folder
out = Path(sys.argv[1])
with atomic_path(out / "a.png") as file, atomic_folder(out / "b") as folder, scratch_folder() as s:
    file.touch()
    (folder / "half").touch()
    print(s, flush=True)
    if sys.argv[2] == "wait":
        sys.stdin.read()
    os.kill(os.getpid(), 9)
"""


def test_what_a_killed_process_left_goes_with_the_next_write(tmp_path: Path) -> None:
    command = [sys.executable, "-c", KILLED, str(tmp_path), "die"]
    scratch = Path(subprocess.run(command, stdout=subprocess.PIPE, text=True).stdout.strip())
    assert len(list(tmp_path.iterdir())) == 2
    assert scratch.is_dir()
    with atomic_path(tmp_path / "c.txt") as temporary:
        temporary.touch()
    assert [p.name for p in tmp_path.iterdir()] == ["c.txt"]
    with scratch_folder() as mine:
        assert not scratch.exists()
    assert not mine.exists()


def test_what_another_process_is_writing_stays(tmp_path: Path) -> None:
    command = [sys.executable, "-c", KILLED, str(tmp_path), "wait"]
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as other:
        assert other.stdout is not None
        other.stdout.readline()
        before = set(tmp_path.iterdir())
        assert len(before) == 2
        remove_leftovers(tmp_path)
        assert set(tmp_path.iterdir()) == before
    remove_leftovers(tmp_path)
    assert not list(tmp_path.iterdir())


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="starts of processes are not told")
def test_a_number_given_to_another_process_is_not_taken_for_it(tmp_path: Path) -> None:
    with atomic_path(tmp_path / "a.txt") as temporary:
        *before, start, end = temporary.name.rsplit("-", 2)
        reused = tmp_path / "-".join([*before, str(int(start) - 1), end])
        reused.touch()
        temporary.touch()
        remove_leftovers(tmp_path)
        assert not reused.exists()
        assert temporary.exists()


def test_those_of_another_machine_go_when_they_are_old(tmp_path: Path) -> None:
    fresh = tmp_path / ".a.epinet-01234567-1-1-89abcdef.png"
    old = tmp_path / ".b.epinet-01234567-1-1-89abcdef.png"
    fresh.touch()
    old.touch()
    os.utime(old, (0, 0))
    others = {tmp_path / name for name in (".b.48f936ee.png", ".epinet", "c.epinet-1")}
    for other in others:
        other.touch()
        os.utime(other, (0, 0))
    remove_leftovers(tmp_path)
    assert set(tmp_path.iterdir()) == {fresh, *others}


def test_what_was_being_replaced_comes_back(tmp_path: Path) -> None:
    with atomic_path(tmp_path / "x") as temporary:
        mark = temporary.name.removeprefix(".x.epinet")
        temporary.touch()
    pid = mark.split("-")[2]
    gone = mark.replace(f"-{pid}-", "-999999999-")
    old = tmp_path / f".result.v2.epinet-old{gone}"
    old.mkdir()
    (old / "kept").touch()
    remove_leftovers(tmp_path)
    assert (tmp_path / "result.v2" / "kept").exists()
    assert not old.exists()


def test_the_longest_names_can_be_written(tmp_path: Path) -> None:
    target = tmp_path / ("n" * 251 + ".txt")
    with atomic_path(target) as temporary:
        temporary.write_text("x")
    folder = tmp_path / ("ö" * 127)
    for _ in range(2):
        with atomic_folder(folder) as inner:
            (inner / "x").touch()
    assert set(tmp_path.iterdir()) == {target, folder}
