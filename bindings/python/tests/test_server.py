"""Servers that are not there, no longer there, or not answering: an exception, and the session goes on after it."""

import gc
import signal
import subprocess
import threading
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from conftest import fill, in_a_moment, interrupt

import contactd


def test_no_server_is_named(runtime):
    with pytest.raises(contactd.NoServer, match="nobody"):
        contactd.connect("nobody")
    with pytest.raises(contactd.BadAddress):
        contactd.connect("No/Name")
    with pytest.raises(ValueError, match="nothing.toml"):
        contactd.embedded("/nowhere/nothing.toml")


def test_a_killed_server_is_noticed_and_its_successor_told(own_server):
    with contactd.connect("own") as session:
        ball, _ = fill(session)
        session.begin_step(1)[0] = contactd.end(ball, (4, 0, 0))
        session.finish(timeout=10)
        epoch = session.epoch
        own_server.kill()
        session.begin_step(1)[0] = contactd.end(ball, (12, 0, 0))
        with pytest.raises(contactd.ServerLost) as lost:
            session.finish(timeout=10)
        assert lost.value.code is None and "reconnect" in str(lost.value)
        with pytest.raises(contactd.ServerLost):
            session.begin_step(1)
        with pytest.raises(contactd.NoServer):
            session.reconnect(timeout=0.2)
        own_server.start()
        session.reconnect(timeout=20)
        assert session.epoch != epoch
        poses = session.resend()
        assert poses[0].position.tolist() == [12, 0, 0]
        # From x = 4, where the last accepted step ended: the ball's surface meets the wall's after 4 of 8.
        assert session.finish(timeout=10)[0].time == pytest.approx(0.5, abs=1e-9)


def start_later(server):
    time.sleep(0.4)
    try:
        server.start()
    except BaseException:
        signal.raise_signal(signal.SIGINT)  # nobody else ends the wait of the main thread
        raise


@pytest.mark.parametrize("timeout", [float("inf"), 1e300, 600.0])
def test_a_wait_for_a_server_is_as_long_as_it_is_and_ends_by_ctrl_c(own_server, timeout):
    with contactd.connect("own") as session:
        ball, _ = fill(session)
        own_server.kill()
        with pytest.raises(contactd.ServerLost):
            session.set_resolution(None)
        with pytest.raises(KeyboardInterrupt), in_a_moment(interrupt):
            session.reconnect(timeout)
        with pytest.raises(contactd.ServerLost):
            session.begin_step(1)
        with ThreadPoolExecutor() as pool:
            later = pool.submit(start_later, own_server)
            try:
                session.reconnect(timeout)
            finally:
                later.result()
        session.begin_step(1)[0] = contactd.end(ball, (16, 0, 0))
        assert session.finish(timeout=10)[0].time == 0.5
        for wrong in (-1.0, float("nan")):
            with pytest.raises(ValueError, match="timeout"):
                session.reconnect(wrong)


def test_options_in_the_middle_of_a_call_are_misuse(own_server):
    with contactd.connect("own") as session:
        fill(session)
        session.begin_step(0)
        with own_server.suspended():
            session.send()
            found = []

            def look():
                try:
                    found.append(session.options)
                except contactd.Misuse as e:
                    found.append(str(e))

            other = threading.Timer(0.1, look)
            other.start()
            with in_a_moment(look), pytest.raises(contactd.Timeout):
                session.finish(timeout=0.5)
            other.join()
        assert found == 2 * ["the session is in use by another call"]
        session.finish(timeout=20)
        assert session.options.advance == 1.0


def test_a_server_killed_while_its_reply_is_read(own_server):
    session = contactd.connect("own")
    ball, _ = fill(session)
    session.begin_step(1)[0] = contactd.end(ball, (16, 0, 0))
    records = session.finish(timeout=10).records
    plain = np.asarray(records)
    own_server.kill()
    assert records["time"][0] == 0.5 and plain["time"][0] == 0.5, "the memory stays"
    with pytest.raises(contactd.ServerLost):
        session.load_model("m", "sphere(r = 1);")
    with pytest.raises(BufferError):
        session.reconnect(timeout=0)
    del plain
    own_server.start()
    session.reconnect(timeout=20)
    with pytest.raises(contactd.Stale):
        records["time"]
    session.close()


def test_a_server_killed_in_a_with_block_lets_it_end(own_server):
    with contactd.connect("own") as session:
        own_server.kill()
    assert session.closed


def test_a_step_outlives_its_timeout_and_ctrl_c(own_server):
    with contactd.connect("own") as session:
        ball, _ = fill(session)
        session.options.advance = 0.25
        session.begin_step(1)[0] = contactd.end(ball, (16, 0, 0))
        with own_server.suspended():
            session.send()
            with pytest.raises(contactd.Timeout) as out:
                session.finish(timeout=0.05)
            assert isinstance(out.value, TimeoutError) and "in flight" in str(out.value)
            assert session.options.advance == 0.25, "not yet accepted"

            with pytest.raises(KeyboardInterrupt), in_a_moment(interrupt):
                session.finish()
        reply = session.finish(timeout=20)
        assert reply[0].time == 0.5 and session.options.advance == 1.0


def test_sessions_that_are_dropped_end_on_the_server(binary, runtime, tmp_path):
    config = tmp_path / "few.toml"
    config.write_text("sessions = 2\n")
    command = [str(binary), "serve", "--name", "few", "--cache", "off", "--config", str(config)]
    server = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    try:
        assert "few" in server.stdout.readline()
        for k in range(12):
            # Never closed: in turn idle, with poses begun, with a step in flight, with a reply.
            session = contactd.connect("few")
            ball, _ = fill(session)
            if k % 4:
                session.begin_step(1)[0] = contactd.end(ball, (16, 0, 0))
            if k % 4 == 2:
                session.send()
            if k % 4 == 3:
                session.finish(timeout=10)
            del session
            gc.collect()
    finally:
        server.terminate()
        server.wait(timeout=20)
        server.stdout.close()
