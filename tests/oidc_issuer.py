"""An OpenID Connect issuer on a loopback port, which signs what a test wants."""

from __future__ import annotations

import json
import threading
import time
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

import jwt
from cryptography.hazmat.primitives.asymmetric import ec, rsa
from jwt.algorithms import ECAlgorithm, RSAAlgorithm
from typing_extensions import Self

AUDIENCE = "drones"


class Issuer:
    """Publishes its keys, which a test may change, at `url`."""

    def __init__(self) -> None:
        self.keys: dict[str, Any] = {}
        """Private keys by id."""
        self.fetches = 0
        """How often its set of keys was asked for."""
        self.requests = 0
        """How often it was asked for anything."""
        self.down = False
        """Whether it answers by 500."""
        self.called: str | None = None
        """What it calls itself, if not by its address."""
        self.moved: str | None = None
        """Where it sends who asks for its keys."""
        self.use = "sig"
        """What its keys are for."""
        self.add("first")

    def __enter__(self) -> Self:
        issuer = self

        class Handler(BaseHTTPRequestHandler):
            def do_GET(self) -> None:
                issuer.requests += 1
                content = json.dumps(issuer._answer(self.path)).encode()
                moved = issuer.moved if self.path.endswith("/keys") else None
                self.send_response(500 if issuer.down else 302 if moved else 200)
                if moved:
                    self.send_header("Location", moved)
                self.send_header("Content-Length", str(len(content)))
                self.end_headers()
                self.wfile.write(content)

            def log_message(self, format: str, *args: object) -> None:  # noqa: A002 - the base's
                pass

        self._server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        self.url = f"http://127.0.0.1:{self._server.server_port}/realms/farm"
        threading.Thread(target=self._server.serve_forever, args=(0.02,), daemon=True).start()
        return self

    def __exit__(self, *_: object) -> None:
        self._server.shutdown()
        self._server.server_close()

    def add(self, id_: str, *, curve: bool = False) -> None:
        """Make a key."""
        self.keys[id_] = (
            ec.generate_private_key(ec.SECP256R1())
            if curve
            else rsa.generate_private_key(public_exponent=65537, key_size=2048)
        )

    def token(self, key: str = "first", *, without: str = "", **claims: Any) -> str:  # noqa: ANN401
        """A token signed by a key, good but for these claims."""
        private = self.keys[key]
        kind = "ES256" if isinstance(private, ec.EllipticCurvePrivateKey) else "RS256"
        return jwt.encode(self.claims(without, **claims), private, kind, headers={"kid": key})

    def claims(self, without: str = "", **changes: Any) -> dict[str, Any]:  # noqa: ANN401
        """Claims of a pilot, good for a minute, but for these changes."""
        known: dict[str, Any] = {
            "iss": self.url,
            "aud": AUDIENCE,
            "sub": "5f2c",
            "preferred_username": "asha",
            "iat": int(time.time()),
            "exp": int(time.time()) + 60,
            "aerodaas_role": "pilot",
            "aerodaas_tenant": "farm",
            **changes,
        }
        return {name: value for name, value in known.items() if name != without}

    def published(self, id_: str) -> dict[str, Any]:
        """A key as it is published."""
        public = self.keys[id_].public_key()
        curve = isinstance(public, ec.EllipticCurvePublicKey)
        found = ECAlgorithm.to_jwk(public, True) if curve else RSAAlgorithm.to_jwk(public, True)  # noqa: FBT003
        return {**found, "kid": id_, "use": self.use}

    def _answer(self, path: str) -> dict[str, Any]:
        if path.endswith("/.well-known/openid-configuration"):
            return {"issuer": self.called or self.url, "jwks_uri": f"{self.url}/keys"}
        self.fetches += 1
        return {"keys": [self.published(one) for one in self.keys]}
