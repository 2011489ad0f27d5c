"""Flights from columns are those of files; what is no flight is refused with its place."""

import numpy
import pandas
import pytest

import phyture

STATES = ["x", "y", "z", "roll", "pitch", "yaw", "vx", "vy", "vz", "wx", "wy", "wz", "u1", "u2", "u3", "u4"]
COLUMNS = [*STATES, *phyture.CHANNELS]


def columns(flights, name):
    frame = flights.to_pandas()
    part = frame[frame["flight"] == name]
    return {"t": part["t"].to_numpy(), **{column: part[column].to_numpy() for column in COLUMNS}}


def test_columns_of_numpy_and_pandas_and_lists_are_read_as_files(flights):
    names = flights.names[:3]
    given = {name: columns(flights, name) for name in names}
    frames = {name: pandas.DataFrame(given[name]) for name in names}
    lists = {name: {key: list(map(float, values)) for key, values in given[name].items()} for name in names}
    for several in (given, frames, lists):
        read = phyture.Flights.from_columns(several)
        assert read.names == names and read.manoeuvres == flights.manoeuvres[:3]
        assert len(read.sha256) == 64
        for name in names:
            assert read.column(name, "wz_dot").tobytes() == flights.column(name, "wz_dot").tobytes()


def test_columns_of_polars_are_read_as_files(flights):
    polars = pytest.importorskip("polars")
    name = flights.names[0]
    read = phyture.Flights.from_columns({name: polars.DataFrame(columns(flights, name))})
    assert read.column(name, "wz_dot").tobytes() == flights.column(name, "wz_dot").tobytes()


def test_accelerations_that_are_not_there_are_derived(flights):
    name = flights.names[0]
    given = {key: values for key, values in columns(flights, name).items() if key not in phyture.CHANNELS}
    read = phyture.Flights.from_columns({name: given})
    assert any("zero-phase" in note for note in read.notes), read.notes


def test_a_description_renames_columns(flights):
    name = flights.names[0]
    given = columns(flights, name)
    given["north"] = given.pop("x")
    read = phyture.Flights.from_columns({name: given}, described='[columns]\nx = "north"\n')
    assert read.column(name, "x").tobytes() == flights.column(name, "x").tobytes()


def test_a_cell_without_a_number_is_refused_by_flight_line_and_column(flights):
    name = flights.names[0]
    given = columns(flights, name)
    given["vx"] = given["vx"].copy()
    given["vx"][3] = numpy.nan
    with pytest.raises(phyture.Error) as caught:
        phyture.Flights.from_columns({name: given})
    assert caught.value.kind == "cell"
    assert str(caught.value).startswith(f"{name}, line 5, column `vx`: found ")


def test_a_message_names_the_argument_that_helps(flights):
    name = flights.names[0]
    given = {column: values.copy() for column, values in columns(flights, name).items()}
    given["t"][100:] += 5.0
    with pytest.raises(phyture.Error) as caught:
        phyture.Flights.from_columns({name: given})
    assert "`split_at_gaps` makes a flight of each part" in str(caught.value) and "--" not in str(caught.value)
    assert len(phyture.Flights.from_columns({name: given}, split_at_gaps=True)) == 2


def test_what_is_no_table_is_refused(flights):
    with pytest.raises(phyture.Error, match="columns of one length"):
        phyture.Flights.from_columns({"hover/a": {"t": [0.0, 0.1], "vx": [1.0]}})
    with pytest.raises(phyture.Error, match="no logs"):
        phyture.Flights.from_columns({})
    with pytest.raises(TypeError, match="mapping or a frame"):
        phyture.Flights.from_columns({"hover/a": 3})
    with pytest.raises(phyture.Error) as caught:
        phyture.Flights.read("no/such/folder")
    assert caught.value.kind == "io" and "no/such/folder" in str(caught.value)


def test_flights_are_written_left_out_and_looked_at(flights, tmp_path):
    fewer = flights.leave_out([flights.names[0]])
    assert len(fewer) == len(flights) - 1
    with pytest.raises(phyture.Error, match="leave_out"):
        flights.leave_out(["no_such_flight"])
    fewer.write(tmp_path / "again")
    assert phyture.Flights.read(tmp_path / "again").names == fewer.names
    frame = flights.to_pandas()
    assert list(frame.columns[:3]) == ["manoeuvre", "flight", "t"] and set(COLUMNS) <= set(frame.columns)
    assert len(frame) == round(flights.duration_s / flights.steps_s[0])
    assert repr(flights).startswith("<phyture.Flights: 20 flights")
    with pytest.raises(phyture.Error, match="no_such_column"):
        flights.column(flights.names[0], "no_such_column")
    with pytest.raises(phyture.Error, match="which is the name of 0 flights"):
        flights.column("no_such_flight", "vx")
    assert len(phyture.Flights.read(tmp_path / "again", leave_out=[fewer.names[0]])) == len(fewer) - 1
    with pytest.raises(phyture.Error, match="unknown|no such|expected"):
        phyture.simulate(minutes=1, hide={"no_such_effect": 1.0})
    with pytest.raises(phyture.Error, match="level"):
        phyture.simulate(minutes=1, level="7")
