"""The report needs nothing but itself, hides nothing, and its commands fly what it shows."""

import os
import re
import shlex

import msgspec
import numpy as np
import pytest
from helpers.browser import SMALL_WORDS, Browser, needs_browser
from helpers.html_pages import Page
from helpers.trials import failed, row, study

from planning.planner_loading import load_planner
from sim.__main__ import COMMANDS
from sim.scenario.loading import load_scenario
from sim.study.analysis.answers import Difference
from sim.study.analysis.intervals import Estimate, compute_p_values, count_maps_needed, estimate_means
from sim.study.analysis.metric_choice import find_shown_metric
from sim.study.report.comparison import About
from sim.study.report.report_files import make_files, write
from sim.study.report.sentences import write_verdict
from sim.terminal.commands import load_command
from tracking.errors import InputError

EVIL = "<script>alert('x')</script> & \"quoted\" --rm"
ABOUT = About(
    "tried",
    description=EVIL,
    command="understory compare tried.toml --seeds 0-5",
    versions={"understory": "0.1.0", "numpy": "2.0"},
    machine="2 cores, test",
    wall_s=5400.0,
    baseline="sma-nbo",
)


MINE = "mylab.planners.greedy:GreedyWithReturnToBase(share=0.5, style='a b')"


def rows():
    """A study with a planner that shells mind and phones might cut, and one failed trial."""
    bad = failed(MINE, 3, (("lambda", "15"), ("R", "5")), error=EVIL)
    good = row(MINE, 1, (("lambda", "15"), ("R", "5")), {"ospa.share_under_1m": 0.5})
    return [*study(), good, bad]


@pytest.fixture(scope="module")
def files():
    return make_files(rows(), ABOUT)


@pytest.fixture(scope="module")
def page(files):
    return Page(files["report.html"].decode())


def test_the_page_needs_nothing_else_its_links_lead_and_figures_speak(page, files):
    assert not page.of("script") and page.asks_for_nothing()["default-src"] == "'none'"
    ids = [given["id"] for _, given in page.elements if "id" in given]
    assert len(ids) == len(set(ids)) > 10 and {given["href"][1:] for given, _ in page.of("a")} <= set(ids)
    images = page.of("img")
    assert len(images) == len(page.of("figcaption")) == 5
    assert files["figures/levels-lambda.pdf"].startswith(b"%PDF")
    for given, _ in images:
        assert len(given["alt"]) > 40 and re.search(r"\d", given["alt"])
    text = files["report.html"].decode()
    assert "<script" not in text and text.count("&lt;script&gt;alert(") == 2
    assert any(EVIL in shown for _, shown in page.of("strong"))


def test_what_was_run_by_which_version_is_there(page, without_pictures):
    ((_, text),) = page.of("main")
    for part in (
        *("tried", "forest", "R = 5", "15, 75", MINE, "6: 0-5", "37 done, 1 failed"),
        *("1 h 30 min", "2 cores, test", "numpy 2.0", ABOUT.command, "Failures: 1"),
    ):
        assert part in text, part
    given = [msgspec.structs.replace(r, version="0.1.0+abc") for r in study(("sma-nbo", "greedy"), ("15",), seeds=2)]
    text = make_files(given, About("x", versions={"understory": "0.1.0", "numpy": "2.0"}))["report.html"].decode()
    assert "<dt>set for all trials</dt><dd>duration = 10, sensing.mode = ideal" in text
    assert "understory 0.1.0+abc, numpy 2.0" in text


def test_commands_fly_the_maps_that_they_stand_for_best_and_worst(page):
    commands = [shlex.split(text) for text in page.commands()]
    known = {option for parameter in load_command(COMMANDS["run"][0]).params for option in parameter.opts}
    flown = [words for words in commands if words[1] == "run"]
    assert len(flown) == 2 * 6 + 1 + 1  # best and worst of six groups, the only map of one, and what failed
    for words in flown:
        assert words[:3] == ["understory", "run", "forest"]
        options, values = words[3::2], words[4::2]
        assert set(options) == {"--planner", "--seed", "--set"} <= known
        setting = load_scenario("forest", [v for o, v in zip(options, values, strict=True) if o == "--set"])
        assert (setting.trees.density, setting.sensing.mode, setting.duration) == (75.0, "ideal", 10.0)
        planner = values[options.index("--planner")]
        if not planner.startswith("mylab."):
            load_planner(planner)
    assert MINE in {words[4] for words in flown}
    metric, group = "ospa.share_under_1m", [r for r in study() if r.planner == "greedy" and r.factors[0][1] == "75"]
    for what, pick in (("best", max), ("worst", min)):
        seed = pick(group, key=lambda r: r.metrics[metric]).seed
        (shown,) = [t for _, t in page.of("div", class_="map") if f"λ = 75, greedy, seed {seed}: {what}," in t]
        assert f"--planner greedy --seed {seed} " in shown


def test_the_same_rows_in_any_order_give_the_same_files_wrong_names_none(files, tmp_path):
    assert make_files(rows()[::-1], ABOUT) == files
    for about in (About("x", baseline="sma-nob"), About("x", metrics=("ospa.maen_m",))):
        with pytest.raises(InputError, match="did you mean"):
            write(study(), tmp_path / "report", about)
    assert os.listdir(tmp_path) == []


def test_verdicts_figures_and_failures_name_the_cell_of_what_they_are_about(without_pictures):
    given = [row("a", s, (("lambda", level),), {"ospa.mean_m": 1.0}) for level in ("15", "75") for s in range(7)]
    given += [row("b", s, (("lambda", "75"),), {"ospa.mean_m": 2.0 + s / 100}) for s in range(7)]
    text = make_files(given, About("x"))["report.html"].decode()
    assert "<li>b (λ = 75) is worse than a: " in text and "Median OSPA at the last scan: a (λ = 15) 1.00 m; " in text
    places = {"scenario": "dense", "version": "0.2.0"}
    given = [row("a", 0), row("a", 1), row("a", 0, **places), failed("a", 1, error="ValueError: full", **places)]
    (shown,) = Page(make_files(given, About("x"))["report.html"].decode()).of("div", class_="map failed")
    assert shown[1].startswith("scenario = dense, version = 0.2.0, a, seed 1: ValueError: full")


def test_planners_that_differ_on_few_maps_are_not_told_apart_and_have_no_interval():
    """Intervals covered 72 % in such a case."""
    own = [1.0] * 7 + [0.1, 0.2, 0.3]
    given = [
        row(p, s, metrics={"ospa.share_under_1m": v if p == "a" else 1.0}) for p in "ba" for s, v in enumerate(own)
    ]
    text = Page(make_files(given, About("x", baseline="b"))["report.html"].decode()).of("main")[0][1]
    verdict = (
        "a and b are equal on too many maps to tell them apart: scans with OSPA under 1 m -24.0 points; of 10 maps it "
    )
    assert verdict + "won 0, tied 7 and lost 3." in text and "(95 %:" not in text
    assert "No brackets where fewer than 6 maps differ from the most common value" in text


def test_of_equal_maps_none_is_called_best_or_worst_and_equal_planners_are_equal(without_pictures):
    shares = {"a": [1.0, 1.0, 0.9, 0.8, 0.8, 1.0], "b": [1.0, 1.0, 0.9, 0.8, 0.8, 1.0], "c": [0.2] * 6, "d": [0.3]}
    given = [row(p, s, metrics={"ospa.share_under_1m": v}) for p, own in shares.items() for s, v in enumerate(own)]
    page = Page(make_files(given, About("x"))["report.html"].decode())
    shown = [text.partition("understory run")[0] for _, text in page.of("div", class_="map")]
    ends = "seed 0: best, 100.0 % and 2 equal", "seed 3: worst, 80.0 % and 1 equal"
    assert shown == [f"{p}, {end}" for p in "ab" for end in ends] + [
        "c, seed 0: 20.0 %, all 6 equal",
        "d, seed 0: 30.0 %, the only one",
    ]
    over = [text for attributes, text in page.of("td") if attributes.get("colspan") == "4"]
    assert over == ["20.0, seed 0, all 6 equal", "30.0, seed 0, the only one"]  # under no heading
    ((_, text),) = page.of("main")
    assert "b and a cannot be told apart, being equal on every map: scans with OSPA under 1 m 0.0 points" in text
    assert "Seeds flown: 6; a comparison counts those on which both planners have a value." in text
    assert "For each planner separately, by scans with OSPA under 1 m [%]." in text
    assert "Differences, and won, tied, lost, are over the maps on which both planners have a value." in text
    assert "Maps: the number with a value" not in text  # all that were flown have one
    given[7] = failed("b", 1)
    assert "Maps: the number with a value, of all flown. Mean and median are over those with a value." in str(
        make_files(given, About("x"))
    )


def test_where_neither_way_is_better_no_map_is_called_best(without_pictures):
    given = [row("a", seed, metrics={"nees.position.mean": 1.0 + seed}) for seed in range(3)]
    text = make_files(given, About("x", metrics=("nees.position.mean",)))["report.html"].decode()
    assert "Least and greatest maps</h2>" in text and "a, seed 0: least, 1.00" in text and "best" not in text.lower()


def test_files_are_whole_or_not_there(tmp_path, monkeypatch, without_pictures):
    files = make_files(rows(), ABOUT)

    def written():
        return {path.relative_to(tmp_path).as_posix(): path.read_bytes() for path in tmp_path.rglob("*.*")}

    write(rows(), tmp_path, ABOUT)
    assert written() == files
    assert {"report.html", "table.csv", "figures/ecdf.svg", "figures/ecdf.png"} <= set(files)

    def full(path, data):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("pathlib.Path.write_bytes", full)
    with pytest.raises(InputError, match="cannot be written: No space left on device"):
        write(rows(), tmp_path, ABOUT)
    assert written() == files


def test_figures_of_a_larger_report_before_go_and_all_else_stays(tmp_path, without_pictures):
    few = [row("sma-nbo", 0), row("greedy", 0)]
    larger, smaller = (About("x", metrics=names) for names in (("ospa.mean_m", "detection.recall"), ("ospa.mean_m",)))
    few = [msgspec.structs.replace(r, metrics={"ospa.mean_m": 1.0, "detection.recall": 0.5}) for r in few]
    write(few, tmp_path, larger)
    (tmp_path / "figures" / "mine.png").write_bytes(b"")
    assert (tmp_path / "figures" / "maps-detection-recall.svg").exists()
    write(few, tmp_path, smaller)
    found = {str(path.relative_to(tmp_path)) for path in tmp_path.rglob("*.*")}
    assert found == {*make_files(few, smaller), "figures/mine.png"}


@pytest.mark.parametrize(
    "given",
    [
        [row("sma-nbo", 0, metrics={"ospa.mean_m": 0.0})],
        [failed("sma-nbo", 0), failed("greedy", 0)],
        [msgspec.structs.replace(r, metrics={"nees.position.mean": float("nan")}) for r in study(seeds=2)],
        study(planners=("sma-nbo",), densities=("15", "45", "75")),
    ],
    ids=["one trial", "all failed", "all undefined", "one planner"],
)
def test_studies_with_nothing_to_compare_have_a_report(given, without_pictures):
    page = Page(make_files(given, About("odd"))["report.html"].decode())
    assert page.of("h1") and page.of("table")


def gap_of(values, shown=1):
    (mean,), (p_value,) = estimate_means(values), compute_p_values(values)
    signs = np.sign(values)
    counts = [int(np.sum(signs == sign)) for sign in (1, 0, -1)]
    return Difference(
        mean, len(values), 0, *counts, p_value=p_value, needed=count_maps_needed(values)[0], survives=shown == 1
    )


def test_verdicts_follow_the_interval():
    share = find_shown_metric("ospa.share_under_1m")
    spread = np.linspace(-0.05, 0.05, 9)[:, None]
    one = "mine and base cannot be told apart: scans with OSPA under 1 m +1.0 points (95 %: -1.6 to +3.6)"
    for middle, told in ((0.1, "mine is better than base: "), (-0.1, "mine is worse than base: ")):
        gap = gap_of(spread + middle)
        assert write_verdict("mine", "base", share, gap).startswith(told)
        assert "Holm" not in write_verdict("mine", "base", share, gap, shown=4)
        lone = gap_of(spread + middle, shown=4)
        told = write_verdict("mine", "base", share, lone, shown=4)
        assert told.endswith("survive Holm's correction for all 4 differences.")
    text = write_verdict("mine", "base", share, gap_of(spread + 0.01))
    assert text.startswith(one)
    assert text.endswith("tied 0 and lost 4. To find a difference of this size takes about 94 maps.")
    alone = write_verdict("mine", "base", share, Difference(Estimate(), 0, 2, 0, 0, 0))
    assert alone == "mine and base cannot be told apart: they have no map in common."


def test_few_maps_tell_nothing_apart_however_large_the_difference():
    share = find_shown_metric("ospa.share_under_1m")
    for maps in range(1, 6):
        for what in ("map", "flight", "seed"):
            gap = gap_of(0.5 + 1e-3 * np.arange(maps)[:, None])
            text = write_verdict("mine", "base", share, gap, sample=what)
            start = f"{maps} {what}{'s are' if maps > 1 else ' is'} too few to tell mine and base apart: scans with"
            assert text.startswith(start) and f"At least 6 {what}s are needed." in text


def test_no_verdict_contradicts_its_interval_or_asks_for_fewer_maps_than_there_are():
    rng, asked = np.random.default_rng(0), 0
    share = find_shown_metric("ospa.share_under_1m")
    for _ in range(400):
        gap = gap_of(rng.normal(0.02, 1) * 0.03 + 0.05 * rng.gamma(0.5, size=(int(rng.integers(2, 13)), 1)))
        text = write_verdict("mine", "base", share, gap)
        apart = gap.mean.low > 0 or gap.mean.high < 0
        assert ("cannot be told apart" in text) == (not apart and gap.pairs >= 6)
        assert ("is better than" in text or "is worse than" in text) == (apart and gap.pairs >= 6)
        more = re.findall(r"takes about (\d+) maps", text)
        assert all(int(maps) > gap.pairs for maps in more)
        asked += gap.needed <= gap.pairs and not gap.significant
    assert asked


def test_repeats_are_told_and_flown_again(without_pictures):
    rows = [
        row(p, s, metrics={"ospa.share_under_1m": 0.1 * s + 0.01 * r + 0.02 * i}, repeat=r)
        for i, p in enumerate(("sma-nbo", "greedy"))
        for s in range(8)
        for r in range(3)
    ]
    page = Page(make_files(rows, About("again"))["report.html"].decode())
    ((_, text),) = page.of("main")
    assert "repeats of each map3" in re.sub(r"\s+(?=\d)", "", text) and "48 done, 0 failed" in text
    best = [words for words in page.commands() if "--seed 7" in words]
    assert len(best) == 2 and all("--seed 7 --repeat 2 --set" in words for words in best)
    worst = [words for words in page.commands() if "--seed 0" in words]
    assert len(worst) == 2 and not any("--repeat" in words for words in worst)
    assert len(page.of("a")) and "seed 7, repeat 2" in text


@needs_browser
def test_on_paper_a_report_cuts_no_table_off(tmp_path):
    name = "mylab.planners.experimental:InformationGreedyPlanner(horizon=3, evaluations=9216, weight=0.25)"
    page = tmp_path / "report.html"
    page.write_bytes(make_files(study((name, f"{name[:-2]}6)", "hover")), About("long"))["report.html"])
    with Browser(tmp_path / "profile", width=700) as browser:
        browser.open(page)
        browser.show_as("print")
        wide = (
            "[...document.querySelectorAll('table')].filter(t => t.getBoundingClientRect().right > innerWidth).length"
        )
        assert browser.run(wide) == 0 and browser.print() < 20


@needs_browser
def test_a_browser_shows_it_without_complaint_and_cuts_nothing_on_a_phone(tmp_path, files):
    page = tmp_path / "report.html"
    page.write_bytes(files["report.html"])
    with Browser(tmp_path / "profile") as browser:
        browser.open(page)
        for width in (1280, 1440, 390):
            browser.resize(width, 900)
            assert browser.run("document.documentElement.scrollWidth") == width
            assert width < 400 or browser.run(SMALL_WORDS) == []
        assert browser.run("[...document.images].every(i => i.complete && i.naturalWidth > 300)")
        assert browser.run("[...document.querySelectorAll('.wide')].every(w => w.scrollWidth <= w.clientWidth)")
        shown = "[...document.querySelectorAll('td')].map(d => getComputedStyle(d, '::before').content)"
        assert {'"mean"', '"maps"', '"won, tied, lost"'} <= set(browser.run(shown))
        assert browser.complaints == [] and browser.requests_elsewhere() == [page.as_uri()[:100]]
