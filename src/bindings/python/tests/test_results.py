"""Results: documents, frames, notebooks, figures."""

import json
import re

import numpy
import pytest
from conftest import SMALL

import phyture


def test_every_result_is_a_document_a_text_and_a_table(flights, start, calibrated, training):
    results = [
        phyture.check(flights, start),
        phyture.calibrate(flights, start),
        phyture.compare(flights, calibrated),
        phyture.rollout(flights, calibrated, horizon=5, stride=500),
        phyture.predict(flights, calibrated, stride=500),
    ]
    for result in results:
        document = result.to_dict()
        assert document["schema"] == 1 and json.loads(result.to_json()) == document
        assert str(result) and type(result).__name__ in repr(result)
        assert len(result.to_pandas()) > 0
        html = result._repr_html_()
        assert html.startswith(("<table>", "<p>", "<pre>")) and "<script" not in html
        document["schema"] = 0
        assert result["schema"] == 1
    assert training["parameters"] > 0 and "training loss" in str(training) and "<pre>" in training._repr_html_()
    assert not hasattr(training, "to_pandas")


def test_frames_hold_the_documents_numbers(flights, start, calibrated):
    calibration = phyture.calibrate(flights, start).to_pandas()
    assert list(calibration.columns) == ["effect", "name", "value", "low", "high", "unit"]
    known = calibration["low"].notna()
    assert known.any() and (calibration["low"][known] <= calibration["value"][known]).all()
    comparison = phyture.compare(flights, {"before": start, "after": calibrated})
    rmse = comparison.to_pandas()
    assert list(rmse.index) == [model["name"] for model in comparison["models"]] and "mean" in rmse
    assert rmse.loc["after", "mean"] < rmse.loc["before", "mean"]
    assert (comparison.to_pandas("r2").loc["after"] <= 1).all()
    rollouts = phyture.rollout(flights, {"after": calibrated}, horizon=5, stride=500).to_pandas()
    assert len(rollouts) == 3 * 4 * 5 and set(rollouts["quantity"]) == {"position", "velocity", "attitude", "rates"}


def test_figures_are_drawn_when_they_are_asked_for(flights, calibrated, tmp_path):
    comparison = phyture.compare(flights, calibrated, stride=20)
    figures = comparison.figures()
    assert len(figures) > 2 and all(svg.startswith("<svg ") for svg in figures.values())
    name = list(figures)[1]
    assert comparison.svg(name) == figures[name] and comparison.svg() == next(iter(figures.values()))
    assert comparison.svg()._repr_svg_() == comparison.svg()
    assert comparison.data(name).count("\n") > 1
    with pytest.raises(KeyError, match="no_such_figure"):
        comparison.svg("no_such_figure")
    comparison.save_page(tmp_path / "comparison.html")
    page = (tmp_path / "comparison.html").read_text(encoding="utf-8")
    assert page.startswith("<!doctype html>") and "calibrated" in page or calibrated.name in page
    rollouts = phyture.rollout(flights, calibrated, horizon=5, stride=500)
    assert rollouts.svg().startswith("<svg ") and "Open-loop" in rollouts.page()


def test_a_diagnosis_has_a_model_a_table_and_a_page(flights, start):
    diagnosis = phyture.diagnose(flights, start, max_effects=1)
    table = diagnosis.to_pandas()
    assert list(table["effect"]) == ["weathercock"] and table["worth"][0] > 0
    assert "weathercock" in diagnosis._repr_html_() and "weathercock" in str(diagnosis)
    assert "weathercock" in diagnosis.page() and diagnosis.svg().startswith("<svg ")
    after = phyture.calibrate(flights, diagnosis.model)
    assert after.rmse["train"]["wz_dot"] < phyture.calibrate(flights, start).rmse["train"]["wz_dot"]


def test_a_fault_of_the_log_is_told_and_nothing_is_searched(flights, start):
    turned = {}
    frame = flights.to_pandas()
    for name in flights.names:
        part = frame[frame["flight"] == name].drop(columns=["flight", "manoeuvre"])
        turned[name] = part.assign(wz=-part["wz"], wz_dot=-part["wz_dot"])
    wrong = phyture.Flights.from_columns(turned)
    report = phyture.check(wrong, start)
    assert report.fault and report.to_pandas()["verdict"].eq("fault").any()
    assert report.suggestion is not None or report.open
    for found in (phyture.diagnose(wrong, start), phyture.loop(wrong, start)):
        assert found.accepted == [] and "convention_fault" in found.to_json()
        assert "Nothing was searched" in found.page()


def test_floors_come_from_the_explainable_part():
    flights = phyture.simulate(minutes=4, seed=3, hide={})
    model = phyture.Model.paper("truth", 4.58, [0.18, 0.34, 0.28], 0.8)
    calibrated = phyture.calibrate(flights, model).model
    comparison = phyture.compare(flights, calibrated, all=True, explainable=flights.explainable, stride=10)
    own = next(one for one in comparison["models"] if one["name"] == calibrated.name)
    assert 0 < comparison["floor"]["vx_dot"] <= own["rmse"]["vx_dot"]


def test_the_hybrid_is_an_estimator(flights, start, tmp_path):
    hybrid = phyture.Hybrid(start, config=SMALL, folder=tmp_path / "run")
    assert set(hybrid.get_params()) >= {"model", "config", "seed"}
    assert hybrid.set_params(epochs=1).epochs == 1
    with pytest.raises(ValueError, match="no parameter"):
        hybrid.set_params(depth=3)
    with pytest.raises(ValueError, match="not been fitted"):
        hybrid.predict(flights)
    assert hybrid.fit(flights) is hybrid
    few = flights.leave_out(flights.names[2:])
    predicted = hybrid.predict(few)
    assert predicted.shape[1] == 6 and numpy.isfinite(predicted).all()
    assert 0.3 < hybrid.score(few) <= 1.0
    assert (tmp_path / "run" / "network.safetensors").exists()


def test_names_of_several_are_their_own(flights, calibrated):
    with pytest.raises(ValueError, match="two models of one name"):
        phyture.compare(flights, [calibrated, calibrated])
    with pytest.raises(phyture.Error, match="expected a model file or a network"):
        phyture.compare(flights)
    with pytest.raises(TypeError, match="list of names"):
        phyture.compare(flights, calibrated, lock="hover")


def test_versions_agree():
    assert re.fullmatch(r"\d+\.\d+\.\d+", phyture.__version__)
