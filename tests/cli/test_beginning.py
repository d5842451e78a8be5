"""The first hour: examples by name, copies of them, and an application of one's own."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from command_line import Ended, ran

from aerodaas.cli.shipped import TEMPLATES, find_application, purpose, shipped_applications
from aerodaas.environment.document.flying import compile_application
from aerodaas.errors import ConfigError, MissionError
from aerodaas.testing.flight import fly

Command = Callable[..., Ended]
TEMPLATE_NAMES = sorted(path.parent.name for path in TEMPLATES.glob("*/my_app.py"))
ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def aerodaas(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Command:
    """The command line in an empty folder."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    return lambda *words: ran(capsys, *words)


def test_the_applications_that_ship_are_the_repositorys() -> None:
    """Under their names, each with a line that says what it is for."""
    shipped = shipped_applications()
    assert {path.name for path in shipped.values()} == {
        path.name for path in (ROOT / "apps").glob("*.py")
    }
    assert all(purpose(path) for path in shipped.values())


def _first_program() -> str:
    """The README's first program, as printed."""
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    return text.split("```python\n")[1].split("```")[0]


def test_the_first_program_is_built_as_printed(aerodaas: Command) -> None:
    """From the README into the folder that the README names, with what ships."""
    assert aerodaas("examples")[0] == 0
    Path("examples/first.py").write_text(_first_program(), encoding="utf-8")
    code, out, said = aerodaas("check", "examples/first.py")
    assert code == 0, out + said


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_the_first_program_flies_as_printed(aerodaas: Command, tmp_path: Path) -> None:
    """It follows the person that it says it follows, and lands at the raised hand."""
    assert aerodaas("examples")[0] == 0
    first = Path("examples/first.py")
    first.write_text(_first_program(), encoding="utf-8")
    drone = fly(first, tmp_path / "flown", seed=1, timeout=850).robots["tello"]
    assert drone.outcome.startswith("landed: an analysis asked to land")
    assert drone.distance > 40


def test_only_templates_are_named(aerodaas: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    """Not the folder in which Python keeps what it has compiled."""
    shutil.copytree(TEMPLATES, "templates")
    Path("templates/__pycache__").mkdir(exist_ok=True)
    monkeypatch.setattr("aerodaas.cli.shipped.TEMPLATES", Path("templates"))
    code, _, said = aerodaas("new", "patrol", "--template", "__pycache__")
    assert code == 2
    assert "known: camera, detector, driver, extension, follow, scheduler, survey" in said


def test_help_names_what_is_flown(aerodaas: Command) -> None:
    """Each kind of vehicle of the documentation."""
    told = aerodaas("--help")[1]
    assert all(name in told for name in ("PX4", "ArduPilot", "ROS 2", "Tello"))


def test_an_application_is_found_by_path_first(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A file of one's own goes before an example of the same name."""
    monkeypatch.chdir(tmp_path)
    shipped = shipped_applications()["farm_survey"]
    assert find_application(Path("farm_survey")) == shipped
    assert find_application(Path("farm_survey.py")) == shipped
    Path("farm_survey.py").touch()
    assert find_application(Path("farm_survey.py")) == Path("farm_survey.py")


@pytest.mark.parametrize(
    ("given", "remedy"),
    [
        ("farm_survy", "did you mean farm_survey?"),
        ("patrl.py", "did you mean patrol.py?"),
        ("here/patrl.py", "did you mean here/patrol.py?"),
        ("here/farm_survey", "did you mean farm_survey?"),
        ("here", "`aerodaas examples` copies"),
        ("nowhere/zzz.py", "`aerodaas examples` copies"),
    ],
)
def test_a_name_that_is_none_gets_its_remedy(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, given: str, remedy: str
) -> None:
    """The name that is close, of the folder's files and the examples; else the way to one."""
    monkeypatch.chdir(tmp_path)
    Path("here").mkdir()
    Path("patrol.py").touch()
    Path("here/patrol.py").touch()
    with pytest.raises(ConfigError, match="there is no application") as raised:
        find_application(Path(given))
    assert remedy in str(raised.value)


def test_examples_are_copied_whole(aerodaas: Command, tmp_path: Path) -> None:
    """All of them with what they read; a second time, too; but never over changes."""
    code, out, _ = aerodaas("examples")
    assert code == 0
    assert "farm_survey" in out
    for path in [*(ROOT / "apps").glob("*.py"), *(ROOT / "apps" / "environments").iterdir()]:
        copy = tmp_path / "examples" / path.relative_to(ROOT / "apps")
        assert copy.read_bytes() == path.read_bytes()
    assert aerodaas("examples")[0] == 0
    changed = tmp_path / "examples" / "farm_survey.py"
    changed.write_text("mine")
    (tmp_path / "examples" / "fleet_survey.py").unlink()
    code, _, said = aerodaas("examples")
    assert (code, changed.read_text()) == (2, "mine")
    assert "farm_survey.py is there and differs" in said
    assert not (tmp_path / "examples" / "fleet_survey.py").exists()


def test_one_example_is_copied_alone(aerodaas: Command, tmp_path: Path) -> None:
    """With the environments; a list copies nothing; a wrong name is told."""
    assert aerodaas("examples", "--list")[0] == 0
    assert not list(tmp_path.iterdir())
    assert aerodaas("examples", "fleet_survey", "--to", "fleet")[0] == 0
    assert [path.name for path in (tmp_path / "fleet").glob("*.py")] == ["fleet_survey.py"]
    assert (tmp_path / "fleet" / "environments" / "fleet.json").is_file()
    code, _, said = aerodaas("examples", "flet_survey")
    assert code == 2
    assert "did you mean fleet_survey?" in said


@pytest.mark.parametrize("template", TEMPLATE_NAMES)
def test_a_new_application_holds_together(
    aerodaas: Command, tmp_path: Path, template: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its graph can be flown, its files speak of it by its own name, and its test names it."""
    code, out, _ = aerodaas("new", "patrol", "--template", template)
    assert code == 0
    assert "cd patrol && aerodaas run patrol.py" in out
    folder = tmp_path / "patrol"
    assert {"patrol.py", "test_patrol.py", "README.md", "environment.json"} <= {
        path.name for path in folder.iterdir()
    }
    assert not [path for path in folder.iterdir() if "my_app" in path.read_text()]
    assert '"patrol.py"' in (folder / "test_patrol.py").read_text()
    monkeypatch.chdir(folder)
    code, out, said = aerodaas("compile", "patrol.py")
    # Classes of one's own are code, which no document holds, and which the refusal names.
    own = {"camera": "Darkness", "detector": "Greenness", "scheduler": "MyScheduler"}
    assert code == (2 if template in own else 0), said
    assert own.get(template, "") in said
    for module in ("chessboard", "darkness", "greenness", "hoverbot", "my_scheduler"):
        sys.modules.pop(module, None)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("my-app",), "'my-app' is no name for a Python file"),
        (("class",), "'class' is no name for a Python file"),
        (("numpy",), "a module is called 'numpy' already"),
        (("json",), "a module is called 'json' already"),
        (("taken",), "taken is there already"),
        (("mine", "--template", "surve"), "did you mean survey?"),
    ],
)
def test_a_name_that_would_hurt_is_refused(
    aerodaas: Command, tmp_path: Path, words: tuple[str, ...], message: str
) -> None:
    """No Python name, one that hides a module, a folder that is there, a template that is not."""
    (tmp_path / "taken").write_text("mine")
    code, _, said = aerodaas("new", *words)
    assert code == 2
    assert message in said
    assert [path.name for path in tmp_path.iterdir()] == ["taken"]


@pytest.mark.slow
@pytest.mark.parametrize("template", TEMPLATE_NAMES)
def test_a_new_application_flies(aerodaas: Command, tmp_path: Path, template: str) -> None:
    """As its own test says: the drone lands, and nobody is alarmed but by whom it gives way to."""
    assert aerodaas("new", "patrol", "--template", template)[0] == 0
    flight = fly(tmp_path / "patrol" / "patrol.py", tmp_path / "flight", seed=7)
    robot = flight.robots["drone"]
    assert robot.outcome.startswith("landed")
    assert robot.distance > 5.0
    assert not [one for one in flight.alerts if one[1] != "person_close"]
    if template == "detector":
        assert flight.detections["green"] > 10
    if template == "scheduler":
        assert flight.decisions["edge"] > 10


def test_a_flight_that_fails_says_why(tmp_path: Path) -> None:
    """An author's test shows the application's own error."""
    application = tmp_path / "app.py"
    application.write_text("raise ValueError('no field today')\n")
    with pytest.raises(MissionError, match="no field today"):
        fly(application, tmp_path / "flight")


def test_a_document_of_an_example_is_the_examples() -> None:
    """Found by name, an application reads its environment beside itself."""
    document = compile_application(find_application(Path("farm_survey")), [])
    assert document.environment == "farm.json"
