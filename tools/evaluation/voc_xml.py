"""Pascal VOC's annotations: an XML for each picture, in `Annotations` beside `JPEGImages`.

Source of the format: host.robots.ox.ac.uk/pascal/VOC/voc2012, development kit. Pixels count from 1
there, and both corners belong to the box.
"""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree as ET

from aerodaas.errors import ConfigError
from aerodaas.text.xml_text import XmlError, parse_xml
from tools.evaluation.dataset import (
    AnnotatedPicture,
    Dataset,
    Thing,
    checked_box,
    counted,
    read_bytes,
    shown,
)

__all__ = ["read_voc"]

_MOST_BYTES = 4 << 20
_CORNERS = ("xmin", "ymin", "xmax", "ymax")


def read_voc(path: Path, pictures: Path | None = None) -> Dataset:
    """Read the annotations of a folder, or of `Annotations` in it.

    Args:
        path: The folder.
        pictures: Folder of the pictures; by default `JPEGImages` beside the annotations, or their
            own folder.

    Raises:
        ConfigError: That names the file and the object, if one is not as it should be.
    """
    texts = path / "Annotations" if (path / "Annotations").is_dir() else path
    beside = texts.parent / "JPEGImages"
    folder = pictures or (beside if beside.is_dir() else texts)
    found = counted((_picture(file, folder) for file in sorted(texts.glob("*.xml"))), texts)
    labels = sorted({one.label for picture in found for one in picture.things})
    return Dataset(found, tuple(labels))


def _picture(file: Path, folder: Path) -> AnnotatedPicture:
    try:
        root = parse_xml(read_bytes(file, _MOST_BYTES), "VOC")
    except XmlError as error:
        place = file if error.line is None else f"{file}:{error.line}"
        raise ConfigError(f"{place}: {error}") from None
    if root.tag != "annotation":
        raise ConfigError(f"{file}: is XML of the kind {shown(root.tag)!r}, not an annotation")
    name = (root.findtext("filename") or "").strip() or f"{file.stem}.jpg"
    if "\0" in name or Path(name).name != name:
        raise ConfigError(f"{file}: filename: {shown(name)!r} leads out of the pictures' folder")
    things = [
        _thing(f"{file}: object {number}", one)
        for number, one in enumerate(root.findall("object"), 1)
    ]
    return AnnotatedPicture(folder / name, tuple(things))


def _thing(place: str, entry: ET.Element) -> Thing:
    label = (entry.findtext("name") or "").strip()
    if not label:
        raise ConfigError(f"{place}: has no name")
    texts = [(entry.findtext(f"bndbox/{corner}") or "").strip() for corner in _CORNERS]
    try:
        left, top, right, bottom = (float(text) for text in texts)
    except ValueError:
        given = shown(", ".join(texts))
        raise ConfigError(
            f"{place}: bndbox must have the numbers {', '.join(_CORNERS)}, not {given}"
        ) from None
    box = checked_box([left - 1, top - 1, right, bottom], place)
    return Thing(label, box, (entry.findtext("difficult") or "0").strip() not in ("", "0"))
