"""What a session records: read by the ``mcap`` package, and its last step as a scene."""

import json
import struct

import pytest

import contactd


def step(session, ball, x):
    session.begin_step(1)[0] = contactd.end(ball, (x, 0, 0))
    return session.finish()


def test_what_is_recorded_is_counted_and_a_second_one_refused(ball_and_wall, tmp_path):
    session, ball, _ = ball_and_wall
    session.record(tmp_path / "run.mcap")
    with pytest.raises(contactd.Refused, match="a recording runs already") as refused:
        session.record(tmp_path / "other.mcap")
    assert refused.value.code == contactd.ErrorCode.RECORDING
    for k in range(5):
        step(session, ball, k % 2 * 8.5)
    assert session.recording().steps == 5
    done = session.stop_recording()
    assert (done.steps, done.dropped, done.failure) == (5, 0, "")
    assert done.bytes == (tmp_path / "run.mcap").stat().st_size
    with pytest.raises(contactd.Refused, match="nothing is being recorded"):
        session.stop_recording()


def test_a_saved_step_is_a_scene(ball_and_wall, tmp_path):
    session, ball, _ = ball_and_wall
    step(session, ball, 9.0)
    scene = session.save_step(tmp_path / "saved")
    text = scene.read_text()
    assert 'name = "ball"' in text and "position = [9.0, 0.0, 0.0]" in text
    assert sorted(p.name for p in scene.parent.iterdir()) == ["model-1", "model-2", "scene.toml"]
    with pytest.raises(contactd.Refused, match="expected to make a new folder"):
        session.save_step(tmp_path / "saved")


def test_the_mcap_package_reads_what_was_recorded(ball_and_wall, tmp_path):
    reader = pytest.importorskip("mcap.reader", reason="the package mcap is not installed: pip install mcap")
    session, ball, _ = ball_and_wall
    path = tmp_path / "run.mcap"
    session.record(path)
    times = [step(session, ball, k % 2 * 9.5).records["time"].tolist() for k in range(6)]
    session.stop_recording()
    with path.open("rb") as file:
        read = reader.make_reader(file)
        messages = [(c.topic, c.message_encoding, m.data) for _, c, m in read.iter_messages()]
        about = {m.name: m.metadata for m in read.iter_metadata()}
    assert about["contactd"]["format"] == "1" and about["contactd.end"]["steps"] == "6"
    steps = [data for topic, encoding, data in messages if topic == "/contactd/step" and encoding == "x-contactd-step"]
    # As docs/record.md says: session, records, slots, request, reply, then both.
    head = 16 + 64
    found = []
    for data in steps:
        _, records, slots = struct.unpack_from("<QII", data)
        (told,) = struct.unpack_from("<I", data, head + 28)
        first = len(data) - 128 * slots
        assert records == 1 and first > head + 64
        found.append([struct.unpack_from("<d", data, first + 128 * i + 16)[0] for i in range(told)])
    assert found == times
    scenes = [json.loads(data) for topic, _, data in messages if topic == "/scene"]
    assert {e["id"].split()[-1] for s in scenes for e in s["entities"]} >= {"ball", "wall"}
    assert any(e["spheres"] for s in scenes for e in s["entities"])
