"""Client of one model behind the Open Inference Protocol: metadata check and inference."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from http import HTTPStatus
from typing import Any
from urllib.parse import quote

from numpy.typing import NDArray

from aerodaas.analytics.endpoint.connection import Connection, Reply
from aerodaas.analytics.endpoint.tensors import (
    HEADER_LENGTH,
    MALFORMED,
    TensorSpec,
    decode_reply,
    encode_request,
)
from aerodaas.config.secrets import SecretUrl
from aerodaas.errors import ConfigError, EndpointError, ModelError

__all__ = ["EndpointModel", "refuse_denied"]

_TEXT_SHOWN = 200
_DENIED = {HTTPStatus.UNAUTHORIZED, HTTPStatus.FORBIDDEN}


def refuse_denied(reply: Reply, url: SecretUrl) -> None:
    """Refuse a reply that rejects the secret.

    Args:
        reply: The reply.
        url: Address of the endpoint, for the error.

    Raises:
        ConfigError: If the endpoint rejects the secret.
    """
    if reply.status in _DENIED:
        raise ConfigError(
            f"{url} refuses our secret (status {reply.status}): "
            "set endpoint.token_env, and that variable on the edge node"
        )


class EndpointModel:
    """Client of the model `name` at an endpoint."""

    def __init__(self, connection: Connection, name: str) -> None:
        self.name = name
        self._connection = connection
        self._path = f"{connection.url.get_secret_value()}/v2/models/{quote(name, safe='/')}"
        self._binary = True

    def check(self, inputs: Sequence[TensorSpec], outputs: Sequence[TensorSpec]) -> None:
        """Compare the model's metadata at the endpoint with the expected inputs and outputs.

        Args:
            inputs: Tensors that the model must take.
            outputs: Tensors that the model must give, of any element type.

        Raises:
            ModelError: If the model does not fit, or is not there.
            ConfigError: If the endpoint rejects the secret.
            EndpointError: Without a reply.
        """
        reply = self._connection.ask("GET", self._path)
        refuse_denied(reply, self._connection.url)
        if reply.status != HTTPStatus.OK:
            raise ModelError(
                f"{self._connection.url} has no model {self.name!r} (status {reply.status}: "
                f"{reply.text}); name the one it has in endpoint.models"
            )
        told = _metadata(reply, self._connection)
        for kind, wanted in (("inputs", inputs), ("outputs", outputs)):
            known = {spec.name: spec for spec in told[kind]}
            for spec in wanted:
                there = known.get(spec.name)
                # Outputs of any element type are converted.
                kinds = kind == "outputs" or (there and there.datatype == spec.datatype)
                if there is None or not kinds or not there.fits(spec.shape):
                    raise self._misfit(f"no {kind[:-1]} {spec}", told[kind])

    def rehearse(self, inputs: Mapping[str, NDArray[Any]], outputs: Sequence[TensorSpec]) -> None:
        """Run one trial inference, which determines whether the server accepts binary tensors.

        Args:
            inputs: Arrays of the trial picture by name.
            outputs: Tensors that the model must give.

        Raises:
            ModelError: If it accepts neither binary nor JSON tensors, or the outputs do not fit.
            EndpointError: Without a reply.
        """
        for self._binary in (True, False):
            reply = self._infer(inputs, outputs, None)
            if reply.status == HTTPStatus.OK:
                try:
                    self._outputs(reply, outputs)
                except EndpointError as error:
                    raise ModelError(f"{error}; serve the same file as on the edge") from None
                return
        raise ModelError(
            f"the model {self.name!r} at {self._connection.url} fails on a trial picture "
            f"(status {reply.status}: {reply.text}); does it run the same file as the edge?"
        )

    def infer(
        self,
        inputs: Mapping[str, NDArray[Any]],
        outputs: Sequence[TensorSpec],
        budget: float | None,
    ) -> list[NDArray[Any]]:
        """Run the model.

        Args:
            inputs: Arrays by name.
            outputs: Tensors to be returned, in this order.
            budget: Wall seconds for the reply, as for `Connection.ask`.

        Returns:
            Array of each output.

        Raises:
            EndpointError: Without a valid reply.
        """
        reply = self._infer(inputs, outputs, budget)
        if reply.status != HTTPStatus.OK:
            self._connection.failures["status"] += 1
            text = f"{self._connection.url}: status {reply.status}: {reply.text}"
            raise EndpointError(text)
        return self._outputs(reply, outputs)

    def _infer(
        self,
        inputs: Mapping[str, NDArray[Any]],
        outputs: Sequence[TensorSpec],
        budget: float | None,
    ) -> Reply:
        names = [spec.name for spec in outputs]
        body, headers = encode_request(inputs, names, binary=self._binary)
        url = f"{self._path}/infer"
        return self._connection.ask("POST", url, body=body, headers=headers, budget=budget)

    def _outputs(self, reply: Reply, wanted: Sequence[TensorSpec]) -> list[NDArray[Any]]:
        try:
            found = decode_reply(reply.body, reply.headers.get(HEADER_LENGTH))
            return [_picked(found, spec) for spec in wanted]
        except EndpointError as error:
            self._connection.failures["garbage"] += 1
            text = self._connection.cleaned(f"{self._connection.url}: {error}")
            raise EndpointError(text) from None

    def _misfit(self, problem: str, told: Sequence[TensorSpec]) -> ModelError:
        return ModelError(
            f"the model {self.name!r} at {self._connection.url} has {problem}; "
            f"it has {', '.join(map(str, told)) or 'none'}: serve the same file as on the edge"
        )


def _picked(found: Mapping[str, NDArray[Any]], spec: TensorSpec) -> NDArray[Any]:
    if spec.name not in found:
        raise EndpointError(f"the reply lacks {spec.name}")
    if not spec.fits(found[spec.name].shape):
        shape = list(found[spec.name].shape)
        raise EndpointError(f"the reply has a wrong shape: {shape} for {spec}")
    return found[spec.name]


def _metadata(reply: Reply, connection: Connection) -> dict[str, list[TensorSpec]]:
    try:
        content = json.loads(reply.body)
        return {
            key: [
                TensorSpec(
                    str(tensor["name"]),
                    str(tensor["datatype"]),
                    tuple(axis if axis >= 0 else None for axis in map(int, tensor["shape"])),
                )
                for tensor in content[key]
            ]
            for key in ("inputs", "outputs")
        }
    except MALFORMED as error:
        reason = connection.cleaned(repr(error))[:_TEXT_SHOWN]
        raise ModelError(
            f"{connection.url} tells of no model of the Open Inference Protocol ({reason}); "
            'check endpoint.url, or set endpoint.protocol to "function"'
        ) from None
