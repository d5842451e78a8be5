"""Where analyses run: nodes and endpoints, and what an analysis has for itself there."""

from __future__ import annotations

import re
from typing import Annotated, Literal

from pydantic import AfterValidator, Field, SecretStr, model_validator
from typing_extensions import Self

from aerodaas.config.checked import NotNegative, Positive, Settings, Strict
from aerodaas.config.secrets import SecretUrl, shown_text
from aerodaas.identifiers import Identifier

__all__ = ["ComputeConfig", "EndpointConfig", "RuntimeEnvConfig"]

_HTTP = re.compile(r"^https?://[^\s@]+$")


def _plain_http(url: SecretUrl) -> SecretUrl:
    if not _HTTP.match(url.get_secret_value()):
        message = "must be http://… or https://…, without spaces and without user and password"
        raise ValueError(message)
    return url


class EndpointConfig(Strict):
    """How an inference endpoint is called; the calls come from the edge node."""

    url: Annotated[
        SecretUrl, AfterValidator(_plain_http), Field(json_schema_extra={"pattern": _HTTP.pattern})
    ]
    """Without a password: a secret belongs into `token_env`."""
    protocol: Literal["v2", "function"] = "v2"
    """`v2`: the Open Inference Protocol; `function`: JPEG in, JSON detections out."""
    models: dict[Identifier, str] = Field(default_factory=dict)
    """Name there by analysis. An analytics scheduler may send the analyses named here."""
    timeout: Positive = 2.0
    """Seconds for one frame, all attempts together."""
    retries: Annotated[int, Field(ge=0, le=10)] = 2
    """Further attempts after a refused connection or a busy server, while there is time."""
    cost: NotNegative | None = None
    """Utility that a call costs; None: the analysis' `cloud_cost`."""
    token_env: Annotated[str, Field(pattern=r"^[A-Za-z_][A-Za-z0-9_]*$")] | None = None
    """Environment variable of the edge node that holds the secret to send along."""
    token_header: Annotated[str, Field(pattern=r"^[A-Za-z0-9\-]+$")] = "Authorization"  # noqa: S105
    """As `Bearer …` where it is `Authorization`, else the bare secret."""


class RuntimeEnvConfig(Strict):
    """Runtime environment of one analysis: packages, environment variables, or a container."""

    packages: list[str] = Field(default_factory=list)
    """Requirements such as `torch==2.4.1`, or paths of wheels, laid over the node's own."""
    env_vars: dict[str, SecretStr] = Field(default_factory=dict)
    """Environment variables of its process. Their values are shown, logged and recorded nowhere."""
    image_uri: str | None = None
    """Container image, for nodes that have podman; it brings its own packages."""

    @model_validator(mode="after")
    def _makes_sense(self) -> Self:
        if self.image_uri is not None and self.packages:
            message = "an image_uri brings its own packages; build them into the image"
            raise ValueError(message)
        for package in self.packages:
            _check_requirement(package)
        for name in self.env_vars:
            if not name.isidentifier() or name.startswith("RAY_"):
                message = f"{name!r} cannot be set: a letter first, and not one of Ray's (RAY_…)"
                raise ValueError(message)
        return self


def _check_requirement(package: str) -> None:
    from packaging.requirements import InvalidRequirement, Requirement  # noqa: PLC0415 - rarely used

    if package.endswith(".whl"):
        return
    try:
        Requirement(package)
    except InvalidRequirement as error:
        reason = shown_text(str(error).splitlines()[0])
        package = shown_text(package)
        message = f"{package!r} is neither a requirement such as name==1.0 nor a wheel: {reason}"
        raise ValueError(message) from None


class ComputeConfig(Strict):
    """One compute resource: a class of Ray nodes by their custom resource, or an endpoint."""

    id: Identifier
    kind: Literal["edge", "cloud", "http"] = "edge"
    node: str | None = None
    """A named node's address, where the kind alone does not say."""
    simulated: bool = False
    """Of the kind `cloud`: there in simulated time alone, if `simulation.execution_times` says
    how long executions take, and left out in real time."""
    executors: Annotated[int, Field(ge=1, le=256)] = 1
    """Inferences that may run at once."""
    compression: Literal["jpeg", "png", "none"] = "jpeg"
    """Of frames that an analytics scheduler sends to a cloud node; `png` is lossless."""
    endpoint: EndpointConfig | None = None
    """Of the kind `http`."""
    settings: Settings = Field(default_factory=dict)

    @model_validator(mode="after")
    def _endpoint_of_http(self) -> Self:
        if (self.kind == "http") != (self.endpoint is not None):
            message = 'the kind "http" needs an endpoint, and no other kind has one'
            raise ValueError(message)
        if self.kind == "http" and self.node is not None:
            message = 'the kind "http" has no node; its address is endpoint.url'
            raise ValueError(message)
        if self.simulated and (self.kind != "cloud" or self.node is not None):
            message = 'what is simulated is of the kind "cloud", and has no node'
            raise ValueError(message)
        return self
