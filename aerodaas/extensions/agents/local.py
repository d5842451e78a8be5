"""A service of one's own for an agent: a process over a simulated fleet, with two accounts.

It ends once whoever started it is gone, whatever ended that, and has its drones land before.
"""

from __future__ import annotations

import contextlib
import json
import os
import re
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

import psutil

from aerodaas.cli.flying.application import speed_option
from aerodaas.config.model import EnvironmentConfig
from aerodaas.config.overrides import located
from aerodaas.environment.provider.client import ProviderClient
from aerodaas.errors import AeroDaaSError, ConfigError, SourceError
from aerodaas.protocol.schemas import USUAL_SCOPES, AccountIn, Role, Scope, TokenIn
from aerodaas.service.access.accounts import Accounts
from aerodaas.service.serve import serve
from aerodaas.service.settings import ServiceSettings
from aerodaas.service.store import Store

__all__ = ["LocalService", "local_service"]

_AGENT = AccountIn(
    name="agent",
    tenant="agent",
    role=Role.PILOT,
    scopes=[Scope.SENSE, Scope.COMPUTE, Scope.PROPOSE],
)
_PERSON = AccountIn(name="person", tenant="agent", role=Role.OPERATOR, scopes=list(USUAL_SCOPES))
_SERVING = re.compile(r"serving .* at (http://\S+)")
_START_SECONDS = 120.0
_LANDING_SECONDS = 20.0
"""Seconds that simulated drones have to come home once the agent has gone."""
_END_SECONDS = 5.0


@dataclass(frozen=True)
class LocalService:
    """A running service, and tokens of its two accounts."""

    url: str
    agent: str
    person: str


@contextlib.contextmanager
def local_service(environment: Path, state: Path | None, speed: str) -> Iterator[LocalService]:
    """Serve a simulated fleet by a process of its own, which ends after the context.

    Args:
        environment: The fleet's environment file.
        state: Folder of the service; None for a temporary one.
        speed: As `aerodaas serve --speed`.

    Raises:
        ConfigError: If a drone of the fleet is real.
        SourceError: If the service does not start.
    """
    for robot in EnvironmentConfig.load(environment).robots:
        if robot.driver != "simulated":
            raise ConfigError(
                f"{robot.id} is no simulated drone: offer it by `aerodaas serve`, then "
                "`aerodaas agent --to URL` with an agent's token"
            )
    words = [str(environment.absolute()), speed, *([] if state is None else [str(state)])]
    command = [sys.executable, "-m", __name__, *words]
    process = subprocess.Popen(  # noqa: S603 - our own module
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, start_new_session=True
    )
    assert process.stdin is not None and process.stdout is not None  # noqa: PT018, S101 - pipes
    timer = threading.Timer(_START_SECONDS, process.kill)
    timer.start()
    from aerodaas.extensions.agents import server as _  # noqa: F401, PLC0415 - loads meanwhile

    line = process.stdout.readline()
    timer.cancel()
    if not line:
        raise SourceError("the service has not started: its reason stands above")
    try:
        yield LocalService(**json.loads(line))
    finally:
        # It may take as long as drones need to come home; nobody waits for that.
        process.stdin.close()


def _serve(environment: Path, speed: str, state: Path) -> None:
    """Serve until standard input closes; the first line of standard output tells where."""
    state.mkdir(parents=True, exist_ok=True, mode=0o700)
    agent, person = _tokens(state)

    def announce(text: str) -> None:
        if found := _SERVING.match(text):
            client = ProviderClient(found[1], person)
            threading.Thread(target=_end_with_starter, args=(client,), daemon=True).start()
            sys.stdout.write(json.dumps(asdict(LocalService(found[1], agent, person))) + "\n")
            sys.stdout.flush()
        else:
            sys.stderr.write(f"{text}\n")

    factor, simulated_time = speed_option(speed)
    config = located(EnvironmentConfig.load(environment), environment.parent)
    pace = "max" if simulated_time else factor or 1.0
    serve(ServiceSettings(environment, config, state.absolute(), speed=pace), port=0, tell=announce)


def _tokens(state: Path) -> tuple[str, str]:
    """New tokens of a day for the agent and the person; those of earlier runs are revoked."""
    found = []
    with Store.open(state / "service.db") as store:
        accounts = Accounts(store)
        for account in (_AGENT, _PERSON):
            if store.accounts.get(account.name) is None:
                accounts.add(account)
            for token in store.tokens.all(account.name):
                if not token.revoked:
                    accounts.revoke(token.id)
            found.append(accounts.issue(TokenIn(account=account.name, days=1.0)).secret or "")
    agent, person = found
    return agent, person


def _end_with_starter(client: ProviderClient) -> None:
    """Wait until the starter is gone, have all drones land, and end this process."""
    sys.stdin.buffer.read()
    until = time.monotonic() + _LANDING_SECONDS
    with contextlib.suppress(AeroDaaSError):
        while time.monotonic() < until:
            left = [one for one in client.missions() if not one.phase.over]
            if not left:
                break
            for mission in left:
                with contextlib.suppress(AeroDaaSError):
                    client.cancel(mission.id)
            time.sleep(0.5)
    flights = psutil.Process().children(recursive=True)
    for flight in flights:
        with contextlib.suppress(psutil.Error):
            flight.terminate()
    psutil.wait_procs(flights, _END_SECONDS)
    # The server raises it again at its end: SIGTERM would leave the folder behind.
    os.kill(os.getpid(), signal.SIGINT)


if __name__ == "__main__":
    with contextlib.suppress(KeyboardInterrupt), contextlib.ExitStack() as _stack:
        _environment, _speed, *_folder = sys.argv[1:]
        if not _folder:
            _folder = [_stack.enter_context(tempfile.TemporaryDirectory(prefix="aerodaas-"))]
        _serve(Path(_environment), _speed, Path(_folder[0]))
