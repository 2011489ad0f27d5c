"""The package computes what the command line computes, to the bit."""

import csv
import json

import numpy
import pytest
from conftest import SMALL, without_time

import phyture


def test_simulated_flights_are_those_that_the_program_writes(flights):
    made = phyture.simulate(minutes=10, seed=7, hide={"weathercock": 2.0})
    assert made.manoeuvres == flights.manoeuvres
    assert made.duration_s == flights.duration_s
    for name in made.names[:3]:
        written = next(other for other in flights.names if other.rsplit("/", 1)[-1] == name.rsplit("/", 1)[-1])
        for column in ("vx", "wz_dot", "u4", "yaw"):
            assert made.column(name, column).tobytes() == flights.column(written, column).tobytes()
    assert made.explainable is not None and made.explainable.names == made.names and flights.explainable is None


def test_check(command_line, flights, start):
    report = phyture.check(flights, start)
    assert report.to_json() == command_line.json("check", "flights")
    assert report.fault is False and report.suggestion is None


@pytest.mark.parametrize("horizon", [None, 10])
def test_calibrate(command_line, flights, start, horizon):
    options = [] if horizon is None else ["--output-error", "--horizon", horizon]
    found = phyture.calibrate(flights, start, output_error=horizon is not None, horizon=horizon or 50)
    assert found.to_json() == command_line.json("calibrate", "flights", "-o", "again.toml", *options)
    assert found.model.to_toml() == (command_line.folder / "again.toml").read_text(encoding="utf-8")


def test_calibrate_with_locked_flights(command_line, flights, start):
    locked = flights.manoeuvres[0]
    found = phyture.calibrate(flights, start, lock=[locked])
    assert found.to_json() == command_line.json("calibrate", "flights", "-o", "locked.toml", "--lock", locked)
    assert set(found.rmse) == {"train", "locked"}
    assert found.model.to_toml() == (command_line.folder / "locked.toml").read_text(encoding="utf-8")


def test_compare(command_line, flights, start, calibrated, training, tmp_path):
    written = tmp_path / "run"
    written.mkdir()
    training.network.save(written / "network.safetensors")
    found = phyture.compare(flights, {"model": start, "calibrated": calibrated}, {"run": training.network}, stride=7, ridge=5)
    models = ["-m", "flights/model.toml", "-m", "calibrated.toml", "-n", written]
    assert found.to_json() == command_line.json("compare", "flights", *models, "--stride", 7, "--ridge", 5)


def test_diagnose(command_line, flights, start):
    found = phyture.diagnose(flights, start)
    assert without_time(found.to_json()) == without_time(command_line.json("diagnose", "flights"))
    assert found.verdict == "effects_missing" and found.accepted == ["weathercock"]
    assert any(effect["name"] == "weathercock" for effect in found.model.effects)


def test_loop_writes_the_model_and_the_ledger_of_the_program(command_line, flights, start, tmp_path):
    found = phyture.loop(flights, start, output=tmp_path / "amended.toml")
    document = json.loads(command_line.json("loop", "flights", "-o", "amended.toml"))
    own = found.to_dict()
    for told in (own, document):
        told.pop("model")
        told.pop("ledger")
    assert without_time(json.dumps(own)) == without_time(json.dumps(document))
    for name in ("amended.toml", "amended.ledger.jsonl"):
        assert (tmp_path / name).read_text(encoding="utf-8") == (command_line.folder / name).read_text(encoding="utf-8")
    assert found.accepted == ["weathercock"] and found.model == phyture.Model.read(tmp_path / "amended.toml")


def test_train(command_line, training, tmp_path):
    settings = command_line.folder / "train.toml"
    settings.write_text(phyture.training_config(SMALL), encoding="utf-8")
    options = ["-m", "calibrated.toml", "-o", "run", "--config", settings, "--seed", 2030]
    document = json.loads(command_line.json("train", "flights", *options))
    own = training.to_dict()
    for told in (own, document):
        told.pop("network")
        told.pop("seconds")
    assert own == document
    training.network.save(tmp_path / "own.safetensors")
    assert (tmp_path / "own.safetensors").read_bytes() == (command_line.folder / "run/network.safetensors").read_bytes()


def written_table(path):
    """The columns of a CSV file, as texts."""
    with open(path, encoding="utf-8", newline="") as file:
        names, *rows = csv.reader(file)
    return {name: [row[place] for row in rows] for place, name in enumerate(names)}


def numbers(texts):
    """The shortest decimals that read back to the same bits, read back."""
    return numpy.array([float(text) for text in texts])


def test_predict(command_line, flights, calibrated):
    table = phyture.predict(flights, calibrated, stride=50).to_pandas()
    command_line.run("predict", "flights", "-m", "calibrated.toml", "-o", "physics.csv", "--stride", 50, "--force")
    written = written_table(command_line.folder / "physics.csv")
    assert list(table.columns) == list(written)
    assert list(table["flight"]) == written["flight"] and list(table["manoeuvre"]) == written["manoeuvre"]
    for name in list(written)[2:]:
        assert table[name].to_numpy().tobytes() == numbers(written[name]).tobytes(), name


def test_predict_with_a_network(command_line, flights, training, tmp_path):
    found = phyture.predict(flights, network=training.network, stride=500)
    training.network.save(tmp_path / "network.safetensors")
    network = tmp_path / "network.safetensors"
    command_line.run("predict", "flights", "-n", network, "-o", "hybrid.csv", "--stride", 500, "--force")
    written = written_table(command_line.folder / "hybrid.csv")
    predicted = found.to_numpy()
    for place, channel in enumerate(phyture.CHANNELS):
        assert predicted[:, place].tobytes() == numbers(written[f"{channel}_predicted"]).tobytes(), channel
    assert len(found) == len(written["t"]) > 0 and found["of"] == "hybrid"


def test_rollout(command_line, flights, calibrated):
    found = phyture.rollout(flights, {"calibrated": calibrated}, horizon=20, stride=100)
    options = ["-m", "calibrated.toml", "--horizon", 20, "--stride", 100]
    assert found.to_json() == command_line.json("rollout", "flights", *options)
