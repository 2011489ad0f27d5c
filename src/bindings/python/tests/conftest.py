"""What the tests share: the program, and flights of the built-in simulator that both it and the package read."""

import json
import os
import pathlib
import subprocess

import pytest

import phyture

HERE = pathlib.Path(__file__).resolve().parent
#: The command line that the package is held against.
PROGRAM = os.environ.get("PHYTURE") or str(HERE / "../../../../target/debug/phyture")


class CommandLine:
    """The program in a folder of its own, with `flights` and `model.toml` in it."""

    def __init__(self, folder: pathlib.Path) -> None:
        self.folder = folder

    def run(self, *words: object) -> None:
        done = subprocess.run([PROGRAM, *map(str, words)], cwd=self.folder, capture_output=True, text=True, check=False)
        assert done.returncode in (0, 3), done.stderr

    def json(self, *words: object) -> str:
        """The document of a command."""
        path = self.folder / "result.json"
        self.run(*words, "--json", path, "--force", "--quiet")
        return path.read_text(encoding="utf-8")


@pytest.fixture(scope="session")
def command_line(tmp_path_factory: pytest.TempPathFactory) -> CommandLine:
    folder = tmp_path_factory.mktemp("command-line")
    line = CommandLine(folder)
    line.run("simulate", "flights", "--minutes", 10, "--seed", 7, "--hide", "weathercock=2")
    line.run("calibrate", "flights", "-o", "calibrated.toml", "--quiet")
    return line


@pytest.fixture(scope="session")
def folder(command_line: CommandLine) -> pathlib.Path:
    return command_line.folder


@pytest.fixture(scope="session")
def flights(folder: pathlib.Path) -> phyture.Flights:
    return phyture.Flights.read(folder / "flights")


@pytest.fixture(scope="session")
def start(folder: pathlib.Path) -> phyture.Model:
    """The model file beside the flights: the paper's baseline, uncalibrated."""
    return phyture.Model.read(folder / "flights" / "model.toml")


@pytest.fixture(scope="session")
def calibrated(folder: pathlib.Path) -> phyture.Model:
    return phyture.Model.read(folder / "calibrated.toml")


#: A network that trains in seconds.
SMALL = {"epochs": 1, "stride": 40, "network": {"history": 64, "d_model": 16}}


@pytest.fixture(scope="session")
def training(flights: phyture.Flights, calibrated: phyture.Model, tmp_path_factory: pytest.TempPathFactory) -> phyture.Training:
    return phyture.train(flights, calibrated, tmp_path_factory.mktemp("run"), config=SMALL, seed=2030)


def without_time(document: str) -> object:
    """A document without the times that the work took."""

    def strip(value: object) -> object:
        if isinstance(value, dict):
            return {key: strip(one) for key, one in value.items() if key != "seconds"}
        return [strip(one) for one in value] if isinstance(value, list) else value

    return json.dumps(strip(json.loads(document)))
