from __future__ import annotations

import numpy as np
import pytest

from bullet_sim.client import Pose, yaw_quaternion
from bullet_sim.scene import TagSettings, WristSettings
from bullet_sim.sensors import BiasField, TagCamera, TagReading, Ticker, WristSensor, multiply

STEP = 1 / 400
TAG = Pose(np.array([1.0, -0.5, 0.78]), yaw_quaternion(0.7))


def watch(camera: TagCamera, seconds: float, tags: dict[str, Pose] | None = None) -> list[tuple[float, TagReading]]:
    """Everything delivered, with the time of delivery."""
    seen = []
    for number in range(round(seconds / STEP)):
        time = number * STEP
        if camera.capture_due(time):
            camera.capture(time, tags or {"table": TAG})
        seen += [(time, reading) for reading in camera.deliver(time)]
    return seen


@pytest.mark.parametrize("rate", [1.0, 15.0, 30.0, 100.0, 399.0])
def test_a_ticker_keeps_its_rate_without_drift(rate: float) -> None:
    ticker = Ticker(rate)
    moments = [n * STEP for n in range(400 * 20) if ticker.due(n * STEP)]
    assert abs(len(moments) - 20 * rate) <= 1
    ideal = np.arange(len(moments)) / rate
    assert np.all(np.array(moments) - ideal < STEP)
    assert np.all(np.array(moments) - ideal > -1e-6)


def test_readings_come_at_their_rate_a_latency_later() -> None:
    seen = watch(TagCamera(TagSettings(dropout=0.0), np.random.default_rng(0)), 4.0)
    stamps = np.array([reading.stamp for _, reading in seen])
    delays = np.array([time - reading.stamp for time, reading in seen])
    assert np.all(np.diff(stamps) > 0)
    assert np.diff(stamps).mean() == pytest.approx(1 / 15, rel=0.01)
    assert np.all(delays >= 0.075 - 1e-9)
    assert np.all(delays < 0.075 + STEP + 1e-9)


def test_noise_has_the_size_asked_for_around_a_biased_pose() -> None:
    settings = TagSettings(rate=200, dropout=0.0)
    camera = TagCamera(settings, np.random.default_rng(1))
    readings = [reading for _, reading in watch(camera, 20.0)]
    positions = np.array([reading.position for reading in readings])
    yaws = np.array([Pose(reading.position, reading.quaternion).yaw for reading in readings])
    np.testing.assert_allclose(positions.std(axis=0), [0.003, 0.003, 0.006], rtol=0.06)
    assert yaws.std() == pytest.approx(settings.sigma_yaw, rel=0.06)
    assert yaws.mean() == pytest.approx(0.7, abs=0.001)
    mean_error = positions.mean(axis=0) - TAG.position
    np.testing.assert_allclose(mean_error[:2], camera.field.at(TAG.position), atol=4e-4)
    assert mean_error[2] == pytest.approx(0.0, abs=5e-4)


def test_quaternions_stay_unit() -> None:
    for _, reading in watch(TagCamera(TagSettings(), np.random.default_rng(2)), 3.0):
        assert np.linalg.norm(reading.quaternion) == pytest.approx(1.0, abs=1e-12)


@pytest.mark.parametrize("dropout", [0.0, 0.2, 0.9])
def test_as_many_readings_are_missed_as_asked_for(dropout: float) -> None:
    seen = watch(TagCamera(TagSettings(rate=200, dropout=dropout, latency=0), np.random.default_rng(3)), 10.0)
    assert len(seen) / 2000 == pytest.approx(1 - dropout, abs=0.04)


def test_dropouts_of_one_run_do_not_change_the_noise_of_the_readings_that_remain() -> None:
    full, sparse = (
        {reading.stamp: reading for _, reading in watch(TagCamera(TagSettings(dropout=p), np.random.default_rng(4)), 3)}
        for p in (0.0, 0.5)
    )
    assert set(sparse) < set(full)
    for stamp, reading in sparse.items():
        np.testing.assert_array_equal(reading.position, full[stamp].position)


def test_bias_is_bounded_smooth_and_of_the_expected_size() -> None:
    fields = [BiasField(0.008, 1.0, np.random.default_rng(seed)) for seed in range(40)]
    grid = [np.array([x, y]) for x in np.linspace(-3, 3, 13) for y in np.linspace(-3, 3, 13)]
    errors = np.array([[field.at(place) for place in grid] for field in fields])
    assert np.abs(errors).max() < 0.008
    assert 0.002 < errors.std() < 0.006
    near = np.array([[field.at(np.add(place, [0.05, 0.0])) for place in grid] for field in fields])
    assert np.abs(near - errors).max() < 0.0025, "5 cm further on the error has hardly changed"
    far = np.array([[field.at(np.add(place, [2.0, 0.0])) for place in grid] for field in fields])
    assert abs(np.corrcoef(far.ravel(), errors.ravel())[0, 1]) < 0.35
    assert np.abs(BiasField(0.0, 1.0, np.random.default_rng(0)).at([1, 2])).max() == 0.0


def test_same_seed_same_bytes() -> None:
    def run() -> bytes:
        rng = np.random.default_rng(9)
        camera, wrist = TagCamera(TagSettings(), rng), WristSensor(WristSettings(), rng)
        tags = b"".join(reading.position.tobytes() + reading.quaternion.tobytes() for _, reading in watch(camera, 2.0))
        forces = [wrist.measure(n * STEP, np.ones(3), np.zeros(3)) for n in range(400)]
        return tags + b"".join(reading.force.tobytes() for reading in forces if reading is not None)

    assert run() == run()


def wrist_readings(
    settings: WristSettings, force: list[float], seconds: float = 20.0
) -> tuple[WristSensor, np.ndarray]:
    sensor = WristSensor(settings, np.random.default_rng(5))
    made = [sensor.measure(n * STEP, np.array(force), np.zeros(3)) for n in range(round(seconds / STEP))]
    return sensor, np.array([[*reading.force, *reading.torque] for reading in made if reading is not None])


def test_wrist_shows_truth_plus_bias_plus_noise() -> None:
    settings = WristSettings(force_resolution=0, torque_resolution=0)
    sensor, shown = wrist_readings(settings, [10.0, -20.0, 5.0])
    assert len(shown) == 2000
    np.testing.assert_allclose(shown.mean(axis=0), np.add([10, -20, 5, 0, 0, 0], sensor.bias), atol=0.01)
    np.testing.assert_allclose(shown.std(axis=0), [0.06, 0.11, 0.06, 0.006, 0.009, 0.006], rtol=0.08)
    assert np.all(np.abs(sensor.bias[:3]) <= 1.5)


def test_wrist_counts_in_steps_and_saturates() -> None:
    settings = WristSettings()
    _, shown = wrist_readings(settings, [10.0, -2000.0, 5.0], 1.0)
    np.testing.assert_allclose(shown[:, 0] * 8, np.round(shown[:, 0] * 8), atol=1e-9)
    np.testing.assert_array_equal(shown[:, 1], -580.0)


def test_wrist_averages_over_its_period() -> None:
    quiet = WristSettings(
        force_noise=(0, 0, 0),
        torque_noise=(0, 0, 0),
        force_bias=0,
        torque_bias=0,
        force_resolution=0,
        torque_resolution=0,
    )
    sensor = WristSensor(quiet, np.random.default_rng(0))
    made = [sensor.measure(n * STEP, np.array([float(n), 0, 0]), np.zeros(3)) for n in range(9)]
    assert [reading.force[0] for reading in made if reading is not None] == [0.0, 2.5, 6.5]


def test_multiply_matches_rotation_matrices() -> None:
    rng = np.random.default_rng(6)
    for _ in range(20):
        first, second = (q / np.linalg.norm(q) for q in rng.normal(size=(2, 4)))
        origin = np.zeros(3)
        product = Pose(origin, multiply(first, second)).matrix
        np.testing.assert_allclose(product, Pose(origin, first).matrix @ Pose(origin, second).matrix, atol=1e-12)
