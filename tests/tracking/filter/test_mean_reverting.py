"""Motion model of a walking speed against NCV, sums over scans, drawn people, the walkers, and others."""

from pathlib import Path

import numpy as np
import pytest

from sim.scenario.environment import Area, People
from sim.world.recorded_people import read_trajectories
from sim.world.walkers import walk
from tracking.filter.kalman import Gaussian, NearlyConstantVelocity
from tracking.filter.mean_reverting import MeanRevertingVelocity
from tracking.geometry.visibility import Forest

PLAZA = Path(__file__).resolve().parents[3] / "assets" / "trajectories" / "plaza.csv"
DT = 0.2
NCV = NearlyConstantVelocity(DT, 0.6)  # the default before walking speeds
WALKING = MeanRevertingVelocity(DT, 0.75, walking_speed=1.75)
SURE = 1e-6 * np.eye(4)


def after(model: NearlyConstantVelocity, mean: list[float], P: np.ndarray, steps: int) -> Gaussian:
    belief = Gaussian(np.array(mean), P)
    for _ in range(steps):
        belief = model.predict(belief)
    return belief


def test_speeds_return_to_that_of_walking_and_directions_stay():
    """The deviation of the speed falls by 1/e in 3 s, and so does the rest of the way that it adds."""
    calm = MeanRevertingVelocity(DT, 1e-6, walking_speed=1.75)
    for speed in (0.4, 1.75, 3.0):
        x, y, u, v = after(calm, [10.0, -5.0, 0.6 * speed, 0.8 * speed], SURE, 15).mean
        expected = 1.75 + (speed - 1.75) * np.exp(-1.0)
        assert np.hypot(u, v) == pytest.approx(expected, rel=1e-3) and v / u == pytest.approx(4 / 3, rel=1e-9)
        way = 3.0 * 1.75 + 3.0 * (1.0 - np.exp(-1.0)) * (speed - 1.75)
        assert np.hypot(x - 10.0, y + 5.0) == pytest.approx(way, rel=1e-3)


def test_a_person_of_unknown_direction_is_expected_to_stay():
    belief = after(WALKING, [1.0, 2.0, 0.0, 0.0], np.diag([0.1, 0.1, 2.0, 2.0]), 50)
    np.testing.assert_array_equal(belief.mean, [1.0, 2.0, 0.0, 0.0])
    vague = after(WALKING, [0.0, 0.0, 0.3, 0.0], np.diag([0.1, 0.1, 2.0, 2.0]), 5).mean[2]
    sure = after(WALKING, [0.0, 0.0, 0.3, 0.0], SURE, 5).mean[2]
    assert 0.0 < vague < 0.35 < 0.5 < sure


def test_moments_are_those_of_people_moved_one_by_one():
    """Deviations of 200 000 drawn people fade in 6 s, and each has an acceleration of its own in each scan."""
    rng, P = np.random.default_rng(0), np.diag([0.3, 0.2, 0.4, 0.1]) + 0.05
    mean, left = np.array([3.0, 1.0, -2.0, 0.5]), np.exp(-DT / 6.0)
    people = rng.multivariate_normal(np.zeros(4), P, 200_000)
    for _ in range(15):
        a = rng.normal(scale=0.75, size=(200_000, 2))
        people[:, :2] += 6.0 * (1.0 - left) * people[:, 2:] + DT**2 / 2 * a
        people[:, 2:] = left * people[:, 2:] + DT * a
    np.testing.assert_allclose(after(WALKING, list(mean), P, 15).covariance, np.cov(people.T), atol=0.02)


def test_one_step_of_several_scans_is_that_many_scans():
    step = MeanRevertingVelocity(1.0, 0.75, walking_speed=1.75, scans=5)
    P = np.diag([0.3, 0.2, 0.4, 0.1]) + 0.05
    one, five = after(step, [3.0, 1.0, -2.0, 0.5], P, 1), after(WALKING, [3.0, 1.0, -2.0, 0.5], P, 5)
    np.testing.assert_allclose(one.mean, five.mean, rtol=1e-13)
    np.testing.assert_allclose(one.covariance, five.covariance, rtol=1e-13)
    np.testing.assert_allclose(step.F @ P @ step.F.T + step.Q, five.covariance, rtol=1e-12)
    ahead = step.positions_ahead(np.array([[3.0, 1.0, -2.0, 0.5]]), P[None], 3)
    np.testing.assert_allclose(ahead[0, 0], one.mean[:2], rtol=1e-13)
    np.testing.assert_allclose(ahead[2, 0], after(step, [3.0, 1.0, -2.0, 0.5], P, 3).mean[:2], rtol=1e-13)


@pytest.mark.parametrize("speed", [-0.1, np.nan, np.inf])
def test_a_walking_speed_is_finite_and_not_negative(speed):
    with pytest.raises(ValueError, match=r"^walking_speed must be 0 or more and finite, is"):
        MeanRevertingVelocity(DT, 0.7, walking_speed=speed)


def test_the_walking_speed_is_the_mean_of_what_was_expected_and_seen():
    """The first value counts as much as one person in view for 20 s."""
    rng = np.random.default_rng(0)
    seen = [rng.normal(size=(rng.integers(5), 2)) for _ in range(200)]
    model, step = WALKING, MeanRevertingVelocity(1.0, 0.75, walking_speed=1.75, scans=5)
    for velocities in seen:
        model, step = model.learn(velocities), step.learn(velocities)
    speeds = np.linalg.norm(np.concatenate(seen), axis=1)
    expected = (20.0 * 1.75 + DT * speeds.sum()) / (20.0 + DT * len(speeds))
    assert model.walking_speed == pytest.approx(expected, rel=1e-12) and expected < 1.5
    assert step.walking_speed == model.walking_speed
    assert (model.dt, model.sigma_a) == (DT, 0.75)


def hidden(places: np.ndarray, first: NearlyConstantVelocity) -> dict[int, tuple[float, float]]:
    """Mean NEES per coordinate, and RMS error [m], of people hidden for so many scans after 6 s in view.

    places: positions (81, M, 2) m. Each six people are of a mission of their own, in which the model learns.
    """
    found: dict[int, list[np.ndarray]] = {5: [], 10: [], 25: [], 50: []}
    rng, R = np.random.default_rng(0), 0.09 * np.eye(2)
    noisy = places + rng.normal(scale=0.3, size=places.shape)
    for i in range(0, places.shape[1], 6):
        true, z, model = places[:, i : i + 6], noisy[:, i : i + 6], first
        means = np.hstack([z[0], np.zeros_like(z[0])])
        covariances = np.tile(np.diag([0.09, 0.09, 2.25, 2.25]), (len(means), 1, 1))
        for k in range(1, 81):
            means, covariances = model.predict_all(means, covariances)
            if k <= 30:
                gains = covariances[:, :, :2] @ np.linalg.inv(covariances[:, :2, :2] + R)
                means = means + (gains @ (z[k] - means[:, :2])[..., None])[..., 0]
                covariances = covariances - gains @ covariances[:, :2]
                model = model.learn(means[:, 2:]) if hasattr(model, "learn") else model
            elif k - 30 in found:
                e = means[:, :2] - true[k]
                nees = (e * np.linalg.solve(covariances[:, :2, :2], e[..., None])[..., 0]).sum(axis=1)
                found[k - 30].append(np.column_stack([nees / 2, (e**2).sum(axis=1)]))
    mean = {k: np.concatenate(both).mean(axis=0) for k, both in found.items()}
    return {k: (float(nees), float(np.sqrt(square))) for k, (nees, square) in mean.items()}


def walkers(way: str) -> np.ndarray:
    """Positions (81, 120, 2) m of people of the testbed walking for 16 s."""
    people, found = People(count=6, paths=(), walks=(way,)), []
    for seed in range(100, 120):
        paths = walk(people, Area(), Forest(()), duration=16.2, rng=np.random.default_rng(seed))
        found.append([paths.at(DT * k)[0] for k in range(81)])
    return np.concatenate(found, axis=1)


def plaza() -> np.ndarray:
    """Positions (81, M, 2) m of the pedestrians of the world `recorded`, each for 16 s from every fifth second on."""
    found, paths = [], read_trajectories(PLAZA, Area(), duration=50.0)
    for start in range(0, 35, 5):
        places = np.array([paths.at(start + DT * k)[0] for k in range(81)])
        found.append(places[:, ~np.isnan(places).any(axis=(0, 2))])
    return np.concatenate(found, axis=1)


@pytest.mark.parametrize("way", ["levy", "waypoints", "groups", "stop-and-go"])
def test_hidden_walkers_are_nearer_to_where_they_are_believed_than_by_ncv(way):
    """Hidden for 1, 2, 5 and 10 s; of other ways of walking than the first, which chose the settings, too."""
    people = walkers(way)
    plain, ours = hidden(people, NCV), hidden(people, WALKING)
    print(way, plain, ours)
    assert all(ours[k][1] < 1.01 * plain[k][1] for k in plain) and ours[50][1] < 0.96 * plain[50][1]
    if way != "groups":
        assert ours[25][1] < 0.91 * plain[25][1] and ours[50][1] < 0.9 * plain[50][1]
    if way in ("levy", "waypoints"):  # the others stop or part, and are farther off than either model says
        assert all(nees < 1.3 for k, (nees, _) in ours.items() if k <= 25)
        assert ours[50][0] < (2.0 if way == "levy" else 1.1)


def test_pedestrians_on_a_plaza_are_found_where_they_are_believed():
    people = plaza()
    plain, ours, fixed = (hidden(people, model) for model in (NCV, WALKING, Fixed(DT, 0.75, walking_speed=1.75)))
    print(people.shape, plain, ours, fixed)
    assert all(nees < 1.0 for nees, _ in ours.values()) and ours[50][1] < min(1.1 * plain[50][1], 0.9 * fixed[50][1])


class Fixed(MeanRevertingVelocity):
    """Learns nothing."""

    def learn(self, velocities: np.ndarray) -> MeanRevertingVelocity:
        return self
