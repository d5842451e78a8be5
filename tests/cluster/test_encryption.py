"""What is said where one end speaks TLS and the other does not, or does not trust it."""

from __future__ import annotations

import contextlib
import shutil
import socket
import ssl
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest
from certificates import make_certificates, tls_variables
from required import needs

from aerodaas.actors.cluster.handshake import require_same_encryption
from aerodaas.errors import AeroDaaSError, ConfigError

pytestmark = needs(shutil.which("openssl"), "install openssl")
HERE, ELSEWHERE = "127.0.0.1", "127.0.0.2"


@pytest.fixture(scope="module")
def ours(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Certificates of the cluster's authority."""
    return make_certificates(tmp_path_factory.mktemp("ours"), HERE)


@pytest.fixture(scope="module")
def others(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Certificates of somebody else's."""
    return make_certificates(tmp_path_factory.mktemp("others"), HERE)


@contextlib.contextmanager
def listening(context: ssl.SSLContext | None, host: str = HERE) -> Iterator[tuple[str, int]]:
    """A server that speaks first, as gRPC's do."""
    server = socket.create_server((host, 0))

    def serve() -> None:
        with contextlib.suppress(OSError):
            while True:
                link, _ = server.accept()
                with contextlib.suppress(OSError), link:
                    if context is None:
                        link.sendall(b"\0\0\0\4\0\0\0\0\0")
                        link.recv(4096)
                    else:
                        with context.wrap_socket(link, server_side=True) as secured:
                            secured.sendall(b"\0\0\0\4\0\0\0\0\0")
                            secured.recv(1)

    thread = threading.Thread(target=serve)
    thread.start()
    yield server.getsockname()
    server.shutdown(socket.SHUT_RDWR)
    server.close()
    thread.join()


def encrypted(folder: Path) -> ssl.SSLContext:
    """A server's side that asks for certificates of its own authority, as Ray's does."""
    context = ssl.create_default_context(ssl.Purpose.CLIENT_AUTH, cafile=folder / "ca.crt")
    context.load_cert_chain(folder / f"{HERE}.crt", folder / f"{HERE}.key")
    context.verify_mode = ssl.CERT_REQUIRED
    return context


def greet(listener: tuple[str, int]) -> None:
    """Ask."""
    require_same_encryption("the-head:6379", listener)


def use(monkeypatch: pytest.MonkeyPatch, variables: dict[str, str]) -> None:
    """Set our variables."""
    for name, value in variables.items():
        monkeypatch.setenv(name, value)


def test_both_or_neither(ours: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Then nothing is said."""
    with listening(None) as listener:
        greet(listener)
    use(monkeypatch, tls_variables(ours, HERE))
    with listening(encrypted(ours)) as listener:
        greet(listener)


def test_only_one_of_the_two(ours: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whoever lacks it is told what to set."""
    with (
        listening(encrypted(ours)) as listener,
        pytest.raises(AeroDaaSError, match="speaks TLS only: set RAY_USE_TLS=1"),
    ):
        greet(listener)
    use(monkeypatch, tls_variables(ours, HERE))
    with (
        listening(None) as listener,
        pytest.raises(AeroDaaSError, match="the-head:6379 does not speak TLS"),
    ):
        greet(listener)


def test_another_authority(ours: Path, others: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """We do not trust its certificate; or it does not trust ours."""
    use(monkeypatch, tls_variables(others, HERE))
    with listening(encrypted(ours)) as listener:
        with pytest.raises(AeroDaaSError, match=r"do not vouch for: unable to get|self.signed"):
            greet(listener)
        monkeypatch.setenv("RAY_TLS_CA_CERT", str(ours / "ca.crt"))
        with pytest.raises(AeroDaaSError, match="refuses our certificate"):
            greet(listener)


def test_a_certificate_for_another_address(ours: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A node's certificate is good for its own address only."""
    use(monkeypatch, tls_variables(ours, HERE))
    with (
        listening(encrypted(ours), ELSEWHERE) as listener,
        pytest.raises(AeroDaaSError, match=r"vouch for: IP address mismatch"),
    ):
        greet(listener)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"RAY_TLS_SERVER_KEY": ""}, "RAY_USE_TLS needs RAY_TLS_SERVER_KEY, too"),
        ({"RAY_TLS_CA_CERT": "/nowhere/ca.crt"}, "cannot be used: .*No such file"),
        ({"RAY_TLS_SERVER_KEY": "{ours}/ca.key"}, "cannot be used: .*mismatch"),
    ],
)
def test_files_that_cannot_be_used(
    ours: Path, monkeypatch: pytest.MonkeyPatch, change: dict[str, str], said: str
) -> None:
    """They are named before anyone is called."""
    changed = {name: value.format(ours=ours) for name, value in change.items()}
    use(monkeypatch, {**tls_variables(ours, HERE), **changed})
    with pytest.raises(ConfigError, match=said):
        greet((HERE, 1))


def test_an_authority_signs_for_further_nodes_later(tmp_path: Path) -> None:
    """The script keeps the authority that it finds."""
    authority = (make_certificates(tmp_path, HERE) / "ca.crt").read_bytes()
    make_certificates(tmp_path, ELSEWHERE)
    assert (tmp_path / "ca.crt").read_bytes() == authority
    assert (tmp_path / f"{ELSEWHERE}.key").stat().st_mode & 0o077 == 0
