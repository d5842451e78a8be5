"""Reads the licences of installed distributions from their metadata."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from importlib.metadata import Distribution, PackageNotFoundError, distribution

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from tools.licences.policy import EXCEPTIONS, is_accepted

__all__ = ["Licence", "installed_licences", "licence_of"]

_UNKNOWN = "unknown"
_BY_TEXT = {
    "0BSD": r"0BSD",
    "Apache-2.0": r"Apache([ -]Software)?( License)?,?( Version)?[ -]*(2\.0)?",
    "BSD-2-Clause": r"(BSD[ -]2[ -]Clause( License)?|FreeBSD)",
    "BSD-3-Clause": r"(BSD[ -]3[ -]Clause( License)?|3-Clause BSD License|Modified BSD License"
    r"|BSD( License)?)",
    # Eclipse's double licence: their files and LICENSE leave the choice.
    "EPL-2.0 OR BSD-3-Clause": r"EPL-2\.0, BSD-3-Clause",
    "GPL-2.0-only": r"GPLv2",
    "ISC": r"ISC( License)?( \(ISCL\))?",
    "LGPL-3.0-only": r"(LGPLv3|GNU Lesser General Public License v3 \(LGPLv3\))",
    "MIT": r"MIT( License)?",
    "MPL-2.0": r"(MPL[ -]2\.0|Mozilla Public License 2\.0 \(MPL 2\.0\))",
    "PSF-2.0": r"(PSF-2\.0|Python Software Foundation License)",
}
"""What older metadata says for an SPDX id; a plain "BSD" is taken for the stricter of the two."""
_CARRIED = {"libx264": "GPL-2.0-or-later", "libx265": "GPL-2.0-or-later"}
"""Native libraries in binary wheels, of which the metadata says nothing."""


@dataclass(frozen=True)
class Licence:
    """One distribution's licence, and whether it is lived with."""

    name: str
    version: str
    expression: str
    """SPDX; "unknown" if the metadata gives none that can be read."""
    runtime: bool
    """Whether flying needs it, extras included, or only development."""
    carried: tuple[str, ...] = ()
    """Licences of native libraries in the wheel, as far as they are stricter."""

    @property
    def reasons(self) -> list[str]:
        """Why it is an exception."""
        wanted = [(self.name, one) for one in (self.expression, *self.carried)]
        return [EXCEPTIONS[key] for key in wanted if key in EXCEPTIONS]

    @property
    def objections(self) -> list[str]:
        """Licences that are neither accepted nor explained."""
        return [
            one
            for one in (self.expression, *self.carried)
            if not is_accepted(one) and (self.name, one) not in EXCEPTIONS
        ]


def installed_licences(project: str = "aerodaas") -> list[Licence]:
    """Licences of all that `project` needs here: of its extras `all` and `dev`, by name."""
    runtime = set(_needed(project, "all"))
    found = sorted(runtime | set(_needed(project, "dev")))
    return [licence_of(distribution(name), runtime=name in runtime) for name in found]


def licence_of(found: Distribution, *, runtime: bool) -> Licence:
    """Read one distribution's licence from its expression, else its text, else its classifiers."""
    name = canonicalize_name(found.metadata["Name"])
    files = {file.name.partition("-")[0] for file in found.files or () if ".libs" in str(file)}
    carried = sorted({_CARRIED[one] for one in files if one in _CARRIED})
    return Licence(name, found.version, _expression(found), runtime, tuple(carried))


def _expression(found: Distribution) -> str:
    metadata = found.metadata
    for expression in metadata.get_all("License-Expression") or ():
        return str(expression)
    text = "".join(metadata.get_all("License") or ()).strip()
    # Some give the whole licence, below its title.
    known = _known([text.partition("\n")[0]]) or _known(
        line.rpartition("::")[2].strip()
        for line in metadata.get_all("Classifier") or ()
        if line.startswith("License ::")
    )
    if known:
        return " AND ".join(known)
    return text if text and all(map(_is_id, re.split(r" (?:AND|OR) ", text))) else _UNKNOWN


def _known(texts: Iterable[str]) -> list[str]:
    """SPDX ids of the texts that are known."""
    return [
        spdx
        for text in texts
        for spdx, pattern in _BY_TEXT.items()
        if re.fullmatch(pattern, text, re.IGNORECASE)
    ]


def _is_id(text: str) -> bool:
    return bool(re.fullmatch(r"[A-Za-z0-9.+-]+", text)) and text != "UNKNOWN"


def _needed(project: str, extra: str) -> Iterator[str]:
    """Names of what is installed of the requirements of `project[extra]`, and of theirs."""
    waiting, seen = [(canonicalize_name(project), extra)], set()
    while waiting:
        name, extra = waiting.pop()
        if (name, extra) in seen:
            continue
        seen.add((name, extra))
        try:
            lines = distribution(name).requires or []
        except PackageNotFoundError:
            continue  # for another platform or Python
        if name != canonicalize_name(project):
            yield name
        for requirement in map(Requirement, lines):
            if requirement.marker is None or requirement.marker.evaluate({"extra": extra}):
                wanted = canonicalize_name(requirement.name)
                waiting += [(wanted, one) for one in ("", *requirement.extras)]
