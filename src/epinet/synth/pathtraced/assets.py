"""Freely licensed models and textures from three public packages; none is part of epinet.

The packages need not be installed: their downloaded files, lying in one folder, are enough.
"""

from __future__ import annotations

import importlib.util
import io
import tarfile
import zipfile
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath
from typing import Any

from epinet.errors import InputError
from epinet.io.atomic import atomic_path

_MODELS_FILE = "usr/share/sweethome3d/furniture/BlendSwap-CC-0.sh3f"
_CATALOGUE = "PluginFurnitureCatalog.properties"


@dataclass(frozen=True)
class Package:
    """A package of assets and where its files lie."""

    name: str
    version: str
    pattern: str
    """Of its downloaded file."""
    prefix: str
    """Folder of the assets inside it."""
    licence: str
    origin: str


PACKAGES = {
    "models": Package(
        "sweethome3d-furniture",
        "1.8-1",
        "sweethome3d-furniture_*.deb",
        "blendswap-cc-0/",
        "CC0-1.0",
        "Debian package, BlendSwap-CC-0.sh3f: models by users of blendswap.com",
    ),
    "textures": Package(
        "robosuite",
        "1.5.2",
        "robosuite-*.whl",
        "robosuite/models/assets/textures/",
        "MIT",
        "PyPI package",
    ),
    "photos": Package(
        "scikit-image",
        "0.26.0",
        "scikit_image-*.whl",
        "skimage/data/",
        "CC0-1.0 or public domain, per image",
        "PyPI package, skimage.data",
    ),
}

PHOTO_LICENCES = {
    "astronaut.png": "public domain (NASA)",
    "brick.png": "CC0-1.0 (CC0Textures)",
    "camera.png": "CC0-1.0 (Lav Varshney)",
    "chelsea.png": "CC0-1.0 (Stefan van der Walt)",
    "coffee.png": "CC0-1.0 (Rachel Michetti)",
    "grass.png": "CC0-1.0 (linolafett)",
    "gravel.png": "CC0-1.0 (CC0Textures)",
    "hubble_deep_field.jpg": "public domain (NASA)",
    "retina.jpg": "CC0-1.0 (Mikael Haeggstroem)",
    "rocket.jpg": "public domain (SpaceX)",
}
"""Photos that may be used, with what scikit-image's documentation says of each."""

HOW_TO_GET = """fetch the packages of assets into a folder (installing them is not needed):
    mkdir -p ASSETS && cd ASSETS
    pip download --no-deps --only-binary=:all: --python-version 3.11 \\
        robosuite==1.5.2 scikit-image==0.26.0
    apt-get download sweethome3d-furniture
and name it with --assets ASSETS"""


@dataclass
class Library:
    """Assets by kind and name, unpacked to a cache when they are first asked for.

    Raises:
        InputError: a package is not found; names all that are missing and how to get them.
    """

    folder: Path | None
    """Where the downloaded packages lie; None looks for installed ones only."""
    cache: Path
    used: dict[str, dict[str, str]] = field(default_factory=dict)
    """Source and licence of each asset that was asked for."""

    def __post_init__(self) -> None:
        finders: dict[str, Callable[[], zipfile.Path | Path | None]] = {
            "models": self._find_models,
            "textures": lambda: self._find_python("textures", "robosuite"),
            "photos": lambda: self._find_python("photos", "skimage"),
        }
        found = {kind: find() for kind, find in finders.items()}
        where = f"{self.folder}: " if self.folder else ""
        missing = [PACKAGES[kind].name for kind, root in found.items() if root is None]
        if missing:
            raise InputError(
                [f"{where}no assets of {name}, packed or installed" for name in missing]
                + [HOW_TO_GET]
            )
        self._roots = {kind: root for kind, root in found.items() if root is not None}
        self._authors: dict[str, str] | None = None

    def file(self, kind: str, name: str) -> Path:
        """The unpacked file of an asset, e.g. `file("photos", "chelsea.png")`.

        Raises:
            InputError: there is none of that name, or a photo without a known licence.
        """
        package = PACKAGES[kind]
        target = self.cache / kind / name
        self._note(kind, name)
        if not target.exists():
            source = self._roots[kind].joinpath(*PurePosixPath(name).parts)
            if not source.is_file():
                raise InputError(f"{package.name} {package.version}: holds no {name}")
            with atomic_path(target) as temporary:
                temporary.write_bytes(source.read_bytes())
        return target

    def _note(self, kind: str, name: str) -> None:
        package = PACKAGES[kind]
        licence = package.licence
        if kind == "photos":
            if name not in PHOTO_LICENCES:
                raise InputError(f"skimage.data {name}: its licence is not on record here")
            licence = PHOTO_LICENCES[name]
        note = {"package": f"{package.name} {package.version}", "licence": licence}
        if kind == "models" and (author := self._author(PurePosixPath(name).parts[0])):
            note["author"] = author
        self.used[f"{kind}/{name}"] = note

    def _author(self, model: str) -> str | None:
        """Who made a model, as the catalogue beside the models says."""
        if self._authors is None:
            package: Any = self._roots["models"].parent  # a path inside an archive
            text = package.joinpath(_CATALOGUE).read_text(encoding="latin-1")
            lines = (line.split("=", 1) for line in text.splitlines() if "=" in line)
            entries = {key.strip(): value.strip() for key, value in lines}
            self._authors = {
                PurePosixPath(value).parent.name: entries.get(key.replace("model", "creator"), "")
                for key, value in entries.items()
                if key.startswith("model#")
            }
        return self._authors.get(model)

    def _find_models(self) -> zipfile.Path | None:
        installed = Path("/", _MODELS_FILE)
        package = self._download("models")
        if package is not None:
            data: Path | io.BytesIO = io.BytesIO(_member_of_deb(package, _MODELS_FILE))
        elif installed.exists():
            data = installed
        else:
            return None
        return zipfile.Path(zipfile.ZipFile(data), PACKAGES["models"].prefix)

    def _find_python(self, kind: str, module: str) -> zipfile.Path | Path | None:
        package = self._download(kind)
        if package is not None:
            return zipfile.Path(zipfile.ZipFile(package), PACKAGES[kind].prefix)
        found = importlib.util.find_spec(module)
        if found is None or found.origin is None:
            return None
        return Path(found.origin).parent.parent / PACKAGES[kind].prefix

    def _download(self, kind: str) -> Path | None:
        if self.folder is None:
            return None
        return max(self.folder.glob(PACKAGES[kind].pattern), default=None)


def _member_of_deb(package: Path, member: str) -> bytes:
    """One file of a Debian package: an `ar` archive that holds data.tar.xz."""
    data, position = package.read_bytes(), 8
    while position + 60 <= len(data):
        header = data[position : position + 60]
        name, size = header[:16].decode("ascii").strip(" /"), int(header[48:58])
        body = data[position + 60 : position + 60 + size]
        if name.startswith("data.tar"):
            with tarfile.open(fileobj=io.BytesIO(body)) as tar:
                file = tar.extractfile(f"./{member}")
                if file is not None:
                    return file.read()
        position += 60 + size + size % 2
    raise InputError(f"{package}: holds no {member}; download the package again")
