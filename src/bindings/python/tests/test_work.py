"""Work: told, stopped, refused, and never a panic."""

import os
import signal
import threading
import time

import pytest
from conftest import SMALL

import phyture
from phyture import _phyture


class Interrupts:
    """A progress callback after whose first call the process gets Ctrl-C from elsewhere."""

    def __init__(self, after: int = 1) -> None:
        self.told = []
        self.after = after
        self.begun = threading.Event()
        threading.Thread(target=self._interrupt, daemon=True).start()

    def __call__(self, stage, done, of):
        self.told.append((stage, done, of))
        if done >= self.after or of == 0:
            self.begun.set()

    def _interrupt(self):
        if self.begun.wait(60):
            self.sent = time.monotonic()
            os.kill(os.getpid(), signal.SIGINT)


def test_ctrl_c_stops_a_search_at_once(flights, start):
    progress = Interrupts()
    with pytest.raises(KeyboardInterrupt):
        phyture.diagnose(flights, start, progress=progress)
    assert time.monotonic() - progress.sent < 2.0
    assert progress.told[0][0]


def test_ctrl_c_saves_a_training_run_that_is_gone_on_with(flights, calibrated, tmp_path):
    config = {**SMALL, "epochs": 6}
    progress = Interrupts()
    with pytest.raises(KeyboardInterrupt):
        phyture.train(flights, calibrated, tmp_path / "run", config=config, progress=progress)
    assert (tmp_path / "run" / "checkpoint.phyture").exists()
    assert not (tmp_path / "run" / "network.safetensors").exists()
    assert any(stage.startswith("training, epoch") and 0 < done <= of for stage, done, of in progress.told)
    with pytest.raises(phyture.Error) as caught:
        phyture.train(flights, calibrated, tmp_path / "run", config=config)
    assert caught.value.kind == "exists" and str(caught.value).endswith("or `force` to overwrite it")
    again = phyture.train(flights, calibrated, tmp_path / "run", config=config, resume=True)
    whole = phyture.train(flights, calibrated, tmp_path / "whole", config=config)
    assert again["training_loss"] == whole["training_loss"]


def test_what_a_callback_raises_ends_the_work(flights, start):
    def refuse(*told):
        raise LookupError("enough")

    with pytest.raises(LookupError, match="enough"):
        phyture.diagnose(flights, start, progress=refuse)


def test_other_threads_go_on_meanwhile(flights, start):
    ticks, ends = [], threading.Event()

    def tick():
        while not ends.wait(0.01):
            ticks.append(time.monotonic())

    thread = threading.Thread(target=tick)
    thread.start()
    begun = time.monotonic()
    try:
        phyture.diagnose(flights, start, max_effects=1)
    finally:
        took = time.monotonic() - begun
        ends.set()
        thread.join()
    assert len(ticks) > 10 * took


def test_a_bar_is_shown_or_nothing(flights, start):
    assert phyture.check(flights, start, progress=True)["flights"] == len(flights)


def test_errors_are_the_librarys_with_their_kind(flights, start, calibrated, tmp_path):
    cases = [
        (lambda: phyture.Model.from_toml("[model]\nmass = 3\n"), "config", "mass"),
        (lambda: phyture.calibrate(flights, start, lock=["no_such_class"]), "config", "`lock` is `no_such_class`"),
        (lambda: phyture.calibrate(flights, start, split="thirds"), "config", "`split` is `thirds`"),
        (lambda: phyture.compare(flights, calibrated, stride=0), "config", "`stride` is 0, expected 1 to"),
        (lambda: phyture.rollout(flights, calibrated, horizon=0), "config", "`horizon` is 0"),
        (lambda: phyture.diagnose(flights, start, max_effects=0), "config", "`max_effects` is 0"),
        (lambda: phyture.diagnose(flights), "config", "`model` is nothing"),
        (lambda: phyture.predict(flights), "config", "`model` is nothing"),
        (lambda: phyture.predict(flights, calibrated, stride=0), "config", "`stride` is 0"),
        (lambda: phyture.train(flights, calibrated, tmp_path, config={"epoch": 3}), "file", "epoch"),
        (lambda: phyture.train(flights, calibrated, tmp_path, resume=True), "file", "no checkpoint"),
        (lambda: phyture.Network.read(tmp_path / "nothing"), "io", "nothing"),
    ]
    for call, kind, words in cases:
        with pytest.raises(phyture.Error) as caught:
            call()
        assert caught.value.kind == kind and words in str(caught.value), str(caught.value)
    assert issubclass(phyture.Error, Exception)


@pytest.mark.skipif(not hasattr(_phyture, "panics"), reason="a release build has no function that panics")
def test_a_panic_stops_at_the_border(capfd):
    with pytest.raises(phyture.Error, match="a fault of the library: index 7 of 3") as caught:
        _phyture.panics("index 7 of 3")
    assert caught.value.kind == "fault"


def test_a_configuration_is_told_and_read_again(tmp_path):
    text = phyture.training_config(SMALL)
    assert "history = 64" in text and "epochs = 1" in text
    (tmp_path / "train.toml").write_text(text, encoding="utf-8")
    assert phyture.training_config(tmp_path / "train.toml") == text
    assert "history = 1000" in phyture.training_config(paper=True)
