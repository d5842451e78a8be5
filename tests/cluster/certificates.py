"""Certificates as `clusters/certificates.sh` makes them."""

from __future__ import annotations

import subprocess
from pathlib import Path

__all__ = ["make_certificates", "tls_variables"]

_SCRIPT = Path(__file__).resolve().parents[2] / "clusters/certificates.sh"


def make_certificates(folder: Path, *addresses: str) -> Path:
    """An authority and a certificate for each address; returns the folder."""
    subprocess.run([str(_SCRIPT), str(folder), *addresses], check=True, capture_output=True)
    return folder


def tls_variables(folder: Path, address: str) -> dict[str, str]:
    """What the node at `address` sets."""
    return {
        "RAY_USE_TLS": "1",
        "RAY_TLS_SERVER_CERT": str(folder / f"{address}.crt"),
        "RAY_TLS_SERVER_KEY": str(folder / f"{address}.key"),
        "RAY_TLS_CA_CERT": str(folder / "ca.crt"),
    }
