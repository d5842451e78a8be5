"""Secrets of a configuration: types that show themselves without it, and texts cleaned of it.

A secret is a value of a secret type (`SecretStr`, `SecretUrl`), the value of a setting that is
called like one (`password`, `token`, …), and what a URL holds beside its scheme, host and path.
"""

from __future__ import annotations

import re
import string
from collections.abc import Iterator, Mapping
from typing import Any

from pydantic import BaseModel, Secret, SecretBytes, SecretStr

__all__ = [
    "HIDDEN",
    "MAVLINK_KEY",
    "SecretUrl",
    "cleaned",
    "is_secret_name",
    "plain",
    "secret_texts",
    "shown",
    "shown_text",
]

HIDDEN = "**********"
"""What stands in the place of a secret, as pydantic shows one."""
MAVLINK_KEY = "AERODAAS_MAVLINK_KEY"
"""Environment variable that may hold the signing key of MAVLink vehicles, as 64 hexadecimal digits.

It goes to the processes that fly or watch a vehicle, and to no other."""
_LETTERS, _FURTHER = string.ascii_letters, string.digits + "+.-"
"""Characters with which a URL's scheme begins, and which it has beside them."""
_PARAMETERS = re.compile(r"[?#;=\s\"']")
_WORD = re.compile(
    r"\w*(?:passw(?:or)?d|passphrase|secret|token|credential|bearer|cookie)s?|"
    r"pass|pwd|auth|authorization|login|key|pin|psk",
    re.IGNORECASE,
)
"""One word of a name that tells of a secret."""
_ABOUT = re.compile(r"[_\-.](?:env|file|header|id|name|path|timeout|type)$", re.IGNORECASE)
"""Ends of names of settings that tell of a secret without holding it, such as `token_env`."""
_SHORTEST = 4
"""Characters below which a secret is not searched for in texts: it would be found everywhere."""


class SecretUrl(Secret[str]):
    """A path or URL that shows itself without user, password, query and fragment."""

    def _display(self) -> str:
        return shown_text(self.get_secret_value())


def shown_text(text: str) -> str:
    """Return `text` as it is, but a URL in it without user, password and parameters.

    What stands before the last `@` is taken for user and password, for both may hold a `/`. What
    follows the first `?`, `#`, `;` or `=` is left out, for some cameras have the password in the
    path.
    """
    found = _scheme(text)
    if found is None:
        return text
    start, end = found
    before = _cut(text[:start])
    end += len(text[end:]) - len(text[end:].lstrip("/"))
    login, at, address = text[end:].rpartition("@")
    # An @ behind parameters may be a password's or a parameter's: what follows is either.
    shown_address = "***" if at and _PARAMETERS.search(login) else _cut(address)
    return f"{before}{text[start:end]}{shown_address}"


def _scheme(text: str) -> tuple[int, int] | None:
    """Where the first scheme of a URL begins, and where its `:/` ends; None without one.

    Each character is looked at once: an expression would begin anew at each of a long word.
    """
    begin = 0
    while (colon := text.find(":/", begin)) >= 0:
        rest = text[begin:colon].rstrip(_LETTERS + _FURTHER)
        word = text[begin + len(rest) : colon].lstrip(_FURTHER)
        if word:
            return colon - len(word), colon + len(":/")
        begin = colon + len(":/")
    return None


def _cut(text: str) -> str:
    found = _PARAMETERS.search(text.rstrip(" @"))
    return text if found is None else f"{text[: found.start()]}?***"


def is_secret_name(name: str) -> bool:
    """Whether a setting of this name holds a secret: `password`, `api_key`, `mqtt_token`, …."""
    words = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name)
    secret = any(map(_WORD.fullmatch, re.split(r"[_\-.\s]", words)))
    return secret and _ABOUT.search(words) is None


def plain(value: object) -> Any:  # noqa: ANN401 - of any type
    """Return the value of a secret; any other value as it is."""
    return (
        value.get_secret_value() if isinstance(value, Secret | SecretStr | SecretBytes) else value
    )


def shown(value: object, name: str = "") -> Any:  # noqa: ANN401, PLR0911 - as nested as its input
    """Return settings without their secrets, of the same form and of JSON's types.

    Args:
        value: A setting, or settings in dicts and lists.
        name: The setting's name; one that names a secret hides every value but None and "".

    Returns:
        The settings, with `HIDDEN` in the place of each secret and URLs as by `shown_text`.
    """
    if value is None or value == "" or isinstance(value, bool):
        return value
    if isinstance(value, Mapping):
        return {str(key): shown(one, _longer(name, str(key))) for key, one in value.items()}
    if isinstance(value, list | tuple | set | frozenset):
        return [shown(one, name) for one in value]
    if isinstance(value, SecretUrl):
        return str(value)
    if is_secret_name(name) or isinstance(value, Secret | SecretStr | SecretBytes):
        return HIDDEN
    if isinstance(value, BaseModel):
        return shown(dict(value), name)
    if isinstance(value, int | float):
        return value
    return shown_text(str(value))


def _longer(name: str, key: str) -> str:
    """The name by which a value is judged: what lies below a secret's name is secret, too."""
    return name if is_secret_name(name) else key


def secret_texts(value: object, name: str = "") -> Iterator[str]:  # noqa: C901 - one kind each
    """Yield the secrets in settings as texts, the parts of URLs that are not shown among them.

    Args:
        value: Settings: a model, plain data, or a part of them.
        name: Name of the setting, which may tell that it is a secret.
    """
    if isinstance(value, BaseModel):
        value = dict(value)
    if isinstance(value, Mapping):
        for key, one in value.items():
            yield from secret_texts(one, _longer(name, str(key)))
    elif isinstance(value, list | tuple | set | frozenset):
        for one in value:
            yield from secret_texts(one, name)
    elif isinstance(value, SecretBytes):
        yield value.get_secret_value().decode("latin-1")
    elif isinstance(value, SecretStr | Secret) and not isinstance(value, SecretUrl):
        yield str(value.get_secret_value())
    elif is_secret_name(name) and value is not None and not isinstance(value, bool):
        yield str(value)
    elif isinstance(value, str | SecretUrl):
        text = str(plain(value))
        if shown_text(text) != text:
            yield from _parts(text)


def _parts(url: str) -> Iterator[str]:
    """A URL and its parts that are not shown, as a library's message may quote them singly."""
    yield url
    found = _scheme(url)
    rest = url[found[1] :].lstrip("/") if found else url
    login, at, address = rest.rpartition("@")
    if at:
        yield login
        yield login.partition(":")[2]
    parameters = _PARAMETERS.search(address)
    if parameters is not None:
        yield address[parameters.end() :]
        for pair in re.split(r"[&;]", address[parameters.end() :]):
            yield pair.partition("=")[2]


def cleaned(text: str, value: object) -> str:
    """Return a text without the secrets in some settings.

    Args:
        text: The text, such as a library's error message.
        value: The settings.
    """
    for secret in sorted(set(secret_texts(value)), key=len, reverse=True):
        if len(secret) >= _SHORTEST:
            text = text.replace(secret, HIDDEN).replace(repr(secret)[1:-1], HIDDEN)
    return text
