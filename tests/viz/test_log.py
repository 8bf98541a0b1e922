"""Recordings read back: whole, with what the layout asks for, and with the run's own numbers."""

from __future__ import annotations

import dataclasses
import errno
import os
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from rollover.assessment.bands import Band
from rollover.dynamics.result import GroundTrack, Run
from rollover.spec.vehicle import Vehicle
from tests.viz import example
from viz.content.entities import force_path, series
from viz.recordings.scene import rotation
from viz.recordings.viewer import viewer_binary

log = pytest.importorskip("viz.recordings.log", reason="no rerun wheel for this platform", exc_type=ImportError)
rr = pytest.importorskip("rerun", reason="no rerun wheel for this platform")

from rerun.chunk import RrdReader  # noqa: E402

from viz.recordings.draw import picture, upright_to  # noqa: E402
from viz.recordings.stream import stamps  # noqa: E402
from viz.recordings.verify import blueprint_queries, check_rrd, read_column, read_entities  # noqa: E402

RECORDINGS = ("overturn_rrd", "drop_rrd")


def one(path: Path, entity: str, component: str) -> Any:
    """The only row of a static component."""
    _, rows = read_column(path, entity, component)
    assert len(rows) == 1
    return rows[0]


def flat(path: Path, entity: str, component: str = "Scalars:scalars") -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    time, rows = read_column(path, entity, component)
    return time, np.array([row[0] for row in rows])


@pytest.mark.parametrize("name", RECORDINGS)
def test_recording_is_whole_and_holds_what_its_layout_asks_for(name: str, request: pytest.FixtureRequest) -> None:
    path = request.getfixturevalue(name)
    assert check_rrd(path) == []
    done = subprocess.run([viewer_binary(), "rrd", "verify", path], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert not list(path.parent.glob(".*"))


def test_layout_answers_the_loads_first(overturn_rrd: Path, drop_rrd: Path) -> None:
    views = dict(blueprint_queries(overturn_rrd))
    assert {"ROPS force, kN", "Mount left, kN", "How high, and when", "Events", "Phase", "Following"} <= set(views)
    rig = dict(blueprint_queries(drop_rrd))
    assert {"Ground force, kN", "Sinkage, mm", "Striker acceleration, m/s²"} <= set(rig)
    assert not any("ROPS" in view or "Mount" in view for view in rig)
    assert any(view.startswith("Scene: arrows 1 m = ") for view in rig)


@pytest.mark.parametrize(("name", "run"), [("overturn_rrd", "overturn"), ("drop_rrd", "drop")])
def test_every_channel_is_plotted_with_its_own_values_and_times(
    name: str, run: str, request: pytest.FixtureRequest
) -> None:
    path, given = request.getfixturevalue(name), request.getfixturevalue(run)
    nanoseconds = np.array([round(t * 1e9) for t in given.recording.time.tolist()])
    for channel, values in given.recording.channels.items():
        s = series(channel)
        time, plotted = flat(path, "/" + s.simulated)
        np.testing.assert_array_equal(time, nanoseconds)
        np.testing.assert_array_equal(plotted, values * s.factor)


def test_a_peak_of_one_sample_is_drawn_in_full_height(overturn_rrd: Path) -> None:
    s = series("rops/force")
    time, plotted = flat(overturn_rrd, "/" + s.simulated)
    at = int(plotted.argmax())
    assert plotted[at] == example.SPIKE * 1e-3
    assert plotted[at] > 1.2 * plotted[at - 1]
    assert time[at] == 1_362_000_000
    assert [*flat(overturn_rrd, "/" + s.peak)] == [[1_362_000_000], [example.SPIKE * 1e-3]]
    assert one(overturn_rrd, "/" + s.peak, "SeriesPoints:names") == ["peak 63.2 kN at 1.362 s"]
    assert one(overturn_rrd, "/" + s.filtered_peak, "SeriesPoints:names") == ["CFC 60: 44.2 kN at 1.370 s"]
    assert one(overturn_rrd, "/" + s.simulated, "SeriesLines:names") == ["ROPS force"]
    mount = series("rops/mount/left/force_z")
    assert one(overturn_rrd, "/" + mount.simulated, "SeriesLines:names") == ["z"]  # the title names the mount
    assert one(overturn_rrd, "/" + mount.simulated, "SeriesLines:colors") == [mount.colour]
    # averaging policies draw a short peak at half its height or less
    lines = [e for e, parts in read_entities(overturn_rrd).items() if "SeriesLines:names" in parts]
    assert len(lines) > 30
    for entity in lines:
        policy = one(overturn_rrd, entity, "SeriesLines:aggregation_policy")
        assert policy == [rr.components.AggregationPolicy.MinMax.value], entity


def test_stamps_round_to_the_nearest_ns_around_zero() -> None:
    time = np.arange(-2000, 2000) * 1e-3
    np.testing.assert_array_equal(stamps(time).astype(np.int64), np.arange(-2000, 2000) * 1_000_000)


def test_time_before_contact_is_negative(drop: Run, drop_rrd: Path) -> None:
    time, _ = read_column(drop_rrd, "/world/striker", "Transform3D:translation")
    assert time[0] == -100_000_000
    assert len(time) == drop.frame_time.size


def test_gaps_stay_gaps(drop: Run, tmp_path: Path) -> None:
    force = drop.recording["ground/force_normal"].copy()
    force[10:20] = np.nan
    recording = dataclasses.replace(drop.recording, channels={"ground/force_normal": force})
    log.write_rrd(dataclasses.replace(drop, recording=recording), tmp_path / "gap.rrd")
    _, plotted = flat(tmp_path / "gap.rrd", "/" + series("ground/force_normal").simulated)
    np.testing.assert_array_equal(plotted, force * 1e-3)


def test_a_band_of_scatter_joins_the_plot_of_its_load(overturn: Run, tmp_path: Path) -> None:
    time, force = overturn.recording.time, overturn.recording["rops/force"]
    band = Band(channel="rops/force", cfc=60, starts=3, time=time, mean=force, deviation=0.1 * force)
    log.write_rrd(overturn, tmp_path / "band.rrd", bands=[band])
    entity = "/" + series("rops/force").scatter
    assert entity.startswith("/" + series("rops/force").path + "/"), "the plot shows what lies below its path"
    (at, mean), (_, variance) = (
        flat(tmp_path / "band.rrd", entity, f"Measurements:{c}") for c in ("values", "variances")
    )
    np.testing.assert_array_equal(at, stamps(time).astype(np.int64))
    np.testing.assert_allclose(mean, 1e-3 * force, rtol=1e-6)
    np.testing.assert_allclose(variance, (1e-4 * force) ** 2, rtol=1e-5)


@pytest.mark.parametrize("member", ["left_post", "right_post", "crossbar"])
def test_a_tube_ends_where_the_member_ends(member: str, overturn: Run, overturn_rrd: Path) -> None:
    assert isinstance(overturn.scenario.vehicle, Vehicle)
    assert overturn.scenario.vehicle.rops is not None
    tube: Any = next(m for m in overturn.scenario.vehicle.rops.members if m.name == member)
    entity = f"/world/rops/{member}"
    found = {p: one(overturn_rrd, entity, f"Cylinders3D:{p}")[0] for p in ("lengths", "centers", "quaternions")}
    # a cylinder stands along z, centred
    half = rotation(np.array(found["quaternions"])) @ np.array([0.0, 0.0, 0.5 * found["lengths"]])
    np.testing.assert_allclose(np.array(found["centers"]) - half, tube.start, atol=1e-6)
    np.testing.assert_allclose(np.array(found["centers"]) + half, tube.end, atol=1e-6)
    assert one(overturn_rrd, entity, "Cylinders3D:radii")[0] == pytest.approx(0.5 * tube.diameter, rel=1e-6)


@pytest.mark.parametrize("direction", [(0, 0, 1), (0, 0, -1), (1, 0, 0), (0.6, -0.8, 0), (0.1, 0.2, -0.97)])
def test_upright_is_turned_into_any_direction(direction: tuple[float, float, float]) -> None:
    d = np.array(direction) / np.linalg.norm(direction)
    q = upright_to(d)
    assert np.linalg.norm(q) == pytest.approx(1.0, abs=1e-12)
    np.testing.assert_allclose(rotation(q) @ [0.0, 0.0, 1.0], d, atol=1e-12)


def test_wheels_and_boxes_have_their_size_and_place(overturn: Run, overturn_rrd: Path) -> None:
    vehicle = overturn.scenario.vehicle
    assert isinstance(vehicle, Vehicle)
    for wheel in vehicle.wheels:
        entity = f"/world/{wheel.carrier}/{wheel.name}"
        points = np.array(one(overturn_rrd, entity, "Mesh3D:vertex_positions")) - np.array(wheel.centre)
        radius = np.hypot(points[:, 0], points[:, 2])
        assert radius.max() == pytest.approx(wheel.tyre.radius, rel=1e-6)
        assert np.ptp(points[:, 1]) == pytest.approx(wheel.tyre.width, rel=1e-6)
    box: Any = vehicle.outline[0]
    centre = np.array(one(overturn_rrd, "/world/chassis/bonnet", "Boxes3D:centers")[0])
    half = np.array(one(overturn_rrd, "/world/chassis/bonnet", "Boxes3D:half_sizes")[0])
    np.testing.assert_allclose(centre - half, box.low, atol=1e-6)
    np.testing.assert_allclose(centre + half, box.high, atol=1e-6)


def test_clearance_zone_is_drawn_through_its_corners(overturn: Run, overturn_rrd: Path) -> None:
    assert isinstance(overturn.scenario.vehicle, Vehicle)
    assert overturn.scenario.vehicle.rops is not None
    zone = overturn.scenario.vehicle.rops.clearance_zone
    assert zone is not None
    strips = one(overturn_rrd, "/world/chassis/clearance_zone", "LineStrips3D:strips")
    drawn = {tuple(round(x, 5) for x in p) for strip in strips for p in strip}
    assert drawn == {tuple(round(x, 5) for x in c) for c in zone.corners().tolist()}
    assert len(strips) == 8  # two rings and six edges between them


def test_bodies_move_as_the_run_says(overturn: Run, overturn_rrd: Path) -> None:
    for body in ("chassis", "front_axle", "rops"):
        time, origin = read_column(overturn_rrd, f"/world/{body}", "Transform3D:translation")
        _, turn = read_column(overturn_rrd, f"/world/{body}", "Transform3D:quaternion")
        np.testing.assert_array_equal(time, [round(t * 1e9) for t in overturn.frame_time.tolist()])
        np.testing.assert_allclose([o[0] for o in origin], overturn.motion[body].origin, atol=1e-6)
        np.testing.assert_allclose([q[0] for q in turn], overturn.motion[body].quaternion, atol=1e-6)


def test_arrows_have_the_stated_scale_and_vanish_without_force(overturn: Run, overturn_rrd: Path) -> None:
    scale = picture(overturn).force
    entity = "/" + force_path(scale, "rops")
    time, vectors = read_column(overturn_rrd, entity, "Arrows3D:vectors")
    _, labels = read_column(overturn_rrd, entity, "Arrows3D:labels")
    force = overturn.contact["rops"].force
    there = np.linalg.norm(force, axis=1) > 0.0
    assert 0 < there.sum() < there.size == time.size
    assert [len(v) for v in vectors] == there.astype(int).tolist()
    np.testing.assert_allclose([v[0] for v in vectors if v], force[there] / scale, rtol=1e-6)
    at = int(np.linalg.norm(force, axis=1).argmax())
    assert labels[at] == [f"ROPS {1e-3 * np.linalg.norm(force[at]):.1f} kN"]
    assert picture(overturn).scales[0] == f"arrows 1 m = {1e-3 * scale:g} kN"


def test_ground_begins_flat_and_ends_as_it_was_left(overturn: Run, overturn_rrd: Path) -> None:
    patches = picture(overturn).ground.patches
    assert len(patches) > 1
    untouched = np.zeros(overturn.track.element.size)
    for patch in patches:
        entity = f"/world/ground/touched/{patch.name}"
        time, rows = read_column(overturn_rrd, entity, "Mesh3D:vertex_positions")
        assert time[0] == 0
        assert len(time) < 3 or np.diff(time[1:]).min() >= 19_999_999  # 50 Hz
        np.testing.assert_array_equal(np.array(rows[0], dtype=np.float32), patch.positions(untouched))
        np.testing.assert_array_equal(np.array(rows[-1], dtype=np.float32), patch.positions(overturn.track.sinkage[-1]))
        triangles = np.array(one(overturn_rrd, entity, "Mesh3D:triangle_indices"))
        assert triangles.max() == len(rows[0]) - 1


def test_events_peaks_and_phases_are_told_in_order(overturn: Run, overturn_rrd: Path) -> None:
    time, texts = read_column(overturn_rrd, "/events", "TextLog:text")
    _, levels = read_column(overturn_rrd, "/events", "TextLog:level")
    overlays = [(text[0], level[0]) for text, level in zip(texts, levels, strict=True)]
    assert np.all(np.diff(time) >= 0)
    assert ("first touch, ROPS: crossbar at 3.4 m/s", "INFO") in overlays
    assert ("plastic hinge, left: yields along y", "WARN") in overlays
    assert ("ROPS force: 63.2 kN at 1.362 s", "PEAK") in overlays
    assert overlays[-1] == ("came to rest at 2.600 s", "INFO")
    start, names = read_column(overturn_rrd, "/phase", "StateChange:state")
    assert [n[0] for n in names] == ["support", "tipping", "impact", "rest"]
    assert start[2] == 1_310_000_000
    # marks stay, labels go
    _, marks = read_column(overturn_rrd, "/world/events/marks", "Points3D:positions")
    assert [len(m) for m in marks] == list(range(1, len(overturn.events) + 1))
    when, labels = read_column(overturn_rrd, "/world/events/label", "Points3D:labels")
    assert labels[-1] == []
    assert when[-1] == 2_900_000_000


def test_nothing_lies_beyond_the_end_of_the_run(overturn_rrd: Path, drop_rrd: Path) -> None:
    for path, last in ((overturn_rrd, 3_000_000_000), (drop_rrd, 300_000_000)):
        moving = [c for c in RrdReader(path).stream().to_chunks() if not c.is_static]
        ends = {str(c.entity_path): max(c.to_record_batch()["sim_time"].cast("int64").to_pylist()) for c in moving}
        assert max(ends.values()) == last, ends


def test_a_failed_run_is_shown_as_far_as_it_came(tmp_path: Path) -> None:
    path = tmp_path / "failed.rrd"
    log.write_rrd(example.overturn(failed=True), path)
    assert check_rrd(path) == []
    (words,) = one(path, "/report/verdict", "TextDocument:text")
    assert words.startswith("# Run failed at 1.500 s\n\n**the time step did not converge")
    _, levels = read_column(path, "/events", "TextLog:level")
    assert levels[-1] == ["ERROR"]
    _, names = read_column(path, "/phase", "StateChange:state")
    assert names[-1] == ["failed"]


def test_a_run_that_failed_at_once_is_shown_too(tmp_path: Path) -> None:
    run = example.overturn(failed=True)
    channels = {name: values[:1] for name, values in run.recording.channels.items()}
    nothing = GroundTrack(time=np.zeros(0), element=np.zeros(0, dtype=np.int64), sinkage=np.zeros((0, 0)))
    run = dataclasses.replace(
        run,
        recording=dataclasses.replace(run.recording, time=run.recording.time[:1], channels=channels),
        frame_time=np.zeros(0),
        motion={},
        contact={},
        events=(),
        phases=(),
        track=nothing,
        ledger={},
        stop_time=0.0,
    )
    log.write_rrd(run, tmp_path / "at_once.rrd")
    assert [p for p in check_rrd(tmp_path / "at_once.rrd") if "asks for" not in p] == []


def test_a_recording_is_written_whole_or_not_at_all(
    overturn: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "run.rrd"
    path.write_bytes(b"before")

    def fails(*args: Any) -> None:
        raise RuntimeError("in the middle")

    monkeypatch.setattr(log, "_events", fails)
    with pytest.raises(RuntimeError, match="in the middle"):
        log.write_rrd(overturn, path)
    assert [p.name for p in tmp_path.iterdir()] == ["run.rrd"]
    assert path.read_bytes() == b"before"


def test_no_thread_of_the_recorder_meets_a_full_disk(
    overturn: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It would end without a word, and its recorder wait for it: the file is written by this process alone."""
    (path := tmp_path / "run.rrd").write_bytes(b"before")
    monkeypatch.setattr(rr.RecordingStream, "save", None)
    monkeypatch.setattr(Path, "write_bytes", refused)
    with pytest.raises(OSError, match=os.strerror(errno.ENOSPC)):
        log.write_rrd(overturn, path)
    assert [p.name for p in tmp_path.iterdir()] == ["run.rrd"]
    assert path.read_bytes() == b"before"


def refused(path: Path, data: bytes) -> int:
    assert data.startswith(b"RRF2")
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path))


def test_mistakes_are_errors_and_not_warnings(overturn: Run, tmp_path: Path) -> None:
    short = dataclasses.replace(overturn.motion["rops"], origin=overturn.motion["rops"].origin[:-1])
    motion = {**overturn.motion, "rops": short}
    with pytest.raises(ValueError, match=r"rows|length"):
        log.write_rrd(dataclasses.replace(overturn, motion=motion), tmp_path / "wrong.rrd")
    assert list(tmp_path.iterdir()) == []
    assert not rr.strict_mode()  # nobody else's setting is touched


def test_identity_comes_from_the_scenario(overturn: Run) -> None:
    assert log.run_id(overturn) == log.run_id(example.overturn())
    assert log.run_id(overturn).startswith("side-overturn-of-the-example-tractor-")
    assert log.run_id(overturn) != log.run_id(example.overturn(slope_deg=10.0))


def test_properties_say_what_was_run(overturn_rrd: Path) -> None:
    found: dict[str, Any] = {}
    for chunk in RrdReader(overturn_rrd).stream().filter(content="/__properties/**").to_chunks():
        batch = chunk.to_record_batch()
        found |= {n: batch[n].to_pylist() for n in batch.schema.names if n != "rerun.controls.RowId"}
    assert found["status"] == [["done"]]
    assert len(found["scenario_hash"][0][0]) == 64
    assert found["version_rerun_sdk"][0][0].startswith("0.")


def test_a_broken_recording_is_found(overturn_rrd: Path, tmp_path: Path) -> None:
    cut = tmp_path / "cut.rrd"
    cut.write_bytes(overturn_rrd.read_bytes()[:-2000])
    assert "cannot be read as a whole recording" in check_rrd(cut)[0]


def test_a_recording_without_its_end_is_found(tmp_path: Path) -> None:
    path = tmp_path / "crashed.rrd"
    rec = rr.RecordingStream("crashed", recording_id="crashed")
    rec.save(path, write_footer=False)
    rec.send_columns(
        "phase", [rr.TimeColumn("sim_time", duration=stamps(np.zeros(1)))], rr.Scalars.columns(scalars=[1.0])
    )
    rec.flush()
    rec.disconnect()
    assert "cannot be read as a whole recording" in check_rrd(path)[0]


def test_check_finds_what_is_wrong(tmp_path: Path) -> None:
    import rerun.blueprint as rrb

    path = tmp_path / "wrong.rrd"
    rec = rr.RecordingStream("wrong", recording_id="wrong")
    views = rrb.Horizontal(
        rrb.TimeSeriesView(
            origin="/a",
            contents=["+ /a/b"],
            name="there",
            overrides={"a/b": rr.SeriesLines.from_fields(aggregation_policy=rr.components.AggregationPolicy.Average)},
        ),
        rrb.TimeSeriesView(origin="/a", contents=["+ /a/c/**"], name="missing"),
    )
    rec.save(path, default_blueprint=rrb.Blueprint(views))
    rec.set_log_time_enabled(False)
    rec.send_columns("a/b", [rr.TimeColumn("step", sequence=[0, 1])], rr.Scalars.columns(scalars=[1.0, 2.0]))
    rec.flush()
    rec.disconnect()
    problems = "\n".join(check_rrd(path))
    assert "view 'missing' asks for /a/c/**, which nothing was logged to" in problems
    assert "'there'" not in problems
    assert "/a/b: time lines ['step'], not sim_time alone" in problems
    assert "/a/b: drawn without MinMax" in problems
    assert "wrong.rrd: the layout draws " in problems
    assert problems.count("the layout draws") == 1
