"""Analytics schedulers by registered name, `module:Class`, `file.py:Class`, or as they are.

A published scheduler whose published code departs from its idea is mended by default;
`dems_published` and the like give the behaviour of that code.
"""

from __future__ import annotations

import importlib.util
import sys
from importlib.abc import Loader
from importlib.machinery import ModuleSpec
from pathlib import Path
from typing import Any, cast

from aerodaas.config.options import current_options
from aerodaas.config.plugins import load_plugin, plugin_names
from aerodaas.errors import SchedulerError, UnknownIdError
from aerodaas.schedulers.analytics.base import AnalyticsScheduler

__all__ = ["load_scheduler", "scheduler_names"]

_PUBLISHED = "_published"


def scheduler_names() -> list[str]:
    """The registered names, sorted."""
    return plugin_names("analytics_schedulers")


def load_scheduler(
    wanted: str | type[AnalyticsScheduler] | AnalyticsScheduler,
) -> AnalyticsScheduler:
    """Make a scheduler of a name, `module:Class`, `file.py:Class`, a class, or an instance.

    Raises UnknownIdError for an unregistered name and SchedulerError for something that
    cannot be imported, built without arguments, or is no scheduler.
    """
    if isinstance(wanted, AnalyticsScheduler):
        return wanted
    if not isinstance(wanted, str):
        return _build(wanted, repr(wanted))
    if ":" in wanted:
        return _build(_import(wanted), wanted)
    name = wanted.replace("-", "_").lower()
    idea = name.removesuffix(_PUBLISHED)
    if idea != name:
        # The names are read from every installed package, which takes milliseconds.
        names = scheduler_names()
        if name not in names and idea in names:
            return _build(_import(idea), wanted, published=True)
    return _build(_import(name), wanted)


def _import(wanted: str) -> Any:  # noqa: ANN401 - whatever the plug-in's author wrote there
    try:
        file, _, attribute = wanted.rpartition(":")
        if not file.endswith(".py"):
            return load_plugin("analytics_schedulers", wanted)
        file = str(current_options.get().beside_application(Path(file)))
        name = f"aerodaas_plugin_{Path(file).stem}"
        # With a location, from which a run reads the source that it sends to its processes.
        spec = cast("ModuleSpec", importlib.util.spec_from_file_location(name, file))
        module = importlib.util.module_from_spec(spec)
        # Pickling an instance looks its class up in sys.modules.
        sys.modules[name] = module
        cast("Loader", spec.loader).exec_module(module)
        return getattr(module, attribute)
    except UnknownIdError:
        raise
    except Exception as error:
        raise SchedulerError(f"cannot import the scheduler {wanted!r}: {error}") from error


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
