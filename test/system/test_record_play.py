"""`./pbrl play` into `./pbrl record`: what is played is recorded."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

from bullet_sim.scene import load_scene
from pbrl_bag import cut_episodes, describe, read_recording
from pbrl_bringup.graph import free_domain
from pbrl_bringup.simulate import simulate_push
from pbrl_control.push_plan import Segment, load_plan

PBRL = [sys.executable, "-m", "pbrl_bringup"]


def test_what_is_played_is_recorded(tmp_path: Path, nothing_left: None) -> None:
    plan = load_plan("turn_table").model_copy(update={"segments": (Segment(twist=(0.2, 0.0, 0.0), duration=1.0),)})
    simulate_push(load_scene("locked_caster"), plan, 0, tmp_path / "played")
    environment = {**os.environ, "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
    with free_domain() as domain:
        record = [*PBRL, "record", "--out", "recorded", "--domain", str(domain)]
        play = [*PBRL, "play", "played", "--domain", str(domain)]
        with subprocess.Popen(record, cwd=tmp_path, env=environment, stderr=subprocess.PIPE, text=True) as recorder:
            assert recorder.stderr is not None
            assert "recording into recorded" in recorder.stderr.readline()
            player = subprocess.run(play, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=120)
            recorder.send_signal(signal.SIGINT)
            last = recorder.stderr.read()
            assert recorder.wait(60) == 0
    assert player.returncode == 0, player.stderr
    assert "messages into recorded" in last
    played, recorded = describe(tmp_path / "played"), describe(tmp_path / "recorded")
    assert recorded.finished
    assert {topic.name for topic in recorded.topics} >= {topic.name for topic in played.topics}
    (episode,) = cut_episodes(read_recording(tmp_path / "recorded"))
    assert episode.object == "table_a"
