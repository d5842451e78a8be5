"""Models are fetched whole and with the right checksum, or not at all; and never unasked."""

from __future__ import annotations

import hashlib
import http.server
import io
import threading
import zipfile
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pytest
from synthetic_models import constant_model

from aerodaas.analytics.detection.detector import OnnxDetector
from aerodaas.analytics.models.cache import fetched_path
from aerodaas.analytics.models.fetching import fetch_model
from aerodaas.analytics.models.registry import REGISTRY, Archive, RegisteredModel
from aerodaas.errors import ConfigError, ModelError, SourceError, UnknownIdError

BOXES = np.zeros((1, 6, 84), np.float32)
BOXES[0, :, -1] = [32, 32, 20, 20, 0.0, 0.01]


@dataclass
class Release:
    """A server of one file, which may break off, and what it was asked for."""

    content: bytes
    breaks_after: int | None = None
    takes_ranges: bool = True
    status: int = 200
    ranges: list[str | None] = field(default_factory=list)
    address: str = ""


@pytest.fixture
def release(tmp_path: Path) -> Iterator[Release]:
    """The file of a small detector, on this machine."""
    path = constant_model(tmp_path / "a.onnx", [BOXES], metadata={"names": "['vest', 'person']"})
    served = Release(path.read_bytes())

    class Handler(http.server.BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            asked = self.headers["Range"]
            served.ranges.append(asked)
            start = 0
            if self.path != "/models/small_1.onnx" or served.status != 200:
                self.send_error(served.status if served.status != 200 else 404)
                return
            if asked and served.takes_ranges:
                start = int(asked.removeprefix("bytes=").rstrip("-"))
                self.send_response(206)
                last = len(served.content) - 1
                self.send_header("Content-Range", f"bytes {start}-{last}/{len(served.content)}")
            else:
                self.send_response(200)
            self.send_header("Content-Length", str(len(served.content) - start))
            self.end_headers()
            self.wfile.write(served.content[start : served.breaks_after])

        def log_message(self, format: str, *args: object) -> None:  # noqa: A002 - its name
            del format, args

    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    served.address = f"http://127.0.0.1:{server.server_port}/models/small_1.onnx"
    threading.Thread(target=server.serve_forever, args=(0.02,), daemon=True).start()
    yield served
    server.shutdown()
    server.server_close()


@pytest.fixture
def small(release: Release, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> RegisteredModel:
    """A registered model that this server releases, and a folder of fetched ones."""
    monkeypatch.setenv("AERODAAS_MODELS", str(tmp_path / "models"))
    model = RegisteredModel(
        "small",
        "detect",
        release.address,
        hashlib.sha256(release.content).hexdigest(),
        len(release.content),
        "Apache-2.0",
        "vests",
        (64, 64),
        "nothing",
    )
    monkeypatch.setitem(REGISTRY, "small", model)
    return model


def left(model: RegisteredModel) -> list[str]:
    """What lies in the folder of fetched models."""
    return sorted(path.name for path in fetched_path(model).parent.iterdir())


def test_a_name_that_was_not_fetched_is_an_error_with_the_command(
    small: RegisteredModel, release: Release
) -> None:
    """Nothing is fetched by an application."""
    with pytest.raises(ModelError, match=r"fetch it once with `aerodaas models add small`"):
        OnnxDetector("small")
    assert release.ranges == []
    assert not fetched_path(small).parent.exists()


def test_a_name_that_there_is_not_is_told_the_close_one(tmp_path: Path) -> None:
    """A file of such a name is meant only if it is there."""
    with pytest.raises(UnknownIdError, match="did you mean yolox-nano"):
        OnnxDetector("yolox-nanno")
    with pytest.raises(ModelError, match="cannot be read"):
        OnnxDetector(tmp_path / "yolox-nanno")


def test_fetched_once_it_is_used_by_name(small: RegisteredModel, release: Release) -> None:
    """With its progress told; the second time asks nobody."""
    told: list[tuple[int, int]] = []
    path = fetch_model("small", progress=lambda *one: told.append(one))
    assert told[0] == (0, small.size)
    assert told[-1] == (small.size, small.size)
    detector = OnnxDetector("small")
    assert (detector.names, detector.model_name) == (("vest", "person"), "small")
    assert fetch_model("small") == path
    assert release.ranges == [None]
    assert left(small) == ["small.onnx"]


@pytest.mark.parametrize("takes_ranges", [True, False])
def test_what_was_cut_off_goes_on(
    small: RegisteredModel,
    release: Release,
    takes_ranges: bool,  # noqa: FBT001
) -> None:
    """From where it ended, or from the start if the server knows no ranges."""
    release.breaks_after = 100
    with pytest.raises(SourceError, match=rf"cut off after 100 of {small.size} bytes"):
        fetch_model("small")
    with pytest.raises(ModelError, match="not on this machine"):
        OnnxDetector("small")
    release.breaks_after, release.takes_ranges = None, takes_ranges
    assert fetch_model("small").read_bytes() == release.content
    assert release.ranges == [None, "bytes=100-"]
    assert left(small) == ["small.onnx"]


def test_another_file_is_not_kept(small: RegisteredModel, release: Release) -> None:
    """Of the same size, and longer; both before anything reads them."""
    good = release.content
    release.content = good[:-1] + bytes([good[-1] ^ 1])
    with pytest.raises(ModelError, match="what arrived is not small: its SHA-256 is"):
        fetch_model("small")
    assert left(small) == []
    release.content = good + b"more"
    with pytest.raises(ModelError, match="is longer than small"):
        fetch_model("small")
    release.content = good
    assert fetch_model("small").read_bytes() == good


def test_a_file_that_was_changed_later_is_not_used(small: RegisteredModel) -> None:
    """Its checksum is verified whenever it is read; fetched again, it is whole."""
    path = fetch_model("small")
    whole = path.read_bytes()
    path.write_bytes(whole[:-1] + b"x")
    with pytest.raises(ModelError, match="is not the released small any more"):
        OnnxDetector("small")
    assert fetch_model("small").read_bytes() == whole
    assert left(small) == ["small.onnx"]


def test_from_a_mirror_or_a_file(small: RegisteredModel, release: Release, tmp_path: Path) -> None:
    """Of a folder, the file has its released name; the checksum is the same."""
    path = fetch_model("small", release.address.removesuffix("small_1.onnx"))
    path.unlink()
    assert fetch_model("small", str(tmp_path / "a.onnx")).read_bytes() == release.content
    path.unlink()
    for name, content in (("short", b"ab"), ("other", bytes(small.size))):
        (tmp_path / name).write_bytes(content)
        with pytest.raises(ModelError, match=r"is shorter than|what arrived is not"):
            fetch_model("small", str(tmp_path / name))
    for source in ("nowhere.onnx", "ftp://127.0.0.1/small_1.onnx", "https://"):
        with pytest.raises(ConfigError, match="neither a file nor an address"):
            fetch_model("small", source)


@pytest.mark.usefixtures("small")
def test_a_server_that_refuses_or_is_not_there(release: Release) -> None:
    """Told with what else there is."""
    release.status = 503
    with pytest.raises(SourceError, match="answers with status 503"):
        fetch_model("small")
    with pytest.raises(SourceError, match=r"cannot be reached: .*--from takes a mirror"):
        fetch_model("small", "http://127.0.0.1:1/small_1.onnx")


def test_one_process_at_a_time(small: RegisteredModel) -> None:
    """A second would write into the same file."""
    import fcntl  # noqa: PLC0415

    folder = fetched_path(small).parent
    folder.mkdir()
    with (folder / "small_1.onnx.part").open("ab") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        with pytest.raises(ConfigError, match="another process is fetching small"):
            fetch_model("small")


def test_a_model_in_an_archive(
    small: RegisteredModel, release: Release, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Both checksums are verified, the archive's before it is opened; its folders do not matter."""
    content = release.content
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("./sdk/end2end.onnx", content)
    release.content = packed.getvalue()
    sha256 = hashlib.sha256(release.content).hexdigest()
    archived = Archive(sha256, len(release.content), "end2end.onnx")
    monkeypatch.setitem(REGISTRY, "small", replace(small, archive=archived))
    assert fetch_model("small").read_bytes() == content
    assert left(small) == ["small.onnx"]
    fetched_path(small).unlink()
    monkeypatch.setitem(REGISTRY, "small", replace(small, archive=archived, sha256="0" * 64))
    with pytest.raises(ModelError, match="what arrived is not small"):
        fetch_model("small")
    monkeypatch.setitem(
        REGISTRY, "small", replace(small, archive=replace(archived, member="gone.onnx"))
    )
    with pytest.raises(ModelError, match="archive of small is damaged"):
        fetch_model("small")
    assert left(small) == []


def test_the_registry_is_consistent() -> None:
    """Names as on a command line, checksums of the right form, licences that all can live with."""
    for name, model in REGISTRY.items():
        assert name == model.name
        assert model.address.startswith("https://")
        assert model.licence in ("Apache-2.0", "MIT", "BSD-3-Clause")
        hashes = [model.sha256, *([model.archive.sha256] if model.archive else [])]
        assert all(len(one) == 64 and int(one, 16) for one in hashes)
