"""The seedling keeps to what planners must, and learns from its expert; its training repeats."""

import csv
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pytest
from seedling.fitting import Example, example, fitted, loss
from seedling.planner import Seedling, choices
from seedling.policy import chosen, scores
from seedling.train import TRAINED, VALIDATED, Learned, Lesson, Training, fly, main, train
from seedling.weights import LEARNED, PAIR_FEATURES, PLACE_FEATURES, Weights, drawn, load, save
from threadpoolctl import threadpool_limits

from understory import Array, check_planner, make_random_team

# Greedy is the expert here, as it decides in no time.
TINY = ["--missions", "4", "--duration", "4", "--expert", "greedy", "--epochs", "5", "--validations", "1"]
CROSS = np.array([[0.0, 0.0], [1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])


def made_up(count: int, seed: int = 0, most: int = 3) -> list[Example]:
    """Decisions over up to `most` tracks; the expert flies to where the third feature of the place is greatest."""
    rng, found = np.random.default_rng(seed), []
    for _ in range(count):
        moves, tracks = rng.permutation(CROSS), int(rng.integers(0, most + 1))
        pairs, places = rng.normal(size=(5, tracks, PAIR_FEATURES)), rng.normal(size=(5, PLACE_FEATURES))
        found.append(example((moves, pairs, places), moves[np.argmax(places[:, 2])], 1.0))
    return found


def test_it_conforms() -> None:
    """As `understory check-planner seedling` says."""
    for finding in check_planner("seedling.planner:Seedling"):
        assert finding.passed, finding


def by_definition(weights: Weights, one: Example) -> Array:
    """Scores of the moves of a decision, by NumPy."""
    made = one.pairs.astype(float) @ weights.pair.T
    inputs = np.hstack([(made / (1 + np.abs(made))).sum(axis=1), one.places])
    hidden = inputs @ weights.joint.T
    return np.asarray(hidden / (1 + np.abs(hidden)) @ weights.score + inputs @ weights.linear)


def test_the_loss_is_the_relative_entropy_of_the_scores_in_flight() -> None:
    """In flight the network is compiled, in a fit it is NumPy's, in single precision."""
    weights, examples, values = drawn(1), made_up(9), []
    for one in examples:
        found = scores(weights, one.pairs.astype(float), one.places.astype(float))
        np.testing.assert_allclose(found, by_definition(weights, one), atol=1e-9)
        chances = np.exp(found) / np.exp(found).sum()
        values.append((one.alike * (np.log(one.alike) - np.log(chances))).sum())
    assert loss(weights, examples) == pytest.approx(np.mean(values), rel=1e-4)


def test_the_gradient_is_that_of_the_loss() -> None:
    """One step of Adam, whose first step has the signs of the gradient, goes down in each layer."""
    before, examples = drawn(2), made_up(20)
    after = fitted(before, examples, 1, 1e-3, 0)
    for name, part in after._asdict().items():
        assert loss(before._replace(**{name: part}), examples) < loss(before, examples), name


def test_a_fit_finds_what_the_expert_goes_by() -> None:
    """On decisions that it was not fitted to, too."""
    others, before = made_up(100, seed=1), drawn(0)
    after = fitted(before, made_up(400), 20, 0.01, 0)
    assert loss(after, others) < 0.4 * loss(before, others)


def test_moves_near_to_the_best_are_averaged_and_others_are_not() -> None:
    """The far one has the second best score."""
    moves = np.array([[1.0, 0.0], [1.0, 0.2], [-1.0, 0.0]])
    found = chosen(np.array([2.0, 2.0 - np.log(3.0), 1.9]), moves, 1.0)
    np.testing.assert_allclose(found, [1.0, 0.05], atol=1e-9)


def test_a_uav_knows_only_plans_that_it_receives() -> None:
    """What an earlier UAV decided changes the features, but not where no message comes."""
    first, second = make_random_team(3, uavs=2, targets=3, trees=4)[:2]
    plan = Seedling().plan([first], np.random.default_rng(0))[0]
    far = type(plan)(-plan.controls - 1.0)
    told = [choices(second, {first.own.id: p})[1] for p in (plan, far)]
    assert np.any(told[0] != told[1])
    alone = type(second)(**{**vars(second), "reception": ((),)})
    untold = [choices(alone, {first.own.id: p})[1] for p in (plan, far)]
    np.testing.assert_array_equal(untold[0], untold[1])


def test_training_repeats_lowers_the_loss_and_is_flown(tmp_path: Path) -> None:
    """Nor does it matter how many processes fly."""
    runs: dict[str, list[str]] = {"one": [], "more": ["--workers", "2"], "other": ["--seed", "1"]}
    for name, options in runs.items():
        main(["--rounds", "2", *TINY, *options, "--out", str(tmp_path / f"{name}.npz")])
    one, more, other = ((tmp_path / f"{name}.npz").read_bytes() for name in runs)
    assert one == more != other
    with (tmp_path / "one.csv").open() as file:
        first, second = csv.DictReader(file)
    assert 0.0 < float(first["held_out"]) < float(first["held_out_before"])
    assert int(second["decisions"]) > int(first["decisions"])
    learned = load(tmp_path / "one.npz")
    assert fly(Lesson(learned, "", 0.0, "forest", VALIDATED, 4.0)).gospa == pytest.approx(
        float(second["gospa"]), rel=1e-5
    )


def test_training_does_not_depend_on_the_threads_of_blas() -> None:
    """Long sums would be split among them."""
    found = []
    for threads in (1, 2):
        with threadpool_limits(threads, user_api="blas"):
            found.append(train(Training(rounds=1, missions=4, epochs=3, validations=0), _made_up, lambda *_: None))
    for one, other in zip(*found, strict=True):
        np.testing.assert_array_equal(one, other)


def _made_up(_: object, lessons: Iterable[Lesson]) -> list[Learned]:
    return [Learned(made_up(100, lesson.seed, most=100), 0.0) for lesson in lessons]


def test_an_expert_with_all_decisions_flies_as_without_a_pupil() -> None:
    """The weights do not matter then, and every decision is an example."""
    flown = [fly(Lesson(drawn(seed), "greedy", 1.0, "forest", TRAINED, 4.0)) for seed in (0, 1)]
    assert flown[0].gospa == flown[1].gospa and len(flown[0].examples) == 5 * 3
    assert fly(Lesson(drawn(0), "greedy", 0.0, "forest", TRAINED, 4.0)).gospa != flown[0].gospa


def test_maps_of_training_validation_and_reports_are_apart() -> None:
    """Each mission flies a new map."""
    lessons = [lesson for turn in range(4) for lesson in Training().lessons(turn, drawn(0))]
    seeds = [lesson.seed for lesson in lessons]
    assert len(set(seeds)) == len(seeds) and TRAINED <= min(seeds) and max(seeds) < VALIDATED
    assert [lesson.share for lesson in lessons[::40]] == pytest.approx([1.0, 0.4, 0.16, 0.064])


def test_the_learned_weights_are_small_and_are_kept_without_loss(tmp_path: Path) -> None:
    """The file is far below a megabyte."""
    assert LEARNED.stat().st_size < 100_000
    learned = load(LEARNED)
    save(learned, tmp_path / "again.npz")
    for part, again in zip(learned, load(tmp_path / "again.npz"), strict=True):
        np.testing.assert_array_equal(part, again)


def test_other_weights_are_refused(tmp_path: Path) -> None:
    """The error names what the file holds."""
    np.savez(tmp_path / "other.npz", table=np.zeros(3))
    with pytest.raises(ValueError, match="holds table; expected pair"):
        Seedling(str(tmp_path / "other.npz"))
    (tmp_path / "text.npz").write_text("no weights")
    with pytest.raises(ValueError, match=r"text\.npz is no \.npz file of numbers"):
        Seedling(str(tmp_path / "text.npz"))


def test_a_training_that_cannot_be_is_refused_in_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Nothing is flown."""
    for given, said in (
        (["--missions", "1"], "missions at least 2"),
        (["--out", str(tmp_path / "none" / "z.npz")], "--out: there is no folder"),
        (["--expert", "sma-nbo-gosp"], "did you mean sma-nbo-gospa?"),
    ):
        with pytest.raises(SystemExit) as left:
            main(given)
        assert left.value.code == 2 and said in capsys.readouterr().err.splitlines()[-1]


class Failing:
    """A planner whose every decision fails."""

    def plan(self, team: object, rng: object) -> object:
        """Fail."""
        raise ArithmeticError("no idea")


def test_an_expert_that_decides_nothing_is_told_by_its_fault(monkeypatch: pytest.MonkeyPatch) -> None:
    """There would be nothing to fit to."""
    monkeypatch.setattr("seedling.train.load_planner", lambda name: Failing())
    with pytest.raises(RuntimeError, match=r"expert 'failing': .*no idea"):
        fly(Lesson(drawn(0), "failing", 1.0, "forest", TRAINED, 2.0))
