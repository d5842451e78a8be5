"""Analytics schedulers by name: registered here, by entry point, or `module:Class`.

A published scheduler whose published code departs from its idea is mended by default;
`dems_published` and the like give the behaviour of that code.
"""

from __future__ import annotations

import importlib
import importlib.util
import sys
from importlib.machinery import ModuleSpec, SourceFileLoader
from importlib.metadata import entry_points
from pathlib import Path
from types import ModuleType
from typing import cast

from aerodaas.errors import SchedulerError, UnknownIdError
from aerodaas.schedulers.analytics.base import AnalyticsScheduler

__all__ = ["ENTRY_POINTS", "REGISTERED", "load_scheduler"]

ENTRY_POINTS = "aerodaas.analytics_schedulers"
"""Entry-point group under which other packages register theirs."""

_PUBLISHED = "_published"
_HERE = "aerodaas.schedulers.analytics"
REGISTERED: dict[str, str] = {
    "fifo": f"{_HERE}.edge_only:Fifo",
    "edf": f"{_HERE}.edge_only:Edf",
    "sjf": f"{_HERE}.edge_only:Sjf",
    "hbf": f"{_HERE}.edge_only:Hbf",
    "huf": f"{_HERE}.edge_only:Huf",
    "hpf": f"{_HERE}.edge_only:Hpf",
    "cld": f"{_HERE}.cloud_only:CloudOnly",
    "ec_edf": f"{_HERE}.edge_cloud:EdgeCloudEdf",
    "ec_sjf": f"{_HERE}.edge_cloud:EdgeCloudSjf",
    "dem": f"{_HERE}.dem:Dem",
    "dems": f"{_HERE}.dems:Dems",
    "dems_a": f"{_HERE}.dems_a:DemsA",
    "gems": f"{_HERE}.gems:Gems",
    "kalmia": f"{_HERE}.kalmia:Kalmia",
    "dedas": f"{_HERE}.dedas:Dedas",
    "margin": f"{_HERE}.margin:Margin",
}
"""Names to `module:Class`, imported when asked for."""


def load_scheduler(
    wanted: str | type[AnalyticsScheduler] | AnalyticsScheduler,
) -> AnalyticsScheduler:
    """Make a scheduler of a name, `module:Class`, `file.py:Class`, a class, or an instance.

    Raises UnknownIdError for a name that nobody registered and SchedulerError for something that
    cannot be imported, built without arguments, or is no scheduler.
    """
    if isinstance(wanted, AnalyticsScheduler):
        return wanted
    if not isinstance(wanted, str):
        return _build(wanted, repr(wanted))
    found = {**{e.name: e.value for e in entry_points(group=ENTRY_POINTS)}, **REGISTERED}
    name = wanted.replace("-", "_").lower()
    published = name not in found and name.endswith(_PUBLISHED)
    if published:
        name = name.removesuffix(_PUBLISHED)
    if ":" not in wanted and name not in found:
        raise UnknownIdError("analytics scheduler", wanted, list(found))
    module_name, _, class_name = found.get(name, wanted).rpartition(":")
    made = getattr(_import(module_name, wanted), class_name, None)
    if made is None:
        raise SchedulerError(
            f"{module_name} holds no class {class_name!r}, asked for by {wanted!r}"
        )
    return _build(made, wanted, **({"published": True} if published else {}))


def _import(module_name: str, wanted: str) -> ModuleType:
    try:
        if not module_name.endswith(".py"):
            return importlib.import_module(module_name)
        name = f"aerodaas_plugin_{Path(module_name).stem}"
        loader = SourceFileLoader(name, module_name)
        spec = importlib.util.spec_from_loader(name, loader, origin=module_name)
        module = importlib.util.module_from_spec(cast("ModuleSpec", spec))
        # Pickling an instance looks its class up in sys.modules.
        sys.modules[name] = module
        loader.exec_module(module)
    except Exception as error:
        raise SchedulerError(f"cannot import the scheduler {wanted!r}: {error!r}") from error
    return module


def _build(made: object, wanted: str, **settings: bool) -> AnalyticsScheduler:
    if not (isinstance(made, type) and issubclass(made, AnalyticsScheduler)):
        raise SchedulerError(
            f"{wanted!r} is no analytics scheduler; derive it from "
            "aerodaas.schedulers.analytics.AnalyticsScheduler"
        )
    try:
        return made(**settings)
    except Exception as error:
        raise SchedulerError(
            f"{wanted!r} cannot be built with {settings or 'no arguments'} ({error!r}); "
            "pass an instance"
        ) from error
