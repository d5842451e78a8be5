"""Bad input through the command line: one clear message, its place, its remedy, an exit code."""

from __future__ import annotations

import json
import os
import re
import socket
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from command_line import Ended, exit_code, ran
from flying import FLAT, robot

from aerodaas.cli.doctor import examine
from aerodaas.recording.reader import Recording
from aerodaas.recording.report.flight import RecordedFlight

CAMERA = {"id": "cam", "type": "camera", "rate": 5, "settings": {"width": 64, "height": 36}}
CONTENT: dict[str, Any] = {
    **FLAT,
    "robots": [robot(sensors=[{"id": "odom", "type": "odometry"}, CAMERA])],
}
HOP = """
from aerodaas import *
from aerodaas.analytics import *

env = Environment("environment.json")
edge = env.get_compute_resource_by_id("edge")
drone = env.get_robot_by_id("drone")
camera = drone.get_sensor_by_id("cam").get_data_stream()
odometry = drone.get_sensor_by_id("odom").get_data_stream()
drone.navigate(AeroListData([Waypoint("a", 2, 0, 2)]))
"""
FLY = "drone.start_mission()\n"


class Commands:
    """Runs `aerodaas` in this process and a folder of the test's own."""

    def __init__(self, folder: Path, capture: pytest.CaptureFixture[str]) -> None:
        self.folder = folder
        self._capture = capture

    def write(self, name: str, text: str) -> None:
        """Write a file."""
        (self.folder / name).write_text(text)

    def __call__(self, *words: str) -> Ended:
        """Run `aerodaas` with these words."""
        return ran(self._capture, *words)

    def run(self, app: str, *words: str) -> Ended:
        """Write an application and run it, without the live view, into the folder `out`."""
        self.write("app.py", app)
        place = ["--record", str(self.folder / "out")]
        return self("run", "app.py", "--no-view", *([] if "--record" in words else place), *words)


@pytest.fixture
def aerodaas(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> Commands:
    """The command line, in a folder with an environment file."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("RAY_ADDRESS", raising=False)
    commands = Commands(tmp_path, capsys)
    commands.write("environment.json", json.dumps(CONTENT))
    return commands


BAD_WORDS: dict[str, tuple[list[str], str]] = {
    "no application": (["run"], "Missing argument"),
    "an unknown command": (["fly"], "No such command 'fly'"),
    "a missing application": (["run", "none.py"], "there is no application none.py"),
    "a folder as application": (["run", "."], "there is no application ."),
    "an option that is misspelt": (["run", "app.py", "--sped", "2"], "No such option: --sped"),
    "a speed that is none": (["run", "app.py", "--speed", "fast"], "not 'fast'"),
    "a speed of zero": (["run", "app.py", "--speed", "0"], 'positive number or "max", not'),
    "a speed of nan": (["run", "app.py", "--speed", "nan"], "not 'nan'"),
    "a negative seed": (["run", "app.py", "--seed", "-1"], "--seed"),
    "a setting without a value": (["run", "app.py", "--set", "cam.rate"], "id.setting=value"),
    "a setting of nobody": (["run", "app.py", "--set", "nose.rate=1"], "called 'nose'"),
    "a setting that there is not": (
        ["run", "app.py", "--set", "drone.wings=2"],
        "drone: settings: wings",
    ),
    "a setting of a wrong type": (
        ["run", "app.py", "--set", "drone.limits.max_speed=quick"],
        "robots.0.limits.max_speed: Input should be a valid number",
    ),
    "a missing environment": (["run", "app.py", "--env", "none.json"], "file none.json: No such"),
}


@pytest.mark.parametrize("case", BAD_WORDS)
def test_bad_words_are_usage_errors(aerodaas: Commands, case: str) -> None:
    """Usage errors name what is wrong and end with 2."""
    words, message = BAD_WORDS[case]
    aerodaas.write("app.py", HOP + FLY)
    ended = aerodaas(*words)
    assert message in " ".join(ended.said.split())
    assert ended.code == 2


BAD_FILES = {
    "not JSON": ("{", "environment.json is not JSON: Expecting property name"),
    "not UTF-8": ("\udcff", "environment.json is not JSON"),
    "a list": ("[]", "environment.json: file: Input should be a valid dictionary"),
    "no robots": ('{"robots": []}', "environment.json: robots: List should have at least 1 item"),
    "an unknown key": (
        '{"robots": [{"id": "d", "colour": 1}]}',
        "robots.0.colour: there is no such setting (of d) (known: actuators, driver, edge,",
    ),
    "two of one id": (
        '{"robots": [{"id": "d"}, {"id": "d"}]}',
        "more than one robot is called d",
    ),
    "a number that is none": (
        '{"robots": [{"id": "d", "limits": {"max_speed": NaN}}]}',
        "environment.json: robots.0.limits.max_speed: must be a finite number, not nan",
    ),
}


@pytest.mark.parametrize("case", BAD_FILES)
def test_a_malformed_environment_names_file_and_place(aerodaas: Commands, case: str) -> None:
    """The file and the place in it are named; `aerodaas schema` is the remedy."""
    text, message = BAD_FILES[case]
    path = aerodaas.folder / "environment.json"
    path.write_bytes(text.encode("utf-8", "surrogateescape"))
    ended = aerodaas.run(HOP + FLY)
    assert message in ended.said
    assert ended.code == 2
    if text.startswith(("[", '{"')) and "finite" not in message:
        assert "aerodaas schema" in ended.said


BAD_LINES = {
    "an unknown robot": ("env.get_robot_by_id('dron')", "no robot is called 'dron'; known: drone"),
    "an unknown sensor": (
        "drone.getSensorByID('nose')",
        "no sensor of drone is called 'nose'; known: cam, odom",
    ),
    "an unknown compute resource": (
        "env.get_compute_resource_by_id('moon')",
        "no compute resource is called 'moon'; known: edge",
    ),
    "an unknown analytics scheduler": (
        "env.set_analytics_scheduler('demz')",
        "no analytics scheduler is called 'demz'; known: ",
    ),
    "a wrong type in the graph": (
        "VipFollowAnalytics().analyse(odometry)",
        "VipFollowAnalytics takes a stream of Detections or Frame, but drone/odom carries Odometry",
    ),
    "navigation by odometry": (
        "drone.navigate(odometry)",
        "drone cannot navigate by drone/odom, which carries Odometry; put a follow analysis",
    ),
    "no stream": (
        "VipFollowAnalytics().analyse(AeroData(1))",
        "VipFollowAnalytics",
    ),
    "a NaN in a waypoint": (
        "Waypoint('b', float('nan'), 0, 2)",
        "waypoint 'b': x must be a finite number, not nan",
    ),
    "two waypoints of one id": (
        "AeroNavigation(data=[Waypoint('b', 1, 0, 2), Waypoint('b', 2, 0, 2)])",
        "two waypoints are called 'b'; give each its own id",
    ),
    "data before the mission": (
        "next(odometry)",
        "drone/odom has no data before the mission starts; call start_mission(wait=False) first",
    ),
    "an unknown monitoring reading": (
        "MonitoringAnalytics(['mood'])",
        "no reading is called 'mood'; known: ",
    ),
}


@pytest.mark.parametrize("case", BAD_LINES)
def test_a_line_that_cannot_work_is_shown(aerodaas: Commands, case: str) -> None:
    """What the application's own line got wrong is told with that line, before anything starts."""
    line, message = BAD_LINES[case]
    ended = aerodaas.run(HOP + line + "\n" + FLY)
    assert message in ended.said
    assert f"at app.py:11: {line}" in ended.said
    assert ended.code == 2
    assert not (aerodaas.folder / "out").exists()


BAD_SETTINGS = {
    "driver": ("drone.driver=tellow", "no driver is called 'tellow'; known: "),
    "camera": ("cam.driver=eye", "no camera is called 'eye'; known: "),
    "trajectory scheduler": (
        "schedulers.trajectory=nearset",
        "no trajectory scheduler is called 'nearset'; known: deadline, ",
    ),
    "module that there is not": (
        "schedulers.trajectory=nowhere:Scheduler",
        "cannot load 'nowhere:Scheduler' (nowhere:Scheduler): No module named 'nowhere'",
    ),
}


@pytest.mark.parametrize("case", BAD_SETTINGS)
def test_a_plug_in_that_there_is_not(aerodaas: Commands, case: str) -> None:
    """An unknown name is told with the known ones, before anything starts."""
    setting, message = BAD_SETTINGS[case]
    ended = aerodaas.run(HOP + FLY, "--set", setting)
    assert message in ended.said
    assert ended.code == 2
    assert not (aerodaas.folder / "out").exists()


@pytest.mark.parametrize(
    ("app", "message"),
    [
        ("x = (\n", "app.py:1: '(' was never closed"),
        ("import nonsense_module\n", "No module named 'nonsense_module'\n  at app.py:1: import"),
        (HOP + "{}['far']\n", "KeyError: 'far'\n  at app.py:11: {}['far']"),
    ],
    ids=["syntax", "import", "exception"],
)
def test_an_application_of_its_own_mistakes(aerodaas: Commands, app: str, message: str) -> None:
    """A failure of the application is told by its own line."""
    ended = aerodaas.run(app)
    assert message in ended.said
    assert ended.code


def test_a_mission_that_was_not_completed_has_failed(aerodaas: Commands) -> None:
    """However safely the drone came home; the reason and what is left are told."""
    app = HOP.replace("2, 0, 2)", "2, 0, 2, 120)")
    ended = aerodaas.run(app + FLY, "--set", "drone.battery=0.28")
    assert "drone: the mission was not completed: " in ended.said
    assert "battery" in ended.said
    assert ended.code == 1
    assert (aerodaas.folder / "out" / "summary.txt").exists()


@pytest.mark.parametrize("command", ["run", "check", "compile --graph", "compile"])
@pytest.mark.parametrize("app", [HOP, HOP.replace("\nenv", "\ndef build():\n  return 1\nenv")])
def test_a_mission_that_is_never_started_is_told(
    aerodaas: Commands, command: str, app: str
) -> None:
    """With the line of the environment that was to fly."""
    aerodaas.write("app.py", app)
    ended = aerodaas(*command.split(), "app.py")
    assert "start_mission()" in ended.said
    assert re.search(r"at app.py:\d+: env = Environment", ended.said)
    assert ended.code == 2


def test_an_application_may_read_an_environment_and_fly_another(aerodaas: Commands) -> None:
    """One that starts is enough, and a file that flies nothing by intention makes none."""
    aerodaas.write(
        "app.py", 'from aerodaas import *\nEnvironment("environment.json")\n' + HOP + FLY
    )
    assert aerodaas("compile", "--graph", "app.py").code == 0
    aerodaas.write("app.py", "print('hello')")
    assert aerodaas("run", "app.py").code == 0


def test_an_analysis_that_analyses_nothing_is_told(aerodaas: Commands) -> None:
    """With the line that deploys it: by the check, which it fails, and in flight."""
    forgotten = "watch = MonitoringAnalytics(['height']).deploy(edge)\n"
    aerodaas.write("app.py", HOP + forgotten + FLY)
    ended = aerodaas("check", "app.py")
    assert ended.code == 1
    told = " ".join(ended.out.split())
    assert "analyse()" in told
    assert f"app.py:11: {forgotten.strip()}" in told
    aerodaas.write("app.py", HOP + forgotten + "watch.analyse(odometry)\n" + FLY)
    ended = aerodaas("check", "app.py")
    assert ended.code == 0, ended.out


def test_nothing_navigates(aerodaas: Commands) -> None:
    """The call that is missing is named."""
    app = (
        'from aerodaas import *\nenv = Environment()\nenv.get_robot_by_id("drone").start_mission()'
    )
    ended = aerodaas.run(app)
    assert "call drone.navigate(…) before start_mission()" in ended.said
    assert ended.code == 2


@pytest.mark.parametrize("address", ["127.0.0.1:9", "ray://127.0.0.1:9"])
def test_a_cluster_that_is_not_there(aerodaas: Commands, address: str) -> None:
    """The address is named, in seconds and with no word of Ray's."""
    aerodaas.write("app.py", HOP + FLY)
    ended = subprocess.run(
        [sys.executable, "-m", "aerodaas", "run", "app.py", "--address", address],
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
        env={**os.environ, "PYTHONPATH": str(Path(__file__).parents[1])},
    )
    assert ended.stderr.startswith(f"error: no Ray cluster answers at {address}: [Errno 111]")
    assert "check address and port" in ended.stderr
    assert ended.stderr.count("\n") == 1
    assert ended.returncode == 1


def not_overwritten(aerodaas: Commands) -> None:
    """Make a recording that stands in the way."""
    (aerodaas.folder / "out").mkdir()
    aerodaas.write("out/flight.mcap", "precious")


def test_a_recording_is_not_overwritten(aerodaas: Commands) -> None:
    """Another path is asked for, and the file is as it was."""
    not_overwritten(aerodaas)
    ended = aerodaas.run(HOP + FLY)
    assert "already exists and is not overwritten; give --record another path" in ended.said
    assert ended.code == 2
    assert (aerodaas.folder / "out" / "flight.mcap").read_text() == "precious"


def picture(path: Path) -> None:
    """Write a picture."""
    cv2.imwrite(str(path), np.full((36, 64, 3), 90, np.uint8))


Prepare = Callable[[Path], None]


def _empty(folder: Path) -> None:
    (folder / "pictures").mkdir()


def _all_broken(folder: Path) -> None:
    _empty(folder)
    (folder / "pictures" / "a.jpg").write_text("no picture")


@pytest.mark.parametrize(
    ("prepare", "message"),
    [
        (_empty, "pictures holds no pictures; put .bmp"),
        (_all_broken, "pictures"),
        (lambda _: None, "pictures"),
    ],
    ids=["empty", "nothing readable", "missing"],
)
def test_a_folder_without_pictures(aerodaas: Commands, prepare: Prepare, message: str) -> None:
    """The folder is named; nothing flies."""
    prepare(aerodaas.folder)
    words = ["--set", "cam.driver=folder", "--set", "cam.path=pictures"]
    ended = aerodaas.run(HOP + FLY, *words)
    assert message in ended.said
    assert ended.said.count("error:") == 1
    assert ended.code == 2


def test_a_broken_picture_is_skipped_and_told(aerodaas: Commands) -> None:
    """The others are flown; the broken one is named in the recording's alerts."""
    _empty(aerodaas.folder)
    pictures = aerodaas.folder / "pictures"
    for name in ("a.png", "c.png"):
        picture(pictures / name)
    (pictures / "b.png").write_text("no picture")
    ended = aerodaas.run(HOP + FLY, "--set", "cam.driver=folder", "--set", f"cam.path={pictures}")
    assert ended.code == 0, ended.said
    with Recording.open(aerodaas.folder / "out" / "flight.mcap") as recording:
        flight = RecordedFlight.read(recording)
    assert flight.frames["drone/cam"] == 2
    ((when, _, text),) = flight.alerts
    assert "b.png" in text
    assert when > 0


def test_a_model_that_does_not_load(aerodaas: Commands) -> None:
    """A missing model, and a file that is none, are refused where the application names them."""
    for name, message in {
        "none.onnx": "the model none.onnx cannot be read (No such file or directory)",
        "app.py": "the model app.py cannot be loaded as an ONNX model",
    }.items():
        ended = aerodaas.run(HOP + f"OnnxDetector('{name}').deploy(edge).analyse(camera)\n" + FLY)
        assert message in ended.said
        assert ended.code == 2


def test_a_good_run_says_where_everything_lies(aerodaas: Commands) -> None:
    """Exit code 0, and the paths of recording and summary."""
    ended = aerodaas.run(HOP + FLY)
    assert ended.code == 0, ended.said
    for name in ("flight.mcap", "summary.txt"):
        assert f"out/{name}" in ended.out
        assert (aerodaas.folder / "out" / name).exists()


def test_the_doctor_names_what_models_run_on(
    runtime: None,  # noqa: ARG001
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Not what onnxruntime could be told to send elsewhere."""
    monkeypatch.setattr(
        "aerodaas.actors.cluster.ray_cluster.disconnect", lambda: None
    )  # others use it, too
    monkeypatch.setattr(
        "onnxruntime.get_available_providers",
        lambda: ["AzureExecutionProvider", "CPUExecutionProvider"],
    )
    examine()
    (line,) = [line for line in capsys.readouterr().out.splitlines() if "inference on" in line]
    assert line.split() == ["ok", "inference", "on", "CPU"]


def test_the_doctor_names_a_port_that_is_taken(
    runtime: None,  # noqa: ARG001
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Who holds the port can be found out with the command shown."""
    monkeypatch.setattr(
        "aerodaas.actors.cluster.ray_cluster.disconnect", lambda: None
    )  # others use it, too
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as held:
        held.bind(("127.0.0.1", 0))
        port = held.getsockname()[1]
        monkeypatch.setattr("aerodaas.cli.doctor._PORTS", {port: "a vehicle"})
        assert not examine()
    shown = " ".join(capsys.readouterr().out.split())
    assert f"UDP {port} Address already in use (a vehicle)" in shown
    assert f"ss -ulpn 'sport = :{port}'" in shown


def test_a_shell_completes_commands() -> None:
    """As the script of `--install-completion` asks."""
    words = {"_AERODAAS_COMPLETE": "complete_bash", "COMP_WORDS": "aerodaas re", "COMP_CWORD": "1"}
    command = "from aerodaas.cli.app import app; app(prog_name='aerodaas')"
    ended = subprocess.run(
        [sys.executable, "-c", command],
        env={**os.environ, **words},
        capture_output=True,
        text=True,
        check=True,
    )
    assert ended.stdout.split() == ["report", "replay", "remote"]


def test_help_loads_no_library_that_flies() -> None:
    """It is there at once: arrays, models of data, Ray and plots take several times as long."""
    code = (
        "import sys, aerodaas.cli.app\n"
        "print(*{'numpy', 'pydantic', 'ray', 'matplotlib', 'cv2', 'mcap'} & set(sys.modules))"
    )
    said = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=60
    )
    assert said.stdout.strip() == ""


def test_a_survey_loads_no_model_and_no_codec(tmp_path: Path) -> None:
    """Up to its start, an application without pictures loads nothing for pictures: 30 MB less."""
    code = (
        "import sys\n"
        "from aerodaas.actors.cluster import ray_cluster\n"
        "def connect(*_):\n"
        "    import aerodaas.actors.run.flight\n"
        "    print('loaded:', *{'cv2', 'onnxruntime', 'matplotlib', 'mcap'} & set(sys.modules))\n"
        "    raise SystemExit\n"
        "ray_cluster.begin, ray_cluster.connect = print, connect\n"
        "from aerodaas.cli.app import app\n"
        "app(['run', 'farm_survey', '--speed', '1'])"
    )
    said = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
        cwd=tmp_path,
    )
    assert "loaded:\n" in said.stdout, said.stdout + said.stderr


def test_compiling_says_what_no_document_can_hold(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """One message and no file; what can be written goes into the file."""
    (tmp_path / "environment.json").write_text(json.dumps(CONTENT))
    application = tmp_path / "app.py"
    watch = "watch = MonitoringAnalytics(['height']).deploy(edge)\nwatch.analyse(odometry)\n"
    trigger = "watch.trigger(drone.end_mission, when=lambda one: True)\n"
    starts = "drone.start_mission()\n"
    wanted = tmp_path / "mission.json"
    for text, folder, code in (
        (HOP + watch + trigger + starts, tmp_path, 2),
        (HOP + watch + starts, tmp_path / "none", 2),
        (HOP + watch + starts, tmp_path, 0),
    ):
        application.write_text(text)
        output = folder / wanted.name
        found = exit_code("compile", str(application), "-o", str(output))
        said = capsys.readouterr().err
        assert found == code, said
        assert said.count("error:") == (code != 0)
        assert output.exists() == (code == 0)
    assert json.loads(wanted.read_text())["analyses"][0]["id"] == "drone/monitoring"
