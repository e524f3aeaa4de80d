from __future__ import annotations

from pathlib import Path

import pytest

from epinet.errors import InputError
from epinet.io.atomic import atomic_folder, atomic_path


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
