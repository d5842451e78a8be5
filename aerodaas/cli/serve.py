"""`aerodaas serve`: a fleet of drones, offered to the applications of others."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from aerodaas.cli.application import speed_option

__all__ = ["serve"]


def serve(
    fleet: Annotated[Path, typer.Argument(help="The environment file of the fleet.")],
    state: Annotated[
        Path, typer.Option(help="Folder of the database, the recordings and the models.")
    ],
    host: Annotated[
        str, typer.Option(help="Address to listen on; beyond this machine only with TLS.")
    ] = "127.0.0.1",
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port; 0 for any free one.")] = 8400,
    database: Annotated[
        str | None,
        typer.Option(
            help="URL of another database, such as postgresql+psycopg://USER@HOST/NAME.",
            envvar="AERODAAS_DATABASE",
        ),
    ] = None,
    certificate: Annotated[Path | None, typer.Option(help="TLS certificate and chain.")] = None,
    key: Annotated[Path | None, typer.Option(help="Key of the certificate.")] = None,
    speed: Annotated[
        str, typer.Option(help="Mission seconds per wall second of simulated drones, or `max`.")
    ] = "1",
    rehearse: Annotated[  # noqa: FBT002 - Typer's flags
        bool, typer.Option(help="Fly each mission in simulation before it flies.")
    ] = True,
    approval: Annotated[  # noqa: FBT002 - as above
        bool, typer.Option("--approval", help="Have an operator approve each mission.")
    ] = False,
    address: Annotated[str | None, typer.Option(help="Ray cluster that flights join.")] = None,
) -> None:
    """Offer a fleet of drones: users' applications fly on it by URL.

    The first start makes the account `admin` and shows its token, once. Ctrl-C ends the service,
    and not the flights: they go on, and the next start finds them again.

        aerodaas serve environments/fleet.json --state fleet/
        AERODAAS_TOKEN=… aerodaas submit farm_survey --to http://127.0.0.1:8400
    """
    from aerodaas.config.extras import require_extra  # noqa: PLC0415 - only to serve

    require_extra("service", "aerodaas serve")
    from aerodaas.config.model import EnvironmentConfig  # noqa: PLC0415
    from aerodaas.config.overrides import located  # noqa: PLC0415
    from aerodaas.service.serve import serve as run  # noqa: PLC0415 - slow to load
    from aerodaas.service.settings import ServiceSettings  # noqa: PLC0415

    factor, lockstep = speed_option(speed)
    settings = ServiceSettings(
        fleet=fleet.absolute(),
        config=located(EnvironmentConfig.load(fleet), fleet.absolute().parent),
        state=state.absolute(),
        rehearse=rehearse,
        approval=approval,
        speed="max" if lockstep else factor or 1.0,
        address=address,
    )
    run(
        settings,
        host=host,
        port=port,
        database=database,
        certificate=certificate,
        key=key,
        tell=typer.echo,
    )
