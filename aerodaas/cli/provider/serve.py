"""`aerodaas serve`: a fleet of drones, offered to the applications of others."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from aerodaas.cli.flying.application import speed_option
from aerodaas.errors import ConfigError

if TYPE_CHECKING:
    from aerodaas.config.model import EnvironmentConfig
    from aerodaas.service.access.oidc import OidcSettings

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
    monitor: Annotated[  # noqa: FBT002 - as above
        bool, typer.Option(help="Hold the connection to each drone between its missions.")
    ] = True,
    approval: Annotated[  # noqa: FBT002 - as above
        bool, typer.Option("--approval", help="Have an operator approve each mission.")
    ] = False,
    most_attached: Annotated[
        int, typer.Option(min=0, help="Missions that may share one flight's cameras; 0: none.")
    ] = 0,
    edge_slots: Annotated[
        int | None,
        typer.Option(
            min=1,
            help="Analyses that flights with an analytics scheduler run at once on the edge, all "
            "together, shared by tenants' weights. Default: each flight as it likes.",
        ),
    ] = None,
    actuator: Annotated[
        list[str] | None,
        typer.Option(
            metavar="TENANT=ROBOT/NAME",
            help="An actuator that a tenant's missions may move. Default: none; never a parachute.",
        ),
    ] = None,
    agents: Annotated[  # noqa: FBT002 - as above
        bool, typer.Option("--agents", help="Let agents propose missions at /mcp, too.")
    ] = False,
    public_url: Annotated[
        str | None,
        typer.Option(metavar="URL", help="Address by which users reach it through a proxy."),
    ] = None,
    address: Annotated[str | None, typer.Option(help="Ray cluster that flights join.")] = None,
    oidc_issuer: Annotated[
        str | None,
        typer.Option(metavar="URL", help="OpenID Connect issuer whose tokens are good, too."),
    ] = None,
    oidc_audience: Annotated[
        str | None, typer.Option(help="What its tokens for this service have as `aud`.")
    ] = None,
    oidc_role_claim: Annotated[
        str, typer.Option(help="Their claim with a role, or a list; dots go into objects.")
    ] = "aerodaas_role",
    oidc_tenant_claim: Annotated[str, typer.Option(help="Their claim with the tenant.")] = (
        "aerodaas_tenant"
    ),
    oidc_role: Annotated[
        list[str] | None,
        typer.Option(
            metavar="VALUE=ROLE", help="Role by value of the claim. Default: roles by their names."
        ),
    ] = None,
) -> None:
    """Offer a fleet of drones: users' applications fly on it by URL.

    The first start makes the account `admin` and shows its token, once. Ctrl-C ends the service,
    and not the flights: they go on, and the next start finds them again.

        aerodaas serve environments/fleet.json --state fleet/
        AERODAAS_TOKEN=… aerodaas submit farm_survey --to http://127.0.0.1:8400
        aerodaas serve fleet.json --state f/ --oidc-issuer https://id.example --oidc-audience drones
    """
    from aerodaas.config.extras import require_extra  # noqa: PLC0415 - only to serve

    require_extra("service", "aerodaas serve")
    if agents:
        require_extra("agents", "aerodaas serve --agents")
    from aerodaas.config.model import EnvironmentConfig  # noqa: PLC0415
    from aerodaas.config.overrides import located  # noqa: PLC0415
    from aerodaas.service.serve import serve as run  # noqa: PLC0415 - slow to load
    from aerodaas.service.settings import ServiceSettings  # noqa: PLC0415

    factor, simulated_time = speed_option(speed)
    config = located(EnvironmentConfig.load(fleet), fleet.absolute().parent)
    settings = ServiceSettings(
        fleet=fleet.absolute(),
        config=config,
        state=state.absolute(),
        rehearse=rehearse,
        monitor=monitor,
        approval=approval,
        speed="max" if simulated_time else factor or 1.0,
        most_attached=most_attached,
        edge_slots=edge_slots,
        actuators=_actuators(actuator or (), config),
        agents=agents,
        public=public_url,
        address=address,
        oidc=_oidc(
            oidc_issuer,
            oidc_audience,
            claims=(oidc_role_claim, oidc_tenant_claim),
            roles=oidc_role or (),
        ),
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


def _actuators(texts: Iterable[str], config: EnvironmentConfig) -> dict[str, frozenset[str]]:
    """Actuators by tenant, of `TENANT=ROBOT/NAME`; raises ConfigError."""
    from aerodaas.config.checked import near  # noqa: PLC0415 - slow to load

    movable = {
        f"{robot.id}/{one.id}"
        for robot in config.robots
        for one in robot.actuators
        if one.type != "parachute"
    }
    found: dict[str, frozenset[str]] = {}
    for text in texts:
        tenant, _, name = text.partition("=")
        if not tenant or name not in movable:
            raise ConfigError(
                f"--actuator is TENANT=ROBOT/NAME, an actuator of the fleet and no parachute, "
                f"not {text!r}{near(name, movable)}"
            )
        found[tenant] = found.get(tenant, frozenset()) | {name}
    return found


def _oidc(
    issuer: str | None,
    audience: str | None,
    *,
    claims: tuple[str, str],
    roles: Iterable[str],
) -> OidcSettings | None:
    """Trust in an OpenID issuer; raises ConfigError for options that do not fit."""
    from aerodaas.protocol.schemas import Role  # noqa: PLC0415 - slow to load
    from aerodaas.service.access.oidc import OidcSettings  # noqa: PLC0415 - as above

    if (issuer is None) != (audience is None):
        raise ConfigError(
            "--oidc-issuer and --oidc-audience go together: without the second, a token for any "
            "other service of the issuer would be good here"
        )
    if issuer is None or audience is None:
        return None
    known = {role.value: role for role in Role}
    mapped: dict[str, Role] = {}
    for text in roles:
        value, _, role = text.rpartition("=")
        if not value or role not in known:
            raise ConfigError(f"--oidc-role is VALUE=ROLE with {', '.join(known)}, not {text!r}")
        mapped[value] = known[role]
    role_claim, tenant_claim = claims
    return OidcSettings(issuer, audience, role_claim, tenant_claim, mapped)
