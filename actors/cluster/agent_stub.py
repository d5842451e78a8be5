"""Stand-in for the dashboard agent of a node of Ray's, of which a local Ray has no use.

Ray's node starts one, waits for the ports that it has written down, and ends with it. Ray's own,
which without the web server's packages does nothing else, takes a second and a half of a core and
50 MB. It is run as a script in front of the words that start Ray's, and does as they say where they
are not as expected: another version of Ray.
"""

from __future__ import annotations

import os
import select
import sys
from pathlib import Path

__all__ = ["main"]

_PORTS = ("metrics_agent_port", "metrics_export_port", "dashboard_agent_listen_port")
"""Names of the files in which Ray's agent writes its ports."""
_NONE = "-1"
"""What Ray's agent writes for a service that it does not offer."""


def main(words: list[str]) -> None:
    """Write down that there are no ports, and wait for the end of the node, our parent.

    `words` are the program and the arguments of Ray's agent.
    """
    parts = (word.removeprefix("--").partition("=") for word in words[1:])
    options = {name: value for name, _, value in parts}
    folder, node = options.get("session-dir"), options.get("node-id")
    if not folder or not node or "minimal" not in options:
        os.execv(sys.executable, [sys.executable, "-u", *words])  # noqa: S606 - Ray's own program
    parent = os.pidfd_open(os.getppid())
    for name in _PORTS:
        path = Path(folder, f"{name}_{node}")
        path.with_name(f"{path.name}.new").write_text(_NONE)
        path.with_name(f"{path.name}.new").rename(path)
    select.select([parent], [], [])


if __name__ == "__main__":
    main(sys.argv[1:])
