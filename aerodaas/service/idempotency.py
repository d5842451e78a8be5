"""Idempotency keys: a submission that is sent again is the same submission.

As in the IETF's draft of the header field `Idempotency-Key`
(draft-ietf-httpapi-idempotency-key-header).
"""

from __future__ import annotations

import hashlib
import json
import re

from aerodaas.protocol.schemas import MissionIn
from aerodaas.service.errors import RefusedError

__all__ = ["fingerprint", "read_key"]

_STRING = re.compile(r'"((?:[\x20-\x21\x23-\x5b\x5d-\x7e]|\\["\\]){1,255})"')
"""A string of HTTP's structured fields (RFC 8941), neither empty nor long."""


def read_key(header: str | None) -> str | None:
    """The key in a request's header field; None without one.

    Raises:
        RefusedError: With status 400, for what is no string of 1 to 255 characters in quotes.
    """
    if header is None:
        return None
    found = _STRING.fullmatch(header.strip(" "))
    if found is None:
        raise RefusedError(
            400,
            "Idempotency-Key is one string of 1 to 255 characters in quotation marks, such as "
            '"8e03978e-40d5-43dd-bc93-6894a57f9324"',
        )
    return re.sub(r"\\(.)", r"\1", found[1])


def fingerprint(wanted: MissionIn) -> str:
    """SHA-256 of a submission's content, hexadecimal; the order of its keys makes no difference.

    What was left out counts as such: a later version's defaults change no fingerprint.
    """
    content = wanted.model_dump(mode="json", exclude_unset=True)
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()
