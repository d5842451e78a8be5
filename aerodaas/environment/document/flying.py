"""Compiling an application's file to a mission document, and flying a document."""

from __future__ import annotations

from pathlib import Path

from aerodaas.config.checked import checked
from aerodaas.config.options import RunOptions, current_options
from aerodaas.dataflow.mission_document import MissionDocument, read_mission
from aerodaas.environment.document.building import build_mission
from aerodaas.environment.document.compiling import write_mission
from aerodaas.environment.environment import Environment
from aerodaas.environment.offering import offered, run_file, the_only
from aerodaas.errors import AeroDaaSError, ConfigError, GraphError
from aerodaas.recording.decoding.messages import decode_json
from aerodaas.recording.reader import Recording

__all__ = [
    "built_document",
    "compile_application",
    "environment_beside",
    "environment_of",
    "fly_mission",
    "recorded_document",
]

_MODELS = "models"
"""Folder beside a document where models lie that are not shipped."""
_ENVIRONMENTS = "environments"
_RECORDED = "mission.json"
"""Attachment of a recording."""


def compile_application(
    application: Path, words: list[str], environment: Path | None = None
) -> MissionDocument:
    """Run an application up to `start_mission()` and write its graph; nothing flies.

    Args:
        application: Python file.
        words: Its arguments.
        environment: Environment file instead of the application's own.

    Raises:
        ConfigError: If there is no such file.
        GraphError: If it holds what no document can, or starts no mission.
    """
    if not application.is_file():
        raise ConfigError(f"there is no application {application}")
    options = RunOptions(application=application.resolve(), environment=environment, view=False)
    with offered() as found:
        run_file(application, words, options)
    try:
        return write_mission(the_only(found), application.stem)
    except GraphError as error:
        raise GraphError(f"{application.name} cannot be written as a document: {error}") from None


def recorded_document(path: Path) -> MissionDocument:
    """The mission document that a recording has flown.

    Raises:
        RecordingError: If it cannot be read, or its application was none that a document can hold.
        ConfigError: For a document that is malformed.
    """
    with Recording.open(path) as recording:
        content = decode_json(recording.attachment(_RECORDED))
    return checked(MissionDocument, content, f"{path}: {_RECORDED}")


def fly_mission(path: Path, options: RunOptions) -> None:
    """Fly a mission document; returns when the mission has ended.

    Args:
        path: The document. Models that are not shipped are looked up in `models/` beside it.
        options: Of the run; without an environment file, the one that the document names is looked
            up beside it and in `environments/`.

    Raises:
        AeroDaaSError: For a document that is malformed, or cannot be flown here.
    """
    built_document(read_mission(path), path, options).start_mission()


def built_document(document: MissionDocument, path: Path, options: RunOptions) -> Environment:
    """The graph of a document, built and not flown.

    Args:
        document: The content of the file.
        path: The file. Models that are not shipped are looked up in `models/` beside it.
        options: Of the run, as for `fly_mission`.

    Raises:
        ConfigError: If there is no environment, or it is malformed.
        GraphError: For what cannot be flown here.
    """
    environment = environment_of(document, path, options)
    try:
        build_mission(document, environment, path.resolve().parent / _MODELS)
    except AeroDaaSError as error:
        raise GraphError(f"{path}: {error}") from None
    return environment


def environment_of(document: MissionDocument, path: Path, options: RunOptions) -> Environment:
    """The environment in which a document is flown, with an empty graph.

    Args:
        document: The content of the file.
        path: The file, beside which the environment is looked up that the document names.
        options: Of the run; its environment file goes before that one.

    Raises:
        ConfigError: If there is none, or it is malformed.
    """
    current_options.set(options)
    # A provider's catalogue needs no file.
    provided = options.provider.url is not None
    return Environment(options.environment or ("" if provided else _file_of(document, path)))


def environment_beside(document: MissionDocument, path: Path) -> Path | None:
    """The environment file that a document names, beside it or in `environments/` there.

    Args:
        document: The content of the file.
        path: The file.

    Returns:
        The file's path; None if there is none.
    """
    name = document.environment
    if name and Path(name).name == name:
        for folder in (path.parent, path.parent / _ENVIRONMENTS):
            if (folder / name).is_file():
                return (folder / name).resolve()
    return None


def _file_of(document: MissionDocument, path: Path) -> Path:
    found = environment_beside(document, path)
    if found is None:
        raise ConfigError(
            f"{path} was written for {document.environment or 'an environment without a name'}, "
            "which is not beside it: give the file of yours by --env"
        )
    return found
