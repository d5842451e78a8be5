"""AeroDaaS: program drones as a service.

Everything that an application imports; `__init__.pyi` beside this file lists the names. Each is
loaded when it is first used, so that `import aerodaas` is quick and starts nothing.
"""

import lazy_loader

import aerodaas.actors  # noqa: F401 - an application may import Ray next, which reads variables then

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
