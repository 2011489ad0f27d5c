"""Models and networks: read, made of others, written."""

import pytest

import phyture


def test_a_model_is_its_file(calibrated, tmp_path):
    calibrated.save(tmp_path / "model.toml")
    assert phyture.Model.read(tmp_path / "model.toml") == calibrated
    assert phyture.Model.from_toml(calibrated.to_toml()).to_toml() == calibrated.to_toml()
    assert calibrated.mass_kg > 0 and len(calibrated.inertia) == 3 and calibrated.rotor_radius_m > 0
    assert calibrated.name in repr(calibrated)


def test_a_formula_is_added_calibrated_and_taken_away(flights, calibrated):
    more = calibrated.with_formula("fin", "wz_dot", "vx * wz")
    assert [effect["name"] for effect in more.effects][-1] == "fin" and more != calibrated
    found = phyture.calibrate(flights, more)
    fin = next(number for number in found["coefficients"] if number["effect"] == "fin")
    assert fin["value"] != 0.0 and fin["ci95"][0] < fin["value"] < fin["ci95"][1]
    assert more.without("fin") == calibrated
    with pytest.raises(phyture.Error, match="no_such_effect"):
        calibrated.without("no_such_effect")
    with pytest.raises(phyture.Error, match="`channel` is `wq_dot`"):
        calibrated.with_formula("fin", "wq_dot", "vx")
    with pytest.raises(phyture.Error) as caught:
        calibrated.with_formula("fin", "wz_dot", "vx +")
    assert caught.value.kind == "formula" and "^" in str(caught.value)


def test_the_papers_baseline_has_no_numbers_yet_and_no_impossible_vehicle():
    model = phyture.Model.paper("mine", 8.1, [0.18, 0.34, 0.28], 0.78)
    numbers = [number["value"] for effect in model.effects for number in effect["coefficients"]]
    assert numbers and all(number == 0.0 for number in numbers)
    with pytest.raises(phyture.Error, match="mass_kg"):
        phyture.Model.paper("mine", -1.0, [0.18, 0.34, 0.28], 0.78)


def test_a_network_is_its_file(training, calibrated, tmp_path):
    network = training.network
    network.save(tmp_path / "network.safetensors")
    again = phyture.Network.read(tmp_path)
    assert again.history == network.history == 64 and again.step_s == network.step_s == 0.01
    assert again.model == network.model
    assert "64 samples" in repr(again)
