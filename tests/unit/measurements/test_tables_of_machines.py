"""Tables as robots, motors, pendulums and films of them leave: which column is what, and what is asked."""

import re
from pathlib import Path

import numpy as np
import pytest

from impactcell.campaign import Coordinate, Excitation
from impactcell.errors import MeasurementError
from impactcell.measurements import guess, make_campaign, read_tables
from impactcell.measurements.columns.mapping import Mapping
from impactcell.measurements.columns.recognition import ColumnMeaning
from impactcell.measurements.given import read_given
from impactcell.measurements.table import Table
from impactcell.web.texts.import_faults import page_fault
from impactcell.web.texts.import_notes import page_note

TIME_S = np.arange(400) * 5e-3


def read(directory: Path, names: str) -> list[Table]:
    """Write a table whose first column is the time and all others move to and fro, and read it."""
    header = names.split(",")
    moved = [np.sin(2.0 * np.pi * (0.7 + 0.1 * place) * TIME_S) for place in range(1, len(header))]
    path = directory / "log.csv"
    np.savetxt(path, np.column_stack([TIME_S, *moved]), delimiter=",", header=names, comments="", fmt="%.7g")
    return read_tables(path)


def meanings(mapping: Mapping) -> dict[str, str]:
    return {item.column: str(item.meaning) for item in mapping.assignments}


@pytest.mark.parametrize(
    "names",
    [
        "t [s],angle [rad],velocity,torque [Nm]",
        "t [s],angle,velocity,torque",
        "t [s],part,velocity,w [rad/s]",
        "t [s],velocity,torque",
    ],
)
def test_the_velocity_of_what_turns_is_asked_in_its_unit(names: str, tmp_path: Path) -> None:
    given = read_given({"columns": ["velocity=velocity"]})
    faults = "\n".join(guess(read(tmp_path, names), given).faults)
    assert "column 'velocity' (velocity) has no unit; say --unit 'velocity=rad/s'" in faults


def test_the_velocity_of_what_goes_along_a_line_is_asked_in_metres_a_second(tmp_path: Path) -> None:
    given = read_given({"columns": ["velocity=velocity"]})
    faults = guess(read(tmp_path, "t [s],x [m],velocity,F [N]"), given).faults
    assert [fault for fault in faults if "velocity=m/s" in fault]


def test_a_mass_of_what_turns_is_asked_as_an_inertia(tmp_path: Path) -> None:
    faults = guess(read(tmp_path, "t [s],angle [rad],torque [Nm],inertia")).faults
    assert any("--unit 'inertia=kg m²'" in fault for fault in faults)


@pytest.mark.parametrize(
    ("names", "position", "force"),
    [
        ("time,q7,dq7,tau7", "q7", "tau7"),
        ("time,q_2,dq_2,ddq_2,tau_2", "q_2", "tau_2"),
        ("t,q,qd,qdd,tau", "q", "tau"),
        ("t,theta2,dtheta2,tau2", "theta2", "tau2"),
        ("t,theta,omega,tau", "theta", "tau"),
        ("t,phi,phi_dot,moment", "phi", "moment"),
        ("time,pos,vel,torque", "pos", "torque"),
        ("time,position,velocity,effort", "position", "effort"),
        ("t,q_meas,dq_meas,tau_meas", "q_meas", "tau_meas"),
        ("t,q_m,dq_m,tau_m", "q_m", "tau_m"),
        ("t,q,q_ref,dq,dq_ref,tau", "q", "tau"),
        ("t,theta,theta_des,theta_dot,tau", "theta", "tau"),
    ],
)
def test_names_of_published_tables_are_known(names: str, position: str, force: str, tmp_path: Path) -> None:
    tables = read(tmp_path, names)
    time = names.split(",", maxsplit=1)[0]
    mapping = guess(tables)
    # the only thing asked is the unit of each of the three
    asked = [re.fullmatch(r"column '(\w+)' \(\w+\) has no unit.*", fault) for fault in mapping.faults]
    assert [match and match[1] for match in asked] == [time, position, force]
    units = [f"{time}=s", f"{position}=rad", f"{force}=N m"]
    mapping = guess(tables, read_given({"units": units}))
    assert (meanings(mapping)[position], meanings(mapping)[force]) == ("position", "force")
    campaign = make_campaign(tables, mapping).campaign
    assert (campaign.coordinate, campaign.excitation) == (Coordinate.ROTATION, Excitation.DRIVEN)
    (shot,) = campaign.shots
    assert not [name for name in shot.covariates if not name.endswith(("_ref", "_des"))]
    place = names.split(",").index(position)
    assert shot.position is not None
    assert shot.position.values == pytest.approx(np.sin(2 * np.pi * (0.7 + 0.1 * place) * TIME_S), abs=1e-6)


JOINTS = "time,{q},{d},{tau}".format(
    q=",".join(f"q{n}" for n in range(1, 8)),
    d=",".join(f"dq{n}" for n in range(1, 8)),
    tau=",".join(f"tau{n}" for n in range(1, 8)),
)


@pytest.mark.parametrize(
    ("names", "ways"),
    [
        (
            JOINTS,
            ("--column 'position=q1' --column 'force=tau1'", "--column 'position=q7' --column 'force=tau7'"),
        ),
        ("time,theta1,theta2,omega1,omega2", ("--column 'position=theta1'", "--column 'position=theta2'")),
        (
            "time,pos_meas1,pos_meas2,vel_meas1,vel_meas2,pos_filt1,pos_filt2,tau_con1,tau_con2,tau_meas1,tau_meas2",
            ("--column 'position=pos_meas2' --column 'force=tau_meas2'",),
        ),
        (
            "time,position_1,position_2,velocity_1,velocity_2,effort_1,effort_2",
            ("--column 'position=position_2' --column 'force=effort_2'",),
        ),
    ],
)
def test_of_several_joints_none_is_guessed_and_the_options_of_each_are_told(
    names: str, ways: tuple[str, ...], tmp_path: Path
) -> None:
    tables = read(tmp_path, names)
    mapping = guess(tables)
    told = [fault for fault in mapping.faults if "joints" in fault]
    assert len(told) == 1
    assert all(way in told[0] for way in ways)
    assert not any("position nor force" in fault for fault in mapping.faults)
    assert set(meanings(mapping).values()) == {"time", "ignored"} | (
        {"covariate"} if "con1" in names else set()
    )
    assert page_fault(told[0], "en")[1] != told[0]
    assert page_fault(told[0], "de")[0] == "de"
    with pytest.raises(MeasurementError, match="joints"):
        make_campaign(tables, mapping)
    # the way out as it is written, and the units
    columns = re.findall(r"--column '([^']+)'", ways[-1])
    units = [f"{one.partition('=')[2]}={'rad' if one.startswith('position') else 'N m'}" for one in columns]
    mapping = guess(tables, read_given({"columns": columns, "units": ["time=s", *units]}))
    assert not mapping.faults
    others = [item for item in mapping.assignments if item.why.startswith("of joint")]
    assert {item.meaning for item in others} == {ColumnMeaning.IGNORED}
    assert page_note(others[0].why, "de")[0] == "de"
    assert make_campaign(tables, mapping).campaign.coordinate is Coordinate.ROTATION


def test_a_force_that_is_named_says_of_which_joint_the_position_is(tmp_path: Path) -> None:
    units = ["time=s", "q3=rad", "tau3=N m"]
    mapping = guess(read(tmp_path, JOINTS), read_given({"columns": ["force=tau3"], "units": units}))
    assert not mapping.faults
    assert meanings(mapping)["q3"] == "position"


def test_two_sensors_are_no_joints(tmp_path: Path) -> None:
    faults = guess(read(tmp_path, "t [s],Kraft [N],Weg 1 [mm],Weg 2 [mm]")).faults
    assert not any("joints" in fault for fault in faults)
    assert any("'Weg 2' could be it too" in fault for fault in faults)


@pytest.mark.parametrize("names", ["t,x,y", "t [s],x [m],y [m]", "t,x,y,vx,vy"])
def test_the_y_beside_the_x_of_a_film_is_no_actuator(names: str, tmp_path: Path) -> None:
    tables = read(tmp_path, names)
    mapping = guess(tables, read_given({"units": ["t=s", "x=m"]}))
    assert not mapping.faults
    assert meanings(mapping) | {"t": "time", "x": "position", "y": "ignored"} == meanings(mapping)
    y = next(item for item in mapping.assignments if item.column == "y")
    assert page_note(y.why, "de")[0] == "de"


def test_a_y_alone_is_the_position_and_beside_a_force_an_actuator(tmp_path: Path) -> None:
    assert meanings(guess(read(tmp_path, "t [s],y [m]")))["y"] == "position"
    assert meanings(guess(read(tmp_path, "t [s],y [m],F [N]")))["y"] == "position"
    assert meanings(guess(read(tmp_path, "t [s],x [m],y [m],F [N]")))["y"] == "actuator"


@pytest.mark.parametrize(("frequency_hz", "is_refused"), [(2.25, False), (2.0, True)])
def test_what_was_filmed_as_it_swings_is_told_the_way_to_its_angle(
    frequency_hz: float, is_refused: bool, tmp_path: Path
) -> None:
    swing = np.cos(2.0 * np.pi * frequency_hz * TIME_S)
    columns = np.column_stack([TIME_S, 0.3 * swing, 0.05 * swing**2])
    path = tmp_path / "film.txt"
    np.savetxt(path, columns, delimiter="\t", header="t [s]\tx [m]\ty [m]", comments="", fmt="%.7g")
    tables = read_tables(path)
    told = "it swings to and fro; of a pendulum give the angle (--column position=NAME --unit NAME=rad)"
    if is_refused:
        with pytest.raises(MeasurementError, match=re.escape(told)) as error:
            make_campaign(tables, guess(tables))
        assert [page_fault(fault, "de")[0] for fault in str(error.value).splitlines()] == ["de", "de"]
        return
    notes = make_campaign(tables, guess(tables)).notes
    note = next(note for note in notes if told in note)
    assert page_note(note, "de")[0] == "de"


def test_a_current_and_a_speed_are_told_as_ways_to_torque_and_angle(tmp_path: Path) -> None:
    tables = read(tmp_path, "t,voltage,current,omega")
    told = next(fault for fault in guess(tables).faults if fault.startswith("neither position"))
    assert "--column 'position=omega' sums it up" in told
    assert "--column 'force=current' --gain 'force=0.05 N m/A'" in told
    said = {"columns": ["position=omega", "force=current"], "gains": ["force=0.05 N m/A"]}
    faults = guess(tables, read_given(said | {"units": ["t=s"]})).faults
    assert faults == ("column 'omega' (position) has no unit; say --unit 'omega=rad/s', or which it is",)
    given = read_given(said | {"units": ["t=s", "omega=rad/s"]})
    campaign = make_campaign(tables, guess(tables, given)).campaign
    (shot,) = campaign.shots
    assert shot.force is not None
    assert shot.force.values == pytest.approx(0.05 * np.sin(2.0 * np.pi * 0.9 * TIME_S), abs=1e-7)


def test_a_voltage_beside_what_is_taken_to_move_freely_is_told(tmp_path: Path) -> None:
    tables = read(tmp_path, "t [s],qm [rad],vir")
    notes = make_campaign(tables, guess(tables)).notes
    told = next(note for note in notes if note.startswith("'vir' may have driven"))
    assert "--column 'force=vir' --gain 'force=0.05 N m/V'" in told
    assert page_note(told, "de")[0] == "de"


@pytest.mark.parametrize("name", ["torque_nm", "control_torque_nm", "Torque [nm]"])
def test_no_torque_is_in_nanometres(name: str, tmp_path: Path) -> None:
    tables = read(tmp_path, f"time_s,position_rad,{name}")
    campaign = make_campaign(tables, guess(tables)).campaign
    assert campaign.excitation is Excitation.DRIVEN
    assert campaign.shots[0].force is not None
    assert np.ptp(campaign.shots[0].force.values) == pytest.approx(2.0, abs=0.01)


def test_a_time_without_a_name_is_found_though_it_was_rounded(tmp_path: Path) -> None:
    path = tmp_path / "log.txt"
    time_s = np.round(446.4 + np.arange(200) / 101.0, 3)
    np.savetxt(path, np.column_stack([time_s, np.sin(time_s)]), fmt="%.6g")
    fault = next(fault for fault in guess(read_tables(path)).faults if "no column of time" in fault)
    assert "'column 1' goes up by 0.01 a row and may be it" in fault
