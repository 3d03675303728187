"""Studies: scenarios by overrides by planners by seeds, from TOML or flags."""

from collections.abc import Mapping, Sequence
from typing import Annotated, Any

import msgspec
from msgspec import Meta, Struct

from sim.installation import ASSETS
from sim.scenario.loading import STUDY_TABLES
from sim.scenario.quantities import REPEATS
from sim.scenario.text_files import located, toml_file
from sim.study.settings_text import flat, toml
from tracking.plugins.registry import InputError, check_known
from tracking.plugins.spelling import did_you_mean

STUDIES = {path.stem: path for path in sorted((ASSETS / "studies").glob("*.toml"))}


class ScoreScale(Struct, frozen=True, forbid_unknown_fields=True):
    """Ends of the normalised score of a study; both are flown, whatever planners are compared."""

    floor: str  # a planner
    bound: str  # a planner, which flies with an unlimited field of view and ideal sensing
    metric: str = "gospa.mean_m"


class Study(Struct, frozen=True):
    """A study: each planner on each seed in each cell, a cell being a scenario and a level of each factor."""

    name: Annotated[str, Meta(pattern=r"^\w[\w.-]*$")]
    planners: tuple[str, ...]
    description: str = ""
    seeds: str = "0-9"  # as --seeds takes them
    repeats: Annotated[int, Meta(ge=1, le=REPEATS)] = 1  # of each seed's map
    scenarios: tuple[str, ...] = ("forest",)
    settings: dict[str, str] = {}  # overrides for all trials, values as --set takes them
    factors: dict[str, dict[str, dict[str, Any]]] = {}  # of each name and level: overrides, and `planner` options
    exclude: tuple[dict[str, str | list[str]], ...] = ()  # trials that match all entries of one are left out
    score: ScoreScale | None = None


def read(name: str) -> Study:
    """The packaged study or TOML file `name`; InputError says what is wrong."""
    path = located(name, STUDIES, "study")
    data = toml_file(path, "study")
    check_keys(data, STUDY_TABLES, f"{name}: ")
    for key in ("study", "set"):
        if not isinstance(data.get(key, {}), Mapping):
            raise InputError(f"{name}: {key}: {data[key]!r} is not allowed; expected a table [{key}]")
    table = data.get("study", {})
    check_keys(table, ("name", "description", "scenarios", "seeds", "repeats", "planners"), f"{name}: study.")
    settings = {key: toml(value) for key, value in flat(data.get("set", {})).items()}
    content = {"name": path.stem, **table, "settings": settings}
    content |= {key: data[key] for key in ("factors", "exclude", "score") if key in data}
    try:
        study = msgspec.convert(content, Study)
    except msgspec.ValidationError as error:
        text, _, where = str(error).replace("`", "").partition(" - at $.")
        raise InputError(f"{name}: {where or 'study'}: {text[0].lower()}{text[1:]}") from error
    _check_excluded(study, name)

    def anchored(scenarios: Sequence[str]) -> list[str]:
        return [str(path.parent / s) if s.endswith(".toml") else s for s in scenarios]

    rules = [
        {key: anchored(_listed(value)) if key == "scenario" else value for key, value in rule.items()}
        for rule in study.exclude
    ]
    return msgspec.structs.replace(study, scenarios=tuple(anchored(study.scenarios)), exclude=tuple(rules))


def _listed(value: str | list[str]) -> list[str]:
    """The values of an entry of `exclude`, which may be one."""
    return [value] if isinstance(value, str) else value


def _check_excluded(study: Study, where: str) -> None:
    """InputError where a study leaves out a planner or a scenario that it has not; of its levels `cells` tells."""
    ends = (study.score.floor, study.score.bound) if study.score else ()
    for i, rule in enumerate(study.exclude):
        for key, known in (("planner", (*study.planners, *ends)), ("scenario", study.scenarios)):
            for name in _listed(rule.get(key, [])):
                check_known(f"{where}: exclude.{i}.{key}", name, known)


def adapted(
    study: Study,
    *,
    planners: Sequence[str] = (),
    scenarios: Sequence[str] = (),
    seeds: str | None = None,
    repeats: int | None = None,
    overrides: Sequence[str] = (),
) -> Study:
    """The study with what is given in place of its own, and of its scenarios those named.

    InputError where an override is what a factor sets, or a scenario is not one of the study's.
    """
    for scenario in scenarios:
        check_known("--scenario", scenario, study.scenarios)
    added: dict[str, str] = {}
    for override in overrides:
        key, equals, value = (part.strip() for part in override.partition("="))
        if not equals or not key:
            raise InputError(f"--set: {override!r} is not of the form key=value, for instance trees.density=75")
        for factor, levels in study.factors.items():
            varied = [f"{other}." for level in levels.values() for other in flat(level)]
            if any(other.startswith(f"{key}.") or f"{key}.".startswith(other) for other in varied):
                raise InputError(f"--set: {key} is what factor {factor!r} of study {study.name} varies")
        added[key] = value
    return msgspec.structs.replace(
        study,
        planners=tuple(dict.fromkeys(planners)) or study.planners,
        scenarios=tuple(dict.fromkeys(scenarios)) or study.scenarios,
        seeds=study.seeds if seeds is None else seeds,
        repeats=study.repeats if repeats is None else repeats,
        settings={**study.settings, **added},
    )


def check_keys(data: Mapping[str, Any], known: Sequence[str], where: str) -> None:
    """Raise InputError at a key that is not one of the known; `where` is the text before it."""
    for key in data:
        if key not in known:
            raise InputError(f"{where}{key}: unknown key; {did_you_mean(key, known)}")
